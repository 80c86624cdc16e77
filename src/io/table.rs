//! Tables: typed columns → a checked Arrow batch → a Parquet file, and back.
//!
//! 1. [`Columns`] takes whole columns by name and puts them in the order of the schema.
//! 2. Every column is checked against its contract: type, length, nulls, finite numbers, allowed words.
//! 3. Rows are sorted by the schema's `order`; two rows of the same name are refused.
//! 4. [`write`] and [`read`] turn a [`Table`] into the bytes of a Parquet file and back; a file read is checked alike.
//!
//! The same values give the same bytes.

mod cell;
mod check;
mod columns;
mod read;
mod write;

use arrow::array::{
    AsArray, BooleanArray, Float64Array, Int64Array, ListArray, RecordBatch, StringArray,
};
use arrow::datatypes::{Float64Type, Int64Type};
use arrow::error::ArrowError;
use thiserror::Error;

pub use cell::{Cell, Value};
pub use columns::Columns;
pub use read::{FileError, read};
pub use write::write;

use super::schema::TableSchema;
use crate::manifest::RunKey;

/// Rows of one table that keep its contract.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    schema: &'static TableSchema,
    key: Option<RunKey>,
    batch: RecordBatch,
}

/// Why columns do not make a table.
#[derive(Debug, Error)]
pub enum TableError {
    /// A column that the schema does not have.
    #[error("table {table}: there is no column {column:?}; see `posegrid schema {table}`")]
    UnknownColumn {
        /// The table.
        table: String,
        /// The column.
        column: String,
    },
    /// The same column twice.
    #[error("table {table}: column {column:?} is given twice")]
    Twice {
        /// The table.
        table: String,
        /// The column.
        column: String,
    },
    /// Columns that nobody gave.
    #[error("table {table}: missing columns {}; a column without values still has to be there, all null", columns.join(", "))]
    Missing {
        /// The table.
        table: String,
        /// The columns.
        columns: Vec<String>,
    },
    /// A column of another type.
    #[error("table {table}, column {column:?}: found {found}, the schema says {expected}")]
    WrongType {
        /// The table.
        table: String,
        /// The column.
        column: String,
        /// The schema's type.
        expected: &'static str,
        /// The type found.
        found: String,
    },
    /// A column of another length than the table.
    #[error("table {table}, column {column:?}: {found} values for {rows} rows")]
    Length {
        /// The table.
        table: String,
        /// The column.
        column: String,
        /// Rows of the table.
        rows: usize,
        /// Values found.
        found: usize,
    },
    /// A value that breaks the column's contract.
    #[error("table {table}, column {column:?}, row {row}: {problem}")]
    Value {
        /// The table.
        table: String,
        /// The column.
        column: String,
        /// The row, from 0, as given.
        row: usize,
        /// What is wrong with it, and what is allowed.
        problem: String,
    },
    /// Two rows that the columns of `order` do not tell apart.
    #[error(
        "table {table}, rows {first} and {second}: the same {}; a table has one row per {one_row_per}",
        if columns.is_empty() { "file".to_owned() } else { columns.join(", ") }
    )]
    SameRow {
        /// The table.
        table: String,
        /// Columns that name a row.
        columns: Vec<String>,
        /// What a row is.
        one_row_per: String,
        /// One row, from 0, as given.
        first: usize,
        /// The other.
        second: usize,
    },
    /// Arrow refused.
    #[error("table {table}: {source}")]
    Arrow {
        /// The table.
        table: String,
        /// Arrow's error.
        source: ArrowError,
    },
}

impl Table {
    /// The table's contract.
    pub const fn schema(&self) -> &'static TableSchema {
        self.schema
    }

    /// The robot, session and run that every row carries; `None` for a table that has none, or several.
    pub const fn key(&self) -> Option<&RunKey> {
        self.key.as_ref()
    }

    /// The rows, sorted by the schema's `order`.
    pub const fn batch(&self) -> &RecordBatch {
        &self.batch
    }

    /// How many rows.
    pub fn rows(&self) -> usize {
        self.batch.num_rows()
    }

    /// A column of numbers.
    ///
    /// # Panics
    /// When the schema has no such column of that type; the same holds for the other accessors.
    pub fn f64(&self, column: &str) -> &Float64Array {
        self.array(column).as_primitive::<Float64Type>()
    }

    /// A column of whole numbers.
    pub fn i64(&self, column: &str) -> &Int64Array {
        self.array(column).as_primitive::<Int64Type>()
    }

    /// A column of truth values.
    pub fn bool(&self, column: &str) -> &BooleanArray {
        self.array(column).as_boolean()
    }

    /// A column of texts.
    pub fn text(&self, column: &str) -> &StringArray {
        self.array(column).as_string()
    }

    /// A column of lists.
    pub fn list(&self, column: &str) -> &ListArray {
        self.array(column).as_list()
    }

    fn array(&self, column: &str) -> &dyn arrow::array::Array {
        let found = self.batch.column_by_name(column);
        found.unwrap_or_else(|| panic!("table {} has no column {column}", self.schema.table))
    }
}
