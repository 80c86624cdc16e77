//! The contents of a row of `runs`.

use std::mem::take;

use crate::io::schema::KEY_COLUMNS;
use crate::io::table::{Row as _, Table};
use crate::io::tables::runs::{RunRow, row_digest};
use crate::manifest::{Input, RunKey, VERSION, Work, Written, cpu_features, platform};

/// A row of `runs` that can be read.
#[derive(Debug, Clone, PartialEq)]
pub struct Claim {
    pub key: RunKey,
    /// Its columns; the lists of files read and written are taken out.
    pub run: RunRow,
    /// Files read.
    pub inputs: Vec<Input>,
    /// Files written.
    pub files: Vec<Written>,
    /// The digest of its content, computed.
    pub found: String,
    /// The version of the table that wrote it.
    pub table_version: u32,
}

/// The first version of the table whose rows state their digest.
const WITH_DIGEST: u32 = 2;

impl Claim {
    /// The claim in the only row of the table `runs`; an error states, as text, why it cannot be read.
    pub fn of(row: &Table) -> Result<Self, String> {
        if row.rows() != 1 {
            return Err(format!("{} rows, and a run has one", row.rows()));
        }
        let [robot, session, key] = KEY_COLUMNS.map(|part| row.text(part).value(0));
        let mut run = RunRow::read(row).swap_remove(0);
        let (inputs, files) = (take(&mut run.inputs), &mut run.files);
        let inputs = together("input", inputs.names, inputs.bytes, inputs.digests)?;
        let [names, digests] = [&mut files.names, &mut files.digests].map(take);
        let files = together("table", names, take(&mut files.rows), digests)?;
        Ok(Self {
            key: RunKey::new(robot, session, key),
            inputs: inputs.map(|(name, bytes, digest)| Input { name, bytes, digest }).collect(),
            files: files.map(written).collect(),
            found: row_digest(row),
            table_version: row.version(),
            run,
        })
    }

    /// The work that it is of.
    pub fn work(&self) -> Work {
        Work {
            robot: self.key.robot.clone(),
            session: self.key.session.clone(),
            pipeline: self.run.pipeline.clone(),
            sessions: self.run.sessions.clone(),
            test_sessions: self.run.test_sessions.clone(),
            inputs: self.inputs.clone(),
            settings: self.run.made.settings.clone(),
        }
    }

    /// Whether rows of its version state a digest.
    pub const fn is_digest_due(&self) -> bool {
        self.table_version >= WITH_DIGEST
    }

    /// Whether another version computed it.
    pub(super) fn is_other_version(&self) -> bool {
        self.run.made.version != VERSION
    }

    /// Whether a processor of another kind, or with other features, computed it.
    pub(super) fn is_other_machine(&self) -> bool {
        self.run.made.platform != platform() || self.run.made.cpu_features != cpu_features()
    }

    /// The version or the machine that computed it, as text, where it is not this program on this processor.
    pub fn elsewhere(&self) -> Vec<String> {
        let mut told = Vec::new();
        if self.is_other_version() {
            told.push(format!("computed by version {}, this is {VERSION}", self.run.made.version));
        }
        if self.is_other_machine() {
            told.push(format!(
                "computed on {} ({}), this is {} ({})",
                self.run.made.platform,
                self.run.made.cpu_features.join(" "),
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
