//! The contents of the sessions' folder: a sub-folder for each session, or files that name theirs.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

mod tables;

use super::growing::growing;
use super::{LeftOut, POOLED, Recorded, SessionTable, Tree, Why, logs};
use crate::files::input::Bound;
use crate::ingest::StationsSettings;
use crate::io::lake;
use crate::io::log::{Limits, SessionLogs, session_record};
use crate::pipeline::file::{InputSection, LogNames, SESSION_PLACE, ToldBy};
use logs::Lack;

/// A session as found: with its files, or why there is no work with it at present.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Session {
    pub name: String,
    pub recorded: Result<Recorded, Why>,
    /// The file of corrected targets that drove it.
    pub corrected: Option<PathBuf>,
    /// The robot that its rows name, where tables have a column of robots.
    pub robot: Option<String>,
}

/// Files of one side, or why there are none.
type Side = Result<Vec<PathBuf>, Lack>;

/// All sessions in the sessions' folder.
#[derive(Debug)]
pub struct Found<'a> {
    pub tree: &'a Tree,
    pub folder: &'a Path,
    pub input: &'a InputSection,
    pub stations: Option<&'a StationsSettings>,
    /// The robot whose rows are meant, where tables have a column of robots; `None`: those of all of them.
    pub robot: Option<&'a str>,
    pub limits: Limits,
    /// By name.
    pub sessions: Vec<Session>,
    /// By name.
    pub left_out: Vec<LeftOut>,
}

