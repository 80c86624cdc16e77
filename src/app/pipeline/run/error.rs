//! The reasons why a piece of work has no result.

use std::path::PathBuf;

use thiserror::Error;

use crate::io::lake::LakeError;
use crate::io::log::LogError;
use crate::io::station_table::StationTableError;
use crate::io::tables::PublishError;
use crate::io::tables::stage_results::NotRestored;
use crate::io::targets::TargetsError;
use crate::join::JoinError;
use crate::judgement::StageError;
use crate::pipeline::configuration::SessionFiles;
use crate::pipeline::damage::DamageError;
use crate::pipeline::fetch::FetchError;
use crate::setup::Finding;

/// The reason why a piece of work has no result.
#[derive(Debug, Error)]
pub enum RunError {
    /// An input cannot be digested.
    #[error("cannot read {}: {source}", path.display())]
    Input { path: PathBuf, source: std::io::Error },
    /// A recording would count twice.
    #[error("{side}: two of its files hold the same: {}; name each part of a split recording once", files.join(", "))]
    SameTwice {
        /// Session and side.
        side: String,
        /// The side's files.
        files: Vec<String>,
    },
    /// A log cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A table of stations cannot be read.
    #[error(transparent)]
    Table(#[from] StationTableError),
    /// A session of logs where the pipeline file reads tables, or the other way round.
    #[error(
        "session {session}: it was recorded in another way than [input] reads: as logs or as a table of stations"
    )]
    OtherKind { session: String },
    /// One session of the work cannot be used; a pool may do without it.
    #[error("{source}")]
    OfSession { session: String, source: Box<RunError> },
    /// A result of a stage that the lake should have.
    #[error(
        "session {session}: the lake has no {what} of it by these settings: run it without --from first"
    )]
    NoResult { session: String, what: &'static str },
    /// A result of a stage that cannot be read back.
    #[error("session {session}: {what} cannot be used: {source}")]
    Unread {
        session: String,
        /// The result with its name.
        what: String,
        source: Box<NotRestored>,
    },
    /// The robot is named neither in the pipeline file nor in the logs.
    #[error(
        "session {session}: neither [robot] name nor a metadata record `session` with a `robot` names the robot; name it in the pipeline file"
    )]
    NoRobotName { session: String },
    /// More of a log was lost than the pipeline file allows.
    #[error("session {session}: {0}", damage)]
    Damaged {
        session: String,
        /// The loss.
        damage: DamageError,
    },
    /// The logs cannot be joined.
    #[error("session {session}: join: {source}")]
    Join { session: String, source: Box<JoinError> },
    /// The logs cannot be joined under any usual mistake of the set-up.
    #[error(
        "session {session}: join: {source} No usual mistake of the set-up makes them agree (units, order, signs and zeros of joints, signs \
         of links, the ready robot files): they are probably logs of two sessions, or of another arm"
    )]
    Unexplained {
        session: String,
        /// Why they cannot be joined as stated.
        source: Box<JoinError>,
    },
    /// What the logs state and what the pipeline file states are two cells.
    #[error("session {session}: the logs contradict the stated set-up: {finding}")]
    SetUp {
        session: String,
        /// The disagreement and what explains it.
        finding: Box<Finding>,
    },
    /// A camera that is mounted otherwise than is stated.
    #[error(
        "session {session}: the readings contradict the stated set-up: the camera is mounted = \"{right}\", not \"{stated}\": {evidence}; \
         set [tracker] camera.mounted = \"{right}\""
    )]
    Mounted {
        session: String,
        /// The stated word.
        stated: &'static str,
        /// The word under which the readings agree.
        right: &'static str,
        /// How well they agree.
        evidence: String,
    },
    /// A stage after the join has no result.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// The corrected targets that drove a session cannot be read.
    #[error("session {session}: corrected targets: {source}")]
    Driving { session: String, source: Box<TargetsError> },
    /// The tables cannot be published.
    #[error(transparent)]
    Publish(#[from] PublishError),
    /// The lake cannot be read.
    #[error(transparent)]
    Lake(#[from] LakeError),
    /// The logs cannot be fetched.
    #[error(transparent)]
    Fetch(#[from] FetchError),
    /// Any of these errors, for logs that were fetched, as text that names the originals.
    #[error("{words}")]
    Copied {
        /// The session that caused it; `None` where no single one did.
        session: Option<String>,
        /// The error as text.
        words: String,
        /// Whether it is a fault of machine or storage.
        is_fault: bool,
    },
}

impl RunError {
    /// Whether readings and the stated set-up contradict each other.
    pub(super) const fn is_of_set_up(&self) -> bool {
        matches!(self, Self::SetUp { .. } | Self::Join { .. } | Self::Unexplained { .. })
    }

    /// Whether the machine or the storage failed, so that the same work may have a result later.
    pub fn is_fault(&self) -> bool {
        use std::io::ErrorKind::{InvalidInput, IsADirectory, NotFound, PermissionDenied};
        match self {
            Self::Input { source, .. } => {
                !matches!(source.kind(), NotFound | PermissionDenied | IsADirectory | InvalidInput)
            }
            Self::Lake(error) | Self::Publish(PublishError::Lake(error)) => error.is_fault(),
            Self::Fetch(_) => true,
            Self::OfSession { source, .. } => source.is_fault(),
            Self::Copied { is_fault, .. } => *is_fault,
            _ => false,
        }
    }

    /// The session that caused it; `None` where no single one did.
    pub fn session(&self) -> Option<&str> {
        match self {
            Self::OfSession { session, .. } => Some(session),
            Self::Copied { session, .. } => session.as_deref(),
            _ => None,
        }
    }

    pub(super) fn of(self, files: &SessionFiles) -> Self {
        Self::OfSession { session: files.name.clone(), source: Box::new(self) }
    }
}
