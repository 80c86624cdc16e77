//! The row of `runs`: what went into a run, what came out of each stage, which files it wrote.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{ManifestError, VERSION, Work};
use crate::io::schema;
use crate::io::table::{Columns, Table};

/// What came into a stage and what became of it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StageCount {
    /// The stage.
    pub stage: &'static str,
    /// What is counted: messages, readings, dwells.
    pub of: &'static str,
    /// How many came in.
    pub read: u64,
    /// How many were kept.
    pub kept: u64,
    /// How many were rejected, by reason.
    pub rejected: BTreeMap<String, u64>,
}

/// One table file that a run wrote.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    /// The table.
    pub table: String,
    /// The session whose file it is.
    pub session: String,
    /// Rows in it.
    pub rows: u64,
    /// BLAKE3 of the file, hexadecimal.
    pub digest: String,
}

/// How a finished run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Outcome {
    /// `met`, `not_met` or `not_shown`.
    pub verdict: String,
    /// Why not met or not shown.
    pub reason: Option<String>,
    /// The run that this one takes the place of.
    pub replaces: Option<Replaced>,
}

/// A run that another takes the place of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Replaced {
    /// Its name.
    pub run: String,
    /// The digest of its row in `runs`, as [`row_digest`] gives it.
    pub row_digest: String,
}

/// The column that holds the digest of all others of a row.
const ROW_DIGEST: &str = "row_digest";

/// BLAKE3 of the content of a row of `runs`, hexadecimal: of all its columns but the one that holds this digest.
pub fn row_digest(row: &Table) -> String {
    row.digest_without(&[ROW_DIGEST])
}

impl Work {
    /// The row of `runs`.
    pub fn runs_table(
        &self,
        counts: &[StageCount],
        written: &[Written],
        outcome: &Outcome,
    ) -> Result<Table, ManifestError> {
        counts.iter().try_for_each(StageCount::check)?;
        let inputs = || self.inputs.iter();
        let replaced = || outcome.replaces.as_ref();
        let files: Vec<String> = written
            .iter()
            .map(|file| format!("{}/{}", file.table, file.session))
            .collect();
        let table = Columns::new(schema::find("runs")?, 1)
            .key(&self.key())
            .same("pipeline", &self.pipeline)
            .same("version", VERSION)
            .same("platform", platform())
            .same("cpu_features", cpu_features())
            .same("sessions", &self.sessions)
            .same("test_sessions", &self.test_sessions)
            .same(
                "input_names",
                inputs()
                    .map(|input| input.name.as_str())
                    .collect::<Vec<_>>(),
            )
            .same(
                "input_bytes",
                inputs().map(|input| input.bytes).collect::<Vec<u64>>(),
            )
            .same(
                "input_digests",
                inputs()
                    .map(|input| input.digest.as_str())
                    .collect::<Vec<_>>(),
            )
            .same("settings", &self.settings)
            .same(
                "settings_digest",
                blake3::hash(self.settings.as_bytes()).to_hex().to_string(),
            )
            .same("counts", serde_json::to_string(counts)?)
            .same("table_names", files)
            .same(
                "table_rows",
                written.iter().map(|file| file.rows).collect::<Vec<u64>>(),
            )
            .same(
                "table_digests",
                written
                    .iter()
                    .map(|file| file.digest.as_str())
                    .collect::<Vec<_>>(),
            )
            .same("verdict", &outcome.verdict)
            .same("reason", outcome.reason.as_deref())
            .same("replaces", replaced().map(|replaced| replaced.run.as_str()))
            .same(
                "replaced_row_digest",
                replaced().map(|replaced| replaced.row_digest.as_str()),
            )
            .absent([ROW_DIGEST])
            .finish()?;
        let digest = row_digest(&table);
        Ok(Columns::like(&table)
            .same(ROW_DIGEST, Some(digest))
            .finish()?)
    }
}

impl StageCount {
    fn check(&self) -> Result<(), ManifestError> {
        let rejected = self.rejected.values().sum();
        if self.kept.checked_add(rejected) == Some(self.read) {
            return Ok(());
        }
        Err(ManifestError::Unbalanced {
            stage: self.stage,
            of: self.of,
            read: self.read,
            kept: self.kept,
            rejected,
        })
    }
}

/// Processor architecture and operating system, as `x86_64-linux`.
pub fn platform() -> String {
    format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS)
}

/// The processor features by which this build and its libraries choose their arithmetic, sorted.
pub fn cpu_features() -> Vec<&'static str> {
    #[cfg(target_arch = "x86_64")]
    let known = [
        ("avx", std::is_x86_feature_detected!("avx")),
        ("avx2", std::is_x86_feature_detected!("avx2")),
        ("avx512f", std::is_x86_feature_detected!("avx512f")),
        ("fma", std::is_x86_feature_detected!("fma")),
        ("sse4.1", std::is_x86_feature_detected!("sse4.1")),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let known: [(&str, bool); 0] = [];
    known
        .into_iter()
        .filter_map(|(name, there)| there.then_some(name))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::tests::work;
    use super::*;

    #[test]
    fn a_stage_that_loses_something_is_refused() {
        let count = |kept| StageCount {
            stage: "join",
            of: "readings",
            read: 10,
            kept,
            rejected: BTreeMap::from([("settling".to_owned(), 2), ("outlier".to_owned(), 1)]),
        };
        let outcome = Outcome {
            verdict: "met".to_owned(),
            reason: None,
            replaces: None,
        };
        let row = work().runs_table(&[count(7)], &[], &outcome).unwrap();
        assert_eq!(row.text("row_digest").value(0), row_digest(&row));
        assert!(
            row.text("counts")
                .value(0)
                .contains(r#""rejected":{"outlier":1,"settling":2}"#)
        );
        let error = work().runs_table(&[count(6)], &[], &outcome).unwrap_err();
        assert!(error.to_string().contains("6 + 3 is not 10"), "{error}");
    }
}
