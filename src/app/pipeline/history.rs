//! A lake → the changes over the sessions of each robot.
//!
//! Steps, for one robot:
//! 1. every row of `runs` is read and digested, on object storage every row that has another tag than before (`rows`); a row that cannot be read, a run that is not the current one of its session and
//!    an estimate over several sessions are left out, with the reason;
//! 2. sessions are put in order (`order`): by the first stamp of the controller's log (`clocks.origin_ns`), then by name.
//!    Stamps are the controller's own: where its clock was set back, the order follows it;
//! 3. earlier judgements are taken from the summary next to the lake's tables as far as its digests are those of the rows
//!    today (`summary`); the other sessions are read (`session`), from what is kept of each where it is there, and judged
//!    ([`crate::history`]);
//! 4. the summary is written again where there was a new session.
//!
//! Robots are worked on side by side. The summary and what is kept are no tables of the lake: they can be removed at any time and are then
//! computed again.

mod figures;
mod fleet;
mod order;
mod rows;
pub(in crate::pipeline) mod session;
mod summary;
mod trend;

use std::collections::BTreeMap;
use std::path::PathBuf;

use rayon::prelude::*;
use thiserror::Error;

use crate::files::store::Place;
use crate::io::lake::{Lake, LakeError};
use crate::io::tables::past::PastSession;
use crate::manifest::RunKey;
use crate::progress::Progress;
pub use figures::{figures, figures_of_ends};
pub use fleet::fleet;
use order::{CurrentRow, current, within};
pub use rows::RunResult;
use rows::{Fact, RobotRows, Row};
use summary::{Entry, Summary};
pub use trend::trend;

/// Number of sessions of a robot read at the same time: each takes some tens of megabytes where its tables are read.
const AT_ONCE: usize = 4;

#[derive(Debug, Clone, Default)]
pub struct Asked {
    pub robot: Option<String>,
    pub since: Option<String>,
    pub until: Option<String>,
    /// Whether to judge every session again, without the summary.
    pub fresh: bool,
}

#[derive(Debug, Clone)]
pub struct RobotHistory {
    pub robot: String,
    pub sessions: Vec<PastSession>,
    pub results: Vec<RunResult>,
    /// Runs left out, with place and reason.
    pub left_out: Vec<LeftOut>,
    /// Rows of `runs` in all: those of `sessions` and `left_out`.
    pub runs: usize,
    pub from_summary: usize,
    pub summary_error: Option<String>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    pub place: PathBuf,
    /// Session and run, where the row could be read.
    pub key: Option<RunKey>,
    pub reason: Reason,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Reason {
    Replaced,
    Pooled,
    Plan,
    NotAsked,
    /// A file of it is damaged, missing or not in this lake.
    Unreadable(String),
}

impl Reason {
    /// The reason in a few words, for counting.
    pub const fn word(&self) -> &'static str {
        match self {
            Self::Replaced => "replaced by another run",
            Self::Pooled => "an estimate over several sessions",
            Self::Plan => "a plan",
            Self::NotAsked => "not asked for",
            Self::Unreadable(_) => "not readable",
        }
    }
}

#[derive(Debug, Error)]
pub enum HistoryError {
    #[error("there is no lake in {}: it has no row in runs; name the folder that `posegrid run` printed as its tables", .0)]
    NoLake(Place),
    #[error("{} has no robot {robot:?}; its robots: {}", lake, robots.join(", "))]
    NoRobot { lake: Place, robot: String, robots: Vec<String> },
    #[error(
        "robot {robot:?} has no session {session:?} in its history; `posegrid history` without --since and --until lists its sessions"
    )]
    NoSession { robot: String, session: String },
    #[error(
        "{lake} has no run of a single session of robot {robot:?} that can be read; name the session: pooled for an estimate over \
         several"
    )]
    NoNewest { lake: Place, robot: String },
    #[error(transparent)]
    Lake(#[from] LakeError),
}

/// The history of each robot of a lake, in the order of their names.
pub fn history(
    lake: &Lake,
    asked: &Asked,
    progress: &dyn Progress,
) -> Result<Vec<RobotHistory>, HistoryError> {
    let mut robots = rows::robots(lake)?;
    if let Some(robot) = &asked.robot {
        robots = vec![named(lake, robots, robot)?];
    }
    if robots.is_empty() {
        return Err(HistoryError::NoLake(lake.root()));
    }
    progress.begin("sessions", robots.iter().map(|own| own.files.len() as u64).sum());
    let of_each = || robots.par_iter().map(|own| of_robot(lake, asked, own, progress)).collect();
    let histories = lake.read_with(of_each);
    progress.end();
    histories
}

