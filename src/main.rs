//! The `posegrid` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    if cfg!(windows) { on_a_thread() } else { posegrid::cli::main() }
}

/// All the work on a thread of its own, as Windows gives a program's first thread other rounding (with mingw's `sin` and `cos`, which use
/// the x87 unit at the precision that a thread begins with) and a smaller stack than the threads that are started later.
fn on_a_thread() -> ExitCode {
    let work = std::thread::Builder::new().name("main".to_owned()).stack_size(8 << 20);
    match work.spawn(posegrid::cli::main).map(std::thread::JoinHandle::join) {
        Ok(Ok(code)) => code,
        // The panic's message is on stderr already.
        Ok(Err(panic)) => std::panic::resume_unwind(panic),
        Err(error) => {
            eprintln!("posegrid cannot start a thread: {error}; close other programs");
            ExitCode::from(75)
        }
    }
}
