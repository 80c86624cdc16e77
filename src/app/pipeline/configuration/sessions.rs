//! Sessions: those to learn from and those that judge, their pieces of work, and those that have to wait.
//!
//! 1. `found` looks into the folder of `[input]`, or `joined` into the lake for sessions as joined; a log that is still being written makes its session wait (`growing`).
//! 2. Named sessions, or all, become pieces of work, alone or pooled. A pool learns from the sessions that are ready; with
//!    one more it is other work.
//! 3. Sessions that wait or are bad are set aside with the reason, and stop no other; a judge that is not ready stops those
//!    that it judges.

mod found;
mod growing;
mod joined;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::tree::Tree;
use super::{ConfigurationError, ConfigurationErrorKind, Overrides, Result, logs};
use crate::ingest::StationsSettings;
use crate::io::lake::Lake;
use crate::io::log::SessionLogs;
use crate::io::station_table::Whose;
use crate::manifest::{Input, RunKey};
use crate::pipeline::file::{InputSection, LogNames, PipelineFile, Pool, SESSION_PLACE, ToldBy};
use found::Found;
pub use found::Session;
pub use joined::Wanted;

pub const POOLED: &str = "pooled";

/// The files that a session was recorded into.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Recorded {
    Logs(SessionLogs),
    Table(SessionTable),
    /// No files: the lake has it as joined.
    Joined(JoinedBefore),
}

impl Recorded {
    /// Its logs; `None` of anything else.
    pub const fn logs(&self) -> Option<&SessionLogs> {
        match self {
            Self::Logs(logs) => Some(logs),
            Self::Table(_) | Self::Joined(_) => None,
        }
    }

    pub fn paths_mut(&mut self) -> Vec<&mut PathBuf> {
        match self {
            Self::Logs(logs) => logs.controller.iter_mut().chain(&mut logs.tracker).collect(),
            Self::Table(table) => vec![&mut table.path],
            Self::Joined(_) => Vec::new(),
        }
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JoinedBefore {
    pub key: RunKey,
    /// The session's own files that it was made from.
    pub inputs: Vec<Input>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SessionTable {
    pub path: PathBuf,
    /// Its robot and its session by the table's columns, where it has columns of them.
    pub whose: Whose,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SessionFiles {
    pub name: String,
    pub recorded: Recorded,
    /// The file of corrected targets that drove it.
    pub corrected: Option<PathBuf>,
}

/// One piece of work: the sessions that one run learns from and is judged on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WorkPiece {
    /// The session of its tables, or `pooled`.
    pub session: String,
    /// Sessions it learns from, in order; tables are for the last.
    pub training: Vec<SessionFiles>,
    /// Sessions that only judge.
    pub test: Vec<SessionFiles>,
}

/// A folder or file among the sessions that is no session, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    pub name: String,
    pub reason: String,
}

/// A session without a piece of work at present.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SetAside {
    pub session: String,
    pub why: Why,
    /// Number of pieces listed before it.
    pub before: usize,
}

impl SetAside {
    fn new(session: &str, why: Why, before: usize) -> Self {
        Self { session: session.to_owned(), why, before }
    }

    pub const fn state(&self) -> &'static str {
        match self.why {
            Why::Waits(_) => "waits",
            Why::Bad(_) => "failed",
        }
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Why {
    /// It is still being written, or one side is not there yet: a later run has it.
    Waits(String),
    Bad(String),
}

impl Why {
    pub fn reason(&self) -> &str {
        match self {
            Self::Waits(reason) | Self::Bad(reason) => reason,
        }
    }

    fn map(&self, words: impl FnOnce(&str) -> String) -> Self {
        match self {
            Self::Waits(reason) => Self::Waits(words(reason)),
            Self::Bad(reason) => Self::Bad(words(reason)),
        }
    }
}

/// The pieces of work, and the sessions without one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Listed {
    pub pieces: Vec<WorkPiece>,
    pub set_aside: Vec<SetAside>,
    pub left_out: Vec<LeftOut>,
}

/// The sessions in the folder of `[input]`, or those that a lake has as joined, and what is no session there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FoundSessions {
    /// By name.
    pub sessions: Vec<Session>,
    /// By name.
    pub left_out: Vec<LeftOut>,
    /// What tells them; `None` of those that a lake has as joined.
    by: Option<ToldBy>,
}

/// Searches the sessions of a pipeline file: `folder` is its `[input] folder`, resolved, in `tree`.
pub(in crate::pipeline) fn look(
    path: &Path,
    tree: &Tree,
    folder: &Path,
    file: &PipelineFile,
) -> Result<FoundSessions> {
    let (input, stations) = (&file.input, file.stations.as_ref());
    let logs = [("controller", &input.controller), ("tracker", &input.tracker)];
    let table = input.stations.as_ref().map(|names| ("stations", names));
    let named = logs.into_iter().filter(|_| table.is_none()).chain(table);
    for (key, names) in named {
        name_sessions(path, key, names, input.sessions_by)?;
    }
    by_what_there_is(path, input, stations)?;
    let (robot, limits) = (file.robot.name.as_deref(), file.limits);
    let (sessions, left_out) = (Vec::new(), Vec::new());
    let mut found = Found { tree, folder, input, stations, robot, limits, sessions, left_out };
    found.look().map_err(|source| {
        let folder = folder.to_owned();
        ConfigurationErrorKind::Folder { folder, source }.at(path)
    })?;
    let Found { sessions, left_out, .. } = found;
    Ok(FoundSessions { sessions, left_out, by: Some(input.sessions_by) })
}