fn named(lake: &Lake, robots: Vec<RobotRows>, robot: &str) -> Result<RobotRows, HistoryError> {
    let names: Vec<String> = robots.iter().map(RobotRows::robot).collect();
    let place = names.iter().position(|name| name == robot);
    match place.and_then(|place| robots.into_iter().nth(place)) {
        Some(own) => Ok(own),
        None if names.is_empty() => Err(HistoryError::NoLake(lake.root())),
        None => {
            Err(HistoryError::NoRobot { lake: lake.root(), robot: robot.to_owned(), robots: names })
        }
    }
}

/// The current run of the robot's newest session: the one that was measured last.
pub fn newest(lake: &Lake, robot: &str) -> Result<RunKey, HistoryError> {
    let own = named(lake, rows::robots(lake)?, robot)?;
    let rows = lake.read_with(|| own.read(lake, &Summary::read(lake, &own.folder)));
    let newest = lake.read_with(|| current(lake, rows)).0.pop();
    newest
        .map(|row| row.fact.key)
        .ok_or_else(|| HistoryError::NoNewest { lake: lake.root(), robot: own.robot() })
}

fn of_robot(
    lake: &Lake,
    asked: &Asked,
    own: &RobotRows,
    progress: &dyn Progress,
) -> Result<RobotHistory, HistoryError> {
    let summary = if asked.fresh { Summary::default() } else { Summary::read(lake, &own.folder) };
    let (robot, rows) = (own.robot(), own.read(lake, &summary));
    let (runs, all, tags) = (rows.len(), facts_of(&rows), tags_of(&rows));
    let is_written = summary.facts == all && summary.tags == tags;
    let (facts, mut left_out) = current(lake, rows);
    let facts = within(facts, asked, &robot, &mut left_out)?;
    progress.advance((runs - facts.len()) as u64);
    let is_whole = asked.since.is_none() && asked.until.is_none();
    let (mut judged, new) = judge(lake, &facts, summary, asked.fresh, progress);
    (judged.facts, judged.tags) = (all, tags);
    let mut history = RobotHistory {
        robot,
        sessions: Vec::new(),
        results: Vec::new(),
        left_out,
        runs,
        from_summary: facts.len() - new,
        summary_error: None,
    };
    if is_whole && !judged.is_cut && (new > 0 || !is_written) {
        let written = judged.write(lake, &own.folder);
        history.summary_error = written.err().map(|error| error.to_string());
    }
    for (row, entry) in facts.into_iter().zip(judged.entries) {
        history.take(row, entry);
    }
    Ok(history)
}

impl RobotHistory {
    fn take(&mut self, row: CurrentRow, entry: Entry) {
        match entry.judged {
            Ok(judged) => {
                self.results.push(row.fact.result);
                let stamp = row.fact.measured_at_ns;
                let measured_at_ns = stamp.expect("a current run without a stamp is left out");
                self.sessions.push(PastSession { key: row.fact.key, measured_at_ns, judged });
            }
            Err(reason) => self.left_out.push(row.left_out(Reason::Unreadable(reason))),
        }
    }
}

fn facts_of(rows: &[Row]) -> BTreeMap<String, Fact> {
    let fact = |row: &Row| Some((row.digest.clone(), row.fact.as_ref().ok()?.clone()));
    rows.iter().filter_map(fact).collect()
}

/// The digest of each row by its path and tag, where the store has tags.
fn tags_of(rows: &[Row]) -> BTreeMap<(String, String), String> {
    let readable = rows.iter().filter(|row| row.fact.is_ok());
    readable.filter_map(|row| Some((row.tagged.clone()?, row.digest.clone()))).collect()
}

/// The judgement of each row, and the number of rows that had to be read.
fn judge(
    lake: &Lake,
    rows: &[CurrentRow],
    summary: Summary,
    is_fresh: bool,
    progress: &dyn Progress,
) -> (Summary, usize) {
    let read = |row: &CurrentRow| session::read(lake, &row.fact, is_fresh);
    let mut judged = summary.up_to(rows, |row| read(row).is_ok());
    let new = &rows[judged.entries.len()..];
    progress.advance((rows.len() - new.len()) as u64);
    for some in new.chunks(AT_ONCE) {
        let figures: Vec<_> = some.par_iter().map(read).collect();
        for (row, figures) in some.iter().zip(figures) {
            let said = figures.map(|figures| judged.session_history.next(&figures));
            judged.entries.push(Entry { digest: row.digest.clone(), judged: said });
            progress.advance(1);
        }
    }
    (judged, new.len())
}
