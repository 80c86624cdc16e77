//! Files that appear completely or not at all: written under a temporary name next to their own, synced, then renamed.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use tempfile::{Builder, NamedTempFile};

/// What went wrong where a file or folder could not be written, and what to do.
pub fn told(error: &io::Error) -> String {
    use io::ErrorKind::{AlreadyExists, IsADirectory, NotADirectory, NotFound};
    match error.kind() {
        // The system's words would say less, or name a temporary file.
        NotFound | NotADirectory | IsADirectory | AlreadyExists => advice(error).to_owned(),
        _ => format!("{error}; {}", advice(error)),
    }
}

fn advice(error: &io::Error) -> &'static str {
    use io::ErrorKind;
    match error.kind() {
        ErrorKind::NotFound => "the folder that it would be in is not there: make it first",
        ErrorKind::NotADirectory => {
            "a part of its path is a file, and only folders hold files: choose another place"
        }
        ErrorKind::IsADirectory => "it is a folder: give the name of a new file in it",
        ErrorKind::AlreadyExists => "that name is taken: choose another, or remove it first",
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            "this user may not write there: choose another folder, or change its permissions"
        }
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "make room there, or choose another place"
        }
        _ => "check the space and the permissions of the folder",
    }
}

/// Writes `path` by `write`; when that fails, no file and no temporary is left. `AlreadyExists` when there is a file at
/// `path`, or one appears meanwhile.
pub fn write_whole<E: From<io::Error>>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> Result<(), E>,
) -> Result<(), E> {
    // Reported before the work, where possible.
    if path.try_exists()? {
        return Err(io::Error::from(io::ErrorKind::AlreadyExists).into());
    }
    let temporary = written_beside(path, write)?;
    temporary.persist_noclobber(path).map_err(|e| e.error)?;
    Ok(())
}

/// Writes `bytes` to `path`, completely or not at all; a file that is there is replaced.
pub fn replace_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let temporary = written_beside(path, |sink| sink.write_all(bytes))?;
    temporary.persist(path).map_err(|e| e.error)?;
    Ok(())
}

/// A temporary file in the folder of `path`, written by `write` and synced; it is removed when dropped.
fn written_beside<E: From<io::Error>>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> Result<(), E>,
) -> Result<NamedTempFile, E> {
    let temporary = beside(path)?;
    let mut sink = BufWriter::new(temporary.as_file());
    write(&mut sink)?;
    sink.flush()?;
    drop(sink);
    temporary.as_file().sync_all()?;
    Ok(temporary)
}

/// It has the same name after a dot, and the permissions of any new file.
fn beside(path: &Path) -> io::Result<NamedTempFile> {
    let name = path.file_name().ok_or(io::ErrorKind::IsADirectory)?;
    let mut prefix = OsString::from(".");
    prefix.push(name);
    prefix.push(".tmp-");
    let mut builder = Builder::new();
    builder.prefix(&prefix);
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    match path.parent() {
        Some(folder) if folder != Path::new("") => builder.tempfile_in(folder),
        _ => builder.tempfile_in("."),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn the_advice_is_for_what_went_wrong() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        let told = |path: &Path| {
            let written = write_whole(path, |sink| sink.write_all(b"x"));
            advice(&written.unwrap_err())
        };
        assert!(told(&folder.path().join("none/a.csv")).contains("make it first"));
        assert!(told(&file.join("a.csv")).contains("a part of its path is a file"));
        assert!(told(&file).contains("that name is taken"));
    }

    #[test]
    fn a_file_appears_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.csv");
        let count = || fs::read_dir(folder.path()).unwrap().count();
        let failed = write_whole(&path, |sink| {
            sink.write_all(b"half")?;
            Err(io::Error::other("no more"))
        });
        assert_eq!(failed.unwrap_err().to_string(), "no more");
        assert_eq!(count(), 0);
        write_whole(&path, |sink| sink.write_all(b"whole")).unwrap();
        assert_eq!((fs::read(&path).unwrap().as_slice(), count()), (b"whole".as_slice(), 1));
        let again = write_whole(&path, |sink| sink.write_all(b"other")).unwrap_err();
        assert_eq!(again.kind(), io::ErrorKind::AlreadyExists);
        assert_eq!(fs::read(&path).unwrap(), b"whole");
    }
}
