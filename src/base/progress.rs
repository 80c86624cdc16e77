//! Progress of a long stage, reported without knowing who listens.

/// A listener for the progress of one long task. To end the task it unwinds with [`Stopped`] from one of these calls
/// ([`std::panic::resume_unwind`]): temporary files are dropped on the way out, and whoever began the task catches it.
pub trait Progress: Sync {
    fn begin(&self, task: &str, total: u64);
    fn advance(&self, steps: u64);
    fn end(&self);
}

/// The payload with which a listener unwinds a task to end it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stopped;

#[derive(Debug, Clone, Copy)]
pub struct Quiet;

impl Progress for Quiet {
    fn begin(&self, _task: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
    fn end(&self) {}
}
