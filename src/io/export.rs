//! Tables of a run → files for controllers and off-line programming. Names come from logs and pipeline files: each is
//! written so that it can only be read as a name.

pub mod controller_base;
pub mod corrected_urdf;
mod held_out;
mod limits;
pub mod nodes_csv;
pub mod origins;
pub mod parameters_csv;
pub mod residuals_mcap;
pub mod ur_calibration;
pub mod urdf;
pub mod urdf_chain;

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::calibrations_table::CalibrationsTableError;
use super::common::CommonError;
use super::compensation_table::CompensationTableError;
use super::lake::LakeError;
use super::schema::SchemaError;
use super::table::FileError;
use super::whole_file::told;
use crate::kinematics::RestateError;
use origins::OriginsError;
use urdf_chain::UrdfChainError;

#[derive(Debug, Error)]
pub enum ExportError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Schema(#[from] SchemaError),
    #[error("{}", kind.message(path))]
    At { path: PathBuf, kind: ExportErrorKind },
    #[error(transparent)]
    Nodes(#[from] CompensationTableError),
    #[error(transparent)]
    Arm(#[from] CalibrationsTableError),
    #[error(transparent)]
    Common(#[from] CommonError),
    #[error(
        "the times of the stations of session {session:?} are in table \"stations\" of the same run, which cannot be read: \
         {source}; give its file by --stations"
    )]
    NoTimes { session: String, source: Box<LakeError> },
    #[error(
        "no table \"stations\" that was read has station {station} of session {session:?}; give the files of all sessions of \
         the run by --stations"
    )]
    NoTime { session: String, station: usize },
    #[error(
        "station {station} of session {session:?} was measured at {ns} ns of the controller's clock, and MCAP times start at 0: \
         the controller's stamps are wrong"
    )]
    EarlyTime { session: String, station: usize, ns: i64 },
    #[error("--stations gives times to --format mcap; {0} has none: leave it out")]
    NoUseForTimes(&'static str),
    #[error("--convention is for --format parameters; {0} has none: leave it out")]
    NoUseForConvention(&'static str),
    #[error(
        "--urdf, --base and --tip are for --format urdf; {0} has no use for them: leave them out"
    )]
    NoUseForUrdf(&'static str),
    #[error("the MCAP file cannot be made: {0}; this is a defect of posegrid, please report it")]
    Mcap(#[from] mcap::McapError),
    #[error("standard output: {0}")]
    Write(#[from] io::Error),
    #[error(transparent)]
    Csv(#[from] csv::Error),
    #[error(transparent)]
    Json(#[from] serde_json::Error),
}

#[derive(Debug)]
pub enum ExportErrorKind {
    OtherTable {
        /// The table in the file, or that there is none.
        found: String,
        format: &'static str,
        needs: &'static str,
    },
    Empty,
    NotOne {
        column: String,
        row: usize,
    },
    NoUrdf(&'static str),
    Convention(RestateError),
    /// An arm that is not one of Universal Robots: why, or `None` for one without six axes.
    NoUr(Option<OriginsError>),
    NoChain(UrdfChainError),
    OtherChain(OriginsError),
    NotRead(io::Error),
    NoLake,
    OtherRun {
        found: String,
        expected: String,
    },
    Exists,
    NotWritten(io::Error),
}

impl ExportErrorKind {
    pub fn at(self, path: &Path) -> ExportError {
        ExportError::At { path: path.to_owned(), kind: self }
    }

    fn message(&self, path: &Path) -> String {
        let path = path.display();
        match self {
            Self::OtherTable { found, format, needs } => {
                format!("{path} holds {found}; {format} is made of table {needs} of a run")
            }
            Self::Empty => format!("{path} holds no row; take the file of a run that has one"),
            Self::NotOne { column, row } => format!(
                "{path}, column {column:?}: row 0 and row {row} differ, and every row has the same there: take the file of a \
                 single run"
            ),
            Self::NoUrdf(problem) => format!(
                "{path}: the arm {problem}, which a URDF cannot say; use tables `calibrations` and `joint_errors`"
            ),
            Self::Convention(source) => format!("{path}: {source}"),
            Self::NoUr(source) => format!("{path}: {}", ur_calibration::no_ur(source.as_ref())),
            Self::NoChain(source) => format!("{path} {source}"),
            Self::OtherChain(source) => format!("{path}: {source}"),
            Self::NotRead(source) => format!("{path}: {source}"),
            Self::NoLake => format!(
                "{path} is not TABLE/ROBOT/SESSION/RUN.parquet of a lake, where the times of its stations would stand beside \
                 it: give the run's file of table \"stations\" by --stations"
            ),
            Self::OtherRun { found, expected } => format!(
                "{path}: run {found} wrote it, and the residuals are of run {expected}; take the file of the same run"
            ),
            Self::Exists => {
                format!("{path} exists already; choose another --out, or remove it first")
            }
            Self::NotWritten(source) => {
                format!("{path}: {}", told(source))
            }
        }
    }
}
