//! Errors of a pipeline file, with advice.

use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::at::At;
use crate::files::store::StoreError;
use crate::io::lake::LakeError;
use crate::manifest::ManifestError;
use crate::nearest::did_you_mean;
use crate::pipeline::robot_file::NoRobotFile;
use crate::pipeline::words::some_of;

pub(in crate::pipeline) type Result<T, E = ConfigurationError> = std::result::Result<T, E>;

#[derive(Debug, Error)]
pub enum ConfigurationError {
    #[error("{}", kind.message(path))]
    At { path: PathBuf, kind: ConfigurationErrorKind },
    #[error("robot {robot:?} ({place}): {source}")]
    OfRobot { robot: String, place: String, source: Box<Self> },
    /// The robot file is no robot file, or its arm is invalid.
    #[error(transparent)]
    RobotParse(#[from] Box<At<NoRobotFile>>),
    #[error("session {session:?}: {reason}; sessions in {}: {}", folder.display(), listed(found))]
    Session {
        session: String,
        reason: String,
        folder: PathBuf,
        /// The sessions there.
        found: Vec<String>,
    },
    #[error(
        "session {session:?} is named {how}: a session is learnt from or judges, once; take one out"
    )]
    NamedTwice { session: String, how: &'static str },
    #[error("there is no folder {} yet", .0.display())]
    NoFolder(PathBuf),
    #[error("no session to learn from in {}: a session is {wanted}{}", folder.display(), besides(left_out))]
    NoSessions {
        folder: PathBuf,
        wanted: String,
        /// Folders and files there that are no session.
        left_out: Vec<String>,
    },
    /// The settings have no canonical form.
    #[error(transparent)]
    Manifest(#[from] ManifestError),
    #[error(transparent)]
    Lake(#[from] LakeError),
    /// The place of the tables, or of the sessions, cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
}

#[derive(Debug)]
pub enum ConfigurationErrorKind {
    Read(io::Error),
    /// A value that the file states is wrong, or contradicts another; the words say which.
    Fault(String),
    Robot {
        robot: PathBuf,
        source: io::Error,
    },
    /// The folder with the sessions cannot be read.
    Folder {
        folder: PathBuf,
        source: io::Error,
    },
}

impl ConfigurationErrorKind {
    /// A key with an invalid value: the value found, and those that are allowed.
    pub(in crate::pipeline) fn setting(
        key: impl Display,
        found: impl Display,
        wanted: impl Display,
    ) -> Self {
        Self::Fault(format!("{key} = {found}, but it has to be {wanted}"))
    }

    /// A key that is missing and that another one needs; with the reason and advice.
    pub(in crate::pipeline) fn missing(key: &str, reason: &str) -> Self {
        Self::Fault(format!("{key} is missing: {reason}"))
    }

    /// The fault that a file does not have the robot of that name, beside those that it has.
    pub(in crate::pipeline) fn no_robot(name: &str, known: &[String]) -> Self {
        Self::Fault(if known.is_empty() {
            format!(
                "it has no robot {name:?} to choose: it is of one robot, so leave --robot out; several stand in [[robots]], or in the \
                 table that [input] robots names"
            )
        } else {
            let meant = did_you_mean(name, known.iter().map(String::as_str));
            format!("it has no robot {name:?}{meant}; its robots: {}", few_of(known))
        })
    }

    pub(in crate::pipeline) fn several_robots(known: &[String]) -> Self {
        let known = few_of(known);
        Self::Fault(format!("it is of several robots: name one of them with --robot: {known}"))
    }

    /// This fault of the pipeline file at `path`.
    pub(in crate::pipeline) fn at(self, path: &Path) -> ConfigurationError {
        ConfigurationError::At { path: path.to_owned(), kind: self }
    }

    fn message(&self, path: &Path) -> String {
        let path = path.display();
        match self {
            Self::Read(source) => format!(
                "cannot read the pipeline file {path}: {source}; give the path of a TOML file like pipelines/quickstart.toml"
            ),
            Self::Fault(fault) => format!("{path}: {fault}"),
            Self::Robot { robot, source } => format!(
                "cannot read the robot file {}, which {path} names under [robot] file: {source}; nominal arms are in \
                 pipelines/robots/",
                robot.display()
            ),
            Self::Folder { folder, source } => format!(
                "cannot read the folder {}, which {path} names under [input] folder: {source}; it has to hold the sessions",
                folder.display()
            ),
        }
    }
}

fn few_of(names: &[String]) -> String {
    const FEW: usize = 12;
    if names.is_empty() { "none".to_owned() } else { some_of(names.iter().cloned(), FEW, "others") }
}

fn listed(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

fn besides(left_out: &[String]) -> String {
    if left_out.is_empty() { String::new() } else { format!("; left out: {}", left_out.join(", ")) }
}

impl ConfigurationError {
    /// Whether the same file may work later: it has no fault.
    pub const fn is_worth_a_retry(&self) -> bool {
        match self {
            Self::Store(error) => error.is_worth_a_retry(),
            Self::OfRobot { source, .. } => source.is_worth_a_retry(),
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_message_names_the_pipeline_file() {
        let absent = || io::Error::from(io::ErrorKind::NotFound);
        for (kind, message) in [
            (
                ConfigurationErrorKind::Read(absent()),
                "cannot read the pipeline file cell/my.toml: entity not found; give the path of a TOML file like \
                 pipelines/quickstart.toml",
            ),
            (
                ConfigurationErrorKind::setting("[robot] up", "[0, 0, 2]", "a direction"),
                "cell/my.toml: [robot] up = [0, 0, 2], but it has to be a direction",
            ),
            (
                ConfigurationErrorKind::missing("[plan]", "it states the cell"),
                "cell/my.toml: [plan] is missing: it states the cell",
            ),
            (
                ConfigurationErrorKind::Robot { robot: "arm.toml".into(), source: absent() },
                "cannot read the robot file arm.toml, which cell/my.toml names under [robot] file: entity not found; nominal \
                 arms are in pipelines/robots/",
            ),
            (
                ConfigurationErrorKind::Folder { folder: "sessions".into(), source: absent() },
                "cannot read the folder sessions, which cell/my.toml names under [input] folder: entity not found; it has to \
                 hold the sessions",
            ),
        ] {
            assert_eq!(kind.at(Path::new("cell/my.toml")).to_string(), message);
        }
    }
}
