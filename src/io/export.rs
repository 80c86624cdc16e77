//! Tables of a run → what controllers and off-line programming read.
//!
//! - [`nodes_csv`]: a compensation table as CSV, a row a node, what holds for all of it in `#` lines before;
//! - [`curves_json`]: the error curve of each joint as JSON, from `calibrations` or `joint_errors`;
//! - [`urdf`]: the identified geometry as URDF, from `calibrations`.
//!
//! Names come from logs and pipeline files: each is written so that it cannot be anything but a name.

pub mod curves_json;
pub mod nodes_csv;
pub mod urdf;

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use super::calibrations_table::CalibrationsTableError;
use super::compensation_table::CompensationTableError;
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
    /// The file holds another table.
    #[error("{} holds {found}; {format} is made of table {needs} of a run", path.display())]
    OtherTable {
        /// The file.
        path: PathBuf,
        /// What it holds.
        found: String,
        /// The format asked for.
        format: &'static str,
        /// The tables it is made of.
        needs: &'static str,
    },
    /// No row.
    #[error("{} holds no row; take the file of a run that has one", .0.display())]
    Empty(PathBuf),
    /// The table of nodes cannot be read.
    #[error(transparent)]
    Nodes(#[from] CompensationTableError),
    /// The identified arm cannot be read.
    #[error(transparent)]
    Arm(#[from] CalibrationsTableError),
    /// Rows that differ in what holds for all of them.
    #[error(
        "{}, column {column:?}: row 0 and row {row} differ, and every row has the same there: take the file of a single run",
        path.display()
    )]
    NotOne {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// The row that differs.
        row: usize,
    },
    /// An arm without joint curves.
    #[error(
        "{} has no row of model \"full\", and joint curves are part of it; switch the full model on in [fit.full]",
        .0.display()
    )]
    NoCurves(PathBuf),
    /// An arm that URDF cannot say.
    #[error("{}: the arm {problem}, which a URDF cannot say; export its joint curves or use table `calibrations`", path.display())]
    NoUrdf {
        /// The file.
        path: PathBuf,
        /// What it has.
        problem: &'static str,
    },
    /// Something stands where the result is to be.
    #[error("{} exists already; choose another --out, or remove it first", .0.display())]
    Exists(PathBuf),
    /// The file cannot be written.
    #[error("{}: {source}; check the space and the permissions of the folder", path.display())]
    NotWritten {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
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