impl Found<'_> {
    pub fn look(&mut self) -> io::Result<()> {
        match (&self.input.stations, self.input.sessions_by) {
            (Some(names), _) => self.tables(names)?,
            (None, ToldBy::Folder) => self.by_folder()?,
            (None, ToldBy::FileName) => self.by_file_name()?,
            (None, ToldBy::Metadata | ToldBy::Column) => self.by_metadata()?,
        }
        self.names_are_sound();
        Ok(())
    }

    fn by_folder(&mut self) -> io::Result<()> {
        let (tree, input) = (self.tree, self.input);
        for path in tree.entries(self.folder)? {
            let name = name_of(&path);
            if tree.is_dir(&path) {
                let controller = logs::find(tree, &path, &input.controller);
                let tracker = logs::find(tree, &path, &input.tracker);
                let corrected = logs::at_most_one(tree, &path, &input.corrected_targets);
                self.add(name, [controller, tracker], corrected);
            } else if !tree.is_file(&path) {
                self.leave_out(name, "it is a link that leads nowhere".to_owned());
            }
        }
        Ok(())
    }

    fn by_file_name(&mut self) -> io::Result<()> {
        let mut controllers = logs::find_named(self.tree, self.folder, &self.input.controller)?;
        let mut trackers = logs::find_named(self.tree, self.folder, &self.input.tracker)?;
        let names: BTreeSet<String> = controllers.keys().chain(trackers.keys()).cloned().collect();
        for name in names {
            let absent =
                |names: &LogNames| Err(Lack::Absent(format!("there is no {}", names.of(&name))));
            let controller = controllers.remove(&name);
            let tracker = trackers.remove(&name);
            let sides = [
                controller.unwrap_or_else(|| absent(&self.input.controller)),
                tracker.unwrap_or_else(|| absent(&self.input.tracker)),
            ];
            self.add(name.clone(), sides, self.corrected_of(&name));
        }
        Ok(())
    }

    fn by_metadata(&mut self) -> io::Result<()> {
        if !matches!(self.tree, Tree::Folder) {
            return Err(io::Error::other(
                "sessions_by = \"metadata\" opens every file, and these are on object storage: use \"folder\" or \"file_name\"",
            ));
        }
        let controllers = logs::all(self.tree, self.folder, &self.input.controller)?;
        let trackers = logs::all(self.tree, self.folder, &self.input.tracker)?;
        let files: BTreeSet<&PathBuf> = controllers.iter().chain(&trackers).collect();
        let mut sides: BTreeMap<String, [Vec<PathBuf>; 2]> = BTreeMap::new();
        for path in files {
            match self.recorded_name(path) {
                Err(reason) => self.leave_out(name_of(path), reason),
                Ok(session) => {
                    let both = sides.entry(session).or_default();
                    for (side, files) in both.iter_mut().zip([&controllers, &trackers]) {
                        side.extend(files.contains(path).then(|| path.clone()));
                    }
                }
            }
        }
        for (session, [controller, tracker]) in sides {
            let controller = only_one(controller, "controller's", &self.input.controller);
            let tracker = only_one(tracker, "tracker's", &self.input.tracker);
            let corrected = self.corrected_of(&session);
            self.add(session, [controller, tracker], corrected);
        }
        Ok(())
    }

    /// The corrected targets of a session whose files are among those of others: their name has to contain the session's.
    fn corrected_of(&self, session: &str) -> Result<Option<PathBuf>, Lack> {
        let names = &self.input.corrected_targets;
        if names.patterns().iter().all(|pattern| pattern.contains(SESSION_PLACE)) {
            logs::at_most_one(self.tree, self.folder, &names.of(session))
        } else {
            Ok(None)
        }
    }

    /// The session that a log's metadata names.
    fn recorded_name(&self, path: &Path) -> Result<String, String> {
        let record = session_record(path, self.limits).map_err(|error| error.to_string())?;
        if let Some(name) = record.get("session").filter(|name| !name.is_empty()) {
            return Ok(name.clone());
        }
        let nothing = "it has no metadata record `session` with a `session`";
        let grows = growing(path, self.settle(), self.limits);
        Err(grows.map_or_else(|| nothing.to_owned(), |grows| format!("{nothing}; {grows}")))
    }

    /// Adds a session, or leaves out a folder that has neither side.
    fn add(&mut self, name: String, sides: [Side; 2], corrected: Result<Option<PathBuf>, Lack>) {
        let [controller, tracker] = sides;
        let (corrected, tracker) = match corrected {
            Ok(corrected) => (corrected, tracker),
            Err(lack) => (None, Err(lack)),
        };
        let logs = match (controller, tracker) {
            (Err(Lack::Absent(one)), Err(Lack::Absent(other))) => {
                let reason = if one == other { one } else { format!("{one}, and {other}") };
                return self.leave_out(name, reason);
            }
            (Err(Lack::Wrong(reason)), _) | (_, Err(Lack::Wrong(reason))) => Err(Why::Bad(reason)),
            (Err(Lack::Absent(reason)), _) | (_, Err(Lack::Absent(reason))) => {
                Err(Why::Waits(format!("{reason} yet")))
            }
            (Ok(controller), Ok(tracker)) => self.settled(SessionLogs { controller, tracker }),
        };
        let recorded = logs.map(Recorded::Logs);
        self.sessions.push(Session { name, recorded, corrected, robot: None });
    }

    /// The logs, unless one of them is still being written.
    fn settled(&self, logs: SessionLogs) -> Result<SessionLogs, Why> {
        let mut paths = logs.controller.iter().chain(&logs.tracker);
        let grows = paths.find_map(|path| growing(path, self.settle(), self.limits));
        grows.map_or(Ok(logs), |grows| Err(Why::Waits(grows)))
    }

    const fn settle(&self) -> Duration {
        Duration::from_secs(self.input.settle_s)
    }

    fn leave_out(&mut self, name: String, reason: String) {
        self.left_out.push(LeftOut { name, reason });
    }

    /// Leaves out sessions with a reserved name, or with a name that two have.
    fn names_are_sound(&mut self) {
        let named = |session: &Session| (session.name.clone(), session.robot.clone());
        let mut counts: BTreeMap<(String, Option<String>), usize> = BTreeMap::new();
        for session in &self.sessions {
            *counts.entry(named(session)).or_default() += 1;
        }
        self.sessions.dedup_by(|later, first| named(later) == named(first));
        for session in &mut self.sessions {
            if session.name == POOLED {
                let reason =
                    format!("{POOLED:?} is what pooled fits are named; rename the session");
                session.recorded = Err(Why::Bad(reason));
            } else if let Err(error) = lake::check_name("session", &session.name) {
                session.recorded = Err(Why::Bad(error.to_string()));
            } else if counts[&named(session)] > 1 {
                let reason = "two folders have this name, as far as it is text; rename one";
                session.recorded = Err(Why::Bad(reason.to_owned()));
            }
        }
    }
}

/// Metadata alone does not show whether two files are one recording or two.
fn only_one(files: Vec<PathBuf>, side: &str, names: &LogNames) -> Side {
    match &files[..] {
        [] => Err(Lack::Absent(format!("no file of {names} names it"))),
        [_] => Ok(files),
        several => {
            let names: Vec<_> = several.iter().map(|path| name_of(path)).collect();
            Err(Lack::Wrong(format!(
                "{} all state that they are its {side} log; a session has one file a side here (with sessions_by = \
                 \"file_name\" a split recording has several)",
                names.join(", ")
            )))
        }
    }
}

fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
