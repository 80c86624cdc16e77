//! Sessions by the robots that their logs' metadata, or the columns of their tables, name.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};

use crate::io::log::{Limits, SessionLogs, session_record};
use crate::pipeline::configuration::{
    ConfigurationError, ConfigurationErrorKind, FoundSessions, Recorded, Result, Robots, Session,
    Tree, Why, logs, look,
};
use crate::pipeline::file::{PipelineFile, ROBOT_PLACE, SESSION_PLACE, ToldBy};

#[derive(Debug, Clone)]
pub struct ByRobot {
    pub found: FoundSessions,
    sessions: BTreeMap<String, Vec<Session>>,
}

impl ByRobot {
    /// Searches the sessions of all robots once, and reads the robot that each names: in its logs' metadata, or in a column of its table.
    /// Those of no robot come with the reason.
    pub fn found(within: &Within<'_>) -> Result<(Self, Vec<(String, Why)>)> {
        check(within)?;
        let mut found = look(within.path, within.tree, within.folder, within.file)?;
        let all = std::mem::take(&mut found.sessions);
        let mut sessions: BTreeMap<String, Vec<Session>> = BTreeMap::new();
        let mut told = Vec::new();
        for session in all {
            let robot = match &session.robot {
                Some(robot) => Ok(robot.clone()),
                None => robot_of(&session, within.file.limits),
            };
            match robot {
                Ok(robot) if within.robots.names().any(|own| own == robot) => {
                    sessions.entry(robot).or_default().push(session);
                }
                Ok(robot) => told.push(unknown(session, &robot)),
                Err(why) => told.push((session.name, why)),
            }
        }
        told.dedup();
        Ok((Self { found, sessions }, told))
    }

    pub fn of(&self, robot: &str) -> FoundSessions {
        let own = self.sessions.get(robot);
        self.found.only(own.cloned().unwrap_or_default())
    }
}

/// Name and reason by which an unknown robot is reported: the session where it has logs, the robot where it has tables, each once.
fn unknown(session: Session, robot: &str) -> (String, Why) {
    let not_known = "no robot of the pipeline file is called so";
    if session.robot.is_some() {
        let reason = format!("{not_known}, as rows of tables state: add it to the robots");
        return (robot.to_owned(), Why::Waits(reason));
    }
    (session.name, Why::Waits(format!("its logs are of {robot:?}, and {not_known}")))
}

/// The robot that a session's logs name, or why they name none.
fn robot_of(session: &Session, limits: Limits) -> Result<String, Why> {
    let recorded = session.recorded.as_ref().map_err(Clone::clone)?;
    let Recorded::Logs(SessionLogs { controller, tracker }) = recorded else {
        return Err(Why::Bad("it has no logs, whose metadata name the robot".to_owned()));
    };
    let mut named: Option<(String, &PathBuf)> = None;
    for path in controller.iter().chain(tracker) {
        let record = session_record(path, limits).map_err(|error| Why::Bad(error.to_string()))?;
        let Some(robot) = record.get("robot").filter(|name| !name.is_empty()) else { continue };
        match &named {
            Some((other, at)) if other != robot => {
                let (at, path) = (at.display(), path.display());
                return Err(Why::Bad(format!("{at} is of {other:?}, and {path} of {robot:?}")));
            }
            _ => named = Some((robot.clone(), path)),
        }
    }
    let nothing = "its logs have no metadata record `session` with a `robot`";
    named.map(|(robot, _)| robot).ok_or_else(|| Why::Waits(nothing.to_owned()))
}

/// Checks that sessions are of a kind, and in a place, that names robots so.
fn check(within: &Within<'_>) -> Result<()> {
    let (by, are_tables) = (within.robots.by, within.file.input.stations.is_some());
    let has_column = within.file.stations.as_ref().is_some_and(|own| own.robot.is_some());
    let is_here = matches!(within.tree, Tree::Folder);
    let (found, wanted) = match by {
        ToldBy::Column if !are_tables => {
            ("column", "\"folder\", \"file_name\" or \"metadata\": logs have no columns")
        }
        ToldBy::Column if !has_column => {
            ("column", "with [stations] robot, the column that names a row's robot")
        }
        ToldBy::Column if !is_here => (
            "column",
            "\"folder\" or \"file_name\": it opens every table, and these are on object storage",
        ),
        ToldBy::Metadata if are_tables => {
            ("metadata", "\"folder\", \"file_name\" or \"column\": tables have no metadata")
        }
        ToldBy::Metadata if !is_here => (
            "metadata",
            "\"folder\" or \"file_name\": it opens every file, and these are on object storage",
        ),
        _ => return Ok(()),
    };
    let kind = ConfigurationErrorKind::setting("[input] robots_by", format!("{found:?}"), wanted);
    Err(kind.at(within.path))
}

