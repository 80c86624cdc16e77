//! Errors of a pipeline file, with advice.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use crate::geometry::PlacementError;
use crate::io::input::toml_problem;
use crate::io::store::StoreError;
use crate::join::JoinError;
use crate::manifest::ManifestError;
use crate::pipeline::keys::missing::Incomplete;
use crate::pipeline::robot_file::NoRobotFile;

/// Why a pipeline file makes no configuration.
#[derive(Debug, Error)]
pub enum ConfigurationError {
    /// The pipeline file cannot be read.
    #[error("cannot read the pipeline file {}: {source}; give the path of a TOML file like pipelines/quickstart.toml", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The pipeline file is no pipeline file.
    #[error("{}: {}", path.display(), toml_problem(source))]
    Parse {
        /// The file.
        path: PathBuf,
        /// Where and why.
        source: Box<toml::de::Error>,
    },
    /// Several keys of the pipeline file are missing, or not known.
    #[error("{}: {source}", path.display())]
    Incomplete {
        /// The file.
        path: PathBuf,
        /// The keys.
        source: Box<Incomplete>,
    },
    /// An invalid value.
    #[error("{}: {key} = {found}, but it has to be {wanted}", path.display())]
    Setting {
        /// The file.
        path: PathBuf,
        /// Section and key.
        key: String,
        /// The value found.
        found: String,
        /// The values that are allowed.
        wanted: String,
    },
    /// A key is missing that another one needs.
    #[error("{}: {key} is missing: {reason}", path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// Section and key.
        key: &'static str,
        /// The key that needs it, and advice.
        reason: &'static str,
    },
    /// An invalid placement.
    #[error("{}: {key}: {source}", path.display())]
    Placement {
        /// The file.
        path: PathBuf,
        /// Section and key.
        key: &'static str,
        /// Why.
        source: PlacementError,
    },
    /// An invalid setting of the join.
    #[error("{}: {source}", path.display())]
    Join {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<JoinError>,
    },
    /// The robot file cannot be read.
    #[error("cannot read the robot file {}, which {} names under [robot] file: {source}; nominal arms are in pipelines/robots/", robot.display(), path.display())]
    Robot {
        /// The pipeline file.
        path: PathBuf,
        /// The robot file.
        robot: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The robot file is no robot file, or its arm is invalid.
    #[error("{}{}: {source}", robot.display(), source.on_line())]
    RobotParse {
        /// The robot file.
        robot: PathBuf,
        /// Where and why.
        source: Box<NoRobotFile>,
    },
    /// The folder with the sessions cannot be read.
    #[error("cannot read the folder {}, which {} names under [input] folder: {source}; it has to hold the sessions", folder.display(), path.display())]
    Folder {
        /// The pipeline file.
        path: PathBuf,
        /// The folder.
        folder: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A session is missing or incomplete.
    #[error("session {session:?}: {reason}; sessions in {}: {}", folder.display(), listed(found))]
    Session {
        /// The session.
        session: String,
        /// The missing part.
        reason: String,
        /// The folder that was searched.
        folder: PathBuf,
        /// The sessions there.
        found: Vec<String>,
    },
    /// A session is named twice, or both to learn from and to judge.
    #[error(
        "session {session:?} is named {how}: a session is learnt from or judges, once; take one out"
    )]
    NamedTwice {
        /// The session.
        session: String,
        /// The two places.
        how: &'static str,
    },
    /// There is no session to learn from.
    #[error("no session to learn from in {}: a session is {wanted}{}", folder.display(), besides(left_out))]
    NoSessions {
        /// The folder that was searched.
        folder: PathBuf,
        /// The definition of a session.
        wanted: String,
        /// Folders and files there that are no session.
        left_out: Vec<String>,
    },
    /// The settings have no canonical form.
    #[error(transparent)]
    Manifest(#[from] ManifestError),
    /// The place of the tables, or of the sessions, cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
}

fn listed(names: &[String]) -> String {
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(", ")
    }
}

fn besides(left_out: &[String]) -> String {
    if left_out.is_empty() {
        String::new()
    } else {
        format!("; left out: {}", left_out.join(", "))
    }
}

impl ConfigurationError {
    /// Whether the same file may work later: it has no fault.
    pub const fn is_worth_a_retry(&self) -> bool {
        matches!(self, Self::Store(error) if error.is_worth_a_retry())
    }
}
