//! Progress of a long stage, reported without knowing who listens.

/// A listener for the progress of one long task.
///
/// A listener who wants the task to end unwinds it with [`Stopped`] from one of these calls
/// ([`std::panic::resume_unwind`], which no panic hook sees): everything under way is dropped on the way out, so files under
/// temporary names go, and whoever began the task catches it. So a task need not know that it can be stopped.
pub trait Progress: Sync {
    /// A task of `total` steps begins.
    fn begin(&self, task: &str, total: u64);
    /// `steps` more are done.
    fn advance(&self, steps: u64);
    /// The task is over.
    fn end(&self);
}

/// The payload with which a listener unwinds a task to end it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stopped;

/// Listens to nothing: tests, benches, and runs without a terminal.
#[derive(Debug, Clone, Copy)]
pub struct Quiet;

impl Progress for Quiet {
    fn begin(&self, _task: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
    fn end(&self) {}
}
