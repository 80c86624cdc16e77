//! Where a run comes from: its logs, what was left out of them, its inputs and settings.

/// What the logs of one session gave.
#[derive(Debug, Clone, PartialEq)]
pub struct Session {
    /// Its name.
    pub name: String,
    /// Whether it trained; otherwise it only judged.
    pub trained: bool,
    /// Its clocks.
    pub clock: Clock,
    /// Its dwells, by verdict and reason.
    pub dwells: Vec<(String, Option<String>, usize)>,
    /// What was left out.
    pub rejects: Vec<Reject>,
}

/// How two clocks relate.
#[derive(Debug, Clone, PartialEq)]
pub struct Clock {
    /// What the tracker's clock is ahead at the first stamp, and its standard error, ns.
    pub offset_ns: [f64; 2],
    /// How much faster it runs, and its standard error, ppm.
    pub drift_ppm: [f64; 2],
    /// Edges that were matched.
    pub edges: i64,
    /// Root mean square of their residuals, ns.
    pub rms_ns: f64,
    /// How it was found.
    pub method: String,
}

/// What was left out for one reason.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Reject {
    /// The stage.
    pub stage: String,
    /// Bytes, messages, readings, dwells.
    pub kind: String,
    /// Why.
    pub reason: String,
    /// How many; absent where damage hides it.
    pub number: Option<i64>,
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
