//! The command line: arguments, messages, exit codes; one file per command.

pub mod compensate;
pub mod inspect;
pub mod schema;
pub mod simulate;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::progress::Quiet;

/// From a robot controller's log and a laser tracker's log to a compensation table.
#[derive(Debug, Parser)]
#[command(name = "posegrid", version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Inspect(inspect::InspectArgs),
}

/// Runs the command line of this process.
pub fn main() -> ExitCode {
    match Arguments::parse().command {
        Command::Inspect(args) => inspect::run(&args, &Quiet),
    }
}
