//! A log file, read by position through one window.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::os::unix::fs::FileExt as _;
use std::path::Path;

use super::packed::{self, Packed};
use super::{FileError, Limits};
use crate::progress::Progress;

/// Bytes read at once where records are small.
const WINDOW: usize = 256 * 1024;
/// How far behind the window a look moves it.
const CLOSE: u64 = 4096;

/// A file of known length. Nothing past the length it had when it was opened is read: it may still be written to.
#[derive(Debug)]
pub struct Source {
    file: File,
    length: u64,
    window: Vec<u8>,
    window_start: u64,
    probe: Vec<u8>,
}

impl Source {
    /// Opens the log at `path`, which is named `name` in errors; one in zstd is decompressed first.
    pub fn open(
        path: &Path,
        name: &str,
        limits: Limits,
        progress: &dyn Progress,
    ) -> Result<(Self, Option<Packed>), FileError> {
        let at_fault = |source| FileError::Io {
            file: name.to_owned(),
            source,
        };
        let file = File::open(path).map_err(at_fault)?;
        let mut source = Self::new(file).map_err(at_fault)?;
        if !packed::is_zstd(source.peek(0, 8).map_err(at_fault)?) {
            return Ok((source, None));
        }
        source.file.seek(SeekFrom::Start(0)).map_err(at_fault)?;
        let (file, packed) = packed::unpack(source.file, name, limits, progress)?;
        Ok((Self::new(file).map_err(at_fault)?, Some(packed)))
    }

    fn new(file: File) -> io::Result<Self> {
        let length = file.metadata()?.len();
        Ok(Self {
            file,
            length,
            window: Vec::new(),
            window_start: 0,
            probe: Vec::new(),
        })
    }

    /// Bytes in the file.
    pub const fn length(&self) -> u64 {
        self.length
    }

    /// Up to `count` bytes (at most a window) at `start`; fewer only at the end of the file.
    pub fn peek(&mut self, start: u64, count: usize) -> io::Result<&[u8]> {
        let count = count.min(WINDOW);
        let available = usize::try_from(self.length.saturating_sub(start)).unwrap_or(usize::MAX);
        let wanted = count.min(available);
        if !self.holds(start, wanted) {
            let mut window = std::mem::take(&mut self.window);
            window.clear();
            self.append(start, WINDOW as u64, &mut window)?;
            self.window = window;
            self.window_start = start;
        }
        let at = usize::try_from(start - self.window_start).expect("within the window");
        // Fewer than wanted only if the file was cut while it was read.
        let end = (at + wanted).min(self.window.len());
        Ok(self.window.get(at..end).unwrap_or_default())
    }

    /// Like [`Self::peek`] for a few bytes that may be far off: the window stays where it is unless they lie close
    /// behind it.
    pub fn probe(&mut self, start: u64, count: usize) -> io::Result<&[u8]> {
        let window_end = self.window_start + self.window.len() as u64;
        let next = start >= self.window_start && start <= window_end + CLOSE;
        let available = self.length.saturating_sub(start).min(count as u64);
        if next || self.holds(start, usize::try_from(available).unwrap_or(count)) {
            return self.peek(start, count);
        }
        let mut probe = std::mem::take(&mut self.probe);
        probe.clear();
        self.append(start, count as u64, &mut probe)?;
        self.probe = probe;
        Ok(&self.probe)
    }

    fn holds(&self, start: u64, count: usize) -> bool {
        let within = start
            .checked_sub(self.window_start)
            .and_then(|at| usize::try_from(at).ok());
        within.is_some_and(|at| {
            at.checked_add(count)
                .is_some_and(|end| end <= self.window.len())
        })
    }

    /// Appends `count` bytes at `start`, or what there is of them, without asking for memory for more than there is.
    pub fn append(&self, start: u64, count: u64, to: &mut Vec<u8>) -> io::Result<()> {
        let count = count.min(self.length.saturating_sub(start));
        let file = &self.file;
        From { file, start }.take(count).read_to_end(to)?;
        Ok(())
    }
}

/// A file from a byte on. It has a place of its own, so that several threads may read the file.
struct From<'f> {
    file: &'f File,
    start: u64,
}

impl Read for From<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read_at(buffer, self.start)?;
        self.start += count as u64;
        Ok(count)
    }
}
