//! `posegrid history`: accuracy over time and drift, from the tables of a lake. Exit codes: 0 the newest session of
//! every robot is where it was and in control; 3 one is not, or some run could not be read; 1 a robot has no session,
//! or output cannot be written; 2 bad usage, or no such lake, robot or session.

mod output;
mod words;

use std::io;
use std::path::PathBuf;

use chrono::NaiveDate;
use clap::Args;
use thiserror::Error;

use super::messages::{self, Printable};
use super::progress::Bars;
use super::streams::Undelivered;
use super::{BAD_USAGE, DONE, NO_RESULT, NOT_MET};
use crate::files::store::Place;
use crate::files::table::TableError;
use crate::files::whole_file::told;
use crate::io::lake::{Lake, LakeError};
use crate::io::tables::past::PastSession;
use crate::pipeline::history::{Asked, HistoryError, LeftOut, Reason, RobotHistory, history};
use crate::units::WallTime;
use output::Output;
use words::words;

/// Find what changed over the sessions of each robot: accuracy, base, target and joints, tested with their covariances.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Each session's current run is compared with all sessions before it, pooled: what moved, base, target or which joint, or what
cannot be distinguished. A session without any change has a false alarm once in 1000 at most. Control charts (EWMA of
self-starting scores) show whether accuracy and places keep their ordinary level; all charts of a robot together have one
false alarm in 1000 sessions at most. Sessions are in the order of the first stamps of their controller logs.

Judged sessions are kept in LAKE/.history, checked against the rows of runs each time; --fresh does not use them. LAKE may be on object
storage: what is new there costs one small object for each session.

--pages alone writes the pages into LAKE/pages, as each `posegrid run` does that made a run: its page leads to them. Of all robots, or of one alone,
index.html is the page of the fleet: robots by verdict, the worst, what moved last night, and which were not measured for how long, as
of the newest session or --as-of. It is not written with --robot.

Examples:
  posegrid history lake
  posegrid history lake --robot ur10 --out trend     # trend/history.parquet, drift.parquet and ur10.html
  posegrid history lake --pages                      # lake/pages/index.html and a page for each robot, without the tables
  posegrid history s3://bucket/lake --pages fleet       # the same into the folder fleet

Exit codes: 0 every robot's newest session is where it was and in control; 3 one is not, or a run could not be read; 1 a robot
has no session, or the output cannot be written; 2 bad usage, or no such lake, robot or session.")]
pub struct HistoryArgs {
    /// The place of the published tables
    pub lake: PathBuf,
    /// Only this robot
    #[arg(long, value_name = "ROBOT")]
    pub robot: Option<String>,
    /// First session to use; earlier ones take no part
    #[arg(long, value_name = "SESSION")]
    pub since: Option<String>,
    /// Last session to use
    #[arg(long, value_name = "SESSION")]
    pub until: Option<String>,
    /// Write the tables history and drift and the pages into this folder, replacing earlier ones
    #[arg(long, alias = "output", value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write the pages alone, into this folder or the lake's own: they need few of the tables that the table history is made of
    #[arg(long, value_name = "DIR", num_args = 0..=1, conflicts_with = "out")]
    pub pages: Option<Option<PathBuf>>,
    /// The time that the page of the fleet is of, UTC, instead of the start of the newest session: 2026-11-25 (its end) or
    /// "2026-11-25 06:30"
    #[arg(long, value_name = "TIME", value_parser = time)]
    pub as_of: Option<WallTime>,
    /// Judge every session again, without the kept results
    #[arg(long)]
    pub fresh: bool,
}

#[derive(Debug, Error)]
enum HistoryCommandError {
    #[error(transparent)]
    History(#[from] HistoryError),
    #[error(transparent)]
    Tables(#[from] TableError),
    #[error(transparent)]
    Page(#[from] LakeError),
    #[error("cannot write {}: {}", path.display(), told(source))]
    Write { path: PathBuf, source: io::Error },
}

pub fn run(args: &HistoryArgs, bars: &Bars) -> u8 {
    let (lake, robots) = match made(args, bars) {
        Ok(made) => made,
        Err(error) => return failed(&error),
    };
    robots.iter().for_each(warn);
    let of_all = args.robot.is_none().then_some(args.as_of);
    let output = Output { lake: &lake, robots: &robots, of_all };
    // The files are written before anything is printed, so they do not depend on whether stdout accepts the text.
    let written = match (&args.out, &args.pages) {
        (Some(to), _) => output.all(to),
        (None, Some(to)) => output.pages(to.as_deref()),
        (None, None) => Ok(Vec::new()),
    };
    let paths = written.iter().flatten().map(|path| format!("written: {}", path.display()));
    let text: String = robots.iter().flat_map(words).chain(paths).map(|text| line(&text)).collect();
    let printed = messages::result(text, bars);
    match written {
        Ok(_) => printed.map_or_else(Undelivered::exit_code, |()| exit_code(&robots)),
        Err(error) => failed(&error),
    }
}

/// Writes the pages of all robots into the lake anew: the pages of runs lead to them. Where that fails, the runs are as sound as before.
pub(super) fn refresh_pages(lake: &Lake, bars: &Bars) {
    let robots = history(lake, &Asked::default(), &bars.of("history"));
    let written = robots
        .map_err(Into::into)
        .and_then(|robots| Output { lake, robots: &robots, of_all: Some(None) }.pages(None));
    if let Err(error) = written {
        let error = error.to_string();
        tracing::warn!("the pages of all nights are not written: {}", Printable(&error));
    }
}

/// A time of the command line: a date, which stands for its end, or date and time.
fn time(text: &str) -> Result<WallTime, String> {
    let date = NaiveDate::parse_from_str(text.trim(), "%Y-%m-%d").ok();
    let next = date.and_then(|date| date.succ_opt()?.and_hms_opt(0, 0, 0));
    let end = next.map(|time| WallTime::of_us(time.and_utc().timestamp_micros()));
    end.or_else(|| WallTime::stated(text))
        .ok_or_else(|| "it is no time; write 2026-11-25 or \"2026-11-25 06:30\"".to_owned())
}

fn failed(error: &HistoryCommandError) -> u8 {
    tracing::error!("{}", Printable(&error.to_string()));
    match error {
        HistoryCommandError::History(_) => BAD_USAGE,
        _ => NO_RESULT,
    }
}

fn line(text: &str) -> String {
    format!("{}\n", Printable(text))
}

fn made(args: &HistoryArgs, bars: &Bars) -> Result<(Lake, Vec<RobotHistory>), HistoryCommandError> {
    let lake = Lake::at(&Place::of(&args.lake)).map_err(HistoryError::from)?;
    let (robot, since, until) = (args.robot.clone(), args.since.clone(), args.until.clone());
    let asked = Asked { robot, since, until, fresh: args.fresh };
    let robots = history(&lake, &asked, &bars.of("history"))?;
    Ok((lake, robots))
}

fn warn(robot: &RobotHistory) {
    for LeftOut { reason, .. } in &robot.left_out {
        if let Reason::Unreadable(reason) = reason {
            tracing::warn!("left out: {}", Printable(reason));
        }
    }
    if let Some(error) = &robot.summary_error {
        tracing::warn!(
            "the judged sessions cannot be kept in the lake's folder .history: {}; the next history judges them again",
            Printable(error)
        );
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
            || robot.left_out.iter().any(|own| matches!(own.reason, Reason::Unreadable(_)))
    };
    if robots.iter().any(is_open) { NOT_MET } else { DONE }
}
