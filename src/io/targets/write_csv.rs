//! A table → CSV: a line a row, and each joint angle in a column of its own.

use std::io::Write;

use arrow::array::{Array as _, ArrayRef, AsArray as _};
use arrow::datatypes::{Float64Type, Int64Type};

use super::angles::{shown, suffix};
use crate::ingest::AngleUnit;
use crate::io::schema::{ColumnSchema, ColumnType};
use crate::io::table::Table;

/// A list of joint angles has a name with this ending.
const ANGLES: &str = "joints_rad";

/// Writes a table as CSV: lengths to the nanometre, joint angles in `unit`, other numbers as exactly as they are, nothing
/// where a value is absent.
///
/// A list of joint angles `…joints_rad` becomes the columns `…q1_rad` or `…q1_deg` and so on, as many as its longest row
/// has; other lists are one column, their elements apart by blanks. Lists that no row has are left out.
pub fn write_csv(table: &Table, unit: AngleUnit, sink: impl Write) -> Result<(), csv::Error> {
    let columns: Vec<Spread<'_>> = Spread::all(table);
    let mut writer = csv::Writer::from_writer(sink);
    writer.write_record(columns.iter().flat_map(|column| column.names(unit)))?;
    for row in 0..table.rows() {
        writer.write_record(columns.iter().flat_map(|column| column.cells(row, unit)))?;
    }
    Ok(writer.flush()?)
}

/// One column of a table, and how many it becomes.
struct Spread<'t> {
    schema: &'t ColumnSchema,
    array: &'t ArrayRef,
    columns: usize,
}

impl<'t> Spread<'t> {
    fn all(table: &'t Table) -> Vec<Self> {
        let arrays = table.schema().columns.iter().zip(table.batch().columns());
        let spread = arrays.map(|(schema, array)| Self {
            schema,
            array,
            columns: count(schema, array),
        });
        spread.filter(|spread| spread.columns > 0).collect()
    }

    /// The name before the joint's number, where it is a list of joint angles.
    fn angles(&self) -> Option<&str> {
        let is_list = self.schema.kind == ColumnType::ListFloat64;
        is_list.then(|| self.schema.name.strip_suffix(ANGLES))?
    }

    fn names(&self, unit: AngleUnit) -> Vec<String> {
        match self.angles() {
            Some(before) => (1..=self.columns)
                .map(|joint| format!("{before}q{joint}_{}", suffix(unit)))
                .collect(),
            None => vec![self.schema.name.clone()],
        }
    }

    fn cells(&self, row: usize, unit: AngleUnit) -> Vec<String> {
        let mut cells = if self.array.is_null(row) {
            Vec::new()
        } else if self.angles().is_some() {
            let list = self.array.as_list::<i32>().value(row);
            let angles = list.as_primitive::<Float64Type>().values().iter();
            angles.map(|&angle| shown(angle, unit)).collect()
        } else {
            vec![cell(self.array, self.schema, row)]
        };
        cells.resize(self.columns, String::new());
        cells
    }
}

/// How many columns a column becomes.
fn count(schema: &ColumnSchema, array: &ArrayRef) -> usize {
    if schema.kind.is_scalar() {
        return 1;
    }
    let lists = array.as_list::<i32>();
    let given = (0..lists.len()).filter(|&row| lists.is_valid(row));
    let longest = given.map(|row| lists.value(row).len()).max().unwrap_or(0);
    if schema.name.ends_with(ANGLES) {
        longest
    } else {
        longest.min(1)
    }
}

/// One value that is not null.
fn cell(array: &ArrayRef, column: &ColumnSchema, row: usize) -> String {
    let real = |array: &ArrayRef, row: usize| array.as_primitive::<Float64Type>().value(row);
    let whole = |array: &ArrayRef, row: usize| array.as_primitive::<Int64Type>().value(row);
    let listed = |each: &dyn Fn(&ArrayRef, usize) -> String| {
        let list = array.as_list::<i32>().value(row);
        let texts: Vec<String> = (0..list.len()).map(|place| each(&list, place)).collect();
        texts.join(" ")
    };
    match (column.kind, column.unit.as_deref()) {
        (ColumnType::Float64, Some("mm")) => format!("{:.6}", real(array, row)),
        (ColumnType::Float64, _) => real(array, row).to_string(),
        (ColumnType::Int64, _) => whole(array, row).to_string(),
        (ColumnType::Bool, _) => array.as_boolean().value(row).to_string(),
        (ColumnType::String, _) => array.as_string::<i32>().value(row).to_owned(),
        (ColumnType::ListFloat64, _) => listed(&|list, place| real(list, place).to_string()),
        (ColumnType::ListInt64, _) => listed(&|list, place| whole(list, place).to_string()),
        (ColumnType::ListString, _) => {
            listed(&|list, place| list.as_string::<i32>().value(place).to_owned())
        }
    }
}
