//! A run computed again into a temporary lake, and every file of it held against the published one.

use std::collections::BTreeMap;
use std::path::Path;

use tempfile::TempDir;

use super::altered::file_name;
use super::cited::DRIVING;
use super::claim::Claim;
use super::source::{NoSource, Source};
use super::{Recomputed, Verified};
use crate::io::lake::{Lake, LakeError, PAGES, temporary};
use crate::io::table::Table;
use crate::io::table::compare::{Comparison, compare};
use crate::manifest::{RunKey, Written};
use crate::pipeline::planning;
use crate::progress::Progress;

/// Columns of `runs` that are not compared as values: who computed it and which run it replaces may differ, inputs and
/// settings were compared before, and the digests of files stand beside their names, and the row's own beside them.
const ROW_ONLY: [&str; 12] = [
    "version",
    "platform",
    "cpu_features",
    "replaces",
    "input_names",
    "input_bytes",
    "input_digests",
    "settings",
    "settings_digest",
    "table_digests",
    "replaced_row_digest",
    "row_digest",
];

/// What temporary lakes are named by.
const TEMPORARY: &str = "posegrid-verify";

/// A file of which the published one and the computed one are not the same byte for byte.
#[derive(Debug, Clone)]
pub struct ComparedFile {
    /// TABLE/SESSION.
    pub name: String,
    /// BLAKE3 of the file computed again; `None` where computing gave none.
    pub computed: Option<String>,
    /// How the two differ.
    pub outcome: FileOutcome,
}

/// How a published file and a computed one differ.
#[derive(Debug, Clone)]
pub enum FileOutcome {
    /// Tables, compared by value.
    Values(Comparison),
    /// Computing gave no such file.
    OnlyPublished,
    /// The row does not name it, or its file is gone.
    OnlyComputed,
    /// Pages that say the same, but for the digests of tables that differ.
    PageOfOtherBytes,
    /// Pages that differ in more than digests.
    Page,
    /// A page of another version or machine, which is not compared.
    PageFromElsewhere,
    /// The published table cannot be read as one: why.
    Unreadable(String),
}

/// A new lake under the system's temporary directory, with the plans of the robot, which the run may be held against. It
/// is removed when dropped; what a process leaves that is interrupted, [`clean`] removes.
pub(super) fn temporary_lake(lake: &Lake, key: &RunKey) -> Result<TempDir, String> {
    let told = |error: &dyn std::fmt::Display| {
        format!("no temporary lake: {error}; TMPDIR names the folder that it is made in")
    };
    let made = temporary::folder(TEMPORARY).map_err(|error| told(&error))?;
    if key.session != planning::SESSION {
        let plans = key.of_session(planning::SESSION);
        let copied = lake.copy_session(&["sampling_plan", "runs"], &plans, made.path());
        copied.map_err(|error| told(&error))?;
    }
    Ok(made)
}

/// Adds what a session that a table drove is held against: the run that made the table.
pub(super) fn add_table(lake: &Lake, made: &RunKey, temporary: &Path) -> Result<(), String> {
    let copied = lake.copy_run(&["runs"], made, temporary);
    let copied = copied.and_then(|()| lake.copy_run(&DRIVING, made, temporary));
    copied.map_err(|error| format!("the run of the table that drove it cannot be copied: {error}"))
}

/// Removes temporary lakes of processes that are gone.
pub fn clean() {
    temporary::clean_folders(TEMPORARY);
}

/// Computes the run again and compares.
pub(super) fn again(
    verified: &Verified,
    source: &Source,
    lake: &Lake,
    temporary: &Path,
    progress: &dyn Progress,
) -> Recomputed {
    let claim = &verified.claim;
    let key = match source.run(claim, progress) {
        Ok(key) => key,
        Err(NoSource::Other(reason) | NoSource::Missing(_, reason)) => {
            return Recomputed::No(reason);
        }
    };
    let sides = Sides {
        verified,
        lake,
        computed: &Lake::new(temporary),
        key: &key,
    };
    sides.compared().unwrap_or_else(|error| {
        Recomputed::No(format!(
            "what was computed again cannot be read: {error}; the logs may name another robot than {:?}",
            claim.key.robot
        ))
    })
}

/// The published run and the computed one.
struct Sides<'a> {
    verified: &'a Verified,
    lake: &'a Lake,
    computed: &'a Lake,
    key: &'a RunKey,
}