impl FoundSessions {
    /// Sessions that were found elsewhere.
    pub const fn of(sessions: Vec<Session>) -> Self {
        Self { sessions, left_out: Vec::new(), by: Some(ToldBy::Folder) }
    }

    /// These sessions alone.
    #[must_use]
    pub fn only(&self, sessions: Vec<Session>) -> Self {
        Self { sessions, left_out: Vec::new(), by: self.by }
    }

    /// The session of that name; a bad one where there is none.
    fn named(&self, name: &str) -> Session {
        let found = self.sessions.iter().find(|session| session.name == name);
        found.cloned().unwrap_or_else(|| Session {
            name: name.to_owned(),
            recorded: Err(Why::Bad(self.not_there(name))),
            corrected: None,
            robot: None,
        })
    }

    fn not_there(&self, name: &str) -> String {
        let Some(by) = self.by else { return "the lake does not have it as joined".to_owned() };
        let left = self.left_out.iter().find(|left| left.name == name);
        match (left, by) {
            (Some(left), _) => left.reason.clone(),
            (None, ToldBy::Folder) if name.contains('/') => {
                "a session is named by its folder's name, not by a path".to_owned()
            }
            (None, ToldBy::Folder) => "there is no such folder".to_owned(),
            (None, _) => "no file names it".to_owned(),
        }
    }
}

/// Sessions that there may be work with.
pub(super) struct Candidates {
    pub(super) found: FoundSessions,
    /// Where they were looked for.
    pub(super) place: PathBuf,
    pub(super) wanted: String,
}

impl Candidates {
    /// The sessions that a lake has as joined.
    pub(super) fn joined(lake: &Lake, wanted: &Wanted<'_>) -> Result<Self> {
        let found = joined::sessions(lake, wanted)?;
        let wanted = "a row of joined_sessions, which `posegrid run --until session` writes";
        Ok(Self { found, place: lake.root().named(), wanted: wanted.to_owned() })
    }

    pub(super) fn listed(&self, input: &InputSection, overrides: &Overrides) -> Result<Listed> {
        let given = |names: &[String]| (!names.is_empty()).then(|| names.to_vec());
        let test = given(&overrides.test).unwrap_or_else(|| input.test.clone());
        let named = given(&overrides.sessions).or_else(|| input.sessions.clone());
        named_once(named.as_deref().unwrap_or_default(), &test)?;
        named_once(&test, &[])?;
        let of_name = |name: &String| self.found.named(name);
        let training: Vec<Session> = if let Some(names) = &named {
            names.iter().map(of_name).collect()
        } else {
            self.found.sessions.iter().filter(|own| !test.contains(&own.name)).cloned().collect()
        };
        let judges: Vec<Session> = test.iter().map(of_name).collect();
        let latest = input.pool_latest.unwrap_or(usize::MAX);
        let (pieces, set_aside) = pieces(input.pool, latest, &training, &judges);
        let waits = |aside: &SetAside| matches!(aside.why, Why::Waits(_));
        if pieces.is_empty() && !set_aside.iter().any(waits) {
            return Err(self.nothing(&training, &judges));
        }
        Ok(Listed {
            pieces,
            set_aside,
            // Entries that are no session matter only where every session is asked for.
            left_out: named.map_or_else(|| self.found.left_out.clone(), |_| Vec::new()),
        })
    }

    /// The error where there is nothing to do and nothing to wait for.
    fn nothing(&self, training: &[Session], judges: &[Session]) -> ConfigurationError {
        let bad = training.iter().chain(judges).find_map(|session| {
            let why = session.files().err()?;
            Some((session.name.clone(), why.reason().to_owned()))
        });
        if let Some((session, reason)) = bad {
            return ConfigurationError::Session {
                session,
                reason,
                folder: self.place.clone(),
                found: self.found.sessions.iter().map(|s| s.name.clone()).collect(),
            };
        }
        let left = self.found.left_out.iter();
        ConfigurationError::NoSessions {
            folder: self.place.clone(),
            wanted: self.wanted.clone(),
            left_out: left.map(|left| format!("{} ({})", left.name, left.reason)).collect(),
        }
    }
}

