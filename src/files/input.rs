//! Input files other than logs: only files are opened, and read only up to a bound. A pipe, a device or a socket could
//! wait without end, and a file may be larger than the memory, whatever size the file system states.

use std::fs::{File, FileType};
use std::io::{self, Read as _};
use std::path::Path;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::system;

/// `[limits]`: the largest sizes that a log may have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// The longest record, bytes; attachments, which are not read, may be longer.
    pub record_bytes: u64,
    /// The largest chunk, bytes as stored and decompressed together.
    pub chunk_bytes: u64,
    /// Bytes worked on at once, as stored and decompressed; a single chunk may be larger.
    pub batch_bytes: u64,
    /// The largest log that is stored in zstd as a whole, bytes after decompression.
    pub unpacked_bytes: u64,
    /// The largest other file of a session; Parquet values take up to sixteen times as much in memory.
    pub file_bytes: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            record_bytes: 256 << 20,
            chunk_bytes: 256 << 20,
            batch_bytes: 32 << 20,
            unpacked_bytes: 64 << 30,
            file_bytes: 64 << 20,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bound {
    pub bytes: u64,
    pub advice: &'static str,
}

impl Bound {
    /// For a file that is read in pieces, however large it is.
    pub const ANY: Self = Self { bytes: u64::MAX, advice: "no file is larger" };
    /// For a pipeline or robot file, which has some thousand bytes.
    pub const SETTINGS: Self = Self {
        bytes: 1 << 20,
        advice: "a pipeline or robot file has some thousand bytes; is it the right file?",
    };
    /// For a table of robots, which has some hundred bytes each.
    pub const ROBOTS: Self = Self {
        bytes: 64 << 20,
        advice: "a table of robots has some hundred bytes a robot; is it the right file?",
    };
    /// For a URDF, which has some hundred thousand bytes where it describes a whole humanoid.
    pub const URDF: Self = Self {
        bytes: 16 << 20,
        advice: "a URDF has some hundred thousand bytes; is it the right file?",
    };
    /// For targets where there is no pipeline file: as text about a million of them, which take less than a gigabyte.
    pub const TARGETS: Self = Self { bytes: 64 << 20, advice: "split it, or give it as Parquet" };
    /// For a table of a run where there is no pipeline file.
    pub const TABLE: Self = Self { bytes: 1 << 30, advice: "is it a table of a run?" };

    pub const fn of(limits: Limits) -> Self {
        Self { bytes: limits.file_bytes, advice: "if that is right, raise file_bytes in [limits]" }
    }

    /// For the values of a Parquet file in memory; the file takes a tenth of them or less on the disk.
    #[must_use]
    pub const fn of_values(self) -> Self {
        Self { bytes: self.bytes.saturating_mul(16), ..self }
    }
}

/// The first bytes of the text that Git LFS leaves in the place of a large file.
pub(super) const POINTER: &[u8] = b"version https://git-lfs.github.com/spec/";

#[derive(Debug, Clone, PartialEq, Eq, Error)]
enum Refused {
    #[error("it is {0}, and only files are read")]
    NoFile(&'static str),
    #[error("it is a pointer of Git LFS, which stands for the file: `git lfs pull` fetches it")]
    Pointer,
    #[error("it has {found} bytes, more than the limit of {limit}; {advice}")]
    TooLarge { found: u64, limit: u64, advice: &'static str },
    #[error("it continues after the limit of {limit} bytes; {advice}")]
    GoesOn { limit: u64, advice: &'static str },
}

/// An error for anything but a file, and for a file above the bound.
pub fn open(path: &Path, bound: Bound) -> io::Result<File> {
    let metadata = path.metadata()?;
    if let Some(other) = other_than_file(metadata.file_type()) {
        return Err(refused(Refused::NoFile(other)));
    }
    if metadata.len() > bound.bytes {
        let (found, Bound { bytes: limit, advice }) = (metadata.len(), bound);
        return Err(refused(Refused::TooLarge { found, limit, advice }));
    }
    File::open(path)
}

/// Those of [`open`], and an error where there are more bytes than the file system stated.
pub fn bytes(path: &Path, bound: Bound) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let file = open(path, bound)?;
    let read = file.take(bound.bytes.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.starts_with(POINTER) {
        return Err(refused(Refused::Pointer));
    }
    if read as u64 > bound.bytes {
        return Err(refused(Refused::GoesOn { limit: bound.bytes, advice: bound.advice }));
    }
    Ok(bytes)
}

/// Those of [`bytes()`], and an error where it is not UTF-8.
pub fn text(path: &Path, bound: Bound) -> io::Result<String> {
    let bytes = bytes(path, bound)?;
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let problem = format!("byte {at} is not UTF-8, and the file is a text");
        io::Error::new(io::ErrorKind::InvalidData, problem)
    })
}

/// The fault of a TOML file, in a line: the reader's own text draws lines of the file.
pub fn toml_problem(error: &toml::de::Error) -> String {
    let drawn = error.to_string();
    let place = drawn.lines().next().unwrap_or_default();
    match place.strip_prefix("TOML parse error at ") {
        Some(place) => format!("{place}: {}", error.message().trim().replace('\n', " ")),
        None => drawn.trim().replace('\n', " "),
    }
}

fn refused(refused: Refused) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, refused)
}

fn other_than_file(kind: FileType) -> Option<&'static str> {
    if kind.is_file() {
        return None;
    }
    Some(if kind.is_dir() { "a folder" } else { system::special(kind) })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: Bound = Bound { bytes: 10, advice: "split it" };

    #[test]
    fn a_file_is_read_up_to_its_bound() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        std::fs::write(&path, "0123456789").unwrap();
        assert_eq!(text(&path, SMALL).unwrap(), "0123456789");
        std::fs::write(&path, "0123456789a").unwrap();
        let told = bytes(&path, SMALL).unwrap_err().to_string();
        assert_eq!(told, "it has 11 bytes, more than the limit of 10; split it");
        std::fs::write(&path, [POINTER, b"v1\n"].concat()).unwrap();
        assert!(bytes(&path, Bound::TABLE).unwrap_err().to_string().contains("git lfs pull"));
        std::fs::write(&path, b"ab\xff").unwrap();
        assert!(text(&path, SMALL).unwrap_err().to_string().contains("byte 2 is not UTF-8"));
    }

    #[test]
    fn a_fault_in_toml_is_told_in_a_line() {
        let told = |text: &str| toml_problem(&toml::from_str::<toml::Table>(text).unwrap_err());
        assert!(told("a = 1\nb = \n").starts_with("line 2, column "), "{}", told("a = 1\nb = \n"));
        assert!(!told("a = 1\na = 2\n").contains('\n'));
    }

    #[test]
    fn a_sparse_file_of_six_gigabytes_is_reported_by_its_size() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("corrected.csv");
        File::create(&path).unwrap().set_len(6 << 30).unwrap();
        let told = bytes(&path, Bound::TARGETS).unwrap_err().to_string();
        assert!(told.contains("6442450944 bytes, more than the limit of 67108864"), "{told}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn what_is_no_file_is_reported_and_never_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let told = |path: &Path| open(path, SMALL).unwrap_err().to_string();
        assert!(told(folder.path()).contains("a folder"));
        assert!(told(Path::new("/dev/zero")).contains("a device"));
        let pipe = folder.path().join("pipe.csv");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        assert!(told(&pipe).contains("a pipe (FIFO)"));
        // A file that states that it is empty but is not.
        let told = bytes(Path::new("/proc/self/mountinfo"), SMALL).unwrap_err().to_string();
        assert!(told.contains("continues after the limit of 10 bytes"), "{told}");
    }
}
