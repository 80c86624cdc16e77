//! What can go wrong with a lake, and what to try.

use std::io;
use std::path::Path;

use thiserror::Error;

use super::name;
use crate::io::schema::SchemaError;
use crate::io::store::{Place, StoreError};
use crate::io::table::{FileError, TableError};

/// Why a lake cannot be used.
#[derive(Debug, Error)]
pub enum LakeError {
    /// The folder or the object storage refused.
    #[error(transparent)]
    Store(#[from] StoreError),
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
        "{place} is published, and computing it again gave other bytes: run `posegrid verify` to see the difference \
         (another processor, or a changed program under the same version); nothing published is rewritten"
    )]
    Rewrite {
        /// The file.
        place: Place,
    },
    /// A table changed between writing and committing.
    #[error(
        "{place} changed while its run was being written: digest {found}, written as {written}; run it again"
    )]
    Changed {
        /// The file.
        place: Place,
        /// Digest of what is there.
        found: String,
        /// Digest of what was written.
        written: String,
    },
    /// A file that is not what its run wrote.
    #[error(
        "{place} is not what its run wrote: its digest is {found}, the row of runs says {written}; it was damaged or changed: \
         get it anew from a copy, or run its session again into another lake and copy the file"
    )]
    NotAsWritten {
        /// The file.
        place: Place,
        /// Its digest.
        found: String,
        /// The digest by the row.
        written: String,
    },
    /// A file that its run did not write.
    #[error(
        "{place} is none of the files that the row of run {run} in runs names: it does not belong there"
    )]
    NotOfRun {
        /// The file.
        place: Place,
        /// The run.
        run: String,
    },
    /// A record of corrections breaks its contract.
    #[error("the record of corrections: {source}")]
    Record {
        /// What is wrong with it.
        source: TableError,
    },
    /// The file of a table cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// No such table.
    #[error(transparent)]
    Schema(#[from] SchemaError),
}

/// The error of doing something at a path, of what the system says.
pub(super) fn folder_error<'a>(
    doing: &'static str,
    path: &'a Path,
) -> impl Fn(io::Error) -> LakeError + use<'a> {
    let told = StoreError::folder(doing, path);
    move |source| told(source).into()
}
