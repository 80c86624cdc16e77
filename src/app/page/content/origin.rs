//! The origin of a run: its logs, the items left out of them, its inputs and settings.

use crate::io::tables::clocks::ClockRow;
use crate::io::tables::rejects::RejectRow;
use crate::io::tables::stations::{PairingVerdict, Unpaired};

#[derive(Debug, Clone, PartialEq)]
pub struct Session {
    pub name: String,
    /// Whether it is a training session; otherwise it is only judged.
    pub trained: bool,
    pub clock: ClockRow,
    pub dwells: Vec<(PairingVerdict, Option<Unpaired>, usize)>,
    pub rejects: Vec<RejectRow>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Count {
    pub stage: String,
    pub of: String,
    pub read: u64,
    pub kept: u64,
    pub rejected: Vec<(String, u64)>,
}

/// The origin of a run: only values that are the same wherever and whenever the same work is done, like the page itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Provenance {
    pub pipeline: String,
    pub version: String,
    /// Files read: name, bytes, digest.
    pub inputs: Vec<(String, u64, String)>,
    /// Tables written: name, rows, digest.
    pub tables: Vec<(String, u64, String)>,
    pub settings: String,
}
