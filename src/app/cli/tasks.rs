//! `posegrid tasks` and `posegrid task`: the work of a pipeline file as independent jobs, a line of JSON each. No log
//! is opened to list them; `task` does one, on any machine that reaches the sessions and the lake. Neither takes the
//! lake's lock.

use std::io::{BufRead as _, Read as _, stdin};
use std::path::PathBuf;

use clap::Args;

use super::messages::{self, Printable};
use super::progress::Bars;
use super::streams::Undelivered;
use super::{BAD_USAGE, DONE, NO_RESULT};
use crate::io::lake::{Lake, LakeError};
use crate::pipeline::configuration::{ConfigurationError, Overrides};
use crate::pipeline::fleet::Fleet;
use crate::pipeline::run::Known;
use crate::pipeline::tasks::{self, Ended, How, Task};

/// The machine or the storage failed, and the same may work later: the code that mailers give such a failure.
pub const FAULT: u8 = 75;

/// List the work that is to be done, as independent tasks.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
  posegrid tasks fleet.toml
  posegrid tasks fleet.toml --robot kr210-07 | head -1 | posegrid task fleet.toml

A line of JSON for each task: its id, robot and session, the sessions that it learns from and is judged on, the size of their files,
and the time and memory that it may take, by what runs of the lake took. The id follows from names, sizes and tags or times of the files, from the settings and from
this version: no log is opened. Work that is known as done is not listed; sessions that wait or cannot be used are told on stderr.
A plan before measuring is no task: `posegrid plan fleet.toml --robot NAME` is one piece of work, and done twice it is done once.

Exit codes: 0 listed; 2 bad usage or bad pipeline file; 75 the sessions or the lake cannot be read now: list again.")]
pub struct TasksArgs {
    /// The pipeline file
    pub pipeline: PathBuf,
    /// List the tasks of this robot alone; may be given several times
    #[arg(long, value_name = "NAME")]
    pub robot: Vec<String>,
    /// The place of the published tables, instead of the pipeline file's
    #[arg(long, value_name = "DIR")]
    pub lake: Option<PathBuf>,
}

/// Do one task.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
  posegrid task fleet.toml --id 5e2c… --robot kr210-07
  posegrid tasks fleet.toml | xargs -d '\\n' -P 4 -I{} sh -c 'echo \"$1\" | posegrid task fleet.toml' _ {}

The task is named by --id, or comes as a line of `posegrid tasks` on standard input. How it ended is a line of JSON on stdout: done,
done-before, failed or fault, with run, verdict and reason. A task may be done twice, at once, or again after it was killed: the run is
there once, with the same bytes.

Exit codes: 0 there is a result, whatever its verdict; 1 there is none, and doing it again gives none; 2 bad usage or bad pipeline file;
75 the machine or the storage failed: do it again.")]
pub struct TaskArgs {
    /// The pipeline file
    pub pipeline: PathBuf,
    /// The task's id; without it a line of `posegrid tasks` is read from standard input
    #[arg(long, value_name = "ID")]
    pub id: Option<String>,
    /// Its robot: the sessions of others are not looked for
    #[arg(long, value_name = "NAME", requires = "id")]
    pub robot: Option<String>,
    /// The place of the published tables, instead of the pipeline file's
    #[arg(long, value_name = "DIR")]
    pub lake: Option<PathBuf>,
}

pub fn list(args: &TasksArgs, bars: &Bars) -> u8 {
    let overrides = Overrides { lake: args.lake.clone(), ..Overrides::default() };
    let fleet = match Fleet::load(&args.pipeline, &args.robot, &overrides) {
        Ok(fleet) => fleet,
        Err(error) => return unusable(&error),
    };
    let Some(known) = known(&fleet, Known::read) else { return FAULT };
    for aside in &fleet.set_aside {
        let (how, reason) = (aside.state(), aside.why.reason());
        tracing::warn!("{how} {}: {}", Printable(&aside.session), Printable(reason));
    }
    let (open, without) = tasks::open(&fleet, &known);
    if let Err(error) = known.keep_gathered() {
        tracing::warn!(
            "what single tasks did cannot be gathered in the index of finished work, and is read again next time: {}",
            Printable(&error.to_string())
        );
    }
    for label in without {
        tracing::warn!(
            "failed {}: a file of it is gone, or its storage has no tag that tells when it changes; list the tasks again",
            Printable(&label)
        );
    }
    written(&open, bars)
}

fn written(open: &[Task], bars: &Bars) -> u8 {
    let line = |task: &Task| serde_json::to_string(task).map(|line| line + "\n");
    match open.iter().map(line).collect::<Result<String, _>>() {
        Ok(lines) => {
            messages::deliver(lines.as_bytes(), bars).map_or_else(Undelivered::exit_code, |()| DONE)
        }
        Err(error) => {
            tracing::error!("{error}");
            NO_RESULT
        }
    }
}

pub fn work(args: &TaskArgs, bars: &Bars) -> u8 {
    let (id, robot) = match named(args) {
        Ok(named) => named,
        Err(reason) => {
            tracing::error!("{}", Printable(&reason));
            return BAD_USAGE;
        }
    };
    let overrides = Overrides { lake: args.lake.clone(), ..Overrides::default() };
    let robots: Vec<String> = robot.into_iter().collect();
    let fleet = match Fleet::load(&args.pipeline, &robots, &overrides) {
        Ok(fleet) => fleet,
        Err(error) => return unusable(&error),
    };
    let Some(known) = known(&fleet, |lake| Ok(Known::one_by_one(lake))) else { return FAULT };
    told(&tasks::work(&fleet, &known, &id, &bars.of("task")), bars)
}

fn told(ended: &Ended, bars: &Bars) -> u8 {
    if let (How::Failed | How::Fault, Some(reason)) = (ended.ended, &ended.reason) {
        tracing::error!("{}", Printable(reason));
    }
    let code = match ended.ended {
        How::Done | How::DoneBefore => DONE,
        How::Failed => NO_RESULT,
        How::Fault => FAULT,
    };
    let line = match serde_json::to_string(ended) {
        Ok(line) => line + "\n",
        Err(error) => {
            tracing::error!("{error}");
            return FAULT;
        }
    };
    messages::result(line, bars).map_or(FAULT, |()| code)
}

/// Most bytes of a task on standard input.
const LONGEST_TASK: u64 = 1 << 16;

fn named(args: &TaskArgs) -> Result<(String, Option<String>), String> {
    if let Some(id) = &args.id {
        return Ok((id.clone(), args.robot.clone()));
    }
    let mut line = String::new();
    // A line of `posegrid tasks` has some hundred bytes.
    let mut input = stdin().lock().take(LONGEST_TASK);
    input.read_line(&mut line).map_err(|error| format!("standard input: {error}"))?;
    let task: Result<Task, _> = serde_json::from_str(&line);
    let task = task.map_err(|error| {
        format!(
            "standard input has no task, a line of `posegrid tasks`: {error}; or name one by --id"
        )
    })?;
    Ok((task.id, task.robot))
}

/// Finished work in the fleet's lake; `None` where it cannot be read, which is reported.
fn known(fleet: &Fleet, read: impl Fn(Lake) -> Result<Known, LakeError>) -> Option<Known> {
    let known = Lake::at(&fleet.lake).and_then(read);
    known.map_err(|error| tracing::error!("{}", Printable(&error.to_string()))).ok()
}

fn unusable(error: &ConfigurationError) -> u8 {
    tracing::error!("{}", Printable(&error.to_string()));
    if error.is_worth_a_retry() { FAULT } else { BAD_USAGE }
}
