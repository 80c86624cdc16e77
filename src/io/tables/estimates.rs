//! `estimates`: what an estimate trained, for runs that differ in what comes after it. Its row makes it exist; `estimate_residuals` has the
//! errors of its stations.

use super::Result;
use super::residuals::{self, EstimateResidualRow};
use super::stage_results::{self, MadeColumns, NotRestored, signed};
use crate::judgement::StoredTrainings;
use crate::lake::Lake;
use crate::manifest::{Input, ROBOT, RunKey, Work, Written};
use crate::report::ResidualSet;
use crate::rows::{Row as _, row};
use crate::table::Table;

row! {
    pub struct EstimateRow of "estimates" {
        made: MadeColumns,
        session_names: Vec<String>,
        session_runs: Vec<String>,
        robot_digest: String,
        models: String,
        fold_models: Vec<String>,
        left_out: String,
        table_names: Option<Vec<String>>,
        table_rows: Option<Vec<u64>>,
        table_digests: Option<Vec<String>>,
        row_digest: Option<String>,
    }
}

/// The work of an estimate, of which its name follows: the robot file and the sessions as joined that train are its inputs.
pub fn work(robot: &str, session: &str, inputs: Vec<Input>, settings: String) -> Work {
    let sessions = inputs.iter().filter(|input| input.name != ROBOT);
    let sessions = sessions.map(|input| input.name.clone()).collect();
    Work::of_stage(robot, session, sessions, inputs, settings)
}

/// The inputs of an estimate: a robot file by its digest, sessions by the names of their results.
pub fn inputs<'s>(
    robot_digest: &str,
    sessions: impl IntoIterator<Item = (&'s String, &'s String)>,
) -> Vec<Input> {
    let input = |name: &str, digest: &str| Input {
        name: name.to_owned(),
        bytes: 0,
        digest: digest.to_owned(),
    };
    let sessions = sessions.into_iter();
    let sessions = sessions.map(|(name, run)| input(name, run));
    std::iter::once(input(ROBOT, robot_digest)).chain(sessions).collect()
}

/// The table `estimate_residuals`; `targets` are the names of targets, where there are several.
pub fn residuals(sets: &[ResidualSet], targets: &[String], key: &RunKey) -> Result<Table> {
    let rows = residuals::rows(sets, targets).into_iter();
    let rows = rows.map(|residual| EstimateResidualRow { residual }).collect();
    Ok(EstimateResidualRow::table(rows, key)?.table)
}

/// The table `estimates` of what this work trained, whose residuals were written as `written`.
pub fn table(trained: &StoredTrainings, work: &Work, written: &[Written]) -> Result<Table> {
    let (robots, sessions): (Vec<&Input>, Vec<&Input>) =
        work.inputs.iter().partition(|input| input.name == ROBOT);
    let row = EstimateRow {
        made: work.into(),
        session_names: sessions.iter().map(|input| input.name.clone()).collect(),
        session_runs: sessions.iter().map(|input| input.digest.clone()).collect(),
        robot_digest: robots.first().map_or_else(String::new, |robot| robot.digest.clone()),
        models: serde_json::to_string(&trained.models)?,
        fold_models: trained.folds.iter().map(serde_json::to_string).collect::<Result<_, _>>()?,
        left_out: serde_json::to_string(&trained.sessions_left_out)?,
        table_names: Some(written.iter().map(Written::name).collect()),
        table_rows: Some(written.iter().map(|file| file.rows).collect()),
        table_digests: Some(written.iter().map(|file| file.digest.clone()).collect()),
        row_digest: None,
    };
    Ok(signed(&work.key(), row, |row, row_digest| EstimateRow { row_digest, ..row })?)
}

/// Reads what an estimate trained back from a lake; `targets` are the names of targets, where there are several.
pub fn restored(
    lake: &Lake,
    key: &RunKey,
    targets: &[String],
) -> Result<StoredTrainings, NotRestored> {
    let row: EstimateRow = stage_results::row(lake, key)?;
    let folds = row.fold_models.iter().map(|own| serde_json::from_str(own));
    Ok(StoredTrainings {
        models: serde_json::from_str(&row.models)?,
        folds: folds.collect::<Result<_, _>>()?,
        sessions_left_out: serde_json::from_str(&row.left_out)?,
        residuals: errors(lake, key, targets),
    })
}

/// The errors of an estimate's stations; `None` where their table is gone or was changed, or does not have all of them.
fn errors(lake: &Lake, key: &RunKey, targets: &[String]) -> Option<Vec<ResidualSet>> {
    let table = lake.read(EstimateResidualRow::TABLE, key).ok()?;
    let rows = EstimateResidualRow::read(&table).into_iter();
    residuals::sets(rows.map(|own| own.residual).collect(), targets)
}
