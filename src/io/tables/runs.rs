//! `runs`: the inputs of a run, the counts of each stage, the files it wrote. Its row makes the run exist.

use super::Result;
pub use super::stage_results::row_digest;
use super::stage_results::{FileColumns, InputColumns, MadeColumns, signed};
use super::words::{TableVerdict, VerdictOf};
use crate::manifest::{Replaced, StageCount, Work, Written};
use crate::rows::{columns, row};
use crate::table::Table;
use crate::units::WallTime;

row! {
    pub struct RunRow of "runs" {
        pipeline: String,
        made: MadeColumns,
        sessions: Vec<String>,
        test_sessions: Vec<String>,
        inputs: InputColumns,
        counts: String,
        files: FileColumns,
        ending: Ending,
        row_digest: Option<String>,
    }
}

columns! {
    /// How a finished run ended, and what it started from.
    #[derive(Default)]
    pub struct Ending {
        session_started: Option<WallTime>,
        first_session_started: Option<WallTime>,
        verdict: TableVerdict,
        reason: Option<String>,
        verdict_of: Option<VerdictOf>,
        statement: Option<String>,
        warnings: Option<Vec<String>>,
        mean_before_mm: Option<f64>,
        mean_after_mm: Option<f64>,
        means_of: Option<String>,
        bound_mm: Option<f64>,
        held_out: Option<usize>,
        visits: Option<usize>,
        stations_covered_share: Option<f64>,
        means_by_poses_mm: Option<Vec<f64>>,
        made_of: Option<Vec<String>>,
        estimate: Option<String>,
        grids: Option<String>,
        replaces: Option<String>,
        replaced_row_digest: Option<String>,
    }
}

impl Ending {
    #[must_use]
    pub fn replacing(self, replaced: Option<Replaced>) -> Self {
        let (replaces, replaced_row_digest) = replaced.map(|own| (own.run, own.row_digest)).unzip();
        Self { replaces, replaced_row_digest, ..self }
    }
}

pub fn table(
    work: &Work,
    counts: &[StageCount],
    written: &[Written],
    ending: &Ending,
) -> Result<Table> {
    counts.iter().try_for_each(StageCount::check)?;
    let row = RunRow {
        pipeline: work.pipeline.clone(),
        made: work.into(),
        sessions: work.sessions.clone(),
        test_sessions: work.test_sessions.clone(),
        inputs: work.inputs[..].into(),
        counts: serde_json::to_string(counts)?,
        files: written.into(),
        ending: ending.clone(),
        row_digest: None,
    };
    Ok(signed(&work.key(), row, |row, row_digest| RunRow { row_digest, ..row })?)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    fn work() -> Work {
        Work::of_stage("ur10", "grid", vec!["grid".to_owned()], Vec::new(), "{}".to_owned())
    }

    #[test]
    fn a_stage_that_loses_something_is_refused() {
        let count = |kept| StageCount {
            stage: "join",
            of: "readings",
            read: 10,
            kept,
            rejected: BTreeMap::from([("settling".to_owned(), 2), ("outlier".to_owned(), 1)]),
        };
        let outcome = Ending::default();
        let row = table(&work(), &[count(7)], &[], &outcome).unwrap();
        assert_eq!(row.text("row_digest").value(0), row_digest(&row));
        assert!(row.text("counts").value(0).contains(r#""rejected":{"outlier":1,"settling":2}"#));
        let error = table(&work(), &[count(6)], &[], &outcome).unwrap_err();
        assert!(error.to_string().contains("6 + 3 is not 10"), "{error}");
    }
}
