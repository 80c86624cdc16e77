//! The chain of stages behind a run, without computing anything: sessions as joined, then the estimate, its grids, then the run.
//!
//! A row of `runs` names the sessions as joined, the estimate and the grids that the run started from. Each of them that the lake still has has to be of
//! the run's own inputs and settings; one that is gone can be made again, and is no contradiction.

use serde_json::Value;

use super::claim::Claim;
use crate::io::lake::{ESTIMATES, GRIDS, JOINED, Lake};
use crate::io::table::{Row, Table};
use crate::io::tables::estimates::EstimateRow;
use crate::io::tables::grids::GridsRow;
use crate::io::tables::joined_sessions::{JoinedSessionRow, inputs};
use crate::manifest::{Input, ROBOT, RunKey, VERSION, canonical};
use crate::pipeline::keys::{estimate_settings, grids_settings, join_settings};
use crate::pipeline::run::is_of_session;

/// Contradictions between a run and the results of stages that it started from.
pub(super) fn contradictions(claim: &Claim, lake: &Lake) -> Vec<String> {
    let Some(made_of) = &claim.made_of else {
        return Vec::new();
    };
    let sessions = || claim.sessions.iter().chain(&claim.test_sessions);
    let named: Vec<RunKey> = made_of
        .iter()
        .filter_map(|name| name.rsplit_once('/'))
        .map(|(session, run)| RunKey::new(&claim.key.robot, session, run))
        .collect();
    if !named.iter().map(|key| &key.session).eq(sessions()) {
        return vec!["the sessions as joined that it names are not those that it reads".to_owned()];
    }
    let mut found: Vec<String> =
        named.iter().filter_map(|key| of_joined(claim, key, lake)).collect();
    let training = &named[..claim.sessions.len()];
    found.extend(of_estimate(claim, training, lake));
    found.extend(of_grids(claim, lake));
    found
}

/// The row of a result that the lake has, and can read.
fn row<R: Row>(lake: &Lake, table: &str, key: &RunKey) -> Option<R> {
    let table: Table = lake.read_as_it_is(table, key).ok()?.table;
    R::read(&table).pop()
}

/// A session as joined that is not of the run's inputs or settings.
fn of_joined(claim: &Claim, key: &RunKey, lake: &Lake) -> Option<String> {
    let row: JoinedSessionRow = row(lake, JOINED, key)?;
    let is_own = |input: &&Input| input.name == ROBOT || is_of_session(&input.name, &key.session);
    let digests = |inputs: &[Input]| -> Vec<(String, String)> {
        let own = inputs.iter().filter(is_own);
        let mut own: Vec<_> = own.map(|input| (input.name.clone(), input.digest.clone())).collect();
        own.sort();
        own
    };
    let of_row = inputs(&row).map(|inputs| digests(&inputs));
    let what = if of_row != Some(digests(&claim.inputs)) {
        "other inputs"
    } else if differs(claim, &row.version, &row.settings, join_settings) {
        "other settings"
    } else {
        return None;
    };
    Some(format!(
        "it states that it started from {} as joined {}, which is of {what}",
        key.session, key.run
    ))
}

/// An estimate that is not of the run's sessions, robot file or settings.
fn of_estimate(claim: &Claim, training: &[RunKey], lake: &Lake) -> Option<String> {
    let name = claim.estimate.as_ref()?;
    let key = RunKey::new(&claim.key.robot, &claim.key.session, name);
    let row: EstimateRow = row(lake, ESTIMATES, &key)?;
    let sessions = row.session_names.iter().zip(&row.session_runs);
    let own = training.iter().map(|key| (&key.session, &key.run));
    let mut robots = claim.inputs.iter().filter(|input| input.name == ROBOT);
    let what = if !sessions.eq(own) {
        "other sessions as joined"
    } else if !robots.any(|robot| robot.digest == row.robot_digest) {
        "another robot file"
    } else if differs(claim, &row.version, &row.settings, estimate_settings) {
        "other settings"
    } else {
        return None;
    };
    Some(format!("it states that it started from the estimate {name}, which is of {what}"))
}

/// Grids that are not of the run's estimate or settings.
fn of_grids(claim: &Claim, lake: &Lake) -> Option<String> {
    let name = claim.grids.as_ref()?;
    let key = RunKey::new(&claim.key.robot, &claim.key.session, name);
    let row: GridsRow = row(lake, GRIDS, &key)?;
    let what = if claim.estimate.as_ref() != Some(&row.estimate) {
        "another estimate"
    } else if differs(claim, &row.version, &row.settings, grids_settings) {
        "other settings"
    } else {
        return None;
    };
    Some(format!("it states that it started from the grids {name}, which are of {what}"))
}

/// Whether a stage's settings are not those of a run; what a stage of another version read is not known.
fn differs(claim: &Claim, version: &str, settings: &str, read: fn(&Value) -> Value) -> bool {
    if version != VERSION || claim.version != VERSION {
        return false;
    }
    let all = serde_json::from_str(&claim.settings).ok();
    let own = all.and_then(|all| canonical(&read(&all)).ok());
    own.as_deref() != Some(settings)
}
