//! Where a run comes from: its logs, what was left out of them, its inputs and settings.

use crate::io::tables::clocks::ClockRow;
use crate::io::tables::rejects::RejectRow;
use crate::io::tables::stations::{PairingVerdict, Unpaired};

/// What the logs of one session gave.
#[derive(Debug, Clone, PartialEq)]
pub struct Session {
    /// Its name.
    pub name: String,
    /// Whether it trained; otherwise it only judged.
    pub trained: bool,
    /// Its clocks.
    pub clock: ClockRow,
    /// Its dwells, by verdict and reason.
    pub dwells: Vec<(PairingVerdict, Option<Unpaired>, usize)>,
    /// What was left out.
    pub rejects: Vec<RejectRow>,
}

/// What came into a stage.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Count {
    /// The stage.
    pub stage: String,
    /// What is counted.
    pub of: String,
    /// How many came in.
    pub read: u64,
    /// How many were kept.
    pub kept: u64,
    /// How many were rejected, by reason.
    pub rejected: Vec<(String, u64)>,
}

/// What a run was made from: what is the same wherever and whenever the same work is done, as the page is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Provenance {
    /// The pipeline file's name.
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
