//! The `posegrid` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    posegrid::cli::main()
}
