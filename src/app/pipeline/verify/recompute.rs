//! A run recomputed into a temporary lake, and all its files compared with the published ones.

use std::path::Path;

use tempfile::TempDir;

use super::altered::by_name;
use super::cited::DRIVING;
use super::claim::Claim;
use super::source::{NoSource, Source};
use super::stage::OF_THE_MACHINE;
use super::{Recomputed, Verified};
use crate::files::table::Table;
use crate::files::table::compare::{Comparison, compare};
use crate::files::temporary;
use crate::io::lake::{ESTIMATES, GRIDS, Lake, LakeError, PAGES};
use crate::io::rows::Row as _;
use crate::io::tables::runs::RunRow;
use crate::manifest::{RunKey, Written};
use crate::pipeline::planning;
use crate::progress::Progress;

/// Columns of `runs` that are not compared as values: the machine and the replaced run may differ, what it is made of is named by version, inputs and settings were
/// compared before, and the digests of files and of the row are compared by themselves.
const ROW_ONLY: [&str; 15] = [
    "made_of",
    "estimate",
    "grids",
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

const TEMPORARY: &str = "posegrid-verify";

#[derive(Debug, Clone)]
pub struct ComparedFile {
    /// TABLE/SESSION.
    pub name: String,
    /// BLAKE3 of the computed file; `None` where computing gave none.
    pub computed: Option<String>,
    pub outcome: FileOutcome,
}

#[derive(Debug, Clone)]
pub enum FileOutcome {
    Values(Comparison),
    OnlyPublished,
    /// The row does not name it, or its file is gone.
    OnlyComputed,
    /// Pages with the same text, except for the digests of tables that differ.
    PageOfOtherBytes,
    /// Pages that differ in more than digests.
    Page,
    /// A page of another version or machine, which is not compared.
    PageFromElsewhere,
    /// The published table cannot be read: the reason.
    Unreadable(String),
}

/// A new lake under the system's temporary directory, with the plans of the robot, which the run may be compared with. It
/// is removed when dropped; the lake of a process that was interrupted is removed by [`clean`].
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

/// Adds the run that made the table that drove the session, for comparison.
pub(super) fn add_table(lake: &Lake, made: &RunKey, temporary: &Path) -> Result<(), String> {
    let copied = lake.copy_run(&["runs"], made, temporary);
    let copied = copied.and_then(|()| lake.copy_run(&DRIVING, made, temporary));
    copied.map_err(|error| format!("the run of the table that drove it cannot be copied: {error}"))
}

/// Removes temporary lakes of processes that are gone.
pub fn clean() {
    temporary::clean_folders(TEMPORARY);
}

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
    let sides = Sides { verified, lake, computed: &Lake::new(temporary), key: &key };
    sides.compared().unwrap_or_else(|error| {
        Recomputed::No(format!(
            "the recomputed run cannot be read: {error}; the logs may name another robot than {:?}",
            claim.key.robot
        ))
    })
}

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
        let (mut same, mut others) = (0, Vec::new());
        for (name, sides) in by_name(&self.verified.claim.files, &computed.files, Written::name) {
            match self.file(sides, &computed)? {
                None => same += 1,
                Some(outcome) => others.push(ComparedFile {
                    name,
                    computed: sides.1.map(|file| file.digest.clone()),
                    outcome,
                }),
            }
        }
        others.extend(self.of_stages(&row)?);
        let published = self.lake.read_as_it_is("runs", &self.verified.claim.key)?.table;
        // The columns of the row that have to agree.
        others.extend(self.difference(&published, &row, &ROW_ONLY));
        Ok(Recomputed::Yes { same, others })
    }

    /// The difference of a file; `None` where there is none.
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
        // Values of a changed file are compared too, to show which differ.
        let own = self.lake.read_as_it_is(&published.table, &own_key);
        Ok(Some(match own {
            Ok(own) => FileOutcome::Values(self.values(&own.table, &other, &[])),
            Err(error) => FileOutcome::Unreadable(error.to_string()),
        }))
    }

    /// The digest of the published file; `None` where it is missing.
    fn found(&self, file: &Written) -> Option<&String> {
        let name = file.name();
        self.verified.outputs.iter().find(|output| output.name == name)?.digest()
    }

    /// Values of two tables; runs of two versions have two names.
    fn values(&self, own: &Table, other: &Table, ignored: &[&str]) -> Comparison {
        let mut ignored = ignored.to_vec();
        if self.key.run != self.verified.claim.key.run {
            ignored.push("run");
        }
        compare(own, other, &ignored)
    }

    /// A page names the digests of its tables: where their bytes differ, the page's do too.
    fn page(&self, own: &RunKey, other: &RunKey, computed: &Claim) -> FileOutcome {
        let claim = &self.verified.claim;
        if claim.is_other_version() || claim.is_other_machine() {
            return FileOutcome::PageFromElsewhere;
        }
        let pages = (self.lake.read_page(own), self.computed.read_page(other));
        let (Ok(own), Ok(mut other)) = pages else { return FileOutcome::Page };
        for again in &computed.files {
            let name = again.name();
            let mut files = claim.files.iter();
            if let Some(published) = files.find(|file| file.name() == name) {
                other = other.replace(&again.digest, &published.digest);
            }
        }
        if own == other { FileOutcome::PageOfOtherBytes } else { FileOutcome::Page }
    }

    /// The differences of the estimates and grids that both started from; none of what the lake does not have any more.
    fn of_stages(&self, computed: &Table) -> Result<Vec<ComparedFile>, LakeError> {
        let claim = &self.verified.claim;
        let Some(computed) = RunRow::read(computed).pop() else { return Ok(Vec::new()) };
        let of_both = [
            (ESTIMATES, &claim.run.ending.estimate, computed.ending.estimate),
            (GRIDS, &claim.run.ending.grids, computed.ending.grids),
        ];
        let mut differences = Vec::new();
        for (stage, published, computed) in of_both {
            let (Some(published), Some(computed)) = (published, computed) else { continue };
            let published = RunKey::new(&claim.key.robot, &claim.key.session, published);
            let computed = RunKey::new(&self.key.robot, &self.key.session, &computed);
            for table in stage.tables() {
                if self.lake.has(table, &published)? {
                    let own = self.lake.read_as_it_is(table, &published)?.table;
                    let other = self.computed.read(table, &computed)?;
                    differences.extend(self.difference(&own, &other, &OF_THE_MACHINE));
                }
            }
        }
        Ok(differences)
    }

    fn difference(&self, own: &Table, other: &Table, ignored: &[&str]) -> Option<ComparedFile> {
        let comparison = self.values(own, other, ignored);
        (comparison.same_values() != Some(0.0)).then(|| ComparedFile {
            name: format!("{}/{}", own.schema().table, self.verified.claim.key.session),
            computed: None,
            outcome: FileOutcome::Values(comparison),
        })
    }
}
