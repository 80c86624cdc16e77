//! Tables of a run → files for controllers and off-line programming.
//!
//! - [`nodes_csv`]: a compensation table as CSV, one row per node, after `#` lines with the values of the whole table;
//! - [`parameters_csv`]: the identified parameters in any convention, with standard errors, from `calibrations`;
//! - [`urdf`]: the identified geometry as URDF, from `calibrations`;
//! - [`corrected_urdf`]: a URDF with the identified geometry in the origins of its joints, from `calibrations`;
//! - [`ur_calibration`]: the identified geometry as the calibration file of a UR's ROS description, from `calibrations`;
//! - [`residuals_mcap`]: error vectors before and after as MCAP, from `residuals` and `stations`.
//!
//! Names come from logs and pipeline files: each is written so that it can only be read as a name.

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

/// The reason why a table is not exported.
#[derive(Debug, Error)]
pub enum ExportError {
    /// The file holds no table.
    #[error(transparent)]
    File(#[from] FileError),
    /// A schema of the program is missing.
    #[error(transparent)]
    Schema(#[from] SchemaError),
    /// A fault in the content of the file, or in writing it.
    #[error("{}", kind.message(path))]
    At { path: PathBuf, kind: ExportErrorKind },
    /// The table of nodes cannot be read.
    #[error(transparent)]
    Nodes(#[from] CompensationTableError),
    /// The identified arm cannot be read.
    #[error(transparent)]
    Arm(#[from] CalibrationsTableError),
    /// The rows are of several runs.
    #[error(transparent)]
    Common(#[from] CommonError),
    /// There is no table with the times of a session's stations.
    #[error(
        "the times of the stations of session {session:?} are in table \"stations\" of the same run, which cannot be read: \
         {source}; give its file by --stations"
    )]
    NoTimes { session: String, source: Box<LakeError> },
    /// A station has no time.
    #[error(
        "no table \"stations\" that was read has station {station} of session {session:?}; give the files of all sessions of \
         the run by --stations"
    )]
    NoTime { session: String, station: usize },
    /// A time is outside the range of MCAP.
    #[error(
        "station {station} of session {session:?} was measured at {ns} ns of the controller's clock, and MCAP times start at 0: \
         the controller's stamps are wrong"
    )]
    EarlyTime {
        session: String,
        station: usize,
        /// Its stamp, ns.
        ns: i64,
    },
    /// Times are given for a format that does not use them.
    #[error("--stations gives times to --format mcap; {0} has none: leave it out")]
    NoUseForTimes(&'static str),
    /// A convention is given for a format that does not use it.
    #[error("--convention is for --format parameters; {0} has none: leave it out")]
    NoUseForConvention(&'static str),
    /// A URDF is given for a format that does not use it.
    #[error(
        "--urdf, --base and --tip are for --format urdf; {0} has no use for them: leave them out"
    )]
    NoUseForUrdf(&'static str),
    /// The MCAP writer failed.
    #[error("the MCAP file cannot be made: {0}; this is a defect of posegrid, please report it")]
    Mcap(#[from] mcap::McapError),
    /// Standard output cannot be written.
    #[error("standard output: {0}")]
    Write(#[from] io::Error),
    /// The CSV writer failed.
    #[error(transparent)]
    Csv(#[from] csv::Error),
    /// The JSON writer failed.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
}

/// The fault in a file that is exported, or in the file made from it.
#[derive(Debug)]
pub enum ExportErrorKind {
    /// The file holds another table.
    OtherTable {
        /// The table in the file, or that there is none.
        found: String,
        /// Name of the format.
        format: &'static str,
        /// The tables that it is made from.
        needs: &'static str,
    },
    /// The table has no row.
    Empty,
    /// Rows differ in a value that all should share.
    NotOne {
        column: String,
        /// Number of the row that differs.
        row: usize,
    },
    /// An arm that URDF cannot say: what it has.
    NoUrdf(&'static str),
    /// An arm that the wanted convention cannot state.
    Convention(RestateError),
    /// An arm that is not one of Universal Robots: why, or `None` for one without six axes.
    NoUr(Option<OriginsError>),
    /// A URDF without the chain that is asked for.
    NoChain(UrdfChainError),
    /// A chain that is not the run's arm.
    OtherChain(OriginsError),
    /// The file cannot be read.
    NotRead(io::Error),
    /// The file is in no lake.
    NoLake,
    /// The stations are of another run.
    OtherRun {
        /// The run of the file.
        found: String,
        /// The run of the residuals.
        expected: String,
    },
    /// The output file exists already.
    Exists,
    /// The file cannot be written.
    NotWritten(io::Error),
}

impl ExportErrorKind {
    /// This problem of the file at `path`.
    pub fn at(self, path: &Path) -> ExportError {
        ExportError::At { path: path.to_owned(), kind: self }
    }

    /// The message for a person, with the file's path.
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
