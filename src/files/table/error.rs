use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};

use arrow_schema::ArrowError;
use parquet::errors::ParquetError;
use thiserror::Error;

use crate::at::At;
use crate::schema::TableSchema;

/// Values that break the contract of a table: where, and how.
#[derive(Debug, Error)]
#[error(transparent)]
pub struct TableError(At<String>);

impl TableError {
    /// `place` follows the table's name: `, column "x"`.
    pub(super) fn at(schema: &TableSchema, place: impl Display, problem: impl Display) -> Self {
        Self(At::new(format!("table {}{place}", schema.table), problem.to_string()))
    }

    pub(super) fn of(schema: &TableSchema, problem: impl Display) -> Self {
        Self::at(schema, "", problem)
    }

    pub(super) fn column(schema: &TableSchema, column: &str, problem: impl Display) -> Self {
        Self::at(schema, format_args!(", column {column:?}"), problem)
    }

    pub(super) fn unknown_column(schema: &TableSchema, name: &str) -> Self {
        let see = format_args!("see `posegrid schema {}`", schema.table);
        Self::of(schema, format_args!("there is no column {name:?}; {see}"))
    }
}

#[derive(Debug, Error)]
#[error("{}", kind.message(path))]
pub struct FileError {
    pub path: PathBuf,
    pub kind: FileErrorKind,
}

/// `NotOfLake` has the difference in which the rows of its lake contradict the file.
#[derive(Debug)]
pub enum FileErrorKind {
    Open(io::Error),
    TooLarge { limit: u64, advice: &'static str },
    NoParquet(&'static str),
    CutOff,
    Damaged(String),
    OtherTable { found: String, expected: String },
    OtherVersion { table: String, found: String, expected: u32 },
    Altered { found: String, stated: String },
    NotOfLake(String),
    Content(TableError),
}

impl FileError {
    /// One that is missing, or of another version, is not damaged.
    pub const fn is_damage(&self) -> bool {
        !matches!(self.kind, FileErrorKind::Open(_) | FileErrorKind::OtherVersion { .. })
    }
}

/// What Parquet says is wrong, without the names of its own kinds of errors.
pub fn plain(error: &ParquetError) -> String {
    match error {
        ParquetError::General(text)
        | ParquetError::NYI(text)
        | ParquetError::EOF(text)
        | ParquetError::ArrowError(text) => text.clone(),
        ParquetError::External(inner) => inner.to_string(),
        other => other.to_string(),
    }
}

/// What Arrow says is wrong with values, likewise.
pub(super) fn plain_values(error: &ArrowError) -> String {
    match error {
        ArrowError::ParquetError(text) => text.clone(),
        ArrowError::ExternalError(inner) => match inner.downcast_ref::<ParquetError>() {
            Some(inner) => plain(inner),
            None => inner.to_string(),
        },
        other => other.to_string(),
    }
}

impl FileErrorKind {
    pub fn at(self, path: &Path) -> FileError {
        FileError { path: path.to_owned(), kind: self }
    }

    fn message(&self, path: &Path) -> String {
        let path = path.display();
        match self {
            Self::Open(source) if source.kind() == io::ErrorKind::NotFound => {
                format!("cannot open {path}: {source}; check its name")
            }
            Self::Open(source) => format!("cannot open {path}: {source}"),
            Self::NoParquet(looks) => format!(
                "cannot read {path} as a Parquet file: it is {looks}; name the right file, or get it \
                 anew from a copy"
            ),
            Self::CutOff => format!(
                "cannot read {path} as a Parquet file: it begins as one and its end is missing, as after a copy that was \
                 interrupted; get it anew from a copy, or run its session again"
            ),
            Self::TooLarge { limit, advice } => format!(
                "{path}: its values take more than the limit of {limit} bytes in memory; {advice}"
            ),
            Self::Damaged(problem) => format!(
                "cannot read {path} as a Parquet file: it is damaged: {problem}; get it anew from a copy, or run its session \
                 again"
            ),
            Self::OtherTable { found, expected } => {
                format!("{path} holds {found}, not table {expected:?}")
            }
            Self::OtherVersion { table, found, expected } => format!(
                "{path} holds version {found} of table {table:?}, this program reads version {expected}: \
                 run the session again, or use the version of posegrid that wrote it (see table runs)"
            ),
            Self::Altered { found, stated } => format!(
                "{path} is not as it was written: its content has the digest {found}, and it says {stated}; it was damaged or \
                 changed: get it anew from a copy, or run its session again into another lake"
            ),
            Self::NotOfLake(problem) => format!(
                "{path} is not believed: {problem}; `posegrid verify` tells more of its lake"
            ),
            Self::Content(source) => format!("{path}: {source}"),
        }
    }
}
