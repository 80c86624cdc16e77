//! `runs`: the inputs of a run, the counts of each stage, the files it wrote. Its row makes the run exist.

use super::PublishError;
pub use super::stage_results::row_digest;
use super::stage_results::signed;
use super::words::{TableVerdict, VerdictOf};
use crate::figures::Counted;
use crate::manifest::{
    Replaced, RunKey, StageCount, VERSION, Work, Written, cpu_features, platform,
};
use crate::table::{Table, row};
use crate::units::WallTime;

row! {
    pub struct RunRow of "runs" {
        pipeline: String,
        version: String,
        platform: String,
        cpu_features: Vec<String>,
        session_started: Option<WallTime>,
        first_session_started: Option<WallTime>,
        sessions: Vec<String>,
        test_sessions: Vec<String>,
        input_names: Vec<String>,
        input_bytes: Vec<u64>,
        input_digests: Vec<String>,
        settings: String,
        settings_digest: String,
        counts: String,
        table_names: Vec<String>,
        table_rows: Vec<u64>,
        table_digests: Vec<String>,
        verdict: TableVerdict,
        reason: Option<String>,
        verdict_of: Option<VerdictOf>,
        statement: Option<String>,
        mean_before_mm: Option<f64>,
        mean_after_mm: Option<f64>,
        means_of: Option<String>,
        bound_mm: Option<f64>,
        held_out: Option<usize>,
        visits: Option<usize>,
        stations_covered_share: Option<f64>,
        made_of: Option<Vec<String>>,
        estimate: Option<String>,
        grids: Option<String>,
        replaces: Option<String>,
        replaced_row_digest: Option<String>,
        row_digest: Option<String>,
    }
}

/// How a finished run ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Ending {
    /// Whether the tolerance is met.
    pub verdict: TableVerdict,
    /// Why not met or not shown.
    pub reason: Option<String>,
    /// The table that the verdict is of.
    pub verdict_of: VerdictOf,
    /// The verdict in words, with what it is of and why.
    pub statement: String,
    /// Start of the last session and of the earliest one; `None` where no clock has an epoch, and of a plan.
    pub started: [Option<WallTime>; 2],
    /// Mean errors before and after correction, mm; `None` of a plan, and where no station judges.
    pub means_mm: Option<[f64; 2]>,
    /// What both are of, in words.
    pub means_of: Option<String>,
    /// The bound that it rests on, mm; `None` where there is none.
    pub bound_mm: Option<f64>,
    /// Held-out poses and visits that the bound counts; `None` of a plan.
    pub counted: Option<Counted>,
    /// Share of all measured stations that the table answers for; `None` where the verdict is of something else.
    pub stations_covered_share: Option<f64>,
    /// The sessions as joined that it started from; `None` of a plan.
    pub made_of: Option<Vec<RunKey>>,
    /// The name of the estimate that it started from; `None` of a plan.
    pub estimate: Option<String>,
    /// The name of the grids that it started from; `None` of a plan.
    pub grids: Option<String>,
    /// The run that this one takes the place of.
    pub replaces: Option<Replaced>,
}

/// The table of the run's row.
pub fn table(
    work: &Work,
    counts: &[StageCount],
    written: &[Written],
    ending: &Ending,
) -> Result<Table, PublishError> {
    counts.iter().try_for_each(StageCount::check)?;
    let row = row(work, serde_json::to_string(counts)?, written, ending);
    Ok(signed(&work.key(), row, |row, row_digest| RunRow { row_digest, ..row })?)
}

/// The row without its digest.
fn row(work: &Work, counts: String, written: &[Written], ending: &Ending) -> RunRow {
    let inputs = || work.inputs.iter();
    let replaced = ending.replaces.as_ref();
    let [session_started, first_session_started] = ending.started;
    RunRow {
        session_started,
        first_session_started,
        mean_before_mm: ending.means_mm.map(|[before, _]| before),
        mean_after_mm: ending.means_mm.map(|[_, after]| after),
        means_of: ending.means_of.clone(),
        pipeline: work.pipeline.clone(),
        version: VERSION.to_owned(),
        platform: platform(),
        cpu_features: cpu_features().into_iter().map(str::to_owned).collect(),
        sessions: work.sessions.clone(),
        test_sessions: work.test_sessions.clone(),
        input_names: inputs().map(|input| input.name.clone()).collect(),
        input_bytes: inputs().map(|input| input.bytes).collect(),
        input_digests: inputs().map(|input| input.digest.clone()).collect(),
        settings: work.settings.clone(),
        settings_digest: work.settings_digest(),
        counts,
        table_names: written.iter().map(Written::name).collect(),
        table_rows: written.iter().map(|file| file.rows).collect(),
        table_digests: written.iter().map(|file| file.digest.clone()).collect(),
        verdict: ending.verdict,
        reason: ending.reason.clone(),
        verdict_of: Some(ending.verdict_of),
        statement: Some(ending.statement.clone()),
        bound_mm: ending.bound_mm,
        held_out: ending.counted.map(|counted| counted.poses),
        visits: ending.counted.map(|counted| counted.visits),
        stations_covered_share: ending.stations_covered_share,
        made_of: ending.made_of.as_ref().map(|sessions| {
            let names = sessions.iter();
            names.map(|own| format!("{}/{}", own.session, own.run)).collect()
        }),
        estimate: ending.estimate.clone(),
        grids: ending.grids.clone(),
        replaces: replaced.map(|replaced| replaced.run.clone()),
        replaced_row_digest: replaced.map(|replaced| replaced.row_digest.clone()),
        row_digest: None,
    }
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
        let outcome = Ending {
            verdict: TableVerdict::Met,
            reason: None,
            verdict_of: VerdictOf::Compensation,
            statement: "met by the compensation table: held-out blocks of mon".to_owned(),
            started: [None; 2],
            means_mm: Some([1.2, 0.1]),
            means_of: None,
            bound_mm: Some(0.2),
            counted: Some(Counted::once(100)),
            stations_covered_share: Some(1.0),
            made_of: None,
            estimate: None,
            grids: None,
            replaces: None,
        };
        let row = table(&work(), &[count(7)], &[], &outcome).unwrap();
        assert_eq!(row.text("row_digest").value(0), row_digest(&row));
        assert!(row.text("counts").value(0).contains(r#""rejected":{"outlier":1,"settling":2}"#));
        let error = table(&work(), &[count(6)], &[], &outcome).unwrap_err();
        assert!(error.to_string().contains("6 + 3 is not 10"), "{error}");
    }
}
