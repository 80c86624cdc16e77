//! Names of robots and sessions, of any characters → names of folders. ASCII letters, digits, `-`, `_` and inner dots
//! stay; every other byte is percent-encoded, so no name is a path, a hidden file, a temporary, or a `key=value` folder
//! that readers would guess columns from. The empty name is `%`. Names that differ only in case share a folder where
//! the file system ignores case.

use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, percent_decode_str, utf8_percent_encode};

/// Bytes that are encoded at any position.
const ENCODED: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'_').remove(b'.');

/// The longest encoded name: file systems allow 255 bytes, and a temporary name adds some to a file's.
pub(super) const LONGEST: usize = 180;

/// The folder's name; an error is its length in bytes, where that is too long.
pub(super) fn encode(name: &str) -> Result<String, usize> {
    if name.is_empty() {
        return Ok("%".to_owned());
    }
    let mut encoded = utf8_percent_encode(name, ENCODED).to_string();
    if encoded.ends_with('.') {
        encoded.replace_range(encoded.len() - 1.., "%2E");
    }
    if encoded.starts_with('.') {
        encoded.replace_range(..1, "%2E");
    }
    if encoded.len() > LONGEST {
        return Err(encoded.len());
    }
    Ok(encoded)
}

pub(super) fn decode(folder: &str) -> String {
    match folder {
        "%" => String::new(),
        other => percent_decode_str(other).decode_utf8_lossy().into_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn hostile_names_become_plain_folder_names() {
        let cases = [
            ("UR10-grid_2020.11", "UR10-grid_2020.11"),
            ("", "%"),
            (".", "%2E"),
            ("..", "%2E%2E"),
            ("...", "%2E.%2E"),
            ("../../etc", "%2E.%2F..%2Fetc"),
            ("robot=7", "robot%3D7"),
            ("a*[b]?", "a%2A%5Bb%5D%3F"),
            ("%2E", "%252E"),
            ("Zelle 3 ü", "Zelle%203%20%C3%BC"),
            ("nul\0", "nul%00"),
        ];
        for (name, folder) in cases {
            assert_eq!(encode(name).as_deref(), Ok(folder), "{name:?}");
        }
    }

    #[test]
    fn a_name_that_no_file_system_takes_is_refused() {
        assert_eq!(encode(&"a".repeat(LONGEST)).map(|name| name.len()), Ok(LONGEST));
        // 61 letters of two bytes each, three characters a byte: 366.
        assert_eq!(encode(&"ü".repeat(61)), Err(366));
    }

    proptest! {
        #[test]
        fn different_names_get_different_folders(a in "\\PC{0,8}", b in "[.%/=a2E]{0,4}") {
            for name in [a, b] {
                let folder = encode(&name).expect("short enough");
                prop_assert!(!folder.starts_with('.') && !folder.ends_with('.') && !folder.contains('/'));
                prop_assert_eq!(decode(&folder), name);
            }
        }
    }
}
