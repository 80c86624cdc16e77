//! Errors of a table of stations: which file, which key of `[stations]`, which column, and what there is instead.

use thiserror::Error;

use crate::at::At;
use crate::join::RowReject;
use crate::measured_table::{ColumnError, MeasuredTableErrorKind};

/// Why a table gives no stations, and its file.
pub type StationTableError = At<StationTableErrorKind>;

/// The fault in a file, or in a table's columns or rows.
#[derive(Debug, Error)]
pub enum StationTableErrorKind {
    /// The file cannot be read as a table.
    #[error(transparent)]
    Table(#[from] MeasuredTableErrorKind),
    /// A column that the table does not have, or has twice.
    #[error(
        "[stations] {key} = {value:?}: {source}; `posegrid inspect` shows the columns and suggests the section"
    )]
    Column {
        /// The key of `[stations]`.
        key: String,
        value: String,
        source: Box<ColumnError>,
    },
    /// A value that names no column at all.
    #[error(
        "[stations] {key} = {value:?} names no column: write a column, or columns and numbers with \" + \" or \" - \" between them"
    )]
    Empty {
        /// The key of `[stations]`.
        key: String,
        value: String,
    },
    /// No row at all, or none of the session.
    #[error("it has no row of a station")]
    NoRows,
    /// Rows, and none that can be used.
    #[error("none of its {rows} rows can be used; the first, line {line}{}: {reason}", column.as_ref().map_or_else(String::new, |column| format!(", column {column:?}")))]
    NothingKept {
        /// Number of rows.
        rows: usize,
        /// Line of the first one.
        line: u64,
        /// The column at fault.
        column: Option<String>,
        /// What is wrong with it.
        reason: String,
    },
}

impl StationTableErrorKind {
    /// The error of a table without a usable row, by the first one that was left out.
    pub(super) fn nothing(rows: usize, first: Option<&RowReject>) -> Self {
        first.map_or(Self::NoRows, |first| Self::NothingKept {
            rows,
            line: first.line,
            column: first.column.clone(),
            reason: first.reason.clone(),
        })
    }
}
