//! Errors of a lake, with advice.

use std::io;
use std::path::Path;

use thiserror::Error;

use super::name;
use crate::schema::SchemaError;
use crate::store::{Place, StoreError};
use crate::table::{FileError, TableError};

/// The reason why a lake cannot be used.
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
        /// The part: robot, session or run.
        part: &'static str,
        /// The name that is too long.
        name: String,
        /// Length of the encoded name, bytes.
        length: usize,
    },
    /// A table of another run, or of none.
    #[error(
        "table {table}: its rows belong to {found}, the run being written is {expected} of robot {robot:?}"
    )]
    OtherRun {
        table: String,
        /// The run that its rows belong to, or that there is none.
        found: String,
        /// Name of the run being written.
        expected: String,
        /// Robot of the run being written.
        robot: String,
    },
    /// A published table would be changed.
    #[error(
        "{place} is published, and recomputing it gave other bytes: run `posegrid verify` to see the difference \
         (another processor, or a changed program under the same version); nothing published is rewritten"
    )]
    Rewrite {
        /// Place of the file.
        place: Place,
    },
    /// A table changed between writing and committing.
    #[error(
        "{place} changed while its run was being written: digest {found}, written as {written}; run it again"
    )]
    Changed {
        /// Place of the file.
        place: Place,
        /// Digest of the file now.
        found: String,
        /// Digest of what was written.
        written: String,
    },
    /// A file differs from the one that its run wrote.
    #[error(
        "{place} is not what its run wrote: its digest is {found}, the row of runs states {written}; it was damaged or changed: \
         restore it from a copy, or run its session again into another lake and copy the file"
    )]
    NotAsWritten {
        /// Place of the file.
        place: Place,
        /// Digest of the file now.
        found: String,
        /// Digest in the run's row.
        written: String,
    },
    /// A file that its run did not write.
    #[error(
        "{place} is none of the files that the row of run {run} in runs names: it does not belong there"
    )]
    NotOfRun {
        /// Place of the file.
        place: Place,
        /// Name of the run.
        run: String,
    },
    /// A file of `asked` that holds the row of another request.
    #[error(
        "{place} does not hold the request that its name states: it was damaged or changed, or does not belong there; restore it \
         from a copy, or remove it"
    )]
    NotAsked {
        /// Place of the file.
        place: Place,
    },
    /// A row of `corrections` or `asked` does not fit its schema.
    #[error("the row to be recorded: {source}")]
    Record {
        /// The fault in the row.
        source: TableError,
    },
    /// The file of a table cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The table is unknown.
    #[error(transparent)]
    Schema(#[from] SchemaError),
}

impl LakeError {
    /// Whether the machine or the storage failed, so that the same may work later.
    pub const fn is_fault(&self) -> bool {
        matches!(self, Self::Store(_) | Self::Changed { .. })
    }
}

/// Makes the error of an operation at a path from the system's error.
pub(super) fn folder_error<'a>(
    doing: &'static str,
    path: &'a Path,
) -> impl Fn(io::Error) -> LakeError + use<'a> {
    let error = StoreError::folder(doing, path);
    move |source| error(source).into()
}
