//! stdout and stderr, either of which may refuse what is written. Every byte passes here, except clap's answer to
//! `--help` and what the panic hook prints: `println!` ends the thread where a stream refuses, so it is not used
//! (`lib.rs` forbids it).

use std::io::{self, Write as _};

use super::{DONE, NO_RESULT};
use crate::files::system;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stream {
    Results,
    Messages,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Undelivered {
    ReaderGone,
    /// stdout refused them; the error was logged on stderr.
    Refused,
}

impl Stream {
    /// Writes all bytes at once, without a buffer.
    pub(super) fn write(self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::Results => system::write_stdout(bytes),
            Self::Messages => io::stderr().write_all(bytes),
        }
    }
}

impl Undelivered {
    /// The exit code of a command that ends for this reason: a reader who left has what it wanted.
    pub const fn exit_code(self) -> u8 {
        match self {
            Self::ReaderGone => DONE,
            Self::Refused => NO_RESULT,
        }
    }
}
