use thiserror::Error;

use crate::at::At;
use crate::join::tabled::Rows;
use crate::measured_table::{ColumnError, MeasuredTableErrorKind};

pub type StationTableError = At<StationTableErrorKind>;

#[derive(Debug, Error)]
pub enum StationTableErrorKind {
    #[error(transparent)]
    Table(#[from] MeasuredTableErrorKind),
    #[error(
        "[stations] {key} = {value:?}: {source}; `posegrid inspect` shows the columns and suggests the section"
    )]
    Column { key: String, value: String, source: Box<ColumnError> },
    #[error(
        "[stations] {key} = {value:?} names no column: write a column, or columns and numbers with \" + \" or \" - \" between them"
    )]
    Empty { key: String, value: String },
    #[error(
        "[stations] {key}: {column:?} is read for something else already; two things are never read from one column"
    )]
    Twice { key: &'static str, column: String },
    #[error("it has no row of a station")]
    NoRows,
    #[error("{kept} of its {rows} rows can be used; the first other, line {line}{}: {reason}", column.as_ref().map_or_else(String::new, |column| format!(", column {column:?}")))]
    NothingKept { rows: usize, kept: usize, line: u64, column: Option<String>, reason: String },
}

impl StationTableErrorKind {
    /// The error of a table of too few rows that can be used, by the first one that was left out.
    pub(super) fn nothing(rows: usize, read: &Rows) -> Self {
        read.rejects.first().map_or(Self::NoRows, |first| Self::NothingKept {
            rows,
            kept: read.rows.iter().filter(|row| !row.readings.is_empty()).count(),
            line: first.line,
            column: first.column.clone(),
            reason: first.reason.clone(),
        })
    }
}
