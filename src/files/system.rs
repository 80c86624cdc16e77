//! Operations that operating systems do each in their own way. Linux is the system of every proof; Windows, which
//! trackers' computers run, does the main job under Wine.

use std::fs::{File, FileType};
use std::io;
use std::path::Path;

/// What Windows calls a pipe without the other end.
#[cfg(not(unix))]
const ERROR_PIPE_NOT_CONNECTED: i32 = 233;

/// Reads bytes at a place of a file, as many as one call gives; on Windows the file's own position moves too.
fn read_at(file: &File, bytes: &mut [u8], start: u64) -> io::Result<usize> {
    #[cfg(unix)]
    return std::os::unix::fs::FileExt::read_at(file, bytes, start);
    #[cfg(windows)]
    return std::os::windows::fs::FileExt::seek_read(file, bytes, start);
}

/// Fills `bytes` from a place of a file, as far as the file goes, and gives their number.
pub fn read_up_to_at(file: &File, bytes: &mut [u8], start: u64) -> io::Result<usize> {
    let mut filled = 0;
    while filled < bytes.len() {
        match read_at(file, &mut bytes[filled..], start + filled as u64) {
            Ok(0) => break,
            Ok(more) => filled += more,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}

/// Fills `bytes` from a place of a file; an error where the file ends before.
pub fn read_exact_at(file: &File, bytes: &mut [u8], start: u64) -> io::Result<()> {
    let is_whole = read_up_to_at(file, bytes, start)? == bytes.len();
    if is_whole { Ok(()) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
}

pub fn special(kind: FileType) -> &'static str {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt as _;
        if kind.is_fifo() {
            return "a pipe (FIFO)";
        }
        if kind.is_socket() {
            return "a socket";
        }
        "a device"
    }
    #[cfg(not(unix))]
    {
        let _ = kind;
        "a device or a pipe"
    }
}

pub fn write_stdout(bytes: &[u8]) -> io::Result<()> {
    use std::io::Write as _;
    // The standard library treats a stream that is not open for writing as one that takes everything, and buffers what it
    // could not write; a file of our own does neither.
    #[cfg(unix)]
    {
        let own = std::os::fd::AsFd::as_fd(&io::stdout()).try_clone_to_owned()?;
        File::from(own).write_all(bytes)
    }
    // A console of Windows takes UTF-16, which the standard library makes.
    #[cfg(not(unix))]
    {
        let mut stdout = io::stdout().lock();
        let written = stdout.write_all(bytes).and_then(|()| stdout.flush());
        written.map_err(|error| match error.raw_os_error() {
            // A pipe whose reader has gone, which the standard library names for two numbers of three.
            Some(ERROR_PIPE_NOT_CONNECTED) => io::Error::from(io::ErrorKind::BrokenPipe),
            _ => error,
        })
    }
}

/// Makes the names in a folder last: on Unix a new name is permanent only once its folder is synced; NTFS keeps a
/// journal of names.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    #[cfg(unix)]
    File::open(folder)?.sync_all()?;
    #[cfg(not(unix))]
    let _ = folder;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_read_where_they_stand() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, b"0123456789").unwrap();
        let file = File::open(&path).unwrap();
        let mut bytes = [0; 3];
        read_exact_at(&file, &mut bytes, 4).unwrap();
        assert_eq!(&bytes, b"456");
        read_exact_at(&file, &mut bytes, 0).unwrap();
        assert_eq!(&bytes, b"012");
        let behind = read_exact_at(&file, &mut bytes, 8).unwrap_err();
        assert_eq!(behind.kind(), io::ErrorKind::UnexpectedEof);
        assert_eq!(read_at(&file, &mut bytes, 10).unwrap(), 0);
    }
}
