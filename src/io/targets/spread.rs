//! A table as text: one row after the other, and each joint angle in a column of its own.

use arrow_array::cast::AsArray as _;
use arrow_array::types::{Float64Type, Int64Type, TimestampMicrosecondType};
use arrow_array::{Array as _, ArrayRef};

use super::angles::JointUnits;
use crate::schema::{ColumnSchema, ColumnType};
use crate::table::Table;
use crate::units::WallTime;

const ANGLES: &str = "joints_rad";

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Cell {
    Absent,
    Number(String),
    Flag(bool),
    Text(String),
    List(Vec<Cell>),
}

/// A list of joint angles `…joints_rad` becomes `…q1_rad` or `…q1_deg` and so on, as many columns as its longest row
/// has; lists that no row has become none.
pub(crate) struct Spread<'t> {
    schema: &'t ColumnSchema,
    array: &'t ArrayRef,
    columns: usize,
}

impl<'t> Spread<'t> {
    pub(crate) fn all(table: &'t Table) -> Vec<Self> {
        let arrays = table.schema().columns.iter().zip(table.batch().columns());
        let spread =
            arrays.map(|(schema, array)| Self { schema, array, columns: count(schema, array) });
        spread.filter(|spread| spread.columns > 0).collect()
    }

    pub(crate) fn name(&self) -> &str {
        &self.schema.name
    }

    /// The prefix before the joint's number, for a list of joint angles; otherwise `None`.
    fn angles(&self) -> Option<&str> {
        let is_list = self.schema.kind == ColumnType::ListFloat64;
        is_list.then(|| self.schema.name.strip_suffix(ANGLES))?
    }

    pub(crate) fn names(&self, units: &JointUnits) -> Vec<String> {
        match self.angles() {
            Some(before) => (0..self.columns)
                .map(|joint| format!("{before}q{}_{}", joint + 1, units.suffix(joint)))
                .collect(),
            None => vec![self.schema.name.clone()],
        }
    }

    /// Its values in a row, one for each name.
    pub(crate) fn cells(&self, row: usize, units: &JointUnits) -> Vec<Cell> {
        let mut cells = if self.array.is_null(row) {
            Vec::new()
        } else if self.angles().is_some() {
            let list = self.array.as_list::<i32>().value(row);
            let angles = list.as_primitive::<Float64Type>().values().iter();
            let angles = angles.enumerate();
            angles.map(|(joint, &angle)| Cell::Number(units.shown(joint, angle))).collect()
        } else {
            vec![cell(self.array, self.schema, row)]
        };
        cells.resize(self.columns, Cell::Absent);
        cells
    }
}

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
        longest.max(usize::from(!schema.nullable)).min(1)
    }
}

fn cell(array: &ArrayRef, column: &ColumnSchema, row: usize) -> Cell {
    let real = |array: &ArrayRef, row: usize| array.as_primitive::<Float64Type>().value(row);
    let whole = |array: &ArrayRef, row: usize| array.as_primitive::<Int64Type>().value(row);
    let text =
        |array: &ArrayRef, row: usize| Cell::Text(array.as_string::<i32>().value(row).to_owned());
    let listed = |each: &dyn Fn(&ArrayRef, usize) -> Cell| {
        let list = array.as_list::<i32>().value(row);
        Cell::List((0..list.len()).map(|place| each(&list, place)).collect())
    };
    match (column.kind, column.unit.as_deref()) {
        (ColumnType::Float64, Some("mm")) => Cell::Number(length(real(array, row))),
        (ColumnType::Float64, _) => Cell::Number(real(array, row).to_string()),
        (ColumnType::Int64, _) => Cell::Number(whole(array, row).to_string()),
        (ColumnType::Bool, _) => Cell::Flag(array.as_boolean().value(row)),
        (ColumnType::Timestamp, _) => {
            let micros = array.as_primitive::<TimestampMicrosecondType>().value(row);
            Cell::Text(WallTime::of_us(micros).to_string())
        }
        (ColumnType::String, _) => text(array, row),
        (ColumnType::ListFloat64, _) => {
            listed(&|list, place| Cell::Number(real(list, place).to_string()))
        }
        (ColumnType::ListInt64, _) => {
            listed(&|list, place| Cell::Number(whole(list, place).to_string()))
        }
        (ColumnType::ListString, _) => listed(&text),
    }
}

/// A length to the nanometre, mm.
pub(crate) fn length(mm: f64) -> String {
    format!("{mm:.6}")
}
