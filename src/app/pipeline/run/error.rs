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

pub(super) type Result<T, E = RunError> = std::result::Result<T, E>;

#[derive(Debug, Error)]
pub enum RunError {
    #[error("cannot read {}: {source}", path.display())]
    Input { path: PathBuf, source: std::io::Error },
    #[error("{side}: two of its files hold the same: {}; name each part of a split recording once", files.join(", "))]
    SameTwice { side: String, files: Vec<String> },
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(transparent)]
    Table(#[from] StationTableError),
    #[error(
        "session {session}: it was recorded in another way than [input] reads: as logs or as a table of stations"
    )]
    OtherKind { session: String },
    #[error("{source}")]
    OfSession { session: String, source: Box<RunError> },
    #[error(
        "session {session}: the lake has no {what} of it by these settings: run it without --from first"
    )]
    NoResult { session: String, what: &'static str },
    #[error("session {session}: {what} cannot be used: {source}")]
    Unread { session: String, what: String, source: Box<NotRestored> },
    #[error(
        "session {session}: neither [robot] name nor a metadata record `session` with a `robot` names the robot; name it in the pipeline file"
    )]
    NoRobotName { session: String },
    #[error("session {session}: {0}", damage)]
    Damaged { session: String, damage: DamageError },
    #[error("session {session}: join: {source}")]
    Join { session: String, source: Box<JoinError> },
    #[error(
        "session {session}: join: {source} No usual mistake of the set-up makes them agree (units, order, signs and zeros of joints, signs \
         of links, the ready robot files): they are probably logs of two sessions, or of another arm"
    )]
    Unexplained { session: String, source: Box<JoinError> },
    #[error("session {session}: the logs contradict the stated set-up: {finding}")]
    SetUp { session: String, finding: Box<Finding> },
    #[error(
        "session {session}: the readings contradict the stated set-up: the camera is mounted = \"{right}\", not \"{stated}\": {evidence}; \
         set [tracker] camera.mounted = \"{right}\""
    )]
    Mounted { session: String, stated: &'static str, right: &'static str, evidence: String },
    #[error(transparent)]
    Stage(#[from] StageError),
    #[error("session {session}: corrected targets: {source}")]
    Driving { session: String, source: Box<TargetsError> },
    #[error(transparent)]
    Publish(#[from] PublishError),
    #[error(transparent)]
    Lake(#[from] LakeError),
    #[error(transparent)]
    Fetch(#[from] FetchError),
    #[error("{words}")]
    Copied {
        /// The session that caused it; `None` where no single one did.
        session: Option<String>,
        words: String,
        is_fault: bool,
    },
}

impl RunError {
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
