//! The command line: arguments, messages, exit codes; one file per command. Results go to stdout, messages and progress
//! bars to stderr. An interrupt ends `run` at its next step and any other command at once: a lake stays sound, since a
//! run exists only once it is whole.
//!
//! Work goes on when messages cannot be written. Results that cannot be written give exit code 1; where their reader
//! has gone away (`| head -1`), a command ends silently. `run` has finished its work by then: a reader who left does
//! not change its exit code.

pub mod check;
pub mod compact;
pub mod compensate;
pub mod export;
pub mod folder_given;
pub mod history;
pub mod init;
pub mod inspect;
pub mod messages;
pub mod plan;
pub mod progress;
pub mod robot;
pub mod run;
pub mod schema;
pub mod shells;
pub mod simulate;
pub mod streams;
pub mod tasks;
pub mod verify;

use std::fmt::Display;
use std::io::{self, Write as _};
use std::process::ExitCode;

use clap::error::{ContextKind, ContextValue};
use clap::{CommandFactory as _, Parser, Subcommand};

use crate::files::memory::keep_what_is_freed;
use messages::{LogFormat, Printable};
use progress::Bars;
use streams::Undelivered;

/// Everything asked for is there, and within tolerance.
pub const DONE: u8 = 0;
/// Something asked for has no result, or results cannot be written.
pub const NO_RESULT: u8 = 1;
/// Bad usage, or a bad pipeline file.
pub const BAD_USAGE: u8 = 2;
/// There is a result, but a tolerance is not met or not shown to be.
pub const NOT_MET: u8 = 3;
/// The reader of `verify`'s output went away before all runs were verified: the code of a process ended by SIGPIPE
/// (13).
pub const READER_GONE: u8 = 128 + 13;

/// From a robot controller's log and a laser tracker's log to identified errors, error-similarity grids and a
/// compensation table.
#[derive(Debug, Parser)]
#[command(name = "posegrid", version, propagate_version = true, after_help = EXIT_CODES)]
struct Arguments {
    /// Format of the messages on stderr
    #[arg(long, global = true, value_enum, default_value_t = LogFormat::Text)]
    log_format: LogFormat,
    /// Errors alone on stderr, and no progress bars
    #[arg(short, long, global = true, conflicts_with = "log_format")]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

const EXIT_CODES: &str = "\
Exit codes: 0 done and within tolerance; 1 some session has no result, or
            results cannot be written to stdout; 2 bad usage or bad pipeline
            file; 3 all have results, but a tolerance is not met or not shown,
            or more was rejected than the pipeline file allows. 1 outranks 3.
            A run that a signal ended: 130 (SIGINT) or 143 (SIGTERM).
            A reader that has gone away (`| head -1`) is no error, but
            `verify` then stops unfinished: 141.
            Messages that cannot be written change nothing.

Example:
  posegrid run pipelines/quickstart.toml";

/// Commands, flags and values of flags that were retired, with what to do instead.
const RETIRED: &[(&str, &str)] = &[
    (
        "benchmark",
        "it was retired: python pipelines/benchmarks/benchmark.py SUITE runs and judges posegrid and other programs on open data",
    ),
    ("--unnamed", "it was retired, as readings name their reflector: leave it out"),
    ("--at-once", "it was retired: without --in-turn all reflectors are measured at once"),
    ("--list", LISTS),
    ("--expect", LISTS),
    (
        "json",
        "export --format json was retired: table joint_errors has the error curve of each joint, and any reader of Parquet reads it",
    ),
    (
        "--plans",
        "tasks --plans was retired: hand out `posegrid plan PIPELINE --robot NAME` itself, which does nothing where the lake has the plan",
    ),
    ("mcap", ARROWS),
    ("--stations", ARROWS),
    (
        "xacro",
        "export --format xacro was retired: write your URDF by xacro's own program (xacro my.urdf.xacro > my.urdf), and give it by \
         --format urdf --urdf my.urdf",
    ),
];
const ARROWS: &str = "export --format mcap, with its --stations, was retired: the page of the run draws the errors as arrows, and table residuals \
                      has them for any reader of Parquet";
const LISTS: &str = "lists of verify were retired: keep the result of `SELECT run, row_digest, robot, session FROM runs` elsewhere, and compare";

#[derive(Debug, Subcommand)]
#[expect(clippy::large_enum_variant, reason = "one value per process")]
enum Command {
    Run(run::RunArgs),
    Tasks(tasks::TasksArgs),
    Task(tasks::TaskArgs),
    Check(check::CheckArgs),
    Inspect(inspect::InspectArgs),
    Init(init::InitArgs),
    Simulate(simulate::SimulateArgs),
    Plan(plan::PlanArgs),
    Compensate(compensate::CompensateArgs),
    Compact(compact::CompactArgs),
    History(history::HistoryArgs),
    Export(export::ExportArgs),
    Verify(verify::VerifyArgs),
    Robot(robot::RobotArgs),
    Schema(schema::SchemaArgs),
    Completions(shells::CompletionsArgs),
    Man(shells::ManArgs),
}

pub fn main() -> ExitCode {
    keep_what_is_freed();
    outlive_limits_of_files();
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(answer) => return ExitCode::from(answered(&with_remedy(answer))),
    };
    let format = if arguments.quiet { LogFormat::Errors } else { arguments.log_format };
    let bars = &Bars::new(format);
    messages::start(format, bars);
    ExitCode::from(match arguments.command {
        Command::Run(args) => run::run(&args, bars),
        Command::Tasks(args) => tasks::list(&args, bars),
        Command::Task(args) => tasks::work(&args, bars),
        Command::Check(args) => shown(check::check(&args), bars),
        Command::Inspect(args) => inspect::run(&args, bars),
        Command::Init(args) => shown(init::run(&args, bars), bars),
        Command::Simulate(args) => shown(simulate::run(&args), bars),
        Command::Plan(args) => plan::run(&args, bars),
        Command::Compensate(args) => compensate::main(&args, bars),
        Command::Compact(args) => compact::run(&args, bars),
        Command::History(args) => history::run(&args, bars),
        Command::Export(args) => export::main(&args, bars),
        Command::Verify(args) => verify::run(&args, bars),
        Command::Robot(args) => shown(robot::show(&args), bars),
        Command::Schema(args) => shown(schema::show(&args), bars),
        Command::Completions(args) => {
            let script = shells::completions(&args, Arguments::command());
            shown(Ok::<_, String>(script), bars)
        }
        Command::Man(args) => shown(shells::man(&args, Arguments::command()), bars),
    })
}

