//! What can be wrong with a file of targets.

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
    /// None of the forms there are.
    #[error("{}: files of targets are .csv, .parquet, .json or .dat (KUKA)", .0.display())]
    UnknownForm(PathBuf),
    /// No row.
    #[error("{} holds no target", .0.display())]
    Empty(PathBuf),
    /// A form that does not hold what a session is judged by.
    #[error("{}: a session is judged by corrected targets as .csv, .parquet or .json; of a data list that is the file of corrections beside it", .0.display())]
    NotDriving(PathBuf),
    /// Corrections of a table that corrects nothing.
    #[error("{}: its targets are corrected by {found:?}; those of `posegrid compensate` are by \"compensation\" or \"calibrations\"", path.display())]
    NotOfATable {
        /// The file.
        path: PathBuf,
        /// What it names.
        found: String,
    },
    /// A number that is none.
    #[error("{}, row {row}, target {target:?}: a length or a covariance is no finite number; take the file as `posegrid compensate` wrote it", path.display())]
    NotANumber {
        /// The file.
        path: PathBuf,
        /// The row, from 0.
        row: usize,
        /// Its target.
        target: String,
    },
    /// Corrections of more than one table.
    #[error("{}: its targets are corrected by several tables; keep those of each table in a file of their own", .0.display())]
    SeveralTables(PathBuf),
    /// Not a CSV file, or one that cannot be read.
    #[error("cannot read {} as CSV: {source}", path.display())]
    Csv {
        /// The file.
        path: PathBuf,
        /// What the reader says.
        source: csv::Error,
    },
    /// Not a JSON text, or one of another shape.
    #[error("cannot read {} as JSON: {source}", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// What the reader says.
        source: serde_json::Error,
    },
    /// A file that cannot be read, is none, or is too large.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Not a Parquet file of targets.
    #[error(transparent)]
    Parquet(#[from] FileError),
    /// The program does not know its own table.
    #[error(transparent)]
    Schema(#[from] SchemaError),
    /// Columns that every target needs.
    #[error(
        "{}: missing columns {}; its first line names {found:?}, separated by commas: see `posegrid schema targets`",
        path.display(),
        missing.join(", ")
    )]
    MissingColumns {
        /// The file.
        path: PathBuf,
        /// The columns.
        missing: Vec<String>,
        /// What the first line names.
        found: Vec<String>,
    },
    /// Columns of joint angles that do not belong together.
    #[error("{}: columns of joint angles: {problem}; see `posegrid compensate --help`", path.display())]
    Angles {
        /// The file.
        path: PathBuf,
        /// What is wrong with them.
        problem: String,
    },
    /// Columns whose names do not say which is which.
    #[error("{}: {problem}", path.display())]
    Names {
        /// The file.
        path: PathBuf,
        /// What is wrong with them.
        problem: NamesProblem,
    },
    /// A file that holds no targets as a whole.
    #[error("{}: {problem}", path.display())]
    Whole {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: RowProblem,
    },
    /// A row with a wrong value.
    #[error("{}, {place}: {problem}", path.display())]
    Row {
        /// The file.
        path: PathBuf,
        /// The row.
        place: Place,
        /// What is wrong with it.
        problem: RowProblem,
    },
}

/// What is wrong with a row of a file of targets.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RowProblem {
    /// Text where a number stands.
    #[error(
        "column {column:?} holds {text:?}, which is no finite number (decimal point, lengths in mm, no unit written)"
    )]
    NoNumber {
        /// The column.
        column: String,
        /// What stands there.
        text: String,
    },
    /// A value of another type.
    #[error("key {key:?} holds {found} where {wanted} is needed")]
    WrongType {
        /// The key.
        key: String,
        /// What is needed.
        wanted: &'static str,
        /// What stands there.
        found: &'static str,
    },
    /// Keys whose names do not say which is which.
    #[error(transparent)]
    Names(#[from] NamesProblem),
    /// Joint angles that do not belong together.
    #[error("{0}; see `posegrid compensate --help`")]
    Angles(String),
    /// A line of a data list.
    #[error(transparent)]
    Krl(KrlProblem),
    /// Nothing where something has to be.
    #[error("column {column:?} is empty, and every target has a value there")]
    NoValue {
        /// The column.
        column: &'static str,
    },
    /// Two targets of one name.
    #[error("target {target:?} stands in {first} already; names are unique within a file")]
    SameName {
        /// Where it stands first.
        first: Place,
        /// Its name.
        target: String,
    },
    /// Some of a position's three numbers.
    #[error(
        "a position is three numbers, x_mm y_mm z_mm, and some of them are missing; give all or none"
    )]
    PartOfPosition,
    /// Some of a target's joint angles.
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
        /// The target.
        target: String,
    },
    /// Joint names for another number of angles.
    #[error("joint_names has {names} names for {angles} joint angles; give one for each, or none")]
    JointNames {
        /// Names.
        names: usize,
        /// Angles.
        angles: usize,
    },
    /// Some of a quaternion's four numbers.
    #[error(
        "an orientation is four numbers, qx qy qz qw, and some of them are missing; give all or none"
    )]
    PartOfQuaternion,
    /// A quaternion that is no rotation.
    #[error("qx qy qz qw have norm {norm}, a rotation has norm 1")]
    NotUnit {
        /// The norm.
        norm: f64,
    },
    /// A file of commands.
    #[error(
        "corrected already, as its key {key:?} says ({value}); correct the targets themselves, a second correction would move \
         the tool by the error once more"
    )]
    Marked {
        /// The key.
        key: String,
        /// What stands there.
        value: String,
    },
    /// A target that is a command already.
    #[error(
        "target {target:?} is corrected already, with table {table_id:?}; correct the targets themselves, a second \
         correction would move the tool by the error once more"
    )]
    Corrected {
        /// The target.
        target: String,
        /// The table that it was corrected with.
        table_id: String,
    },
}

impl RowProblem {
    /// This problem of a row of a file.
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
