//! Tables of a run → what controllers and off-line programming read.
//!
//! - [`nodes_csv`]: a compensation table as CSV, a row a node, what holds for all of it in `#` lines before;
//! - [`curves_json`]: the error curve of each joint as JSON, from `calibrations` or `joint_errors`;
//! - [`urdf`]: the identified geometry as URDF, from `calibrations`;
//! - [`residuals_mcap`]: error vectors before and after as MCAP, from `residuals` and `stations`.
//!
//! Names come from logs and pipeline files: each is written so that it cannot be anything but a name.

pub mod curves_json;
pub mod nodes_csv;
pub mod residuals_mcap;
pub mod urdf;

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::calibrations_table::CalibrationsTableError;
use super::common::CommonError;
use super::compensation_table::CompensationTableError;
use super::lake::LakeError;
use super::schema::SchemaError;
use super::table::FileError;

/// Why a table is not exported.
#[derive(Debug, Error)]
pub enum ExportError {
    /// The file holds no table.
    #[error(transparent)]
    File(#[from] FileError),
    /// The program does not know its own table.
    #[error(transparent)]
    Schema(#[from] SchemaError),
    /// What is wrong with what the file holds, or with writing it.
    #[error("{}", kind.message(path))]
    At {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        kind: ExportErrorKind,
    },
    /// The table of nodes cannot be read.
    #[error(transparent)]
    Nodes(#[from] CompensationTableError),
    /// The identified arm cannot be read.
    #[error(transparent)]
    Arm(#[from] CalibrationsTableError),
    /// Rows of several runs.
    #[error(transparent)]
    Common(#[from] CommonError),
    /// No table with the times of a session's stations.
    #[error(
        "the times of the stations of session {session:?} are in table \"stations\" of the same run, which cannot be read: \
         {source}; give its file by --stations"
    )]
    NoTimes {
        /// The session.
        session: String,
        /// Why.
        source: Box<LakeError>,
    },
    /// A station without a time.
    #[error(
        "no table \"stations\" that was read has station {station} of session {session:?}; give the files of all sessions of \
         the run by --stations"
    )]
    NoTime {
        /// The session.
        session: String,
        /// The station.
        station: usize,
    },
    /// A time that MCAP cannot say.
    #[error(
        "station {station} of session {session:?} was measured at {ns} ns of the controller's clock, and MCAP counts from 0 up: \
         the controller's stamps are wrong"
    )]
    EarlyTime {
        /// The session.
        session: String,
        /// The station.
        station: usize,
        /// Its stamp, ns.
        ns: i64,
    },
    /// Times for a format that has none.
    #[error("--stations gives times to --format mcap; {0} has none: leave it out")]
    NoUseForTimes(&'static str),
    /// As MCAP.
    #[error("the MCAP file cannot be made: {0}; this is a defect of posegrid, please report it")]
    Mcap(#[from] mcap::McapError),
    /// Standard output cannot be written.
    #[error("standard output: {0}")]
    Write(#[from] io::Error),
    /// As CSV.
    #[error(transparent)]
    Csv(#[from] csv::Error),
    /// As JSON.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
}

/// What is wrong with a file that is exported, or with the file that is made of it.
#[derive(Debug)]
pub enum ExportErrorKind {
    /// The file holds another table.
    OtherTable {
        /// What it holds.
        found: String,
        /// The format asked for.
        format: &'static str,
        /// The tables it is made of.
        needs: &'static str,
    },
    /// No row.
    Empty,
    /// Rows that differ in what holds for all of them.
    NotOne {
        /// The column.
        column: String,
        /// The row that differs.
        row: usize,
    },
    /// An arm without joint curves.
    NoCurves,
    /// An arm that URDF cannot say: what it has.
    NoUrdf(&'static str),
    /// A file that stands in no lake.
    NoLake,
    /// Stations of another run.
    OtherRun {
        /// The run of the file.
        found: String,
        /// The run of the residuals.
        expected: String,
    },
    /// Something stands where the result is to be.
    Exists,
    /// The file cannot be written.
    NotWritten(io::Error),
}

impl ExportErrorKind {
    /// This problem of the file at `path`.
    pub(crate) fn at(self, path: &Path) -> ExportError {
        ExportError::At {
            path: path.to_owned(),
            kind: self,
        }
    }

    /// The message for a person, with the file's path.
    fn message(&self, path: &Path) -> String {
        let path = path.display();
        match self {
            Self::OtherTable {
                found,
                format,
                needs,
            } => format!("{path} holds {found}; {format} is made of table {needs} of a run"),
            Self::Empty => format!("{path} holds no row; take the file of a run that has one"),
            Self::NotOne { column, row } => format!(
                "{path}, column {column:?}: row 0 and row {row} differ, and every row has the same there: take the file of a \
                 single run"
            ),
            Self::NoCurves => format!(
                "{path} has no row of model \"full\", and joint curves are part of it; switch the full error model on in [fit.full]"
            ),
            Self::NoUrdf(problem) => format!(
                "{path}: the arm {problem}, which a URDF cannot say; export its joint curves or use table `calibrations`"
            ),
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
                format!("{path}: {source}; check the space and the permissions of the folder")
            }
        }
    }
}
