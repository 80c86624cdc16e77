//! The command line: arguments, messages, exit codes; one file per command.
//!
//! Results go to stdout, messages and progress bars to stderr. An interrupt ends `run` at its next step and any other command
//! at once: a lake stays sound either way, since a run exists only once it is whole.

pub mod check;
pub mod compensate;
pub mod export;
pub mod history;
pub mod inspect;
pub mod messages;
pub mod plan;
pub mod progress;
pub mod run;
pub mod schema;
pub mod simulate;
pub mod verify;

use std::fmt::Display;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::io::memory::keep_what_is_freed;
use messages::LogFormat;
use progress::Bars;

/// Everything asked for is there, and within tolerance.
pub const DONE: u8 = 0;
/// Something asked for has no result.
pub const NO_RESULT: u8 = 1;
/// Bad usage, or a bad pipeline file.
pub const BAD_USAGE: u8 = 2;
/// There is a result, but a tolerance is not met or not shown to be.
pub const NOT_MET: u8 = 3;

/// From a robot controller's log and a laser tracker's log to identified errors, error-similarity grids and a
/// compensation table.
#[derive(Debug, Parser)]
#[command(version, propagate_version = true, after_help = EXIT_CODES)]
struct Arguments {
    /// How messages are written on stderr
    #[arg(long, global = true, value_enum, default_value_t = LogFormat::Text)]
    log_format: LogFormat,
    #[command(subcommand)]
    command: Command,
}

const EXIT_CODES: &str = "\
Exit codes: 0 done and within tolerance; 1 some session has no result;
            2 bad usage or bad pipeline file; 3 all have results, but a tolerance
            is not met or not shown, or more was rejected than the pipeline file
            allows. 1 outranks 3. A run that a signal ended: 130 (SIGINT) or 143
            (SIGTERM).

Example:
  posegrid run pipelines/quickstart.toml";

#[derive(Debug, Subcommand)]
#[expect(clippy::large_enum_variant, reason = "one value per process")]
enum Command {
    Run(run::RunArgs),
    Check(check::CheckArgs),
    Inspect(inspect::InspectArgs),
    Simulate(simulate::SimulateArgs),
    Plan(plan::PlanArgs),
    Compensate(compensate::CompensateArgs),
    History(history::HistoryArgs),
    Export(export::ExportArgs),
    Verify(verify::VerifyArgs),
    Schema(schema::SchemaArgs),
}

/// Runs the command line of this process.
pub fn main() -> ExitCode {
    keep_what_is_freed();
    let arguments = Arguments::parse();
    let bars = Bars::new(arguments.log_format);
    messages::start(arguments.log_format, &bars);
    match arguments.command {
        Command::Run(args) => ExitCode::from(run::run(&args, &bars)),
        Command::Check(args) => shown(check::check(&args)),
        Command::Inspect(args) => inspect::run(&args, &bars.of("inspect")),
        Command::Simulate(args) => shown(simulate::run(&args)),
        Command::Plan(args) => ExitCode::from(plan::run(&args, &bars)),
        Command::Compensate(args) => compensate::main(&args),
        Command::History(args) => ExitCode::from(history::run(&args, &bars)),
        Command::Export(args) => export::main(&args),
        Command::Verify(args) => ExitCode::from(verify::run(&args, &bars)),
        Command::Schema(args) => shown(schema::show(&args)),
    }
}

/// Tells a command's result on stdout, or its error on stderr.
fn shown(result: Result<impl Display, impl Display>) -> ExitCode {
    match result {
        Ok(result) => {
            messages::result(result);
            ExitCode::from(DONE)
        }
        Err(error) => {
            tracing::error!("{error}");
            ExitCode::from(BAD_USAGE)
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

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