impl Sides<'_> {
    fn compared(&self) -> Result<Recomputed, LakeError> {
        let row = self.computed.read("runs", self.key)?;
        let computed = Claim::of(&row).expect("a row just written");
        let published = &self.verified.claim.files;
        let mut files: BTreeMap<String, (Option<&Written>, Option<&Written>)> = BTreeMap::new();
        for file in published {
            files.entry(file_name(file)).or_default().0 = Some(file);
        }
        for file in &computed.files {
            files.entry(file_name(file)).or_default().1 = Some(file);
        }
        let (mut same, mut others) = (0, Vec::new());
        for (name, sides) in files {
            match self.file(sides, &computed)? {
                None => same += 1,
                Some(outcome) => others.push(ComparedFile {
                    name,
                    computed: sides.1.map(|file| file.digest.clone()),
                    outcome,
                }),
            }
        }
        others.extend(self.row(&row)?);
        Ok(Recomputed::Yes { same, others })
    }

    /// How a file differs, if it does.
    fn file(
        &self,
        sides: (Option<&Written>, Option<&Written>),
        computed: &Claim,
    ) -> Result<Option<FileOutcome>, LakeError> {
        let (published, again) = match sides {
            (Some(published), Some(again)) => (published, again),
            (Some(_), None) => return Ok(Some(FileOutcome::OnlyPublished)),
            (None, _) => return Ok(Some(FileOutcome::OnlyComputed)),
        };
        match self.found(published) {
            None => return Ok(Some(FileOutcome::OnlyComputed)),
            Some(found) if *found == again.digest => return Ok(None),
            Some(_) => {}
        }
        let own_key = self.verified.claim.key.of_session(&published.session);
        let other_key = self.key.of_session(&again.session);
        if published.table == PAGES {
            return Ok(Some(self.page(&own_key, &other_key, computed)));
        }
        let other = self.computed.read(&again.table, &other_key)?;
        // Values of a file that was changed are compared too: that tells which.
        let own = self.lake.read_as_it_is(&published.table, &own_key);
        Ok(Some(match own {
            Ok(own) => FileOutcome::Values(self.values(&own.table, &other, &[])),
            Err(error) => FileOutcome::Unreadable(error.to_string()),
        }))
    }

    /// The digest of what is published, if it is there.
    fn found(&self, file: &Written) -> Option<&String> {
        let name = file_name(file);
        let mut outputs = self.verified.outputs.iter();
        outputs.find(|output| output.name == name)?.digest()
    }

    /// Values of two tables; runs of two versions have two names.
    fn values(&self, own: &Table, other: &Table, ignored: &[&str]) -> Comparison {
        let mut ignored = ignored.to_vec();
        if self.key.run != self.verified.claim.key.run {
            ignored.push("run");
        }
        compare(own, other, &ignored)
    }

    /// A page names the digests of its tables: where these are other bytes, so is the page.
    fn page(&self, own: &RunKey, other: &RunKey, computed: &Claim) -> FileOutcome {
        let claim = &self.verified.claim;
        if claim.is_other_version() || claim.is_other_machine() {
            return FileOutcome::PageFromElsewhere;
        }
        let pages = (self.lake.read_page(own), self.computed.read_page(other));
        let (Ok(own), Ok(mut other)) = pages else {
            return FileOutcome::Page;
        };
        for again in &computed.files {
            let name = file_name(again);
            let mut files = claim.files.iter();
            if let Some(published) = files.find(|file| file_name(file) == name) {
                other = other.replace(&again.digest, &published.digest);
            }
        }
        if own == other {
            FileOutcome::PageOfOtherBytes
        } else {
            FileOutcome::Page
        }
    }

    /// How the rows of `runs` differ, but for what may.
    fn row(&self, computed: &Table) -> Result<Option<ComparedFile>, LakeError> {
        let key = &self.verified.claim.key;
        let published = self.lake.read_as_it_is("runs", key)?.table;
        let comparison = self.values(&published, computed, &ROW_ONLY);
        Ok(
            (comparison.same_values() != Some(0.0)).then(|| ComparedFile {
                name: format!("runs/{}", key.session),
                computed: None,
                outcome: FileOutcome::Values(comparison),
            }),
        )
    }
}
