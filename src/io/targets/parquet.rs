//! Targets in Parquet: the columns of table `targets`, whoever wrote them.

use std::path::Path;

use arrow::array::{Array as _, StringArray};

use super::{Place, Row, Rows, TargetsError};
use crate::io::schema;
use crate::io::table::{self, Table};

/// Reads the rows.
pub(super) fn rows(path: &Path) -> Result<Rows, TargetsError> {
    let table = table::read(path, schema::find("targets")?)?;
    let rows = (0..table.rows()).map(|row| (Place::Row(row), row_of(&table, row)));
    let given = |column: &&str| table.list(column).null_count() < table.rows();
    let unused = ["joint_names", "joints_rad"].into_iter().filter(given);
    Ok((rows.collect(), unused.map(str::to_owned).collect()))
}

fn row_of(table: &Table, row: usize) -> Row {
    let number = |column| {
        let numbers = table.f64(column);
        numbers.is_valid(row).then(|| numbers.value(row))
    };
    let text = |column| optional(table.text(column), row);
    Row {
        target: table.text("target").value(row).to_owned(),
        position: ["x_mm", "y_mm", "z_mm"].map(|column| table.f64(column).value(row)),
        quaternion: ["qx", "qy", "qz", "qw"].map(number),
        configuration: text("configuration"),
        tool: text("tool"),
        table_id: text("table_id"),
    }
}

fn optional(texts: &StringArray, row: usize) -> Option<String> {
    texts.is_valid(row).then(|| texts.value(row).to_owned())
}
