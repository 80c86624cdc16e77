//! Errors of a pipeline file, with advice.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::at::At;
use crate::geometry::PlacementError;
use crate::io::input::toml_problem;
use crate::io::lake::LakeError;
use crate::io::store::StoreError;
use crate::manifest::ManifestError;
use crate::pipeline::keys::door::Faults;
use crate::pipeline::keys::retired::Retired;
use crate::pipeline::robot_file::NoRobotFile;

/// Why a pipeline file makes no configuration.
#[derive(Debug, Error)]
pub enum ConfigurationError {
    /// A fault in the pipeline file, or in what it names.
    #[error("{}", kind.message(path))]
    At {
        /// Path of the pipeline file.
        path: PathBuf,
        kind: ConfigurationErrorKind,
    },
    /// A fault in the settings of one of several robots.
    #[error("robot {robot:?} ({place}): {source}")]
    OfRobot {
        robot: String,
        /// Where it is stated.
        place: String,
        source: Box<Self>,
    },
    /// The robot file is no robot file, or its arm is invalid.
    #[error(transparent)]
    RobotParse(#[from] Box<At<NoRobotFile>>),
    /// A session is missing or incomplete.
    #[error("session {session:?}: {reason}; sessions in {}: {}", folder.display(), listed(found))]
    Session {
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
        session: String,
        /// The two places.
        how: &'static str,
    },
    /// A robot has no folder with sessions.
    #[error("there is no folder {} yet", .0.display())]
    NoFolder(PathBuf),
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
    /// The lake cannot be read.
    #[error(transparent)]
    Lake(Box<LakeError>),
    /// The place of the tables, or of the sessions, cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// The fault in a pipeline file, or in what it names.
#[derive(Debug)]
pub enum ConfigurationErrorKind {
    /// The pipeline file cannot be read.
    Read(io::Error),
    /// The pipeline file is no pipeline file.
    Parse(Box<toml::de::Error>),
    /// Keys are missing or not known, or their values are out of range.
    Keys(Faults),
    /// The pipeline file has a key that was retired.
    Retired(Retired),
    /// An invalid value.
    Setting {
        /// Section and key.
        key: String,
        /// The value found.
        found: String,
        /// The values that are allowed.
        wanted: String,
    },
    /// The robots that the file states, or a table beside it, are not sound.
    Robots {
        /// The table beside it; `None` where the file states them.
        table: Option<PathBuf>,
        /// The fault, with its place.
        reason: String,
    },
    /// The file has no robot of that name.
    NoRobot {
        name: String,
        /// The robots that it has.
        known: Vec<String>,
    },
    /// The file has several robots where one is needed.
    SeveralRobots {
        /// The robots that it has.
        known: Vec<String>,
    },
    /// A key is missing that another one needs.
    Missing {
        /// Section and key.
        key: &'static str,
        /// The key that needs it, and advice.
        reason: &'static str,
    },
    /// An invalid placement.
    Placement {
        /// Section and key.
        key: &'static str,
        source: PlacementError,
    },
    /// The robot file cannot be read.
    Robot {
        /// The robot file.
        robot: PathBuf,
        source: io::Error,
    },
    /// The folder with the sessions cannot be read.
    Folder { folder: PathBuf, source: io::Error },
}

impl ConfigurationErrorKind {
    /// This fault of the pipeline file at `path`.
    pub(in crate::pipeline) fn at(self, path: &Path) -> ConfigurationError {
        ConfigurationError::At { path: path.to_owned(), kind: self }
    }

    /// The message for a person, with the file's path.
    fn message(&self, path: &Path) -> String {
        let path = path.display();
        match self {
            Self::Read(source) => format!(
                "cannot read the pipeline file {path}: {source}; give the path of a TOML file like pipelines/quickstart.toml"
            ),
            Self::Parse(source) => format!("{path}: {}", toml_problem(source)),
            Self::Keys(source) => format!("{path}: {source}"),
            Self::Retired(source) => format!("{path}: {source}"),
            Self::Setting { key, found, wanted } => {
                format!("{path}: {key} = {found}, but it has to be {wanted}")
            }
            Self::Robots { table: Some(table), reason } => format!(
                "{}, the table of robots that {path} names under [input] robots: {reason}",
                table.display()
            ),
            Self::Robots { table: None, reason } => format!("{path}: {reason}"),
            Self::NoRobot { name, known } if known.is_empty() => format!(
                "{path} has no robot {name:?} to choose: it is of one robot, so leave --robot out; several stand in [[robots]], or in the table that [input] \
                 robots names"
            ),
            Self::NoRobot { name, known } => {
                format!("{path} has no robot {name:?}; its robots: {}", some_of(known))
            }
            Self::SeveralRobots { known } => format!(
                "{path} is of several robots: name one of them with --robot: {}",
                some_of(known)
            ),
            Self::Missing { key, reason } => format!("{path}: {key} is missing: {reason}"),
            Self::Placement { key, source } => format!("{path}: {key}: {source}"),
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

/// Names, of many the first ones.
fn some_of(names: &[String]) -> String {
    const FEW: usize = 12;
    let first = listed(&names[..names.len().min(FEW)]);
    match names.len().saturating_sub(FEW) {
        0 => first,
        others => format!("{first} and {others} others"),
    }
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

impl From<LakeError> for ConfigurationError {
    fn from(error: LakeError) -> Self {
        Self::Lake(Box::new(error))
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
                ConfigurationErrorKind::Setting {
                    key: "[robot] up".to_owned(),
                    found: "[0, 0, 2]".to_owned(),
                    wanted: "a direction".to_owned(),
                },
                "cell/my.toml: [robot] up = [0, 0, 2], but it has to be a direction",
            ),
            (
                ConfigurationErrorKind::Missing { key: "[plan]", reason: "it states the cell" },
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
