//! Tables: typed columns → a checked Arrow batch → a Parquet file, and back. Every column is checked against its
//! contract, rows are sorted by the schema's `order`, and two rows with the same name are refused. The same values give
//! the same bytes. Every file carries the digest of its content (`digest`).

mod cell;
mod check;
mod columns;
pub mod compare;
mod digest;
mod error;
mod read;
mod same;
mod together;
pub mod values;
mod write;

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type};
use arrow_array::{BooleanArray, Float64Array, Int64Array, ListArray, RecordBatch, StringArray};

pub use cell::{Cell, Value};
pub use columns::Columns;
pub use error::{FileError, FileErrorKind, TableError, plain};
pub(crate) use read::panic_message;
pub use read::{
    Head, Opened, Seal, head, head_of, in_words, open, open_within, read, read_open, read_within,
};
pub use together::together;
pub use write::{Encoder, PartsFile, ROW_GROUP_ROWS, RowGroups, write};

use super::schema::TableSchema;
use crate::manifest::RunKey;

#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    schema: &'static TableSchema,
    key: Option<RunKey>,
    batch: RecordBatch,
    version: u32,
}

impl Table {
    pub const fn schema(&self) -> &'static TableSchema {
        self.schema
    }

    /// The robot, session and run of every row; `None` for a table that has none, or several.
    pub const fn key(&self) -> Option<&RunKey> {
        self.key.as_ref()
    }

    /// The version of the schema by which it was written: for an older one, columns added later are null.
    pub const fn version(&self) -> u32 {
        self.version
    }

    /// The digest of all columns except `except`, hexadecimal; it does not depend on the file.
    pub fn digest_without(&self, except: &[&str]) -> String {
        digest::of_columns(self, except)
    }

    /// The rows, sorted by the schema's `order`.
    pub const fn batch(&self) -> &RecordBatch {
        &self.batch
    }

    pub fn rows(&self) -> usize {
        self.batch.num_rows()
    }

    pub fn f64(&self, column: &str) -> &Float64Array {
        self.array(column).as_primitive::<Float64Type>()
    }

    pub fn i64(&self, column: &str) -> &Int64Array {
        self.array(column).as_primitive::<Int64Type>()
    }

    pub fn bool(&self, column: &str) -> &BooleanArray {
        self.array(column).as_boolean()
    }

    pub fn text(&self, column: &str) -> &StringArray {
        self.array(column).as_string()
    }

    pub fn list(&self, column: &str) -> &ListArray {
        self.array(column).as_list()
    }

    pub fn array(&self, column: &str) -> &dyn arrow_array::Array {
        let found = self.batch.column_by_name(column);
        found.unwrap_or_else(|| panic!("table {} has no column {column}", self.schema.table))
    }
}
