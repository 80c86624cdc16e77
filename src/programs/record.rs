//! The record of a correction: what was replaced in each file, and the original back from it.
//!
//! The record lies beside the corrected files, where anybody may change it. An original is given back only where the corrected
//! file and what comes out of it have the digests of the record.

use std::path::{Component, Path};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::edit::Edit;
use crate::program::File;
use crate::write::in_order;

/// The record's name in the folder of corrected files.
pub const RECORD: &str = "posegrid-corrections.json";

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    pub calibration: String,
    pub robot: String,
    pub session: String,
    pub run: String,
    /// The day of the correction, UTC.
    pub date: String,
    pub files: Vec<Changed>,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Changed {
    pub name: String,
    /// blake3 of the original file, hexadecimal.
    pub original_blake3: String,
    pub corrected_blake3: String,
    /// In the order of the file; they do not overlap.
    pub replaced: Vec<Replaced>,
}

/// Bytes of a corrected file that stand in the place of others.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Replaced {
    /// Place of the first byte in the corrected file.
    pub at: usize,
    pub length: usize,
    /// The original bytes, as the characters of these numbers: Latin-1.
    pub original: String,
}

#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum UndoError {
    #[error(
        "{name:?} is no file of the folder, or stands twice in {RECORD}; was that changed? Take the originals from a backup"
    )]
    Name { name: String },
    #[error(
        "{name}: it is not as posegrid wrote it, so it was edited since; put the corrected file back as it was written, or take the \
         original from a backup: its blake3 is {digest}"
    )]
    Edited { name: String, digest: String },
    #[error(
        "{name}: what {RECORD} says was replaced does not give the original; was it changed? Take the original from a backup: its blake3 \
         is {digest}"
    )]
    Damaged { name: String, digest: String },
}

impl Changed {
    /// The record of a file and of what it has become by edits.
    pub fn of(file: &File, corrected: &[u8], edits: &[Edit]) -> Self {
        let mut longer = 0;
        let mut shorter = 0;
        let replaced = in_order(&file.bytes, edits).map(|edit| {
            let original = &file.bytes[edit.span.clone()];
            let at = edit.span.start + longer - shorter;
            longer += edit.text.len();
            shorter += original.len();
            let original = original.iter().map(|byte| char::from(*byte)).collect();
            Replaced { at, length: edit.text.len(), original }
        });
        Self {
            name: file.name.clone(),
            replaced: replaced.collect(),
            original_blake3: digest(&file.bytes),
            corrected_blake3: digest(corrected),
        }
    }

    /// The path of the file in its folder, and in no other.
    pub fn path(&self) -> Result<&Path, UndoError> {
        let path = Path::new(&self.name);
        let is_inside = |part| matches!(part, Component::Normal(_));
        let wrong = || UndoError::Name { name: self.name.clone() };
        let is_file = !self.name.is_empty() && path.components().all(is_inside);
        is_file.then_some(path).ok_or_else(wrong)
    }

    pub fn original(&self, corrected: &[u8]) -> Result<Vec<u8>, UndoError> {
        let (name, original) = (self.name.clone(), self.original_blake3.clone());
        if digest(corrected) != self.corrected_blake3 {
            return Err(UndoError::Edited { name, digest: original });
        }
        let put_back = self.put_back(corrected).filter(|bytes| digest(bytes) == original);
        put_back.ok_or(UndoError::Damaged { name, digest: original })
    }

    fn put_back(&self, corrected: &[u8]) -> Option<Vec<u8>> {
        let mut bytes = Vec::with_capacity(corrected.len());
        let mut copied = 0;
        for own in &self.replaced {
            bytes.extend(corrected.get(copied..own.at)?);
            for letter in own.original.chars() {
                bytes.push(u8::try_from(letter).ok()?);
            }
            copied = own.at.checked_add(own.length)?;
        }
        bytes.extend(corrected.get(copied..)?);
        Some(bytes)
    }
}

/// blake3, hexadecimal.
pub fn digest(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::write::applied;

    /// A file of Latin-1 with CR LF, and edits that make it longer and shorter.
    fn corrected() -> (File, Vec<u8>, Changed) {
        let bytes = b"DEF T()\r\n;gr\xfc\xdfe\r\nLIN {X 1575.0,Y 33}\r\n".to_vec();
        let file = File { name: "R1/t.src".to_owned(), bytes };
        let edit = |span, text: &str| Edit { span, text: text.to_owned() };
        let edits = [edit(24..30, "1575.2300"), edit(9..9, "; mark\r\n"), edit(10..14, "u")];
        let corrected = applied(&file.bytes, &edits);
        let changed = Changed::of(&file, &corrected, &edits);
        (file, corrected, changed)
    }

    #[test]
    fn a_corrected_file_becomes_its_original_byte_for_byte() {
        let (file, corrected, changed) = corrected();
        assert_eq!(corrected, b"DEF T()\r\n; mark\r\n;ue\r\nLIN {X 1575.2300,Y 33}\r\n");
        assert_eq!(changed.original(&corrected).unwrap(), file.bytes);
        assert_eq!(changed.path().unwrap(), Path::new("R1/t.src"));
    }

    #[test]
    fn an_edited_file_is_refused_by_name_with_the_digest_of_its_original() {
        let (file, mut corrected, changed) = corrected();
        corrected.push(b'\n');
        let told = changed.original(&corrected).unwrap_err().to_string();
        assert!(told.starts_with("R1/t.src: it is not as posegrid wrote it"), "{told}");
        assert!(told.contains(&digest(&file.bytes)), "{told}");
    }

    #[test]
    fn a_record_that_was_changed_gives_no_file() {
        let (_, corrected, sound) = corrected();
        let changes: [fn(&mut Replaced); 5] = [
            |own| own.at = usize::MAX,
            |own| own.length = usize::MAX,
            |own| own.at = 0,
            |own| own.original.push('0'),
            |own| own.original.push('\u{100}'),
        ];
        for change in changes {
            let mut changed = sound.clone();
            change(changed.replaced.last_mut().unwrap());
            let told = changed.original(&corrected).unwrap_err();
            assert!(matches!(told, UndoError::Damaged { .. }), "{told}");
        }
        for name in ["", "..", "/t.src", "../t.src", "R1/../../t.src"] {
            let changed = Changed { name: name.to_owned(), ..sound.clone() };
            assert_eq!(changed.path(), Err(UndoError::Name { name: name.to_owned() }));
        }
    }
}
