//! What a long stage tells of its progress, without knowing who listens.

/// A listener for the progress of one long task.
pub trait Progress: Sync {
    /// A task of `total` steps begins.
    fn begin(&self, task: &str, total: u64);
    /// `steps` more are done.
    fn advance(&self, steps: u64);
    /// The task is over.
    fn end(&self);
}

/// Listens to nothing: tests, benches, and runs without a terminal.
#[derive(Debug, Clone, Copy)]
pub struct Quiet;

impl Progress for Quiet {
    fn begin(&self, _task: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
    fn end(&self) {}
}
