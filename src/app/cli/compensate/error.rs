use std::io;
use std::path::{Path, PathBuf};

use parquet::errors::ParquetError;
use thiserror::Error;

use super::program::ProgramError;
use super::used_with::option;
use crate::at::At;
use crate::cli::folder_given::FolderGiven;
use crate::compensation::Exception;
use crate::compensation::validity::Outside;
use crate::files::store::Place;
use crate::files::table::{self, FileError, TableError};
use crate::files::whole_file;
use crate::io::calibrations_table::CalibrationsTableError;
use crate::io::compensation_table::CompensationTableError;
use crate::io::lake::LakeError;
use crate::io::targets::TargetsError;
use crate::manifest::RunKey;
use crate::pipeline::history::HistoryError;

/// The targets are corrected already: posegrid wrote the file, or it holds commands that posegrid wrote.
#[derive(Debug, Error)]
#[error(
    "{}: corrected already: {what} posegrid wrote {when} with table {} of robot {:?}, session {:?} ({}); \
     correct the targets themselves, a second correction would move the tool by the error once more",
    path.display(), key.run, key.robot, key.session, record.display()
)]
pub struct CorrectedAlready {
    pub path: PathBuf,
    /// "the file", or which of its targets.
    pub what: String,
    pub when: String,
    pub key: RunKey,
    pub record: PathBuf,
}

pub(super) type Result<T, E = CompensateCommandError> = std::result::Result<T, E>;

#[derive(Debug, Error)]
pub enum CompensateCommandError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error(
        "{} holds {found}; targets are corrected by table \"compensation\" or \"calibrations\" of a run",
        path.display()
    )]
    OtherTable { path: PathBuf, found: String },
    #[error(transparent)]
    Table(#[from] CompensationTableError),
    #[error(transparent)]
    Arm(#[from] CalibrationsTableError),
    #[error(transparent)]
    Targets(#[from] TargetsError),
    #[error(transparent)]
    Again(Box<CorrectedAlready>),
    #[error(
        "{}: this record of corrections cannot be used: {problem}; without it a corrected file \
         could be corrected again unnoticed: restore the file, or remove it from the lake",
        place.display()
    )]
    Unreadable { place: PathBuf, problem: String },
    #[error(transparent)]
    Records(#[from] LakeError),
    #[error(
        "the lake {} cannot record this correction, so nothing was written: {source}; without a record a \
         file whose marks are removed could be corrected again unnoticed: make the lake writable, or give --no-record",
        lake.display()
    )]
    NotRecorded { lake: PathBuf, source: Box<LakeError> },
    #[error("cannot read {0}")]
    Digest(At<io::Error>),
    #[error(
        "{}: this {what} {}, so nothing is corrected with it; why stands in table runs (reason) and on the page of run {run}: \
         measure more or repair the set-up and run the session again, or correct all the same with {}",
        path.display(),
        if *needed == Exception::NotMet { "does not meet its pipeline's tolerance" } else { "was not shown to meet its pipeline's tolerance" },
        option(*needed)
    )]
    Verdict { path: PathBuf, what: &'static str, run: String, needed: Exception },
    #[error(
        "there is no file {}; give the file of table compensation or calibrations of a run, or a robot's name and its lake: \
         --lake DIR",
        .0.display()
    )]
    NoTable(PathBuf),
    #[error(transparent)]
    Folder(#[from] FolderGiven),
    #[error(
        "{} is a lake; give a robot of it by name: posegrid compensate ROBOT TARGETS --lake {}; its robots: {}",
        path.display(), path.display(), robots.join(", ")
    )]
    IsLake { path: PathBuf, robots: Vec<String> },
    #[error(transparent)]
    Current(#[from] HistoryError),
    #[error(
        "the lake {lake} has no run of robot {robot:?}, session {session:?}; `posegrid history {lake}` tells its sessions"
    )]
    NoRun { lake: Place, robot: String, session: String },
    #[error(
        "run {} of robot {:?}, session {:?} has no table {table}: no step gave one, or it was removed; choose \
         another by --by or --session",
        key.run, key.robot, key.session
    )]
    NoTableOfRun { key: RunKey, table: &'static str },
    #[error(
        "the table is not valid for what the targets will be run with: {}; use a table measured so, or correct all the same with {}",
        .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "),
        .0.iter().map(|own| option(Exception::Term(own.term))).collect::<Vec<_>>().join(" ")
    )]
    Outside(Vec<Outside>),
    #[error("{} exists already; choose another --out, or remove it first", .0.display())]
    Exists(PathBuf),
    #[error(transparent)]
    Program(#[from] ProgramError),
    #[error(transparent)]
    Result(#[from] TableError),
    #[error("{}: {}", path.as_deref().map_or_else(|| "standard output".into(), Path::to_string_lossy), source.told())]
    Write { path: Option<PathBuf>, source: WriteCause },
}

#[derive(Debug, Error)]
pub enum WriteCause {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error(transparent)]
    Csv(#[from] csv::Error),
    #[error("{}", table::plain(.0))]
    Parquet(#[from] ParquetError),
}

impl WriteCause {
    pub(crate) fn told(&self) -> String {
        match self {
            Self::Io(error) => whole_file::told(error),
            Self::Csv(_) | Self::Parquet(_) => {
                format!("{self}; check the space and the permissions of the folder")
            }
        }
    }
}

impl CompensateCommandError {
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::Program(own) => own.exit_code(),
            Self::Result(_) | Self::NotRecorded { .. } | Self::Write { .. } => 1,
            _ => 2,
        }
    }
}
