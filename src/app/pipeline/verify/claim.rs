//! The contents of a row of `runs`.

use std::mem::take;
use std::sync::Arc;

use crate::files::schema::KEY_COLUMNS;
use crate::files::table::Table;
use crate::io::rows::Row as _;
use crate::io::tables::runs::{RunRow, row_digest};
use crate::manifest::{Input, RunKey, VERSION, Work, Written, cpu_features, platform};

/// A row of `runs` that can be read.
#[derive(Debug, Clone, PartialEq)]
pub struct Claim {
    pub key: RunKey,
    /// Its columns; the lists of files read and written are taken out.
    pub run: RunRow,
    pub inputs: Vec<Input>,
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

/// Every run of a lake whose row is at its place.
#[derive(Debug, Clone, Default)]
pub struct Register {
    pub(super) runs: Vec<Arc<Claim>>,
}

impl Register {
    /// The run of this name; no two runs have one.
    pub(super) fn run(&self, name: &str) -> Option<&Arc<Claim>> {
        self.runs.iter().find(|own| own.key.run == name)
    }

    /// A run that wrote this table with this digest, and the file.
    pub(super) fn with_file(&self, table: &str, digest: &str) -> Option<(&Arc<Claim>, &Written)> {
        let is_it = |file: &&Written| file.table == table && file.digest == digest;
        self.runs.iter().find_map(|own| Some((own, own.files.iter().find(is_it)?)))
    }

    /// The name of the run that replaced another; `None` without one.
    pub(super) fn superseding(&self, key: &RunKey) -> Option<String> {
        Some(self.later(key).next()?.key.run.clone())
    }

    /// The runs that replaced another: two where two machines wrote at once.
    pub(super) fn later<'r>(&'r self, key: &'r RunKey) -> impl Iterator<Item = &'r Arc<Claim>> {
        self.runs.iter().filter(|own| {
            let of_session = (&own.key.robot, &own.key.session) == (&key.robot, &key.session);
            of_session && own.run.ending.replaces.as_ref() == Some(&key.run)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::tables::runs::{Ending, table};

    fn run(session: &str, name: &str, replaces: Option<&str>) -> Arc<Claim> {
        let file = Written {
            table: "calibrations".to_owned(),
            session: session.to_owned(),
            rows: 1,
            digest: format!("digest of {name}"),
        };
        let work =
            Work::of_stage("r", session, vec![session.to_owned()], Vec::new(), "{}".to_owned());
        let ending = Ending { replaces: replaces.map(str::to_owned), ..Ending::default() };
        let row = table(&work, &[], &[file], &ending).expect("a row");
        let claim = Claim::of(&row).expect("a claim");
        Arc::new(Claim { key: RunKey::new("r", session, name), ..claim })
    }

    #[test]
    fn a_run_is_superseded_by_one_of_its_own_session() {
        let runs =
            vec![run("mon", "a", None), run("mon", "b", Some("a")), run("tue", "c", Some("b"))];
        let register = Register { runs };
        let by = |session, name| register.superseding(&RunKey::new("r", session, name));
        assert_eq!(by("mon", "a").as_deref(), Some("b"));
        assert_eq!(by("mon", "b"), None, "c is of another session");
        let known = register.with_file("calibrations", "digest of b");
        assert_eq!(known.expect("there").0.key.run, "b");
        assert!(register.with_file("accuracy", "digest of b").is_none());
        assert!(register.run("c").is_some() && register.run("d").is_none());
    }
}
