//! Files that appear whole or not at all: written under a temporary name beside their own, synced, renamed.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Writes `path` by `write`. When that fails, nothing stands under `path`, and no temporary is left.
///
/// # Errors
/// Of `write`, or of the folder; `AlreadyExists` when something stands under `path` already.
pub fn write_whole<E: From<io::Error>>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<(), E> {
    let Some(name) = path.file_name() else {
        return Err(io::Error::from(io::ErrorKind::IsADirectory).into());
    };
    if path.try_exists()? {
        return Err(io::Error::from(io::ErrorKind::AlreadyExists).into());
    }
    let mut temporary = std::ffi::OsString::from(".");
    temporary.push(name);
    temporary.push(format!(".tmp-{}", std::process::id()));
    let temporary = path.with_file_name(temporary);
    let written = write_synced(&temporary, write).and_then(|()| Ok(fs::rename(&temporary, path)?));
    if written.is_err() {
        // The first error is the one to tell; a temporary that stays behind has a name that says what it is.
        let _ = fs::remove_file(&temporary);
    }
    written
}

/// Puts `bytes` in the place of what stands under `path`, if anything does, whole or not at all.
pub fn replace_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let name = path.file_name().ok_or(io::ErrorKind::IsADirectory)?;
    let mut temporary = std::ffi::OsString::from(".");
    temporary.push(name);
    temporary.push(format!(".tmp-{}", std::process::id()));
    let temporary = path.with_file_name(temporary);
    let written = write_synced(&temporary, |sink| sink.write_all(bytes))
        .and_then(|()| fs::rename(&temporary, path));
    if written.is_err() {
        // As above.
        let _ = fs::remove_file(&temporary);
    }
    written
}

fn write_synced<E: From<io::Error>>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<(), E> {
    let mut sink = BufWriter::new(File::create(path)?);
    write(&mut sink)?;
    sink.flush()?;
    Ok(sink.get_ref().sync_all()?)
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert_eq!(
            (fs::read(&path).unwrap().as_slice(), count()),
            (b"whole".as_slice(), 1)
        );
        let again = write_whole(&path, |sink| sink.write_all(b"other")).unwrap_err();
        assert_eq!(again.kind(), io::ErrorKind::AlreadyExists);
        assert_eq!(fs::read(&path).unwrap(), b"whole");
    }
}
