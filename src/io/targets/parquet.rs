//! Targets in Parquet: the columns of table `targets`, written by any program.

use std::path::Path;

use arrow::array::{Array as _, AsArray as _, StringArray};
use arrow::datatypes::Float64Type;

use super::{Place, Row, RowProblem, Rows, TargetsError, names};
use crate::compensation::TargetJoints;
use crate::ingest::AngleUnit;
use crate::io::input::Bound;
use crate::io::schema;
use crate::io::table::{self, Table};

/// Reads the rows.
pub(super) fn rows(path: &Path, bound: Bound) -> Result<Rows, TargetsError> {
    let table = table::read_within(path, schema::find("targets")?, bound)?;
    let row = |row| {
        let place = Place::Row(row);
        let found = row_of(&table, row).map_err(|problem| problem.at(path, place))?;
        Ok((place, found))
    };
    Ok(Rows {
        placed: (0..table.rows())
            .map(row)
            .collect::<Result<_, TargetsError>>()?,
        unused: Vec::new(),
        angle_unit: AngleUnit::Rad,
        list: None,
    })
}

fn row_of(table: &Table, row: usize) -> Result<Row, RowProblem> {
    let number = |column| {
        let numbers = table.f64(column);
        numbers.is_valid(row).then(|| numbers.value(row))
    };
    let text = |column| optional(table.text(column), row);
    Ok(Row {
        target: table.text("target").value(row).to_owned(),
        position: ["x_mm", "y_mm", "z_mm"].map(number),
        joints: joints(table, row)?,
        quaternion: ["qx", "qy", "qz", "qw"].map(number),
        configuration: text("configuration"),
        tool: text("tool"),
        table_id: names::MARKS.into_iter().find_map(text),
    })
}

fn joints(table: &Table, row: usize) -> Result<Option<TargetJoints>, RowProblem> {
    let list = |column| {
        let lists = table.list(column);
        lists.is_valid(row).then(|| lists.value(row))
    };
    let Some(angles) = list("joints_rad") else {
        return Ok(None);
    };
    // The check of the table has refused numbers that are not finite; nulls inside a list are found here.
    let angles: Option<Vec<f64>> = angles.as_primitive::<Float64Type>().iter().collect();
    let angles = angles.ok_or_else(|| RowProblem::PartOfJoints {
        missing: "an angle of joints_rad".to_owned(),
    })?;
    let names = list("joint_names").map_or_else(Vec::new, |names| {
        let texts = names.as_string::<i32>().iter();
        texts
            .map(|name| name.unwrap_or_default().to_owned())
            .collect()
    });
    if !names.is_empty() && names.len() != angles.len() {
        return Err(RowProblem::JointNames {
            names: names.len(),
            angles: angles.len(),
        });
    }
    Ok(Some(TargetJoints { names, angles }))
}

fn optional(texts: &StringArray, row: usize) -> Option<String> {
    texts.is_valid(row).then(|| texts.value(row).to_owned())
}
