//! Errors of `posegrid compensate`.

use std::io;
use std::path::{Path, PathBuf};

use parquet::errors::ParquetError;
use thiserror::Error;

use super::used_with::option;
use crate::at::At;
use crate::cli::folder_given::FolderGiven;
use crate::compensation::Exception;
use crate::compensation::validity::Outside;
use crate::io::calibrations_table::CalibrationsTableError;
use crate::io::compensation_table::CompensationTableError;
use crate::io::lake::LakeError;
use crate::io::store::Place;
use crate::io::table::{self, FileError, TableError};
use crate::io::targets::TargetsError;
use crate::io::whole_file;
use crate::pipeline::history::HistoryError;

/// The targets are corrected already: posegrid wrote the file, or it holds commands that posegrid wrote.
#[derive(Debug, Error)]
#[error(
    "{}: corrected already: {what} posegrid wrote {when} with table {run} of robot {robot:?}, session {session:?} ({}); \
     correct the targets themselves, a second correction would move the tool by the error once more",
    path.display(),
    record.display()
)]
pub struct CorrectedAlready {
    /// Path of the file of targets.
    pub path: PathBuf,
    /// "the file", or which of its targets.
    pub what: String,
    /// Date and time of the correction, as text.
    pub when: String,
    /// The run whose table corrected them.
    pub run: String,
    /// Robot of that run.
    pub robot: String,
    /// Session of that run.
    pub session: String,
    /// Path of the lake's record of the correction.
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
        /// The table in the file, or that there is none.
        found: String,
    },
    /// The table of nodes cannot be read.
    #[error(transparent)]
    Table(#[from] CompensationTableError),
    /// The identified arm cannot be read.
    #[error(transparent)]
    Arm(#[from] CalibrationsTableError),
    /// The targets cannot be read, or the output file has an unknown form.
    #[error(transparent)]
    Targets(#[from] TargetsError),
    /// The file, or some of its targets, are commands that the lake recorded.
    #[error(transparent)]
    Again(Box<CorrectedAlready>),
    /// A record of corrections that cannot be read.
    #[error(
        "{}: this record of corrections cannot be used: {problem}; without it a corrected file \
         could be corrected again unnoticed: restore the file, or remove it from the lake",
        place.display()
    )]
    Unreadable {
        /// Path of the record.
        place: PathBuf,
        /// Why.
        problem: String,
    },
    /// The records of the lake cannot be listed.
    #[error(transparent)]
    Records(#[from] LakeError),
    /// The lake cannot record the correction.
    #[error(
        "the lake {} cannot record this correction, so nothing was written: {source}; without a record a \
         file whose marks are removed could be corrected again unnoticed: make the lake writable, or give --no-record",
        lake.display()
    )]
    NotRecorded {
        /// Folder of the lake.
        lake: PathBuf,
        /// Why.
        source: Box<LakeError>,
    },
    /// The digest of the file of targets cannot be computed.
    #[error("cannot read {0}")]
    Digest(At<io::Error>),
    /// A table that does not meet its tolerance, or was not shown to.
    #[error(
        "{}: this {what} {}, so nothing is corrected with it; why stands in table runs (reason) and on the page of run {run}: \
         measure more or repair the set-up and run the session again, or correct all the same with {}",
        path.display(),
        if *needed == Exception::NotMet { "does not meet its pipeline's tolerance" } else { "was not shown to meet its pipeline's tolerance" },
        option(*needed)
    )]
    Verdict {
        /// The table.
        path: PathBuf,
        /// The kind of table: of nodes, or the identified arm.
        what: &'static str,
        /// Its run.
        run: String,
        /// The exception that it needs.
        needed: Exception,
    },
    /// No such file.
    #[error(
        "there is no file {}; give the file of table compensation or calibrations of a run, or a robot's name and its lake: \
         --lake DIR",
        .0.display()
    )]
    NoTable(PathBuf),
    /// A folder where a file is needed.
    #[error("{0}")]
    Folder(FolderGiven),
    /// A lake without the name of a robot.
    #[error(
        "{} is a lake; give a robot of it by name: posegrid compensate ROBOT TARGETS --lake {}; its robots: {}",
        path.display(), path.display(), robots.join(", ")
    )]
    IsLake {
        /// The lake.
        path: PathBuf,
        /// The folders of its robots.
        robots: Vec<String>,
    },
    /// The current run of a robot cannot be found.
    #[error(transparent)]
    Current(#[from] HistoryError),
    /// No run of a session.
    #[error(
        "the lake {lake} has no run of robot {robot:?}, session {session:?}; `posegrid history {lake}` tells its sessions"
    )]
    NoRun {
        /// The lake.
        lake: Place,
        /// The robot.
        robot: String,
        /// The session.
        session: String,
    },
    /// A run without a table that corrects.
    #[error(
        "run {run} of robot {robot:?}, session {session:?} has no table {table}: no step gave one, or it was removed; choose \
         another by --by or --session"
    )]
    NoTableOfRun {
        /// The run.
        run: String,
        /// The robot.
        robot: String,
        /// The session.
        session: String,
        /// The table.
        table: &'static str,
    },
    /// They will be run with something that the table is not valid for.
    #[error(
        "the table is not valid for what the targets will be run with: {}; use a table measured so, or correct all the same with {}",
        .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "),
        .0.iter().map(|own| option(Exception::Term(own.term))).collect::<Vec<_>>().join(" ")
    )]
    Outside(Vec<Outside>),
    /// A data list can only be corrected, not made.
    #[error(
        "{}: a KUKA data list is made only from one, and the targets are {}; take --out as .csv, .json or .parquet",
        out.display(),
        targets.display()
    )]
    OnlyFromKrl {
        /// The output file.
        out: PathBuf,
        /// Path of the file of targets.
        targets: PathBuf,
    },
    /// The targets state KUKA's S, which is not defined for this arm.
    #[error(
        "the targets state S, but KUKA's S does not describe the arm of this {what}: its axes differ, or are counted \
         differently; use table \"calibrations\" of a KUKA arm's run, or leave S out"
    )]
    Status {
        /// The kind of table.
        what: &'static str,
    },
    /// The output file exists already.
    #[error("{} exists already; choose another --out, or remove it first", .0.display())]
    Exists(PathBuf),
    /// The result does not fit its table.
    #[error(transparent)]
    Result(#[from] TableError),
    /// The result cannot be written.
    #[error("{}: {}", path.as_deref().map_or_else(|| "standard output".into(), Path::to_string_lossy), source.told())]
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
    /// The folder or the disk refused the file.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The CSV writer failed.
    #[error(transparent)]
    Csv(#[from] csv::Error),
    /// The Parquet writer failed.
    #[error("{}", table::plain(.0))]
    Parquet(#[from] ParquetError),
}

impl WriteCause {
    /// What went wrong, and what to do.
    fn told(&self) -> String {
        match self {
            Self::Io(error) => whole_file::told(error),
            Self::Csv(_) | Self::Parquet(_) => {
                format!("{self}; check the space and the permissions of the folder")
            }
        }
    }
}

impl From<FolderGiven> for CompensateCommandError {
    fn from(folder: FolderGiven) -> Self {
        Self::Folder(folder)
    }
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
            | Self::Verdict { .. }
            | Self::NoTable(_)
            | Self::Folder(_)
            | Self::IsLake { .. }
            | Self::Current(_)
            | Self::NoRun { .. }
            | Self::NoTableOfRun { .. }
            | Self::Again(_)
            | Self::Unreadable { .. }
            | Self::Records(_)
            | Self::Digest(_)
            | Self::OnlyFromKrl { .. }
            | Self::Status { .. }
            | Self::Exists(_) => 2,
            Self::Result(_) | Self::NotRecorded { .. } | Self::Write { .. } => 1,
        }
    }
}
