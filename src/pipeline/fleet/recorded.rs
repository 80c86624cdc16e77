//! Sessions by the robots that their logs' metadata names.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::strangers::Within;
use crate::io::log::{Limits, SessionLogs, session_record};
use crate::pipeline::configuration::{
    ConfigurationError, ConfigurationErrorKind, FoundSessions, LeftOut, Recorded, Session, Tree,
    Why, look,
};

/// Found sessions by their robots.
#[derive(Debug, Clone)]
pub struct ByRobot {
    found: FoundSessions,
    sessions: BTreeMap<String, Vec<Session>>,
}

impl ByRobot {
    /// Searches the sessions of all robots once, and reads the robot that each names; those of no robot come with the reason.
    pub fn found(within: &Within<'_>) -> Result<(Self, Vec<(String, Why)>), ConfigurationError> {
        let stations = within.file.input.stations.is_some();
        if stations || !matches!(within.tree, Tree::Folder) {
            return Err(refused(within, stations));
        }
        let mut found = look(within.path, within.tree, within.folder, within.file)?;
        let all = std::mem::take(&mut found.sessions);
        let mut sessions: BTreeMap<String, Vec<Session>> = BTreeMap::new();
        let mut told = Vec::new();
        for session in all {
            match robot_of(&session, within.file.limits) {
                Ok(robot) if within.robots.names().any(|own| own == robot) => {
                    sessions.entry(robot).or_default().push(session);
                }
                Ok(robot) => told.push((session.name, unknown(&robot))),
                Err(why) => told.push((session.name, why)),
            }
        }
        Ok((Self { found, sessions }, told))
    }

    /// The sessions of one robot.
    pub fn of(&self, robot: &str) -> FoundSessions {
        let own = self.sessions.get(robot);
        self.found.only(own.cloned().unwrap_or_default())
    }

    /// Folders and files that are no session.
    pub fn left_out(&self) -> Vec<LeftOut> {
        self.found.left_out.clone()
    }
}

fn unknown(robot: &str) -> Why {
    Why::Waits(format!(
        "its logs are of {robot:?}, and no robot of the pipeline file is called so"
    ))
}

/// The robot that a session's logs name, or why they name none.
fn robot_of(session: &Session, limits: Limits) -> Result<String, Why> {
    let recorded = session.recorded.as_ref().map_err(Clone::clone)?;
    let Recorded::Logs(SessionLogs {
        controller,
        tracker,
    }) = recorded
    else {
        return Err(Why::Bad(
            "it has no logs, whose metadata name the robot".to_owned(),
        ));
    };
    let mut named: Option<(String, &PathBuf)> = None;
    for path in controller.iter().chain(tracker) {
        let record = session_record(path, limits).map_err(|error| Why::Bad(error.to_string()))?;
        let Some(robot) = record.get("robot").filter(|name| !name.is_empty()) else {
            continue;
        };
        match &named {
            Some((other, at)) if other != robot => {
                return Err(Why::Bad(format!(
                    "{} is of {other:?}, and {} of {robot:?}",
                    at.display(),
                    path.display()
                )));
            }
            _ => named = Some((robot.clone(), path)),
        }
    }
    let nothing = "its logs have no metadata record `session` with a `robot`";
    named
        .map(|(robot, _)| robot)
        .ok_or_else(|| Why::Waits(nothing.to_owned()))
}

fn refused(within: &Within<'_>, are_tables: bool) -> ConfigurationError {
    let reason = if are_tables {
        "tables have no metadata"
    } else {
        "it opens every file, and these are on object storage"
    };
    let kind = ConfigurationErrorKind::Setting {
        key: "[input] robots_by".to_owned(),
        found: "\"metadata\"".to_owned(),
        wanted: format!("\"folder\" or \"file_name\": {reason}"),
    };
    kind.at(within.path)
}