/// Turns a write beyond the process's file size limit into an error, like a full disk's, where SIGXFSZ can be caught.
fn outlive_limits_of_files() {
    #[cfg(unix)]
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, std::sync::Arc::default());
}

/// Prints the argument parser's answer: help and version are results, anything else is a message.
fn answered(answer: &clap::Error) -> u8 {
    if answer.use_stderr() {
        let text = answer.render().to_string();
        let lines = text.lines().map(|line| format!("{}\n", Printable(line)));
        // A failure has nowhere to be reported.
        let _ = io::stderr().write_all(lines.collect::<String>().as_bytes());
        return BAD_USAGE;
    }
    let written = answer.print().and_then(|()| io::stdout().flush());
    messages::start(LogFormat::Text, &Bars::new(LogFormat::Text));
    messages::delivered(written).map_or_else(Undelivered::exit_code, |()| DONE)
}

fn with_remedy(mut answer: clap::Error) -> clap::Error {
    let kinds =
        [ContextKind::InvalidSubcommand, ContextKind::InvalidArg, ContextKind::InvalidValue];
    let words = kinds.map(|kind| answer.get(kind).map(ToString::to_string));
    let retired = RETIRED.iter().find(|(own, _)| words.iter().flatten().any(|word| word == own));
    if let Some((_, instead)) = retired {
        let tip = ContextValue::StyledStrs(vec![(*instead).into()]);
        answer.insert(ContextKind::Suggested, tip);
    }
    answer
}

fn shown(result: Result<impl Display, impl Display>, bars: &Bars) -> u8 {
    match result {
        Ok(result) => messages::last_result(result, DONE, bars),
        Err(error) => {
            tracing::error!("{error}");
            BAD_USAGE
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn what_was_retired_is_answered_with_what_to_do_instead() {
        for (arguments, instead) in [
            (vec!["benchmark", "suite.toml"], "pipelines/benchmarks/benchmark.py"),
            (vec!["simulate", "a.toml", "--unnamed"], "readings name their reflector"),
            (vec!["verify", "lake", "--list"], "SELECT run, row_digest, robot, session FROM runs"),
            (vec!["verify", "lake", "--expect", "rows.txt"], "SELECT run, row_digest"),
            (vec!["export", "a.parquet", "--format", "json"], "table joint_errors"),
            (vec!["tasks", "fleet.toml", "--plans"], "posegrid plan PIPELINE --robot NAME"),
            (vec!["export", "a.parquet", "--format", "mcap"], "table residuals"),
            (vec!["export", "a.parquet", "--stations", "b.parquet"], "table residuals"),
            (vec!["export", "a.parquet", "--format", "xacro"], "xacro my.urdf.xacro > my.urdf"),
        ] {
            let answer = Arguments::try_parse_from(["posegrid"].iter().chain(&arguments));
            let answer = with_remedy(answer.expect_err("retired")).to_string();
            assert!(answer.contains(instead), "{answer}");
        }
    }

    #[test]
    fn the_arguments_hold_together_and_every_command_has_an_example() {
        let command = Arguments::command();
        command.clone().debug_assert();
        for sub in command.get_subcommands() {
            let help = sub.get_after_help().map(ToString::to_string);
            assert!(
                help.is_some_and(|help| help.contains("posegrid ")),
                "{} has no example",
                sub.get_name()
            );
        }
    }
}
