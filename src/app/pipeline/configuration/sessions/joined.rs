//! Sessions that a lake has as joined, for work without their logs or tables.
//!
//! Inputs: the rows of `joined_sessions`, and what a result has to be of: the robot, its file, the settings of ingest and join, this
//! version. Output: the sessions by name, each with its one result, or why it has none that can be used.

use std::collections::{BTreeMap, BTreeSet};

use super::found::Session;
use super::{FoundSessions, JoinedBefore, LeftOut, Recorded, Why};
use crate::io::lake::{JOINED, Lake, LakeError};
use crate::io::rows::Row as _;
use crate::io::tables::joined_sessions::JoinedSessionRow;
use crate::manifest::{Input, ROBOT, RunKey, VERSION};

/// What a result of ingest and join has to be of.
#[derive(Debug)]
pub struct Wanted<'a> {
    /// The robot's name; `None` where it is not stated.
    pub robot: Option<&'a str>,
    /// BLAKE3 of the robot file.
    pub robot_digest: &'a str,
    pub settings: &'a str,
}

/// A result of ingest and join, and why it cannot be used; `None` where it can.
type Before = (JoinedBefore, Option<&'static str>);

/// The sessions of a lake as joined, by name, and rows that cannot be read.
pub(super) fn sessions(lake: &Lake, wanted: &Wanted<'_>) -> Result<FoundSessions, LakeError> {
    let mut by_name: BTreeMap<String, Vec<Before>> = BTreeMap::new();
    let mut left_out = Vec::new();
    for (place, row) in lake.rows_of_all(JOINED.rows)? {
        let table = row.and_then(|row| Ok(row.believed(&place.named())?));
        let before = table.map_err(|error| error.to_string()).and_then(|table| {
            let key = table.key().cloned().ok_or("it states no session")?;
            let rows = JoinedSessionRow::read(&table);
            let row = rows.first().ok_or("it has no row")?;
            before(key, row, wanted).ok_or_else(|| "its lists of files differ in length".to_owned())
        });
        match before {
            Ok((own, _)) if wanted.robot.is_some_and(|robot| robot != own.key.robot) => {}
            Ok(before) => by_name.entry(before.0.key.session.clone()).or_default().push(before),
            Err(reason) => left_out.push(LeftOut { name: place.display().to_string(), reason }),
        }
    }
    let sessions = by_name.into_iter().map(session).collect();
    Ok(FoundSessions { sessions, left_out, by: None })
}

fn before(key: RunKey, row: &JoinedSessionRow, wanted: &Wanted<'_>) -> Option<Before> {
    let inputs = row.inputs.inputs()?;
    let is_of_robot = |input: &Input| input.name == ROBOT && input.digest == wanted.robot_digest;
    let unusable = if row.made.version != VERSION {
        Some("of another version of posegrid")
    } else if row.made.settings != wanted.settings {
        Some("of other settings of ingest and join")
    } else if !inputs.iter().any(is_of_robot) {
        Some("of another robot file")
    } else {
        None
    };
    let inputs = inputs.into_iter().filter(|input| input.name != ROBOT);
    Some((JoinedBefore { key, inputs: inputs.collect() }, unusable))
}

/// A session with its one result that can be used.
fn session((name, results): (String, Vec<Before>)) -> Session {
    let (usable, others): (Vec<Before>, Vec<Before>) =
        results.into_iter().partition(|(_, unusable)| unusable.is_none());
    let recorded = match &usable[..] {
        [(one, _)] => Ok(Recorded::Joined(one.clone())),
        [] => {
            let reasons: BTreeSet<&str> =
                others.iter().filter_map(|(_, unusable)| *unusable).collect();
            let why = Vec::from_iter(reasons).join(" and ");
            Err(Why::Bad(format!("as joined the lake has it only {why}: run it from its files")))
        }
        several => {
            let names: Vec<&str> = several.iter().map(|(own, _)| own.key.run.as_str()).collect();
            Err(Why::Bad(format!(
                "the lake has it as joined from several recordings or robots ({}): run it from its files, or name [robot] name",
                names.join(", ")
            )))
        }
    };
    Session { name, recorded, corrected: None, robot: None }
}
