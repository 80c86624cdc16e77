use std::path::Path;

use arrow_array::Array as _;

use super::{Place, Row, RowProblem, Rows, TargetsError};
use crate::compensation::TargetJoints;
use crate::ingest::AngleUnit;
use crate::input::Bound;
use crate::rows::{Row as _, row};
use crate::schema;
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
    let table = table::read_within(path, schema::find("targets")?, bound)?;
    let placed = TargetRow::read(&table).into_iter().enumerate();
    let placed = placed.map(|(number, row)| {
        let place = Place::Row(number);
        let found = row_of(row, lacks_an_angle(&table, number));
        Ok((place, found.map_err(|problem| problem.at(path, place))?))
    });
    let placed = placed.collect::<Result<_, TargetsError>>()?;
    Ok(Rows { placed, unused: Vec::new(), units: AngleUnit::Rad.into() })
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
