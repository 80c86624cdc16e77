//! Files that somebody gives, besides logs: only files are opened, and read only as far as a bound.
//!
//! A pipe, a device or a socket under a file's name could be waited for without end, and a file may be larger than the
//! memory, whatever the file system says of its size. Both are told before anything is read.

use std::fs::{File, FileType};
use std::io::{self, Read as _};
use std::path::Path;

use thiserror::Error;

use super::log::Limits;

/// How large a file may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bound {
    /// Bytes.
    pub bytes: u64,
    /// What to try where a file is larger.
    pub advice: &'static str,
}

impl Bound {
    /// Of a pipeline or robot file, which have some thousand bytes.
    pub const SETTINGS: Self = Self {
        bytes: 1 << 20,
        advice: "a pipeline or robot file has some thousand bytes; is it the right file?",
    };
    /// Of targets where no pipeline file is at hand: as text about a million of them, which take less than a gigabyte.
    pub const TARGETS: Self = Self {
        bytes: 64 << 20,
        advice: "split it, or give it as Parquet",
    };
    /// Of a table of a run where no pipeline file is at hand.
    pub const TABLE: Self = Self {
        bytes: 1 << 30,
        advice: "is it a table of a run?",
    };

    /// Of the files of a session besides its logs.
    pub const fn of(limits: Limits) -> Self {
        Self {
            bytes: limits.file_bytes,
            advice: "if that is right, raise file_bytes in [limits]",
        }
    }

    /// Of the values of a Parquet file in memory, which takes a tenth of them or less on the disk.
    #[must_use]
    pub(super) const fn of_values(self) -> Self {
        Self {
            bytes: self.bytes.saturating_mul(16),
            ..self
        }
    }
}

/// Why a file is not read.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
enum Refused {
    /// Something else under a file's name.
    #[error("it is {0}, and only files are read")]
    NoFile(&'static str),
    /// Too much.
    #[error("it has {found} bytes, more than the limit of {limit}; {advice}")]
    TooLarge {
        found: u64,
        limit: u64,
        advice: &'static str,
    },
    /// Too much, and the file system said less.
    #[error("it goes on behind the limit of {limit} bytes; {advice}")]
    GoesOn { limit: u64, advice: &'static str },
}

/// Opens a file that is not too large.
///
/// # Errors
/// The system's own; and where it is no file, or larger than the bound, an error that says so.
pub fn open(path: &Path, bound: Bound) -> io::Result<File> {
    let metadata = path.metadata()?;
    if let Some(other) = other_than_file(metadata.file_type()) {
        return Err(refused(Refused::NoFile(other)));
    }
    if metadata.len() > bound.bytes {
        return Err(refused(Refused::TooLarge {
            found: metadata.len(),
            limit: bound.bytes,
            advice: bound.advice,
        }));
    }
    File::open(path)
}

/// The bytes of such a file.
///
/// # Errors
/// As [`open`], and where there are more bytes than the file system said.
pub fn bytes(path: &Path, bound: Bound) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let file = open(path, bound)?;
    let read = file
        .take(bound.bytes.saturating_add(1))
        .read_to_end(&mut bytes)?;
    if read as u64 > bound.bytes {
        return Err(refused(Refused::GoesOn {
            limit: bound.bytes,
            advice: bound.advice,
        }));
    }
    Ok(bytes)
}

/// The text of such a file.
///
/// # Errors
/// As [`bytes()`], and where it is not UTF-8.
pub fn text(path: &Path, bound: Bound) -> io::Result<String> {
    let bytes = bytes(path, bound)?;
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let problem = format!("byte {at} is not UTF-8, and the file is a text");
        io::Error::new(io::ErrorKind::InvalidData, problem)
    })
}

fn refused(refused: Refused) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, refused)
}

/// What stands there instead of a file; `None` for a file.
fn other_than_file(kind: FileType) -> Option<&'static str> {
    if kind.is_file() {
        return None;
    }
    if kind.is_dir() {
        return Some("a folder");
    }
    Some(special(kind))
}

#[cfg(unix)]
fn special(kind: FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt as _;
    if kind.is_fifo() {
        "a pipe (FIFO)"
    } else if kind.is_socket() {
        "a socket"
    } else {
        "a device"
    }
}

#[cfg(not(unix))]
fn special(_kind: FileType) -> &'static str {
    "a device or a pipe"
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: Bound = Bound {
        bytes: 10,
        advice: "split it",
    };

    #[test]
    fn a_file_is_read_up_to_its_bound() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        std::fs::write(&path, "0123456789").unwrap();
        assert_eq!(text(&path, SMALL).unwrap(), "0123456789");
        std::fs::write(&path, "0123456789a").unwrap();
        let told = bytes(&path, SMALL).unwrap_err().to_string();
        assert_eq!(told, "it has 11 bytes, more than the limit of 10; split it");
        std::fs::write(&path, b"ab\xff").unwrap();
        assert!(
            text(&path, SMALL)
                .unwrap_err()
                .to_string()
                .contains("byte 2 is not UTF-8")
        );
    }

    #[test]
    fn six_gigabytes_that_take_no_room_are_reported_by_their_size() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("corrected.csv");
        File::create(&path).unwrap().set_len(6 << 30).unwrap();
        let told = bytes(&path, Bound::TARGETS).unwrap_err().to_string();
        assert!(
            told.contains("6442450944 bytes, more than the limit of 67108864"),
            "{told}"
        );
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
        // A file that says it is empty and is not.
        let told = bytes(Path::new("/proc/self/mountinfo"), SMALL)
            .unwrap_err()
            .to_string();
        assert!(
            told.contains("goes on behind the limit of 10 bytes"),
            "{told}"
        );
    }
}
