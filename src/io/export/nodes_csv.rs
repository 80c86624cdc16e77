//! A compensation table as CSV, one row per node, after lines `# name: value` in JSON with the values of the whole
//! table. pandas, polars and `DuckDB` skip these with `comment="#"`, `comment_prefix="#"` and `comment='#'`.

use std::io::Write;
use std::path::Path;

use super::{ExportError, ExportErrorKind};
use crate::compensation_table;
use crate::ingest::AngleUnit;
use crate::rows::{Field as _, Row as _};
use crate::schema::KEY_COLUMNS;
use crate::table::{self, Table};
use crate::tables::compensation::{NodeRow, TableColumns};
use crate::targets::spread::Spread;
use crate::targets::write::{value, write_columns};

/// Writes the nodes of the table in a file, lengths to the nanometre, joint angles in degrees.
pub fn write(path: &Path, mut sink: impl Write) -> Result<(), ExportError> {
    // What is exported is a table that `compensate` would read too.
    let published = compensation_table::read(path)?;
    let table = table::read(path, NodeRow::schema())?;
    // All columns but these differ from node to node; the orientation's number is a part of a node's name.
    let common_columns = TableColumns::columns(&[]).into_iter().map(|column| column.name);
    let common_columns = common_columns.filter(|name| *name != "orientation").chain(KEY_COLUMNS);
    let common_columns: Vec<&str> = common_columns.collect();
    let (of_all, of_nodes): (Vec<_>, Vec<_>) =
        Spread::all(&table).into_iter().partition(|column| common_columns.contains(&column.name()));
    writeln!(
        sink,
        "# posegrid compensation table: error to subtract, attained minus commanded position, in the frame of commands"
    )?;
    let frame = published.error_frame.lines();
    frame.iter().try_for_each(|line| writeln!(sink, "# {}", line.trim()))?;
    for column in &of_all {
        writeln!(sink, "# {}: {}", column.name(), common(path, &table, column)?)?;
    }
    Ok(write_columns(&table, &of_nodes, &published.units, sink)?)
}

/// The value that a column has in every row, as JSON.
fn common(path: &Path, table: &Table, column: &Spread<'_>) -> Result<String, ExportError> {
    let cells = |row| column.cells(row, &AngleUnit::Deg.into());
    let first = cells(0);
    if let Some(row) = (1..table.rows()).find(|&row| cells(row) != first) {
        let column = column.name().to_owned();
        return Err(ExportErrorKind::NotOne { column, row }.at(path));
    }
    let values: Vec<String> = first.iter().map(value).collect();
    Ok(no_formula(values.join(", ")))
}

/// JSON that no spreadsheet takes for a formula where it splits a line at commas: a formula's first character after a
/// comma is written by its number.
fn no_formula(json: String) -> String {
    ["=", "+", "-", "@"].iter().fold(json, |json, sign| {
        let letter = sign.as_bytes()[0];
        json.replace(&format!(",{sign}"), &format!(",\\u{letter:04x}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_in_a_comment_begins_no_cell_with_a_formula() {
        let name = "a,=cmd,+1,-1,@x";
        let written = no_formula(serde_json::Value::from(name).to_string());
        assert_eq!(written, r#""a,\u003dcmd,\u002b1,\u002d1,\u0040x""#);
        let read: String = serde_json::from_str(&written).unwrap();
        assert_eq!(read, name);
        assert_eq!(no_formula("[1, -2.5]".to_owned()), "[1, -2.5]");
    }
}
