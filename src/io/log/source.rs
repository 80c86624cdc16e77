//! A log file, read by position through one window.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

/// Bytes read at once where records are small.
const WINDOW: usize = 256 * 1024;

/// A file of known length. Nothing past the length it had when it was opened is read: it may still be written to.
#[derive(Debug)]
pub struct Source {
    file: File,
    length: u64,
    window: Vec<u8>,
    window_start: u64,
}

impl Source {
    /// Takes an open regular file.
    pub fn new(file: File) -> io::Result<Self> {
        let length = file.metadata()?.len();
        Ok(Self {
            file,
            length,
            window: Vec::new(),
            window_start: 0,
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
        let within = start.checked_sub(self.window_start).and_then(|at| usize::try_from(at).ok());
        let held = within.is_some_and(|at| at.checked_add(wanted).is_some_and(|end| end <= self.window.len()));
        if !held {
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

    /// Appends `count` bytes at `start`, or what there is of them, without asking for memory for more than there is.
    pub fn append(&mut self, start: u64, count: u64, to: &mut Vec<u8>) -> io::Result<()> {
        let count = count.min(self.length.saturating_sub(start));
        self.file.seek(SeekFrom::Start(start))?;
        (&mut self.file).take(count).read_to_end(to)?;
        Ok(())
    }
}
