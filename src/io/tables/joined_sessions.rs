//! `joined_sessions`: sessions as joined, and where each comes from. Its row makes the result of ingest and join exist.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::Result;
use super::readings::{self, ReadingRow};
use super::stage_results::{self, FileColumns, InputColumns, MadeColumns, NotRestored, signed};
use crate::ingest::LogReject;
use crate::join::moved::{Elsewhere, Knock};
use crate::join::tabled::{ReadReference, ReferenceCourse};
use crate::join::{ClockEstimate, JoinReject, Joined, ReadingCounts, RowReject, Thresholds};
use crate::judgement::{DrivenBy, JoinedSession};
use crate::lake::Lake;
use crate::manifest::{Input, RunKey, Work, Written};
use crate::rows::{Row, Rows, row};
use crate::table::Table;
use crate::units::WallTime;

row! {
    #[derive(Default)]
    pub struct JoinedSessionRow of "joined_sessions" {
        made: MadeColumns,
        session_started: Option<WallTime>,
        dwells: usize,
        paired: usize,
        inputs: InputColumns,
        joined: String,
        files: FileColumns,
        row_digest: Option<String>,
    }
}

/// A session as joined, without its dwells and readings, and without what follows from them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AsJoined {
    log_rejects: Vec<LogReject>,
    counts: BTreeMap<String, u64>,
    clock: ClockEstimate,
    rejects: Vec<JoinReject>,
    row_rejects: Vec<RowReject>,
    references: Vec<ReferenceCourse>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    read_references: Vec<ReadReference>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    elsewhere: Vec<Elsewhere>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    knocks: Vec<Knock>,
    reading_counts: ReadingCounts,
    found: Thresholds,
    driven_by: Option<DrivenBy>,
    sampling_plan: Option<String>,
}

#[derive(Debug, Clone)]
pub struct Restored {
    pub inputs: Vec<Input>,
    /// The session's stations, clocks and rejects.
    pub joined: Joined,
    /// Messages and byte ranges that its logs lost.
    pub log_rejects: Vec<LogReject>,
    /// Number of items read, by kind.
    pub counts: BTreeMap<String, u64>,
    /// The corrected targets that drove it.
    pub driven_by: Option<DrivenBy>,
    pub sampling_plan: Option<String>,
}

/// The work of ingest and join of one session, of which the name of its result follows.
pub fn work(robot: &str, session: &str, inputs: Vec<Input>, settings: String) -> Work {
    Work::of_stage(robot, session, vec![session.to_owned()], inputs, settings)
}

pub fn readings(session: &JoinedSession, key: &RunKey) -> Result<Rows<ReadingRow>> {
    Ok(Row::table(readings::rows(&session.joined.stations), key)?)
}

/// The table `joined_sessions` of a session whose readings were written as `written`.
pub fn table(session: &JoinedSession, work: &Work, written: &[Written]) -> Result<Table> {
    let row = JoinedSessionRow {
        made: work.into(),
        session_started: session.started(),
        dwells: session.joined.stations.len(),
        paired: session.joined.paired(),
        inputs: work.inputs[..].into(),
        joined: serde_json::to_string(&AsJoined::of(session))?,
        files: written.into(),
        row_digest: None,
    };
    Ok(signed(&work.key(), row, |row, row_digest| JoinedSessionRow { row_digest, ..row })?)
}

/// Reads a session as joined back from a lake, the same to the last bit.
pub fn restored(lake: &Lake, key: &RunKey) -> Result<Restored, NotRestored> {
    let row: JoinedSessionRow = stage_results::row(lake, key)?;
    let stations = ReadingRow::read(&lake.read(ReadingRow::TABLE, key)?);
    let stations = readings::stations(&stations)?;
    let own: AsJoined = serde_json::from_str(&row.joined)?;
    Ok(Restored {
        inputs: row.inputs.inputs().ok_or(NotRestored::Inputs)?,
        joined: Joined {
            stations,
            clock: own.clock,
            rejects: own.rejects,
            row_rejects: own.row_rejects,
            references: own.references,
            read_references: own.read_references,
            elsewhere: own.elsewhere,
            knocks: own.knocks,
            counts: own.reading_counts,
            found: own.found,
        },
        log_rejects: own.log_rejects,
        counts: own.counts,
        driven_by: own.driven_by,
        sampling_plan: own.sampling_plan,
    })
}

impl AsJoined {
    fn of(session: &JoinedSession) -> Self {
        let joined = &session.joined;
        Self {
            log_rejects: session.log_rejects.clone(),
            counts: session.counts.clone(),
            clock: joined.clock.clone(),
            rejects: joined.rejects.clone(),
            row_rejects: joined.row_rejects.clone(),
            references: joined.references.clone(),
            read_references: joined.read_references.clone(),
            elsewhere: joined.elsewhere.clone(),
            knocks: joined.knocks.clone(),
            reading_counts: joined.counts,
            found: joined.found,
            driven_by: session.driven_by.clone(),
            sampling_plan: session.sampling_plan.clone(),
        }
    }
}
