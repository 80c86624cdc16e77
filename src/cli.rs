//! The command line: arguments, messages, exit codes; one file per command.

pub mod compensate;
pub mod schema;
pub mod simulate;

use std::process::ExitCode;

/// Runs the command line of this process.
pub fn main() -> ExitCode {
    ExitCode::SUCCESS
}
