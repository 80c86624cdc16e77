//! Errors of columns and of files with them.

use std::io;
use std::path::{Path, PathBuf};

use arrow::error::ArrowError;
use parquet::errors::ParquetError;
use thiserror::Error;

/// The reason why columns do not make a table.
#[derive(Debug, Error)]
pub enum TableError {
    /// The schema has no such column.
    #[error("table {table}: there is no column {column:?}; see `posegrid schema {table}`")]
    UnknownColumn { table: String, column: String },
    /// Two columns have names that differ at most in upper and lower case, or one has the schema's name in another case.
    #[error(
        "table {table}: columns {column:?} and {other:?}: the names differ at most in upper and lower case; which is \
         meant is not clear"
    )]
    Alike {
        table: String,
        column: String,
        /// The other column, or the schema's.
        other: String,
    },
    /// A column is given twice.
    #[error("table {table}: column {column:?} is given twice")]
    Twice { table: String, column: String },
    /// Columns are missing.
    #[error("table {table}: missing columns {}; a column without values still has to be there, all null", columns.join(", "))]
    Missing { table: String, columns: Vec<String> },
    /// A column has another type.
    #[error("table {table}, column {column:?}: found {found}, the schema states {expected}")]
    WrongType {
        table: String,
        column: String,
        /// The schema's type.
        expected: &'static str,
        /// The type found.
        found: String,
    },
    /// A column has another length than the table.
    #[error("table {table}, column {column:?}: {found} values for {rows} rows")]
    Length {
        table: String,
        column: String,
        /// Number of rows of the table.
        rows: usize,
        /// Number of values found.
        found: usize,
    },
    /// A value that breaks the column's contract.
    #[error("table {table}, column {column:?}, row {row}: {problem}")]
    Value {
        table: String,
        column: String,
        /// The row, from 0, as given.
        row: usize,
        /// The fault in it, and the values allowed.
        problem: String,
    },
    /// Two rows have the same values in the columns of `order`.
    #[error(
        "table {table}, rows {first} and {second}: the same {}; a table has one row per {one_row_per}",
        if columns.is_empty() { "file".to_owned() } else { columns.join(", ") }
    )]
    SameRow {
        table: String,
        /// The columns that identify a row.
        columns: Vec<String>,
        /// The thing that one row describes.
        one_row_per: String,
        /// One row, from 0, as given.
        first: usize,
        /// The other row.
        second: usize,
    },
    /// Arrow refused.
    #[error("table {table}: {source}")]
    Arrow {
        table: String,
        /// Arrow's error.
        source: ArrowError,
    },
}

/// The error of a file that cannot be read as a table.
#[derive(Debug, Error)]
#[error("{}", kind.message(path))]
pub struct FileError {
    pub path: PathBuf,
    pub kind: FileErrorKind,
}

/// The fault in a file that is read as a table.
#[derive(Debug)]
pub enum FileErrorKind {
    /// The file cannot be opened: the system's error.
    Open(io::Error),
    /// Its values would take too much memory.
    TooLarge {
        /// The limit, bytes.
        limit: u64,
        advice: &'static str,
    },
    /// No Parquet file: what its bytes look like.
    NoParquet(&'static str),
    /// A Parquet file without its end.
    CutOff,
    /// A damaged Parquet file: Parquet's error.
    Parquet(ParquetError),
    /// A file so damaged that the Parquet reader stopped in the middle: the reader's message.
    Damaged(String),
    /// Its values cannot be read: Arrow's error.
    Values(ArrowError),
    /// The file holds another table.
    OtherTable {
        /// The table that the file's own metadata states.
        found: String,
        /// Name of the table asked for.
        expected: String,
    },
    /// The file has another version of the table.
    OtherVersion {
        table: String,
        /// The version found.
        found: String,
        /// The version of this program's schema.
        expected: u32,
    },
    /// The content of the file is not the one that was written.
    Altered {
        /// The digest of its content.
        found: String,
        /// The digest that its metadata has.
        stated: String,
    },
    /// The rows of its lake contradict the file: the difference.
    NotOfLake(String),
    /// The columns of the file break the table's contract.
    Content(TableError),
}

impl FileError {
    /// Whether the file itself is damaged or changed, as far as is known; one that is missing, or of another version, is
    /// not.
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
fn plain_values(error: &ArrowError) -> String {
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
    /// This problem of the file at `path`.
    pub(crate) fn at(self, path: &Path) -> FileError {
        FileError { path: path.to_owned(), kind: self }
    }

    /// The message for a person, with the file's path.
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
            Self::Parquet(source) => format!(
                "cannot read {path} as a Parquet file: it is damaged: {}; get it anew from a copy, or run its session again",
                plain(source)
            ),
            Self::Damaged(problem) => format!(
                "{path} is damaged: reading it failed with \"{problem}\"; restore it from a copy or run its session again"
            ),
            Self::Values(source) => format!(
                "cannot read the values of {path}: it is damaged: {}; get it anew from a copy, or run its session again",
                plain_values(source)
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
