//! Commands of targets → table `corrected_targets`, and any table → CSV.

use std::io::Write;

use arrow::array::{Array as _, AsArray as _};
use arrow::datatypes::{Float64Type, Int64Type};
use nalgebra::Vector3;

use crate::compensation::{Corrected, Refused, Target};
use crate::io::schema::{self, ColumnSchema, ColumnType};
use crate::io::table::{Columns, Table, TableError};
use crate::manifest::RunKey;

/// The rows of targets and what became of each, under the run and the identifier of the table that corrected them.
pub fn corrected(
    targets: &[Target],
    outcomes: &[Result<Corrected, Refused>],
    key: &RunKey,
    table_id: &str,
) -> Result<Table, TableError> {
    let schema = schema::find("corrected_targets").expect("it is one of the program's own schemas");
    let done = || outcomes.iter().map(|outcome| outcome.as_ref().ok());
    let refused = || outcomes.iter().map(|outcome| outcome.as_ref().err());
    let vectors = |of: fn(&Corrected) -> Vector3<f64>| {
        done().map(move |done| done.map(|done| of(done).into()))
    };
    let quaternion = |target: &Target| target.orientation.map(|turn| turn.coords.into());
    Columns::new(schema, targets.len())
        .key(key)
        .column("row", 0..targets.len())
        .column("target", targets.iter().map(|target| &target.name))
        .group(
            ["x_mm", "y_mm", "z_mm"],
            vectors(|done| done.command.coords()),
        )
        .group(["qx", "qy", "qz", "qw"], targets.iter().map(quaternion))
        .column(
            "configuration",
            targets.iter().map(|target| target.configuration.as_ref()),
        )
        .column("tool", targets.iter().map(|target| target.tool.as_ref()))
        .same("table_id", table_id)
        .group::<3, [f64; 3]>(
            ["target_x_mm", "target_y_mm", "target_z_mm"],
            targets.iter().map(|target| target.position.coords().into()),
        )
        .group(
            ["correction_x_mm", "correction_y_mm", "correction_z_mm"],
            vectors(|done| done.correction),
        )
        .group(
            [
                "correction_sd_x_mm",
                "correction_sd_y_mm",
                "correction_sd_z_mm",
            ],
            vectors(Corrected::standard_deviation),
        )
        .column(
            "correction_sd_mm",
            done().map(|done| done.map(Corrected::standard_deviation_norm)),
        )
        .column(
            "iterations",
            done().map(|done| done.map(|done| done.iterations)),
        )
        .column(
            "refused",
            refused().map(|refused| refused.map(|refused| refused.reason.name())),
        )
        .column(
            "reason",
            refused().map(|refused| refused.map(Refused::to_string)),
        )
        .finish()
}

/// Writes a table of scalar columns as CSV: lengths to the nanometre, other numbers as exactly as they are, nothing
/// where a value is absent.
pub fn write_csv(table: &Table, sink: impl Write) -> Result<(), csv::Error> {
    let columns = &table.schema().columns;
    let mut writer = csv::Writer::from_writer(sink);
    writer.write_record(columns.iter().map(|column| &column.name))?;
    for row in 0..table.rows() {
        writer.write_record(columns.iter().map(|column| cell(table, column, row)))?;
    }
    Ok(writer.flush()?)
}

fn cell(table: &Table, column: &ColumnSchema, row: usize) -> String {
    let (place, _) = table
        .schema()
        .column(&column.name)
        .expect("a column of this schema");
    let array = table.batch().column(place);
    if array.is_null(row) {
        return String::new();
    }
    match (column.kind, column.unit.as_deref()) {
        (ColumnType::Float64, Some("mm")) => {
            format!("{:.6}", array.as_primitive::<Float64Type>().value(row))
        }
        (ColumnType::Float64, _) => array.as_primitive::<Float64Type>().value(row).to_string(),
        (ColumnType::Int64, _) => array.as_primitive::<Int64Type>().value(row).to_string(),
        (ColumnType::Bool, _) => array.as_boolean().value(row).to_string(),
        (ColumnType::String, _) => array.as_string::<i32>().value(row).to_owned(),
        (ColumnType::ListFloat64 | ColumnType::ListInt64 | ColumnType::ListString, _) => {
            unreachable!(
                "CSV is written for tables of scalar columns, {} has lists",
                table.schema().table
            )
        }
    }
}
