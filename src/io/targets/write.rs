//! A table → CSV or JSON: a line per row, and each joint angle in a column, or under a key, of its own.

use std::io::{self, Write};

use super::angles::JointUnits;
use super::formula;
use super::spread::{Cell, Spread};
use crate::table::Table;

/// CSV: lengths to the nanometre, joint angles in `units` in a column each (`…q1_deg`), other numbers exactly, an empty cell
/// where a value is absent; other lists are one column. A text that a spreadsheet would run has a `'` before it
/// (`formula`).
pub fn write_csv(
    table: &Table,
    units: impl Into<JointUnits>,
    sink: impl Write,
) -> Result<(), csv::Error> {
    write_columns(table, &Spread::all(table), &units.into(), sink)
}

pub(crate) fn write_columns(
    table: &Table,
    columns: &[Spread<'_>],
    units: &JointUnits,
    sink: impl Write,
) -> Result<(), csv::Error> {
    let mut writer = csv::Writer::from_writer(sink);
    writer.write_record(columns.iter().flat_map(|column| column.names(units)))?;
    for row in 0..table.rows() {
        let cells = columns.iter().flat_map(|column| column.cells(row, units));
        writer.write_record(cells.map(field))?;
    }
    Ok(writer.flush()?)
}

fn field(cell: Cell) -> String {
    let is_text = match &cell {
        Cell::Text(_) => true,
        Cell::List(cells) => matches!(cells.first(), Some(Cell::Text(_))),
        _ => false,
    };
    let text = plain(cell);
    if is_text { formula::marked(text) } else { text }
}

fn plain(cell: Cell) -> String {
    match cell {
        Cell::Absent => String::new(),
        Cell::Number(text) | Cell::Text(text) => text,
        Cell::Flag(flag) => flag.to_string(),
        Cell::List(cells) => cells.into_iter().map(plain).collect::<Vec<_>>().join(" "),
    }
}

/// JSON, an array of objects with the names of the columns as keys: lengths to the nanometre, joint angles in `units`, other numbers
/// exactly, null where a value is absent; other lists are arrays.
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
