//! What can be wrong with a command for corrected targets.

use std::io;
use std::path::{Path, PathBuf};

use parquet::errors::ParquetError;
use thiserror::Error;

use crate::compensation::validity::Outside;
use crate::io::calibrations_table::CalibrationsTableError;
use crate::io::compensation_table::CompensationTableError;
use crate::io::lake::LakeError;
use crate::io::table::{FileError, TableError};
use crate::io::targets::TargetsError;

/// A file of targets that posegrid wrote as corrected, or that has commands of one.
#[derive(Debug, Error)]
#[error(
    "{}: corrected already: {what} posegrid wrote {when} with table {run} of robot {robot:?}, session {session:?} ({}); \
     correct the targets themselves, a second correction would move the tool by the error once more",
    path.display(),
    record.display()
)]
pub struct CorrectedAlready {
    /// The file of targets.
    pub path: PathBuf,
    /// The file, or which of its targets.
    pub what: String,
    /// When it was written, in words.
    pub when: String,
    /// The run whose table corrected them.
    pub run: String,
    /// Its robot.
    pub robot: String,
    /// Its session.
    pub session: String,
    /// The record.
    pub record: PathBuf,
}

/// Why no target was corrected.
#[derive(Debug, Error)]
pub enum CompensateCommandError {
    /// The file holds no table.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file holds a table that corrects nothing.
    #[error(
        "{} holds {found}; targets are corrected by table \"compensation\" or \"calibrations\" of a run",
        path.display()
    )]
    OtherTable {
        /// The file.
        path: PathBuf,
        /// What it holds.
        found: String,
    },
    /// The table of nodes cannot be read.
    #[error(transparent)]
    Table(#[from] CompensationTableError),
    /// The identified arm cannot be read.
    #[error(transparent)]
    Arm(#[from] CalibrationsTableError),
    /// The targets cannot be read, or the result is to have a form that is not known.
    #[error(transparent)]
    Targets(#[from] TargetsError),
    /// The file, or some of its targets, are commands that this lake knows.
    #[error(transparent)]
    Again(Box<CorrectedAlready>),
    /// A record of corrections that says nothing.
    #[error(
        "{}: this record of corrections cannot be believed: {problem}; what was written then could be corrected again unseen: \
         bring the file back, or take it out of the lake",
        place.display()
    )]
    Unreadable {
        /// The record.
        place: PathBuf,
        /// Why.
        problem: String,
    },
    /// The records of the lake cannot be listed.
    #[error(transparent)]
    Records(#[from] LakeError),
    /// The lake takes no record.
    #[error(
        "the lake {} takes no record of what is corrected with its table, so nothing was written: {source}; without a record a \
         file whose marks are stripped could be corrected again unseen: make the lake writable, or give --no-record",
        lake.display()
    )]
    NotRecorded {
        /// The lake.
        lake: PathBuf,
        /// Why.
        source: Box<LakeError>,
    },
    /// The file of targets cannot be digested.
    #[error("cannot read {}: {source}", path.display())]
    Digest {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// They will be run with something that the table is not valid for.
    #[error(
        "the table is not valid for what the targets will be run with: {}; use a table measured so, or --allow one of them",
        .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
    )]
    Outside(Vec<Outside>),
    /// A data list can only be corrected, not made.
    #[error(
        "{}: a KUKA data list is made only from one, and the targets are {}; take --out as .csv, .json or .parquet",
        out.display(),
        targets.display()
    )]
    OnlyFromKrl {
        /// The result.
        out: PathBuf,
        /// The targets.
        targets: PathBuf,
    },
    /// S means nothing for this arm.
    #[error(
        "the targets state S, and this {what} is of no arm whose configurations KUKA's S names: its axes are other or counted \
         otherwise; use table \"calibrations\" of a KUKA arm's run, or leave S out"
    )]
    Status {
        /// The kind of table.
        what: &'static str,
    },
    /// Something stands where the result is to be.
    #[error("{} exists already; choose another --out, or remove it first", .0.display())]
    Exists(PathBuf),
    /// The result is no table.
    #[error(transparent)]
    Result(#[from] TableError),
    /// The result cannot be written.
    #[error("{}: {source}; check the space and the permissions of the folder", path.as_deref().map_or_else(|| "standard output".into(), Path::to_string_lossy))]
    Write {
        /// The file; `None` for standard output.
        path: Option<PathBuf>,
        /// Why.
        source: WriteCause,
    },
}

/// Why a result was not written.
#[derive(Debug, Error)]
pub enum WriteCause {
    /// The folder or the disk refused.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// As CSV.
    #[error(transparent)]
    Csv(#[from] csv::Error),
    /// As Parquet.
    #[error(transparent)]
    Parquet(#[from] ParquetError),
}

impl CompensateCommandError {
    /// The exit code of the command.
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::File(_)
            | Self::OtherTable { .. }
            | Self::Table(_)
            | Self::Arm(_)
            | Self::Targets(_)
            | Self::Outside(_)
            | Self::Again(_)
            | Self::Unreadable { .. }
            | Self::Records(_)
            | Self::Digest { .. }
            | Self::OnlyFromKrl { .. }
            | Self::Status { .. }
            | Self::Exists(_) => 2,
            Self::Result(_) | Self::NotRecorded { .. } | Self::Write { .. } => 1,
        }
    }
}
