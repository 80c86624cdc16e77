//! What can go wrong with a lake, and what to try.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::name;
use crate::io::schema::SchemaError;
use crate::io::table::FileError;

/// Why a lake cannot be used.
#[derive(Debug, Error)]
pub enum LakeError {
    /// The file system refused.
    #[error("cannot {doing} {path}: {source}{}", advice(source))]
    Folder {
        /// What was tried.
        doing: &'static str,
        /// Where.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A name too long for a file system.
    #[error(
        "the name {name:?} takes {length} bytes as a folder's name, more than {longest}: choose a shorter {part} name in \
         the pipeline file",
        longest = name::LONGEST
    )]
    Name {
        /// Robot, session or run.
        part: &'static str,
        /// The name.
        name: String,
        /// Bytes it would take.
        length: usize,
    },
    /// A table of another run, or of none.
    #[error(
        "table {table}: its rows belong to {found}, the run being written is {expected} of robot {robot:?}"
    )]
    OtherRun {
        /// The table.
        table: String,
        /// Whose rows they are.
        found: String,
        /// The run being written.
        expected: String,
        /// Its robot.
        robot: String,
    },
    /// A published table would change.
    #[error(
        "{path} is published, and computing it again gave other bytes: run `posegrid verify` to see the difference \
         (another processor, or a changed program under the same version); nothing published is rewritten"
    )]
    Rewrite {
        /// The file.
        path: PathBuf,
    },
    /// A table changed between writing and committing.
    #[error(
        "{path} changed while its run was being written: digest {found}, written as {written}; run it again"
    )]
    Changed {
        /// The file.
        path: PathBuf,
        /// Digest of what is there.
        found: String,
        /// Digest of what was written.
        written: String,
    },
    /// The file of a table cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// No such table.
    #[error(transparent)]
    Schema(#[from] SchemaError),
}

fn advice(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "; make room there, or name another folder under [output] in the pipeline file; run again afterwards"
        }
        io::ErrorKind::ReadOnlyFilesystem | io::ErrorKind::PermissionDenied => {
            "; make the folder writable, or name another one under [output] in the pipeline file"
        }
        io::ErrorKind::NotADirectory | io::ErrorKind::AlreadyExists => {
            "; a file stands where a folder is needed: name another folder under [output] in the pipeline file"
        }
        io::ErrorKind::Unsupported => {
            "; a lake needs a file system with hard links, to let exactly one of two equal runs commit"
        }
        _ => "",
    }
}

/// The error of doing something at a path, of what the system says.
pub(super) fn folder_error<'a>(
    doing: &'static str,
    path: &'a Path,
) -> impl Fn(io::Error) -> LakeError + use<'a> {
    move |source| LakeError::Folder {
        doing,
        path: path.to_owned(),
        source,
    }
}
