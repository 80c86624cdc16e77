//! The origin of a run: its logs, the items left out of them, its inputs and settings.

use crate::io::tables::clocks::ClockRow;
use crate::io::tables::rejects::RejectRow;
use crate::io::tables::stations::{PairingVerdict, Unpaired};

/// The results from the logs of one session.
#[derive(Debug, Clone, PartialEq)]
pub struct Session {
    /// Name of the session.
    pub name: String,
    /// Whether it is a training session; otherwise it is only judged.
    pub trained: bool,
    /// Its row of table `clocks`.
    pub clock: ClockRow,
    /// The number of its dwells for each verdict and reason.
    pub dwells: Vec<(PairingVerdict, Option<Unpaired>, usize)>,
    /// Its rows of table `rejects`.
    pub rejects: Vec<RejectRow>,
}

/// The numbers of items that a stage read, kept and rejected.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Count {
    /// Name of the stage.
    pub stage: String,
    /// Kind of item.
    pub of: String,
    /// Number of items read.
    pub read: u64,
    /// Number of items kept.
    pub kept: u64,
    /// Number of items rejected for each reason.
    pub rejected: Vec<(String, u64)>,
}

/// The origin of a run: only values that are the same wherever and whenever the same work is done, like the page itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Provenance {
    /// Name of the pipeline file.
    pub pipeline: String,
    /// Version of this program.
    pub version: String,
    /// Files read: name, bytes, digest.
    pub inputs: Vec<(String, u64, String)>,
    /// Tables written: name, rows, digest.
    pub tables: Vec<(String, u64, String)>,
    /// Every setting, as JSON.
    pub settings: String,
}
