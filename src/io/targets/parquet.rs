use std::path::Path;

use arrow_array::Array as _;

use super::angles::is_angle;
use super::{Place, Row, RowProblem, Rows, TargetsError, TargetsErrorKind, names};
use crate::compensation::TargetJoints;
use crate::ingest::AngleUnit;
use crate::input::Bound;
use crate::rows::{Row as _, row};
use crate::table::{self, Table};

row! {
    /// A target as stated in another program's file; missing parts of a position or a quaternion are reported later.
    pub struct TargetRow of "targets" {
        target: String,
        x_mm: Option<f64>,
        y_mm: Option<f64>,
        z_mm: Option<f64>,
        qx: Option<f64>,
        qy: Option<f64>,
        qz: Option<f64>,
        qw: Option<f64>,
        configuration: Option<String>,
        joint_names: Option<Vec<String>>,
        joints_rad: Option<Vec<f64>>,
        tool: Option<String>,
        table_id: Option<String>,
        corrected_by: Option<String>,
    }
}

pub(super) fn rows(path: &Path, bound: Bound) -> Result<Rows, TargetsError> {
    let schema = TargetRow::schema();
    let table = table::read_within(path, schema, bound)?;
    let columns = table::head(path)?.columns;
    names::check(columns.iter().map(String::as_str))
        .map_err(|problem| TargetsErrorKind::Row(problem.into()).at(path))?;
    if let Some(name) = columns.iter().find(|name| is_angle(name)) {
        let problem = format!(
            "{name:?} is one of text; a Parquet file has all of them in the list joints_rad"
        );
        return Err(TargetsErrorKind::Angles(problem).at(path));
    }
    let is_unused = |name: &String| schema.column(name).is_none() && !names::is_mark(name);
    let placed = TargetRow::read(&table).into_iter().enumerate();
    let placed = placed.map(|(number, row)| {
        let place = Place::Row(number);
        let found = row_of(row, lacks_an_angle(&table, number));
        Ok((place, found.map_err(|problem| problem.at(path, place))?))
    });
    let placed = placed.collect::<Result<_, TargetsError>>()?;
    Ok(Rows {
        placed,
        unused: columns.into_iter().filter(is_unused).collect(),
        units: AngleUnit::Rad.into(),
    })
}

fn row_of(row: TargetRow, lacks_an_angle: bool) -> Result<Row, RowProblem> {
    let joints = row.joints_rad.map(|angles| {
        let names = row.joint_names.unwrap_or_default();
        if lacks_an_angle {
            return Err(RowProblem::PartOfJoints { missing: "an angle of joints_rad".to_owned() });
        }
        if !names.is_empty() && names.len() != angles.len() {
            return Err(RowProblem::JointNames { names: names.len(), angles: angles.len() });
        }
        Ok(TargetJoints { names, angles, slides: None })
    });
    Ok(Row {
        target: row.target,
        position: [row.x_mm, row.y_mm, row.z_mm],
        joints: joints.transpose()?,
        quaternion: [row.qx, row.qy, row.qz, row.qw],
        configuration: row.configuration,
        tool: row.tool,
        table_id: row.table_id.or(row.corrected_by),
    })
}

/// Our own lists have every value; other programs' may lack some.
fn lacks_an_angle(table: &Table, row: usize) -> bool {
    let lists = table.list("joints_rad");
    lists.is_valid(row) && lists.value(row).null_count() > 0
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::iter;
    use std::sync::Arc;

    use arrow_array::{ArrayRef, Float64Array, RecordBatch, StringArray};
    use parquet::arrow::ArrowWriter;

    use super::*;

    #[test]
    fn columns_that_are_not_read_are_refused_or_named() {
        let folder = tempfile::tempdir().unwrap();
        let read = |column: &str| {
            let path = folder.path().join(format!("{column}.parquet"));
            let target: ArrayRef = Arc::new(StringArray::from(vec!["A"]));
            let number: ArrayRef = Arc::new(Float64Array::from(vec![1.0]));
            let numbers = ["x_mm", "y_mm", "z_mm", column].map(|own| (own, number.clone()));
            let columns = iter::once(("target", target)).chain(numbers);
            let batch = RecordBatch::try_from_iter(columns).unwrap();
            let file = File::create(&path).unwrap();
            let mut writer = ArrowWriter::try_new(file, batch.schema(), None).unwrap();
            writer.write(&batch).unwrap();
            writer.close().unwrap();
            rows(&path, Bound::TARGETS).map(|own| own.unused).map_err(|error| error.to_string())
        };
        assert_eq!(read("note"), Ok(vec!["note".to_owned()]));
        for (column, says) in [("q1_deg", "the list joints_rad"), ("frame", "is not read here")] {
            let told = read(column).unwrap_err();
            assert!(told.contains(says), "{told}");
        }
    }
}
