//! A table → JSON: an array of objects, one line per row, with the same keys as the columns in CSV.

use std::io::{self, Write};

use super::angles::JointUnits;
use super::spread::{Cell, Spread};
use crate::table::Table;

/// Lengths to the nanometre, joint angles in `units` with a key each (`…q1_deg`), other numbers exactly, null where a
/// value is absent; other lists are arrays.
pub fn write_json(
    table: &Table,
    units: impl Into<JointUnits>,
    mut sink: impl Write,
) -> io::Result<()> {
    let units = units.into();
    let columns = Spread::all(table);
    let names: Vec<String> = columns.iter().flat_map(|c| c.names(&units)).collect();
    sink.write_all(b"[")?;
    for row in 0..table.rows() {
        sink.write_all(if row == 0 { b"\n{" } else { b",\n{" })?;
        let cells = columns.iter().flat_map(|column| column.cells(row, &units));
        for (place, (name, cell)) in names.iter().zip(cells).enumerate() {
            let comma = if place == 0 { "" } else { ", " };
            write!(sink, "{comma}{}: {}", text(name), value(&cell))?;
        }
        sink.write_all(b"}")?;
    }
    sink.write_all(b"\n]\n")
}

pub(crate) fn value(cell: &Cell) -> String {
    match cell {
        Cell::Absent => "null".to_owned(),
        Cell::Number(number) => number.clone(),
        Cell::Flag(flag) => flag.to_string(),
        Cell::Text(own) => text(own),
        Cell::List(cells) => {
            let values: Vec<String> = cells.iter().map(value).collect();
            format!("[{}]", values.join(", "))
        }
    }
}

fn text(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}
