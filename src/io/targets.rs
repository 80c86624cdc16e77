//! Files of targets, CSV or Parquet → [`Target`]s; their commands → files of the same kinds.
//!
//! 1. [`read()`] takes the columns of `schemas/targets.toml` by name and refuses a file with any wrong value, by its row
//!    and column: half a program is worse than none.
//! 2. [`corrected`] makes table `corrected_targets`: for each target its command, or the reason why there is none.
//! 3. [`write_csv`] writes a table as CSV with a nanometre's digits; Parquet is [`super::table::write()`].

mod corrected;
mod csv;
mod error;
mod parquet;

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Point3, Quaternion, UnitQuaternion};

use crate::compensation::Target;
use crate::geometry::Position;

pub use corrected::{corrected, write_csv};
pub use error::{RowProblem, TargetsError};

/// Forms of a file of targets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Comma-separated text, the columns named in its first line.
    Csv,
    /// Apache Parquet.
    Parquet,
}

impl Form {
    /// The form that a file's name says.
    pub fn of(path: &Path) -> Result<Self, TargetsError> {
        let extension = path
            .extension()
            .map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("csv") => Ok(Self::Csv),
            Some("parquet") => Ok(Self::Parquet),
            _ => Err(TargetsError::UnknownForm(path.to_owned())),
        }
    }
}

/// The targets of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Targets {
    /// The targets in the file's order.
    pub targets: Vec<Target>,
    /// Columns of the file that say something no correction from a table uses.
    pub unused: Vec<String>,
}

/// Reads a file of targets; its extension says which form it has.
pub fn read(path: &Path) -> Result<Targets, TargetsError> {
    let (rows, unused) = match Form::of(path)? {
        Form::Csv => csv::rows(path)?,
        Form::Parquet => parquet::rows(path)?,
    };
    if rows.is_empty() {
        return Err(TargetsError::Empty(path.to_owned()));
    }
    let mut places = BTreeMap::new();
    let mut targets = Vec::with_capacity(rows.len());
    for (place, row) in rows {
        if let Some(first) = places.insert(row.target.clone(), place) {
            let problem = RowProblem::SameName {
                first,
                target: row.target,
            };
            return Err(problem.at(path, place));
        }
        targets.push(row.target().map_err(|problem| problem.at(path, place))?);
    }
    Ok(Targets { targets, unused })
}

/// Where a row stands in its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Line of a text, from 1.
    Line(u64),
    /// Row of a table, from 0.
    Row(usize),
}

/// The rows of a file, each with its place, and the names of columns that no correction uses.
type Rows = (Vec<(Place, Row)>, Vec<String>);

/// A row as it stands in the file.
struct Row {
    target: String,
    position: [f64; 3],
    quaternion: [Option<f64>; 4],
    configuration: Option<String>,
    tool: Option<String>,
    table_id: Option<String>,
}

/// Quaternions as people write them have a few digits only; further from unit norm than this they are something else.
const UNIT_NORM: f64 = 1e-3;

impl Row {
    fn target(self) -> Result<Target, RowProblem> {
        if let Some(table_id) = self.table_id {
            return Err(RowProblem::Corrected {
                target: self.target,
                table_id,
            });
        }
        Ok(Target {
            orientation: orientation(self.quaternion)?,
            name: self.target,
            position: Position::claim(Point3::from(self.position)),
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
