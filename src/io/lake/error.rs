use std::io;
use std::path::Path;

use thiserror::Error;

use super::name;
use crate::schema::SchemaError;
use crate::store::{Place, StoreError};
use crate::table::{FileError, TableError};

pub(super) type Result<T, E = LakeError> = std::result::Result<T, E>;

#[derive(Debug, Error)]
pub enum LakeError {
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(
        "the name {name:?} takes {length} bytes as a folder's name, more than {longest}: choose a shorter {part} name in \
         the pipeline file",
        longest = name::LONGEST
    )]
    Name { part: &'static str, name: String, length: usize },
    #[error(
        "table {table}: its rows belong to {found}, the run being written is {expected} of robot {robot:?}"
    )]
    OtherRun { table: String, found: String, expected: String, robot: String },
    #[error(
        "{place} is published, and recomputing it gave other bytes: run `posegrid verify` to see the difference \
         (another processor, or a changed program under the same version); nothing published is rewritten"
    )]
    Rewrite { place: Place },
    #[error(
        "{place} changed while its run was being written: digest {found}, written as {written}; run it again"
    )]
    Changed { place: Place, found: String, written: String },
    #[error(
        "{place} is not what its run wrote: its digest is {found}, the row of runs states {written}; it was damaged or changed: \
         restore it from a copy, or run its session again into another lake and copy the file"
    )]
    NotAsWritten { place: Place, found: String, written: String },
    #[error(
        "{place} is none of the files that the row of run {run} in runs names: it does not belong there"
    )]
    NotOfRun { place: Place, run: String },
    #[error(
        "{place} does not hold the request that its name states: it was damaged or changed, or does not belong there; restore it \
         from a copy, or remove it"
    )]
    NotAsked { place: Place },
    #[error("the row to be recorded: {source}")]
    Record { source: TableError },
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Schema(#[from] SchemaError),
}

impl LakeError {
    pub const fn is_fault(&self) -> bool {
        matches!(self, Self::Store(_) | Self::Changed { .. })
    }
}

pub(super) fn folder_error<'a>(
    doing: &'static str,
    path: &'a Path,
) -> impl Fn(io::Error) -> LakeError + use<'a> {
    let error = StoreError::folder(doing, path);
    move |source| error(source).into()
}
