//! `posegrid history`: accuracy over time and drift, from the tables of a lake.
//!
//! Exit codes: 0 the newest session of every robot is where it was and in control; 3 one is not, or some run could not be
//! read; 1 a robot has no session, or output cannot be written; 2 bad usage, or no such lake, robot or session.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use clap::Args;
use thiserror::Error;

use super::messages::{self, Printable};
use super::progress::Bars;
use super::{BAD_USAGE, DONE, NO_RESULT, NOT_MET};
use crate::history::FALSE_ALARM;
use crate::io::lake::Lake;
use crate::io::table::{Table, write};
use crate::io::tables::PublishError;
use crate::io::tables::{drift, history as history_table};
use crate::io::whole_file::replace_whole;
use crate::manifest::RunKey;
use crate::pipeline::history::{
    Asked, Figure, HistoryError, LeftOut, PastSession, Reason, RobotHistory, figures, history,
    trend,
};

/// Changes told on stdout, the newest ones.
const TOLD: usize = 3;

/// What changed over the sessions of each robot: accuracy, base, target and joints, tested with their covariances.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Each session's current run is held against all sessions before it, pooled: what moved, base, target or which joint, or what
cannot be told apart. A session without any change has a false alarm once in 1000 at most. Control charts (EWMA of
self-starting scores) tell whether accuracy and places keep their ordinary level; all charts of a robot together have one
false alarm in 1000 sessions at most. Sessions are in the order of the first stamps of their controller logs.

What was judged is kept in LAKE/.history, checked against the rows of runs each time; --fresh does without.

Examples:
  posegrid history lake
  posegrid history lake --robot ur10 --output trend     # trend/history.parquet, drift.parquet and ur10.html

Exit codes: 0 every robot's newest session is where it was and in control; 3 one is not, or a run could not be read; 1 a robot
has no session, or the output cannot be written; 2 bad usage, or no such lake, robot or session.")]
pub struct HistoryArgs {
    /// The folder of the published tables
    pub lake: PathBuf,
    /// Only this robot
    #[arg(long, value_name = "ROBOT")]
    pub robot: Option<String>,
    /// From this session on: nothing before it takes part
    #[arg(long, value_name = "SESSION")]
    pub since: Option<String>,
    /// Up to this session
    #[arg(long, value_name = "SESSION")]
    pub until: Option<String>,
    /// Write the tables history and drift and a page for each robot into this folder, in place of those of last time
    #[arg(long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Judge every session anew, without what was kept
    #[arg(long)]
    pub fresh: bool,
}

