//! A table → CSV: one line per row, and each joint angle in a column of its own.

use std::io::Write;

use super::angles::JointUnits;
use super::formula;
use super::spread::{Cell, Spread};
use crate::table::Table;

/// Lengths to the nanometre, joint angles in `units` in a column each (`…q1_deg`), other numbers exactly, an empty cell
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