#[derive(Clone, Copy)]
pub struct Within<'a> {
    pub path: &'a Path,
    pub tree: &'a Tree,
    pub folder: &'a Path,
    /// The pipeline file with the sessions of every robot.
    pub file: &'a PipelineFile,
    pub robots: &'a Robots,
}

impl Within<'_> {
    pub fn folders_of_no_robot(&self) -> Result<Vec<(String, Why)>> {
        let entries = self.tree.entries(self.folder).map_err(|source| self.unread(source))?;
        let known = self.robots.stated.iter().map(|stated| {
            let folder = stated.entry.folder.as_ref().unwrap_or(&stated.entry.name);
            folder.split('/').next().unwrap_or_default()
        });
        let known: BTreeSet<&str> = known.collect();
        let folders = entries.iter().filter(|path| self.tree.is_dir(path));
        let names = folders.map(|path| path.file_name().unwrap_or_default().to_string_lossy());
        let strange = names.filter(|name| !known.contains(&**name) && !name.starts_with('.'));
        let told = |name| {
            let reason = "no robot of the pipeline file has this folder: add it to the robots, or state its `folder`";
            (name, Why::Waits(reason.to_owned()))
        };
        Ok(strange.map(|name| told(name.into_owned())).collect())
    }

    /// Files whose names have a robot in the place of `{robot}` that is not known, by what stands there.
    pub fn files_of_no_robot(&self) -> Result<Vec<(String, Why)>> {
        let mut strange: BTreeMap<String, BTreeSet<PathBuf>> = BTreeMap::new();
        let known: BTreeSet<&str> = self.robots.names().collect();
        for folder in self.folders().map_err(|source| self.unread(source))? {
            for pattern in self.robots.patterns() {
                let pattern = pattern.replace(SESSION_PLACE, "*");
                let named = logs::named(self.tree, &folder, &pattern, ROBOT_PLACE);
                let named = named.map_err(|source| self.unread(source))?;
                for (robot, path) in named {
                    if !known.contains(robot.as_str())
                        && !self.is_of_known(&folder, &pattern, &path)
                    {
                        strange.entry(robot).or_default().insert(path);
                    }
                }
            }
        }
        Ok(strange.into_iter().map(of_files).collect())
    }

    fn folders(&self) -> io::Result<Vec<PathBuf>> {
        if self.file.input.sessions_by != ToldBy::Folder {
            return Ok(vec![self.folder.to_owned()]);
        }
        let entries = self.tree.entries(self.folder)?.into_iter();
        Ok(entries.filter(|path| self.tree.is_dir(path)).collect())
    }

    /// Whether a file's name has a known robot in its place.
    fn is_of_known(&self, folder: &Path, pattern: &str, path: &Path) -> bool {
        let name = path.to_string_lossy();
        let mut named = self.robots.names().filter(|robot| name.contains(robot));
        named.any(|robot| logs::is_matched(folder, &pattern.replace(ROBOT_PLACE, robot), path))
    }

    fn unread(&self, source: io::Error) -> ConfigurationError {
        let folder = self.folder.to_owned();
        ConfigurationErrorKind::Folder { folder, source }.at(self.path)
    }
}

/// The message about a robot that no file of the pipeline describes: its recordings, by the name of the first and their number.
fn of_files((robot, files): (String, BTreeSet<PathBuf>)) -> (String, Why) {
    let first = files.iter().next().and_then(|path| path.file_name());
    let first = first.unwrap_or_default().to_string_lossy();
    let others = match files.len() {
        0 | 1 => String::new(),
        2 => " and another file".to_owned(),
        several => format!(" and {} other files", several - 1),
    };
    let reason = format!(
        "no robot of the pipeline file is called so, as {first}{others} state: add it to the robots"
    );
    (robot, Why::Waits(reason))
}
