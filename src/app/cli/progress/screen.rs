use std::io;
use std::sync::{Mutex, MutexGuard, PoisonError};

use console::Term;
use indicatif::TermLike;

use crate::cli::streams::Stream;

/// stderr as a terminal that never fails: a bar that cannot be drawn, because the terminal was closed, is dropped. The
/// bars' own terminal would keep the text that it could not write.
#[derive(Debug)]
pub(super) struct Screen {
    size: Term,
    /// Text for the next flush, written all at once so that a bar does not flicker.
    pending: Mutex<String>,
}

impl Screen {
    pub(super) fn new() -> Self {
        Self { size: Term::stderr(), pending: Mutex::default() }
    }

    fn pending(&self) -> MutexGuard<'_, String> {
        self.pending.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn put(&self, text: &str) {
        self.pending().push_str(text);
    }

    /// Moves the cursor by so many places; a terminal would take 0 for 1.
    fn go(&self, places: usize, direction: char) {
        if places > 0 {
            self.put(&format!("\x1b[{places}{direction}"));
        }
    }
}

impl TermLike for Screen {
    fn width(&self) -> u16 {
        self.size.size().1
    }

    fn height(&self) -> u16 {
        self.size.size().0
    }

    fn move_cursor_up(&self, lines: usize) -> io::Result<()> {
        self.go(lines, 'A');
        Ok(())
    }

    fn move_cursor_down(&self, lines: usize) -> io::Result<()> {
        self.go(lines, 'B');
        Ok(())
    }

    fn move_cursor_right(&self, places: usize) -> io::Result<()> {
        self.go(places, 'C');
        Ok(())
    }

    fn move_cursor_left(&self, places: usize) -> io::Result<()> {
        self.go(places, 'D');
        Ok(())
    }

    fn write_line(&self, text: &str) -> io::Result<()> {
        self.put(text);
        self.put("\n");
        Ok(())
    }

    fn write_str(&self, text: &str) -> io::Result<()> {
        self.put(text);
        Ok(())
    }

    fn clear_line(&self) -> io::Result<()> {
        self.put("\r\x1b[2K");
        Ok(())
    }

    fn flush(&self) -> io::Result<()> {
        let pending = std::mem::take(&mut *self.pending());
        // A failure has nowhere to be reported.
        let _ = Stream::Messages.write(pending.as_bytes());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_drawn_is_put_together_and_a_move_by_nothing_is_none() {
        let screen = Screen::new();
        screen.move_cursor_up(0).unwrap();
        screen.move_cursor_up(2).unwrap();
        screen.clear_line().unwrap();
        screen.write_line("a").unwrap();
        screen.write_str("b").unwrap();
        assert_eq!(*screen.pending(), "\x1b[2A\r\x1b[2Ka\nb");
    }
}
