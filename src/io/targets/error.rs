//! Errors of a file of targets.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::Place;
use super::krl::KrlProblem;
use super::names::NamesProblem;
use crate::io::schema::SchemaError;
use crate::io::table::FileError;

/// Why a file of targets cannot be read.
#[derive(Debug, Error)]
pub enum TargetsError {
    /// The extension is none of the known forms.
    #[error("{}: files of targets are .csv, .parquet, .json or .dat (KUKA)", .0.display())]
    UnknownForm(PathBuf),
    /// The file has no row.
    #[error("{} holds no target", .0.display())]
    Empty(PathBuf),
    /// A form that lacks what a session is judged by.
    #[error("{}: a session is judged by corrected targets as .csv, .parquet or .json; for a data list give the file of corrections next to it", .0.display())]
    NotDriving(PathBuf),
    /// The corrections are by a table that corrects nothing.
    #[error("{}: its targets are corrected by {found:?}; those of `posegrid compensate` are by \"compensation\" or \"calibrations\"", path.display())]
    NotOfATable {
        /// Path of the file.
        path: PathBuf,
        /// Name of the table in it.
        found: String,
    },
    /// A number that is not finite.
    #[error("{}, row {row}, target {target:?}: a length or a covariance is no finite number; take the file as `posegrid compensate` wrote it", path.display())]
    NotANumber {
        /// Path of the file.
        path: PathBuf,
        /// The row, from 0.
        row: usize,
        /// Name of the target.
        target: String,
    },
    /// The corrections are by more than one table.
    #[error("{}: its targets are corrected by several tables; keep those of each table in a file of their own", .0.display())]
    SeveralTables(PathBuf),
    /// Not a CSV file, or one that cannot be read.
    #[error("cannot read {} as CSV: {source}", path.display())]
    Csv {
        /// Path of the file.
        path: PathBuf,
        /// The reader's error.
        source: csv::Error,
    },
    /// Not a JSON text, or one of another structure.
    #[error("cannot read {} as JSON: {source}", path.display())]
    Json {
        /// Path of the file.
        path: PathBuf,
        /// The reader's error.
        source: serde_json::Error,
    },
    /// A file that cannot be read, is none, or is too large.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// Not a Parquet file of targets.
    #[error(transparent)]
    Parquet(#[from] FileError),
    /// A schema of the program is missing.
    #[error(transparent)]
    Schema(#[from] SchemaError),
    /// A column that every target needs is missing.
    #[error(
        "{}: missing columns {}; its first line names {found:?}, separated by commas: see `posegrid schema targets`",
        path.display(),
        missing.join(", ")
    )]
    MissingColumns {
        /// Path of the file.
        path: PathBuf,
        /// Names of the missing columns.
        missing: Vec<String>,
        /// Names in the first line.
        found: Vec<String>,
    },
    /// Columns of joint angles that do not belong together.
    #[error("{}: columns of joint angles: {problem}; see `posegrid compensate --help`", path.display())]
    Angles {
        /// Path of the file.
        path: PathBuf,
        /// The fault in them.
        problem: String,
    },
    /// Names of columns that are ambiguous.
    #[error("{}: {problem}", path.display())]
    Names {
        /// Path of the file.
        path: PathBuf,
        /// The fault in them.
        problem: NamesProblem,
    },
    /// The file as a whole is wrong.
    #[error("{}: {problem}", path.display())]
    Whole {
        /// Path of the file.
        path: PathBuf,
        /// The fault in it.
        problem: RowProblem,
    },
    /// A row with a wrong value.
    #[error("{}, {place}: {problem}", path.display())]
    Row {
        /// Path of the file.
        path: PathBuf,
        /// Place of the row.
        place: Place,
        /// The fault in it.
        problem: RowProblem,
    },
}

/// The fault in a row of a file of targets.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RowProblem {
    /// A text in the place of a number.
    #[error(
        "column {column:?} holds {text:?}, which is no finite number (decimal point, lengths in mm, no unit written)"
    )]
    NoNumber {
        /// Name of the column.
        column: String,
        /// The text in it.
        text: String,
    },
    /// A value of another type.
    #[error("key {key:?} holds {found} where {wanted} is needed")]
    WrongType {
        /// Name of the key.
        key: String,
        /// The type that is needed.
        wanted: &'static str,
        /// The type that was found.
        found: &'static str,
    },
    /// Names of keys that are ambiguous.
    #[error(transparent)]
    Names(#[from] NamesProblem),
    /// Joint angles that do not belong together.
    #[error("{0}; see `posegrid compensate --help`")]
    Angles(String),
    /// A fault in a line of a data list.
    #[error(transparent)]
    Krl(KrlProblem),
    /// A required value is missing.
    #[error("column {column:?} is empty, and every target has a value there")]
    NoValue {
        /// Name of the column.
        column: &'static str,
    },
    /// Two targets have one name.
    #[error("target {target:?} is in {first} already; names are unique within a file")]
    SameName {
        /// Place of the first one.
        first: Place,
        /// Name of both.
        target: String,
    },
    /// Only some of a position's three numbers are given.
    #[error(
        "a position is three numbers, x_mm y_mm z_mm, and some of them are missing; give all or none"
    )]
    PartOfPosition,
    /// Only some of a target's joint angles are given.
    #[error("{missing} is empty, and a target has all of its joint angles or none")]
    PartOfJoints {
        /// The first column without an angle.
        missing: String,
    },
    /// Neither a position nor joint angles.
    #[error(
        "target {target:?} has neither a position nor joint angles; give x_mm y_mm z_mm, q1_rad …, or both"
    )]
    NoPlace {
        /// Name of the target.
        target: String,
    },
    /// The number of joint names differs from that of the angles.
    #[error("joint_names has {names} names for {angles} joint angles; give one for each, or none")]
    JointNames {
        /// Number of names.
        names: usize,
        /// Number of angles.
        angles: usize,
    },
    /// Only some of a quaternion's four numbers are given.
    #[error(
        "an orientation is four numbers, qx qy qz qw, and some of them are missing; give all or none"
    )]
    PartOfQuaternion,
    /// A quaternion that is not of unit norm.
    #[error("qx qy qz qw have norm {norm}, a rotation has norm 1")]
    NotUnit {
        /// Norm of the quaternion.
        norm: f64,
    },
    /// The file holds commands, not targets.
    #[error(
        "corrected already, as its key {key:?} states ({value}); correct the targets themselves, a second correction would move \
         the tool by the error once more"
    )]
    Marked {
        /// Name of the key.
        key: String,
        /// Value of the key.
        value: String,
    },
    /// The target is a command already.
    #[error(
        "target {target:?} is corrected already, with table {table_id:?}; correct the targets themselves, a second \
         correction would move the tool by the error once more"
    )]
    Corrected {
        /// Name of the target.
        target: String,
        /// The table that it was corrected with.
        table_id: String,
    },
}

impl RowProblem {
    /// The error for this fault in a row of a file.
    pub(super) fn at(self, path: &Path, place: Place) -> TargetsError {
        TargetsError::Row {
            path: path.to_owned(),
            place,
            problem: self,
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Row(row) => write!(f, "row {row}"),
        }
    }
}
