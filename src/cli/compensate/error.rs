//! What can be wrong with a command for corrected targets.

use std::io;
use std::path::{Path, PathBuf};

use parquet::errors::ParquetError;
use thiserror::Error;

use super::used_with::option;
use crate::compensation::Exception;
use crate::compensation::validity::Outside;
use crate::io::calibrations_table::CalibrationsTableError;
use crate::io::compensation_table::CompensationTableError;
use crate::io::lake::LakeError;
use crate::io::store::Place;
use crate::io::table::{FileError, TableError};
use crate::io::targets::TargetsError;
use crate::pipeline::history::HistoryError;

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
        /// What it is.
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
    #[error("{}", folder(path, wanted, files))]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What is needed.
        wanted: &'static str,
        /// Files in it that can be given.
        files: Vec<PathBuf>,
    },
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

/// Files named in a message up to this many.
const FILES_NAMED: usize = 5;

/// What a folder is told: the files in it that can be given.
fn folder(path: &Path, wanted: &str, files: &[PathBuf]) -> String {
    let named: Vec<String> = files
        .iter()
        .take(FILES_NAMED)
        .map(|file| file.display().to_string())
        .collect();
    let more = files.len().saturating_sub(FILES_NAMED);
    let which = match (named.is_empty(), more) {
        (true, _) => "none is in it".to_owned(),
        (false, 0) => format!("in it: {}", named.join(", ")),
        (false, more) => format!("in it: {} and {more} more", named.join(", ")),
    };
    format!("{} is a folder; give {wanted}; {which}", path.display())
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
            | Self::Folder { .. }
            | Self::IsLake { .. }
            | Self::Current(_)
            | Self::NoRun { .. }
            | Self::NoTableOfRun { .. }
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
