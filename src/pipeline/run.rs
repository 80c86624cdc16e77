//! One piece of work: read, joined, run through the stages, published.

use std::path::PathBuf;

use thiserror::Error;

use super::plan::{Plan, WorkPiece};
use crate::grid::Verdict;
use crate::progress::Progress;

/// What a finished piece of work comes to.
#[derive(Debug, Clone)]
pub struct Done {
    /// The session of its tables, or `pooled`.
    pub session: String,
    /// The run's name.
    pub run: String,
    /// Whether the lake had it already.
    pub already_there: bool,
    /// Whether the tolerance is met.
    pub verdict: Verdict,
    /// What came out, line by line.
    pub words: Vec<String>,
    /// Where its tables are.
    pub tables: PathBuf,
}

/// Why a piece of work has no result.
#[derive(Debug, Error)]
pub enum RunError {
    /// To come.
    #[error("not built yet")]
    NotBuilt,
}

/// Does one piece of work.
pub fn run_piece(
    _plan: &Plan,
    _piece: &WorkPiece,
    _progress: &dyn Progress,
) -> Result<Done, RunError> {
    Err(RunError::NotBuilt)
}