/// Checks that sessions are made by something that their files have.
fn by_what_there_is(
    path: &Path,
    input: &InputSection,
    stations: Option<&StationsSettings>,
) -> Result<()> {
    let has_column = stations.is_some_and(|stations| stations.session.is_some());
    let (found, wanted) = match (input.sessions_by, stations.is_some()) {
        (ToldBy::Column, false) => {
            ("column", "\"folder\", \"file_name\" or \"metadata\": logs have no columns")
        }
        (ToldBy::Metadata, true) => {
            ("metadata", "\"folder\", \"file_name\" or \"column\": tables have no metadata")
        }
        (ToldBy::Column, true) if !has_column => {
            ("column", "with [stations] session, the column that names a row's session")
        }
        (ToldBy::Folder | ToldBy::FileName, true) if has_column => {
            ("not column", "\"column\", as [stations] session names a column of sessions")
        }
        _ => return Ok(()),
    };
    let setting =
        ConfigurationErrorKind::setting("[input] sessions_by", format!("{found:?}"), wanted);
    Err(setting.at(path))
}

/// Checks that names have `{session}` in their last part where sessions are found by it, and nowhere else.
fn name_sessions(path: &Path, key: &str, names: &LogNames, by: ToldBy) -> Result<()> {
    let wanted = match by {
        ToldBy::FileName => {
            "names with one {session} in their last part, as sessions_by = \"file_name\" asks"
        }
        _ => {
            "names of files without {session}, which only sessions_by = \"file_name\" gives a meaning to"
        }
    };
    let places = |pattern: &String| {
        let last = Path::new(pattern).file_name().unwrap_or_default();
        let last = last.to_string_lossy().matches(SESSION_PLACE).count();
        (pattern.matches(SESSION_PLACE).count(), last)
    };
    let right = usize::from(by == ToldBy::FileName);
    let patterns = names.patterns();
    if !patterns.is_empty() && patterns.iter().all(|pattern| places(pattern) == (right, right)) {
        return Ok(());
    }
    let (key, found) = (format!("[input] {key}"), format!("{:?}", names.to_string()));
    Err(ConfigurationErrorKind::setting(key, found, wanted).at(path))
}

/// The pieces of the sessions that are ready, pools of at most the `latest` so many of them, and the other sessions.
fn pieces(
    pool: Pool,
    latest: usize,
    training: &[Session],
    judges: &[Session],
) -> (Vec<WorkPiece>, Vec<SetAside>) {
    let (mut pieces, mut set_aside) = (Vec::new(), Vec::new());
    let mut ready: Vec<SessionFiles> = Vec::new();
    // Those that a session would judge which is not ready have no work.
    let test: Result<Vec<SessionFiles>, Why> = judges
        .iter()
        .map(|own| {
            let not_yet = |why: &Why| why.map(|reason| format!("{} judges it: {reason}", own.name));
            own.files().map_err(not_yet)
        })
        .collect();
    let mut add = |name: &str, training: &[SessionFiles], aside: &mut Vec<SetAside>| match &test {
        Ok(test) => pieces.push(WorkPiece {
            session: name.to_owned(),
            training: training.to_vec(),
            test: test.clone(),
        }),
        Err(why) => aside.push(SetAside::new(name, why.clone(), 0)),
    };
    let mut listed = 0;
    for session in training {
        match (session.files(), pool) {
            (Err(why), Pool::Each) => {
                set_aside.push(SetAside::new(&session.name, why.clone(), listed));
            }
            (Err(why), Pool::All | Pool::Until) => {
                let why = why.map(|reason| format!("{reason}; the pool learns without it"));
                set_aside.push(SetAside::new(&session.name, why, listed));
            }
            (Ok(files), pool) => {
                ready.push(files);
                let most = if pool == Pool::Each { 1 } else { latest };
                if pool != Pool::All {
                    add(&session.name, last(&ready, most), &mut set_aside);
                    listed += 1;
                }
            }
        }
    }
    if pool == Pool::All && !ready.is_empty() {
        add(POOLED, last(&ready, latest), &mut set_aside);
    }
    (pieces, set_aside)
}

/// The last so many, or all where they are fewer.
fn last<T>(all: &[T], most: usize) -> &[T] {
    &all[all.len().saturating_sub(most)..]
}

impl Session {
    fn files(&self) -> Result<SessionFiles, &Why> {
        let files = |recorded: &Recorded| SessionFiles {
            name: self.name.clone(),
            recorded: recorded.clone(),
            corrected: self.corrected.clone(),
        };
        self.recorded.as_ref().map(files)
    }
}

impl WorkPiece {
    /// Each session of these pieces by itself, in their order.
    pub fn each_session(pieces: &[Self]) -> Vec<Self> {
        let mut seen = BTreeSet::new();
        let sessions = pieces.iter().flat_map(|own| own.training.iter().chain(&own.test));
        let sessions = sessions.filter(|files| seen.insert(files.name.clone()));
        let piece = |files: &SessionFiles| Self {
            session: files.name.clone(),
            training: vec![files.clone()],
            test: Vec::new(),
        };
        sessions.map(piece).collect()
    }
}

fn named_once(names: &[String], test: &[String]) -> Result<()> {
    let mut seen = BTreeSet::new();
    for name in names {
        let how = if !seen.insert(name) {
            "twice"
        } else if test.contains(name) {
            "to learn from and under test"
        } else {
            continue;
        };
        return Err(ConfigurationError::NamedTwice { session: name.clone(), how });
    }
    Ok(())
}