/// Why there is no history.
#[derive(Debug, Error)]
enum HistoryCommandError {
    #[error(transparent)]
    History(#[from] HistoryError),
    #[error(transparent)]
    Tables(#[from] PublishError),
    #[error("cannot write {}: {source}; check the space and the permissions of the folder", path.display())]
    Write { path: PathBuf, source: io::Error },
}

/// Tells the history; gives the exit code.
pub fn run(args: &HistoryArgs, bars: &Bars) -> u8 {
    match told(args, bars) {
        Ok(robots) => exit_code(&robots),
        Err(error) => {
            tracing::error!("{}", Printable(&error.to_string()));
            match error {
                HistoryCommandError::History(_) => BAD_USAGE,
                HistoryCommandError::Tables(_) | HistoryCommandError::Write { .. } => NO_RESULT,
            }
        }
    }
}

fn told(args: &HistoryArgs, bars: &Bars) -> Result<Vec<RobotHistory>, HistoryCommandError> {
    let lake = Lake::new(&args.lake);
    let asked = Asked {
        robot: args.robot.clone(),
        since: args.since.clone(),
        until: args.until.clone(),
        fresh: args.fresh,
    };
    let robots = history(&lake, &asked, &bars.of("history"))?;
    for robot in &robots {
        warn(robot);
        for line in words(robot) {
            messages::result(Printable(&line));
        }
    }
    if let Some(folder) = &args.output {
        let written = output(&lake, &robots, folder)?;
        for path in written {
            messages::result(format!(
                "written: {}",
                Printable(&path.display().to_string())
            ));
        }
    }
    Ok(robots)
}

fn warn(robot: &RobotHistory) {
    for LeftOut { reason, .. } in &robot.left_out {
        if let Reason::Unreadable(reason) = reason {
            tracing::warn!("left out: {}", Printable(reason));
        }
    }
    if let Some(error) = &robot.summary_error {
        tracing::warn!(
            "what was judged cannot be kept in the lake's folder .history: {}; the next time takes as long",
            Printable(error)
        );
    }
}

fn words(robot: &RobotHistory) -> Vec<String> {
    let count = robot.sessions.len();
    let mut lines = Vec::new();
    if let Some(last) = robot.sessions.last() {
        lines.push(format!("newest: {}", newest(last)));
        lines.push(in_control(last));
    }
    lines.extend(changes(robot));
    lines.extend(left_out(robot));
    let expected = FALSE_ALARM * count as f64;
    lines.push(format!(
        "false alarms to expect of {count} sessions: {expected:.1} by the test, {expected:.1} by the charts, at most"
    ));
    let indented = lines.iter().map(|line| format!("  {line}"));
    [headline(robot)].into_iter().chain(indented).collect()
}

fn headline(robot: &RobotHistory) -> String {
    let text = format!("{}: {} sessions", robot.robot, robot.sessions.len());
    match (robot.sessions.first(), robot.sessions.last()) {
        (Some(first), Some(last)) => {
            format!("{text}, {} to {}", first.key.session, last.key.session)
        }
        _ => text,
    }
}

fn newest(session: &PastSession) -> String {
    let judged = &session.judged;
    let what = judged
        .in_words()
        .unwrap_or_else(|| "nothing moved".to_owned());
    match judged.against {
        0 if judged.began.is_empty() => "the first, nothing to hold it against".to_owned(),
        0 => format!(
            "begins segment {}, as {} changed: nothing to hold it against",
            judged.segment,
            judged.began.join(", ")
        ),
        1 => format!("{what}, against the session before"),
        count => format!("{what}, against {count} sessions before"),
    }
}

fn in_control(session: &PastSession) -> String {
    let charted = &session.judged.charted;
    let out: Vec<&str> = session.judged.out_of_control().collect();
    let shown = charted.iter().filter(|one| one.is_out().is_some()).count();
    if shown == 0 {
        "control charts: not shown, they need three sessions of one segment".to_owned()
    } else if out.is_empty() {
        format!("control charts: all {shown} in control")
    } else {
        format!("control charts: out of control: {}", out.join(", "))
    }
}

fn changes(robot: &RobotHistory) -> Vec<String> {
    let lasting = RobotHistory::lasting(&robot.sessions);
    let changed: Vec<(&PastSession, Option<bool>)> = robot
        .sessions
        .iter()
        .zip(lasting)
        .filter(|(session, _)| session.judged.in_words().is_some())
        .collect();
    let alarms = robot
        .sessions
        .iter()
        .filter(|session| session.judged.out_of_control().next().is_some());
    let segments = robot.sessions.last().map_or(0, |last| last.judged.segment);
    let count = |lasts| {
        changed
            .iter()
            .filter(|(_, lasting)| *lasting == lasts)
            .count()
    };
    let mut lines = vec![format!(
        "changes: {} sessions, {} lasting, {} of one session, {} not settled; out of control: {} sessions; segments: {segments}",
        changed.len(),
        count(Some(true)),
        count(Some(false)),
        count(None),
        alarms.count()
    )];
    let newest = changed.iter().rev().take(TOLD).rev();
    lines.extend(newest.map(|(session, lasting)| {
        let words = session.judged.in_words().unwrap_or_default();
        let settled = match lasting {
            Some(true) => "lasts",
            Some(false) => "of this session alone",
            None => "not settled yet",
        };
        format!("  {}: {words} ({settled})", session.key.session)
    }));
    lines
}

fn left_out(robot: &RobotHistory) -> Option<String> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for left_out in &robot.left_out {
        *counts.entry(left_out.reason.word()).or_default() += 1;
    }
    let words: Vec<String> = counts
        .iter()
        .map(|(reason, count)| format!("{count} {reason}"))
        .collect();
    (!words.is_empty()).then(|| {
        format!(
            "runs: {}, {} used; left out: {}",
            robot.runs,
            robot.sessions.len(),
            words.join(", ")
        )
    })
}

/// Writes the tables and the pages; gives their paths.
fn output(
    lake: &Lake,
    robots: &[RobotHistory],
    folder: &Path,
) -> Result<Vec<PathBuf>, HistoryCommandError> {
    let all: Vec<(Vec<Vec<Figure>>, Vec<String>)> = robots
        .iter()
        .map(|robot| figures(lake, &robot.sessions))
        .collect();
    for reason in all.iter().flat_map(|(_, wrong)| wrong) {
        tracing::warn!("left out of the table history: {}", Printable(reason));
    }
    let rows: Vec<(&PastSession, &Figure)> = robots
        .iter()
        .zip(&all)
        .flat_map(|(robot, (figures, _))| robot.sessions.iter().zip(figures))
        .flat_map(|(session, figures)| figures.iter().map(move |figure| (session, figure)))
        .collect();
    let wrong = |source| HistoryCommandError::Write {
        path: folder.to_owned(),
        source,
    };
    std::fs::create_dir_all(folder).map_err(wrong)?;
    let mut written = Vec::new();
    for (name, table) in [
        ("history", history_table::history(&rows)?),
        ("drift", drift::drift(robots)?),
    ] {
        written.push(put(
            folder,
            &format!("{name}.parquet"),
            &bytes(&table, folder)?,
        )?);
    }
    for (robot, (figures, _)) in robots.iter().zip(&all) {
        let name = file_name(lake, &robot.robot)?;
        let page = trend(robot, figures);
        written.push(put(folder, &name, page.as_bytes())?);
    }
    Ok(written)
}

/// Named as the lake names it: a robot's name may be anything.
fn file_name(lake: &Lake, robot: &str) -> Result<String, HistoryError> {
    let key = RunKey::new("robot", "session", robot);
    let path = lake.page(&key)?;
    let name = path.file_name().unwrap_or_default();
    Ok(name.to_string_lossy().into_owned())
}

fn bytes(table: &Table, folder: &Path) -> Result<Vec<u8>, HistoryCommandError> {
    write(table, Vec::new()).map_err(|error| HistoryCommandError::Write {
        path: folder.to_owned(),
        source: io::Error::other(error),
    })
}

/// Puts a file in the place of the one of last time, whole or not at all.
fn put(folder: &Path, name: &str, bytes: &[u8]) -> Result<PathBuf, HistoryCommandError> {
    let path = folder.join(name);
    match replace_whole(&path, bytes) {
        Ok(()) => Ok(path),
        Err(source) => Err(HistoryCommandError::Write { path, source }),
    }
}

fn exit_code(robots: &[RobotHistory]) -> u8 {
    if robots.iter().any(|robot| robot.sessions.is_empty()) {
        return NO_RESULT;
    }
    let is_moved = |last: &PastSession| {
        last.judged.in_words().is_some() || last.judged.out_of_control().next().is_some()
    };
    let is_open = |robot: &RobotHistory| {
        robot.sessions.last().is_some_and(is_moved)
            || robot
                .left_out
                .iter()
                .any(|own| matches!(own.reason, Reason::Unreadable(_)))
    };
    if robots.iter().any(is_open) {
        NOT_MET
    } else {
        DONE
    }
}
