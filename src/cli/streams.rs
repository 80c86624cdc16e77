//! stdout and stderr, either of which may refuse what is written: a full disk, a reader that has gone away.
//!
//! Every byte that a command writes to them passes here, but for what clap answers to `--help` and what a defect makes the
//! panic hook say. `println!` and `eprintln!` end the thread where a stream refuses, so they are not used (`lib.rs` forbids
//! them), nor do libraries whose words go to stderr tell us so by them.

use std::fs::File;
use std::io::{self, Write as _};
use std::os::fd::AsFd as _;

use super::{DONE, NO_RESULT};

/// A stream of this process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stream {
    /// stdout.
    Results,
    /// stderr.
    Messages,
}

/// Why results did not reach who asked for them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Undelivered {
    /// Whoever read them has gone away, and wants no more.
    ReaderGone,
    /// stdout refused them, which was told on stderr.
    Refused,
}

impl Stream {
    /// Writes bytes as they are, and keeps none of them back.
    pub(super) fn write(self, bytes: &[u8]) -> io::Result<()> {
        match self {
            // The standard library takes a stream that is not open for writing for one that takes everything, and keeps
            // back what it could not write; a file of our own does neither.
            Self::Results => {
                File::from(io::stdout().as_fd().try_clone_to_owned()?).write_all(bytes)
            }
            Self::Messages => io::stderr().write_all(bytes),
        }
    }
}

impl Undelivered {
    /// The exit code of a command that ends because of it: a reader who left has what it wanted.
    pub const fn exit_code(self) -> u8 {
        match self {
            Self::ReaderGone => DONE,
            Self::Refused => NO_RESULT,
        }
    }
}
