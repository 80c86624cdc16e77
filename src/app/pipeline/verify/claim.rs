//! The contents of a row of `runs`.

use crate::io::schema::KEY_COLUMNS;
use crate::io::table::{Row as _, Table};
use crate::io::tables::runs::{RunRow, row_digest};
use crate::manifest::{Input, RunKey, VERSION, Written, cpu_features, platform};

/// A row of `runs`, as far as it can be recomputed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Claim {
    /// Robot, session and name.
    pub key: RunKey,
    /// Name of the pipeline file.
    pub pipeline: String,
    /// Version that computed it.
    pub version: String,
    /// Processor architecture and operating system.
    pub platform: String,
    /// Processor features that determine the arithmetic.
    pub cpu_features: Vec<String>,
    /// Sessions learnt from.
    pub sessions: Vec<String>,
    /// Sessions that only judged.
    pub test_sessions: Vec<String>,
    /// Files read.
    pub inputs: Vec<Input>,
    /// Every setting as JSON.
    pub settings: String,
    /// The digest of `settings`.
    pub settings_digest: String,
    pub files: Vec<Written>,
    /// Sessions as joined that it started from, as SESSION/RUN; `None` of a plan and of earlier versions.
    pub made_of: Option<Vec<String>>,
    /// The estimate that it started from; `None` likewise.
    pub estimate: Option<String>,
    /// The grids that it started from; `None` of a plan, and in rows of versions that did not name them.
    pub grids: Option<String>,
    /// The run of the same robot and session that it replaces.
    pub replaces: Option<String>,
    /// The digests that it states of its own content and of the row that it replaces.
    pub row: RowDigests,
}

/// The digests that a row of `runs` states.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RowDigests {
    /// The version of the table that wrote it: rows of version 1 state no digest.
    pub version: u32,
    /// The digest of its content, computed.
    pub found: String,
    /// The digest of its content, as stated; `None` where it states none.
    pub stated: Option<String>,
    /// The digest of the row of the run that it replaces, as it states it.
    pub replaced: Option<String>,
}

impl RowDigests {
    /// The first version of the table whose rows state their digest.
    const FIRST: u32 = 2;

    /// Whether rows of its version state a digest.
    pub const fn are_due(&self) -> bool {
        self.version >= Self::FIRST
    }
}

impl Claim {
    /// The claim in the only row of the table `runs`; an error states, as text, why it cannot be read.
    pub fn of(row: &Table) -> Result<Self, String> {
        if row.rows() != 1 {
            return Err(format!("{} rows, and a run has one", row.rows()));
        }
        let [robot, session, run] = KEY_COLUMNS.map(|part| row.text(part).value(0));
        let (version, found) = (row.version(), row_digest(row));
        let row = RunRow::read(row).swap_remove(0);
        let inputs = together("input", row.inputs.names, row.inputs.bytes, row.inputs.digests)?;
        let files = together("table", row.files.names, row.files.rows, row.files.digests)?;
        Ok(Self {
            key: RunKey::new(robot, session, run),
            pipeline: row.pipeline,
            version: row.made.version,
            platform: row.made.platform,
            cpu_features: row.made.cpu_features,
            sessions: row.sessions,
            test_sessions: row.test_sessions,
            inputs: inputs.map(|(name, bytes, digest)| Input { name, bytes, digest }).collect(),
            settings: row.made.settings,
            settings_digest: row.made.settings_digest,
            files: files.map(written).collect(),
            made_of: row.ending.made_of,
            estimate: row.ending.estimate,
            grids: row.ending.grids,
            replaces: row.ending.replaces,
            row: RowDigests {
                version,
                found,
                stated: row.row_digest,
                replaced: row.ending.replaced_row_digest,
            },
        })
    }

    /// Whether another version computed it.
    pub(super) fn is_other_version(&self) -> bool {
        self.version != VERSION
    }

    /// Whether a processor of another kind, or with other features, computed it.
    pub(super) fn is_other_machine(&self) -> bool {
        self.platform != platform() || self.cpu_features != cpu_features()
    }

    /// The version or the machine that computed it, as text, where it is not this program on this processor.
    pub fn elsewhere(&self) -> Vec<String> {
        let mut told = Vec::new();
        if self.is_other_version() {
            told.push(format!("computed by version {}, this is {VERSION}", self.version));
        }
        if self.is_other_machine() {
            told.push(format!(
                "computed on {} ({}), this is {} ({})",
                self.platform,
                self.cpu_features.join(" "),
                platform(),
                cpu_features().join(" ")
            ));
        }
        told
    }
}

fn written((name, rows, digest): (String, u64, String)) -> Written {
    let (table, session) = name.split_once('/').unwrap_or((&name, ""));
    Written { table: table.to_owned(), session: session.to_owned(), rows, digest }
}

/// Three lists of the same length.
fn together(
    of: &str,
    names: Vec<String>,
    numbers: Vec<u64>,
    digests: Vec<String>,
) -> Result<impl Iterator<Item = (String, u64, String)>, String> {
    let counts = (names.len(), numbers.len(), digests.len());
    if counts.0 != counts.1 || counts.0 != counts.2 {
        return Err(format!(
            "it lists {} {of} names, {} sizes and {} digests, which belong together one by one",
            counts.0, counts.1, counts.2
        ));
    }
    let together = names.into_iter().zip(numbers).zip(digests);
    Ok(together.map(|((name, number), digest)| (name, number, digest)))
}
