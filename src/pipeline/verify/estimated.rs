//! Estimates, verified by themselves.
//!
//! For each row of `estimates`: its name has to follow from the sessions that train, the robot file, its settings and its version, its
//! digest from its content, and the lake has to have the sessions as joined that it names. A run that started from it is recomputed from
//! its inputs, and what is trained then is compared with it (`recompute`).

use crate::io::lake::{ESTIMATES, JOINED, Lake, LakeError};
use crate::io::store::Place;
use crate::io::table::{Row as _, Table};
use crate::io::tables::estimates::{self, EstimateRow};
use crate::io::tables::runs::row_digest;
use crate::manifest::RunKey;

/// The findings about an estimate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EstimateVerified {
    /// Place of its row.
    pub place: Place,
    /// Robot, session and result; `None` where the row cannot be read.
    pub key: Option<RunKey>,
    /// Contradictions and changes, as text.
    pub problems: Vec<String>,
}

impl EstimateVerified {
    /// Whether something was changed.
    pub const fn is_mismatch(&self) -> bool {
        !self.problems.is_empty()
    }
}

/// Verifies the estimates of these names, of sessions or results; of all where there are none.
pub fn estimates(lake: &Lake, names: &[String]) -> Result<Vec<EstimateVerified>, LakeError> {
    let mut verified = Vec::new();
    for (place, row) in lake.estimates()? {
        let table = row.map_err(|error| error.to_string());
        let table = table.and_then(|row| {
            let believed = row.believed(&place.named());
            believed.map_err(|error| error.to_string())
        });
        let (key, problems) = match table {
            Err(problem) => (None, vec![problem]),
            Ok(table) => {
                let key = table.key().cloned();
                let is_named =
                    |key: &RunKey| names.contains(&key.session) || names.contains(&key.run);
                if !names.is_empty() && !key.as_ref().is_some_and(is_named) {
                    continue;
                }
                let problems = of_table(lake, &place, key.as_ref(), &table)?;
                (key, problems)
            }
        };
        verified.push(EstimateVerified {
            place,
            key,
            problems,
        });
    }
    Ok(verified)
}

/// Contradictions of a row with itself, and with the sessions as joined of its lake.
fn of_table(
    lake: &Lake,
    place: &Place,
    key: Option<&RunKey>,
    table: &Table,
) -> Result<Vec<String>, LakeError> {
    let rows = EstimateRow::read(table);
    let (Some(key), [row]) = (key, &rows[..]) else {
        return Ok(vec!["it has several rows, or states no session".to_owned()]);
    };
    let mut problems = Vec::new();
    if lake.place(ESTIMATES, key)? != *place {
        problems.push("it is not at the place of its own name".to_owned());
    }
    let found = row_digest(table);
    if row.row_digest.as_ref() != Some(&found) {
        problems.push(format!(
            "its content has the digest {found}, and it states another one: it was changed"
        ));
    }
    if row.session_names.len() != row.session_runs.len() {
        problems.push("its lists of sessions differ in length".to_owned());
        return Ok(problems);
    }
    let sessions = || row.session_names.iter().zip(&row.session_runs);
    let inputs = estimates::inputs(&row.robot_digest, sessions());
    let work = estimates::work(&key.robot, &key.session, inputs, row.settings.clone());
    if work.settings_digest() != row.settings_digest {
        problems.push("its settings do not have the digest that it states".to_owned());
    }
    let follows = work.key_by_version(&row.version).run;
    if follows != key.run {
        problems.push(format!(
            "from its sessions, settings and version follows the name {follows}"
        ));
    }
    for (session, run) in sessions() {
        if !lake.has(JOINED, &RunKey::new(&key.robot, session, run))? {
            problems.push(format!("the lake does not have {session} as joined {run}"));
        }
    }
    Ok(problems)
}
