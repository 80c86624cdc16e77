//! A log file, read by position: through a wide window where records follow one another, through a narrow one from
//! chunk to chunk.

use std::fs::{self, File};
use std::io::{self, Seek, SeekFrom};
use std::path::Path;

use super::packed::{self, Packed};
use super::{FileError, FileFault, Limits};
use crate::progress::Progress;
use crate::system;

const WINDOW: usize = 256 * 1024;
/// Largest distance after the wide window at which a look moves it, bytes.
const CLOSE: u64 = 4096;
/// Bytes read at once from chunk to chunk: more than any header.
const GLANCE: usize = 512;

/// A file of known length. Bytes past the length at opening are not read: the file may still be written to.
#[derive(Debug)]
pub struct Source {
    file: File,
    length: u64,
    wide: Window,
    narrow: Window,
}

#[derive(Debug, Default)]
struct Window {
    start: u64,
    bytes: Vec<u8>,
}

impl Source {
    /// Opens the log at `path`, which errors call `name`; a log in zstd is decompressed first.
    pub fn open(
        path: &Path,
        name: &str,
        limits: Limits,
        progress: &dyn Progress,
    ) -> Result<(Self, Option<Packed>), FileError> {
        let at_fault = |source: io::Error| FileError::new(name, source);
        // Opening a pipe would wait for its writer, and a device may have no end.
        let kind = fs::metadata(path).map_err(at_fault)?.file_type();
        if kind.is_dir() {
            return Err(FileError::new(name, FileFault::Folder));
        }
        if !kind.is_file() {
            return Err(FileError::new(name, FileFault::NotAFile(system::special(kind))));
        }
        let mut source = File::open(path).and_then(Self::new).map_err(at_fault)?;
        if !packed::is_zstd(source.peek(0, 8).map_err(at_fault)?) {
            return Ok((source, None));
        }
        source.file.seek(SeekFrom::Start(0)).map_err(at_fault)?;
        let (file, packed) = packed::unpack(source.file, name, limits, progress)?;
        Ok((Self::new(file).map_err(at_fault)?, Some(packed)))
    }

    fn new(file: File) -> io::Result<Self> {
        let length = file.metadata()?.len();
        Ok(Self { file, length, wide: Window::default(), narrow: Window::default() })
    }

    pub const fn length(&self) -> u64 {
        self.length
    }

    /// Up to `count` bytes (at most a window) at `start`; fewer only at the end of the file.
    pub fn peek(&mut self, start: u64, count: usize) -> io::Result<&[u8]> {
        let wanted = self.there(start, count.min(WINDOW));
        if !self.wide.holds(start, wanted) {
            let window = std::mem::take(&mut self.wide);
            self.wide = self.window(window, start, WINDOW)?;
        }
        Ok(self.wide.part(start, wanted))
    }

    /// Reads a few bytes that may be far away: the window stays unless they lie close after it.
    pub fn probe(&mut self, start: u64, count: usize) -> io::Result<&[u8]> {
        let wanted = self.there(start, count);
        let end = self.wide.start + self.wide.bytes.len() as u64;
        let next = start >= self.wide.start && start <= end + CLOSE;
        if next || count > GLANCE || self.wide.holds(start, wanted) {
            return self.peek(start, count);
        }
        if !self.narrow.holds(start, wanted) {
            let window = std::mem::take(&mut self.narrow);
            self.narrow = self.window(window, start, GLANCE)?;
        }
        Ok(self.narrow.part(start, wanted))
    }

    /// The number of bytes at `start`, at most `count`.
    fn there(&self, start: u64, count: usize) -> usize {
        let behind = self.length.saturating_sub(start);
        usize::try_from(behind).map_or(count, |behind| behind.min(count))
    }

    fn window(&self, window: Window, start: u64, count: usize) -> io::Result<Window> {
        let mut bytes = window.bytes;
        self.read(start, count as u64, &mut bytes)?;
        Ok(Window { start, bytes })
    }

    /// Fewer bytes at the end of the file; asks for no more memory than there are bytes.
    pub fn read(&self, start: u64, count: u64, to: &mut Vec<u8>) -> io::Result<()> {
        let count = count.min(self.length.saturating_sub(start));
        let count = usize::try_from(count).map_err(io::Error::other)?;
        // Its old content is overwritten: only the added bytes have to be zeroed.
        to.reserve_exact(count.saturating_sub(to.len()));
        to.resize(count, 0);
        // Fewer where the file was cut while it was read.
        let filled = system::read_up_to_at(&self.file, to, start)?;
        to.truncate(filled);
        Ok(())
    }
}

impl Window {
    fn holds(&self, start: u64, count: usize) -> bool {
        let at = start.checked_sub(self.start);
        let end = at.and_then(|at| usize::try_from(at).ok()?.checked_add(count));
        end.is_some_and(|end| end <= self.bytes.len())
    }

    /// Bytes of the window; fewer than `count` only if the file was cut while it was read.
    fn part(&self, start: u64, count: usize) -> &[u8] {
        let at = usize::try_from(start - self.start).expect("within the window");
        let end = (at + count).min(self.bytes.len());
        self.bytes.get(at..end).unwrap_or_default()
    }
}
