//! Cells of a table by row and column name.

use arrow::array::{Array, AsArray, PrimitiveArray, StringArray};
use arrow::datatypes::{ArrowPrimitiveType, Float64Type};

use crate::io::table::Table;

/// One row of a table; columns and their types are those of the table's schema.
#[derive(Clone, Copy)]
pub(super) struct Row<'t> {
    pub(super) table: &'t Table,
    row: usize,
}

/// The rows of every table of this name, in their order.
pub(super) fn rows<'t>(tables: &'t [Table], name: &'static str) -> impl Iterator<Item = Row<'t>> {
    let own = tables
        .iter()
        .filter(move |table| table.schema().table == name);
    own.flat_map(|table| (0..table.rows()).map(move |row| Row { table, row }))
}

impl Row<'_> {
    /// A text; empty for null, which the schema excludes.
    pub(super) fn text(self, column: &str) -> String {
        self.optional_text(column).unwrap_or_default()
    }

    pub(super) fn optional_text(self, column: &str) -> Option<String> {
        let texts: &StringArray = self.table.text(column);
        texts
            .is_valid(self.row)
            .then(|| texts.value(self.row).to_owned())
    }

    pub(super) fn number(self, column: &str) -> f64 {
        self.table.f64(column).value(self.row)
    }

    pub(super) fn optional_number(self, column: &str) -> Option<f64> {
        valid(self.table.f64(column), self.row)
    }

    pub(super) fn whole(self, column: &str) -> i64 {
        self.table.i64(column).value(self.row)
    }

    pub(super) fn optional_whole(self, column: &str) -> Option<i64> {
        valid(self.table.i64(column), self.row)
    }

    pub(super) fn flag(self, column: &str) -> bool {
        self.optional_flag(column).unwrap_or(false)
    }

    pub(super) fn optional_flag(self, column: &str) -> Option<bool> {
        let flags = self.table.bool(column);
        flags.is_valid(self.row).then(|| flags.value(self.row))
    }

    pub(super) fn texts(self, column: &str) -> Vec<String> {
        let list = self.table.list(column).value(self.row);
        list.as_string::<i32>()
            .iter()
            .flatten()
            .map(str::to_owned)
            .collect()
    }

    pub(super) fn numbers(self, column: &str) -> Vec<f64> {
        let list = self.table.list(column).value(self.row);
        list.as_primitive::<Float64Type>()
            .iter()
            .flatten()
            .collect()
    }
}

fn valid<T: ArrowPrimitiveType>(values: &PrimitiveArray<T>, row: usize) -> Option<T::Native> {
    values.is_valid(row).then(|| values.value(row))
}
