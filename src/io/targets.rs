//! Files of targets, CSV, Parquet or JSON → [`Target`]s; their commands → files of the same kinds.
//! [`read()`] refuses a file with any wrong value, by its row and column: half a program is worse than none.
//! [`corrected`] makes table `corrected_targets`; [`driving::read()`] reads such a file again, for the session that it
//! drove.

mod angles;
mod corrected;
mod csv;
pub mod driving;
mod error;
pub(crate) mod formula;
mod json;
mod names;
mod parquet;
pub(crate) mod spread;
pub(crate) mod write;

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Point3, Quaternion, UnitQuaternion};

use crate::compensation::{Target, TargetJoints};
use crate::geometry::Position;
use crate::input::{self, Bound};
use crate::tables::words::CorrectedForm;

pub use angles::JointUnits;
pub use corrected::{CorrectedBy, CorrectedRow, RefusedFor, corrected};
pub use error::{RowProblem, TargetsError, TargetsErrorKind};
pub use names::NamesProblem;
#[cfg(test)]
pub(crate) use parquet::TargetRow;
pub use write::{write_csv, write_json};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Comma-separated text, the columns named in its first line.
    Csv,
    Parquet,
    /// An array of objects, their keys as the columns of CSV.
    Json,
}

impl Form {
    pub fn of(path: &Path) -> Result<Self, TargetsError> {
        let extension =
            path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("csv") => Ok(Self::Csv),
            Some("parquet") => Ok(Self::Parquet),
            Some("json") => Ok(Self::Json),
            _ => Err(TargetsErrorKind::UnknownForm.at(path)),
        }
    }
}

impl From<Form> for CorrectedForm {
    fn from(form: Form) -> Self {
        match form {
            Form::Csv => Self::Csv,
            Form::Parquet => Self::Parquet,
            Form::Json => Self::Json,
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct Targets {
    pub targets: Vec<Target>,
    pub unused: Vec<String>,
    pub units: JointUnits,
}

fn rows(path: &Path) -> Result<Rows, TargetsError> {
    let bound = Bound::TARGETS;
    match Form::of(path)? {
        Form::Csv => csv::rows(path, bound),
        Form::Parquet => parquet::rows(path, bound),
        Form::Json => json::rows(path, bound),
    }
}

/// A whole file in memory, up to a bound.
fn bytes(path: &Path, bound: Bound) -> Result<Vec<u8>, TargetsError> {
    input::bytes(path, bound).map_err(|source| TargetsErrorKind::Read(source).at(path))
}

pub fn read(path: &Path) -> Result<Targets, TargetsError> {
    let Rows { placed, unused, units } = rows(path)?;
    if placed.is_empty() {
        return Err(TargetsErrorKind::Empty.at(path));
    }
    let mut places = BTreeMap::new();
    let mut targets = Vec::with_capacity(placed.len());
    for (place, row) in placed {
        if let Some(first) = places.insert(row.target.clone(), place) {
            let problem = RowProblem::SameName { first, target: row.target };
            return Err(problem.at(path, place));
        }
        targets.push(row.target().map_err(|problem| problem.at(path, place))?);
    }
    Ok(Targets { targets, unused, units })
}

/// Each target's name with its joint angles; from a corrected file, the corrected ones without the refused targets.
pub fn commands(path: &Path) -> Result<Vec<(String, Option<TargetJoints>)>, TargetsError> {
    let rows = rows(path)?.placed.into_iter().map(|(_, row)| row);
    let refused = |row: &Row| row.table_id.is_some() && row.joints.is_none();
    let commands: Vec<_> =
        rows.filter(|row| !refused(row)).map(|row| (row.target, row.joints)).collect();
    if commands.is_empty() {
        return Err(TargetsErrorKind::Empty.at(path));
    }
    Ok(commands)
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Line of a text, from 1.
    Line(u64),
    /// Row of a table, from 0.
    Row(usize),
}

struct Rows {
    placed: Vec<(Place, Row)>,
    unused: Vec<String>,
    units: JointUnits,
}

#[derive(Debug, Clone, PartialEq)]
struct Row {
    target: String,
    position: [Option<f64>; 3],
    joints: Option<TargetJoints>,
    quaternion: [Option<f64>; 4],
    configuration: Option<String>,
    tool: Option<String>,
    /// The table that it was corrected with, or another mark of a command; `None` for a target.
    table_id: Option<String>,
}

/// Quaternions written by people have only a few digits; one further from unit norm than this is an error.
const UNIT_NORM: f64 = 1e-3;

impl Row {
    fn target(self) -> Result<Target, RowProblem> {
        if let Some(table_id) = self.table_id {
            return Err(RowProblem::Corrected { target: self.target, table_id });
        }
        let position = match self.position {
            [Some(x), Some(y), Some(z)] => Some(Position::claim(Point3::new(x, y, z))),
            [None, None, None] => None,
            _ => return Err(RowProblem::PartOfPosition),
        };
        if position.is_none() && self.joints.is_none() {
            return Err(RowProblem::NoPlace { target: self.target });
        }
        Ok(Target {
            orientation: orientation(self.quaternion)?,
            name: self.target,
            position,
            joints: self.joints,
            configuration: self.configuration,
            tool: self.tool,
        })
    }
}

fn orientation(parts: [Option<f64>; 4]) -> Result<Option<UnitQuaternion<f64>>, RowProblem> {
    match parts {
        [None, None, None, None] => Ok(None),
        [Some(x), Some(y), Some(z), Some(w)] => {
            let quaternion = Quaternion::new(w, x, y, z);
            let norm = quaternion.norm();
            let is_unit = (norm - 1.0).abs() < UNIT_NORM;
            is_unit
                .then(|| Some(UnitQuaternion::from_quaternion(quaternion)))
                .ok_or(RowProblem::NotUnit { norm })
        }
        _ => Err(RowProblem::PartOfQuaternion),
    }
}
