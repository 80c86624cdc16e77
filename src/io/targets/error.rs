use std::fmt;
use std::io;
use std::path::Path;

use thiserror::Error;

use super::Place;
use super::names::NamesProblem;
use crate::at::At;
use crate::table::FileError;

#[derive(Debug, Error)]
pub enum TargetsError {
    #[error(transparent)]
    File(#[from] At<TargetsErrorKind>),
    #[error(transparent)]
    Parquet(#[from] FileError),
}

#[derive(Debug, Error)]
pub enum TargetsErrorKind {
    #[error("files of targets are .csv, .parquet or .json")]
    UnknownForm,
    #[error("it holds no target")]
    Empty,
    #[error(
        "its targets are corrected by {0:?}; those of `posegrid compensate` are by \"compensation\" or \"calibrations\""
    )]
    NotOfATable(String),
    #[error(
        "row {row}, target {target:?}: a length or a covariance is no finite number; take the file as `posegrid compensate` \
         wrote it"
    )]
    NotANumber { row: usize, target: String },
    #[error(
        "its targets are corrected by several tables; keep those of each table in a file of their own"
    )]
    SeveralTables,
    #[error("it cannot be read as CSV: {0}")]
    Csv(csv::Error),
    #[error("it cannot be read as JSON: {0}")]
    Json(serde_json::Error),
    #[error("it cannot be read: {0}")]
    Read(io::Error),
    #[error(
        "missing columns {}; its first line names {found:?}, separated by commas: see `posegrid schema targets`",
        missing.join(", ")
    )]
    MissingColumns { missing: Vec<String>, found: Vec<String> },
    #[error("columns of joint angles: {0}; see `posegrid compensate --help`")]
    Angles(String),
    #[error(transparent)]
    Row(#[from] RowProblem),
}

impl TargetsErrorKind {
    pub(super) fn at(self, path: &Path) -> TargetsError {
        At::<Self>::new(path.display(), self).into()
    }
}

#[derive(Debug, Clone, PartialEq, Error)]
pub enum RowProblem {
    #[error(
        "column {column:?} holds {text:?}, which is no finite number (decimal point, lengths in mm, no unit written)"
    )]
    NoNumber { column: String, text: String },
    #[error("key {key:?} holds {found} where {wanted} is needed")]
    WrongType { key: String, wanted: &'static str, found: &'static str },
    #[error(transparent)]
    Names(#[from] NamesProblem),
    #[error("{0}; see `posegrid compensate --help`")]
    Angles(String),
    #[error("column {column:?} is empty, and every target has a value there")]
    NoValue { column: &'static str },
    #[error("target {target:?} is in {first} already; names are unique within a file")]
    SameName { first: Place, target: String },
    #[error(
        "a position is three numbers, x_mm y_mm z_mm, and some of them are missing; give all or none"
    )]
    PartOfPosition,
    #[error("{missing} is empty, and a target has all of its joint angles or none")]
    PartOfJoints { missing: String },
    #[error(
        "target {target:?} has neither a position nor joint angles; give x_mm y_mm z_mm, q1_rad …, or both"
    )]
    NoPlace { target: String },
    #[error("joint_names has {names} names for {angles} joint angles; give one for each, or none")]
    JointNames { names: usize, angles: usize },
    #[error(
        "an orientation is four numbers, qx qy qz qw, and some of them are missing; give all or none"
    )]
    PartOfQuaternion,
    #[error("qx qy qz qw have norm {norm}, a rotation has norm 1")]
    NotUnit { norm: f64 },
    #[error(
        "corrected already, as its key {key:?} states ({value}); correct the targets themselves, a second correction would move \
         the tool by the error once more"
    )]
    Marked { key: String, value: String },
    #[error(
        "target {target:?} is corrected already, with table {table_id:?}; correct the targets themselves, a second \
         correction would move the tool by the error once more"
    )]
    Corrected { target: String, table_id: String },
}

impl RowProblem {
    pub(super) fn at(self, path: &Path, place: Place) -> TargetsError {
        At::<TargetsErrorKind>::new(format_args!("{}, {place}", path.display()), self).into()
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
