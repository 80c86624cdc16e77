//! Tables of a run → files for controllers and off-line programming. Names come from logs and pipeline files: each is
//! written so that it can only be read as a name.

pub mod acceptance;
pub mod controller_base;
pub mod corrected_urdf;
mod limits;
pub mod nodes_csv;
pub mod origins;
pub mod parameters_csv;
pub mod ur_calibration;
pub mod urdf;
pub mod urdf_chain;

use std::io;
use std::path::Path;

use thiserror::Error;

use super::calibrations_table::CalibrationsTableError;
use super::common::CommonError;
use super::compensation_table::CompensationTableError;
use super::lake::LakeError;
use crate::at::At;
use crate::kinematics::RestateError;
use crate::schema::SchemaError;
use crate::table::FileError;
use crate::whole_file::told;
use origins::OriginsError;
use urdf_chain::UrdfChainError;

#[derive(Debug, Error)]
pub enum ExportError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Schema(#[from] SchemaError),
    #[error(transparent)]
    At(#[from] At<ExportErrorKind>),
    #[error(transparent)]
    Nodes(#[from] CompensationTableError),
    #[error(transparent)]
    Arm(#[from] CalibrationsTableError),
    #[error(transparent)]
    Common(#[from] CommonError),
    #[error("--convention is for --format parameters; {0} has none: leave it out")]
    NoUseForConvention(&'static str),
    #[error(
        "--urdf, --base and --tip are for --format urdf; {0} has no use for them: leave them out"
    )]
    NoUseForUrdf(&'static str),
    #[error(transparent)]
    Lake(#[from] LakeError),
    #[error("the PDF cannot be made: {0}; this is a defect of posegrid, please report it")]
    Pdf(String),
    #[error("standard output: {0}")]
    Write(#[from] io::Error),
    #[error(transparent)]
    Csv(#[from] csv::Error),
    #[error(transparent)]
    Json(#[from] serde_json::Error),
}

#[derive(Debug, Error)]
pub enum ExportErrorKind {
    #[error("it holds {found}; {format} is made of table {needs} of a run")]
    OtherTable { found: String, format: &'static str, needs: &'static str },
    #[error("it holds no row; take the file of a run that has one")]
    Empty,
    #[error(
        "column {column:?}: row 0 and row {row} differ, and every row has the same there: take the file of a single run"
    )]
    NotOne { column: String, row: usize },
    #[error(
        "the arm {0}, which is not written anew; give its own URDF with --urdf, --base and --tip"
    )]
    NoUrdf(&'static str),
    #[error(transparent)]
    Convention(RestateError),
    /// An arm that is not one of Universal Robots: why, or `None` for one without six axes.
    #[error("{}", ur_calibration::no_ur(.0.as_ref()))]
    NoUr(Option<OriginsError>),
    #[error(transparent)]
    NoChain(UrdfChainError),
    #[error(transparent)]
    OtherChain(OriginsError),
    #[error(transparent)]
    NotRead(io::Error),
    #[error(
        "it is not TABLE/ROBOT/SESSION/RUN.parquet of a lake, whose other tables the report needs: name the file in its lake"
    )]
    NotInLake,
    #[error("it exists already; choose another --out, or remove it first")]
    Exists,
    #[error("{}", told(.0))]
    NotWritten(io::Error),
}

impl ExportErrorKind {
    pub fn at(self, path: &Path) -> ExportError {
        At::<Self>::new(path.display(), self).into()
    }
}
