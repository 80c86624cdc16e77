//! Errors of a file of targets.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::Place;
use super::krl::KrlProblem;
use super::names::NamesProblem;
use crate::schema::SchemaError;
use crate::table::FileError;

/// The reason why a file of targets cannot be read.
#[derive(Debug, Error)]
pub enum TargetsError {
    /// What is wrong with the file.
    #[error("{}", kind.message(path))]
    File { path: PathBuf, kind: TargetsErrorKind },
    /// Not a Parquet file of targets.
    #[error(transparent)]
    Parquet(#[from] FileError),
    /// A schema of the program is missing.
    #[error(transparent)]
    Schema(#[from] SchemaError),
}

/// The fault in a file of targets.
#[derive(Debug)]
pub enum TargetsErrorKind {
    /// The extension is none of the known forms.
    UnknownForm,
    /// The file has no row.
    Empty,
    /// A form that lacks what a session is judged by.
    NotDriving,
    /// The corrections are by a table that corrects nothing: the table's name in the file.
    NotOfATable(String),
    /// A number that is not finite.
    NotANumber {
        /// The row, from 0.
        row: usize,
        /// Name of the target.
        target: String,
    },
    /// The corrections are by more than one table.
    SeveralTables,
    /// Not a CSV file, or one that cannot be read: the reader's error.
    Csv(csv::Error),
    /// Not a JSON text, or one of another structure: the reader's error.
    Json(serde_json::Error),
    /// A file that cannot be read, is none, or is too large.
    Read(io::Error),
    /// A column that every target needs is missing.
    MissingColumns {
        /// Names of the missing columns.
        missing: Vec<String>,
        /// The column names in the file's first line.
        found: Vec<String>,
    },
    /// Columns of joint angles that do not belong together: what is wrong with them.
    Angles(String),
    /// Names of columns that are ambiguous.
    Names(NamesProblem),
    /// The file as a whole is wrong.
    Whole(RowProblem),
    /// A row with a wrong value.
    Row(Place, RowProblem),
}

impl TargetsErrorKind {
    /// This problem of the file at `path`.
    pub(super) fn at(self, path: &Path) -> TargetsError {
        TargetsError::File { path: path.to_owned(), kind: self }
    }

    /// The message for a person, with the file's path.
    fn message(&self, path: &Path) -> String {
        let path = path.display();
        match self {
            Self::UnknownForm => {
                format!("{path}: files of targets are .csv, .parquet, .json or .dat (KUKA)")
            }
            Self::Empty => format!("{path} holds no target"),
            Self::NotDriving => format!(
                "{path}: a session is judged by corrected targets as .csv, .parquet or .json; of a data list that is the file \
                 of corrections beside it"
            ),
            Self::NotOfATable(found) => format!(
                "{path}: its targets are corrected by {found:?}; those of `posegrid compensate` are by \"compensation\" or \
                 \"calibrations\""
            ),
            Self::NotANumber { row, target } => format!(
                "{path}, row {row}, target {target:?}: a length or a covariance is no finite number; take the file as \
                 `posegrid compensate` wrote it"
            ),
            Self::SeveralTables => format!(
                "{path}: its targets are corrected by several tables; keep those of each table in a file of their own"
            ),
            Self::Csv(source) => format!("cannot read {path} as CSV: {source}"),
            Self::Json(source) => format!("cannot read {path} as JSON: {source}"),
            Self::Read(source) => format!("cannot read {path}: {source}"),
            Self::MissingColumns { missing, found } => format!(
                "{path}: missing columns {}; its first line names {found:?}, separated by commas: see `posegrid schema targets`",
                missing.join(", ")
            ),
            Self::Angles(problem) => format!(
                "{path}: columns of joint angles: {problem}; see `posegrid compensate --help`"
            ),
            Self::Names(problem) => format!("{path}: {problem}"),
            Self::Whole(problem) => format!("{path}: {problem}"),
            Self::Row(place, problem) => format!("{path}, {place}: {problem}"),
        }
    }
}

/// The fault in a row of a file of targets.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RowProblem {
    /// A text in the place of a number.
    #[error(
        "column {column:?} holds {text:?}, which is no finite number (decimal point, lengths in mm, no unit written)"
    )]
    NoNumber { column: String, text: String },
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
    NoValue { column: &'static str },
    /// Two targets have one name.
    #[error("target {target:?} is in {first} already; names are unique within a file")]
    SameName {
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
        TargetsErrorKind::Row(place, self).at(path)
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
