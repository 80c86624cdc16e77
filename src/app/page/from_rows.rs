//! The published rows of a run's tables, and the statements that no table has → the content of its page.

use std::collections::BTreeMap;

use super::content::{Content, Session, Statements};
use crate::grid::Tolerance;
use crate::io::lake::{Lake, page_over_time};
use crate::io::rows::Word as _;
use crate::io::tables::accuracy::AccuracyRow;
use crate::io::tables::stations::{PairingVerdict, Unpaired};
use crate::io::tables::{RunRows, SessionRows};
use crate::manifest::{RunKey, StageCount, Work, Written};
use crate::report::Point;
use crate::report::frame::StatedFrame;
use crate::report::next::{Next, Stated};
use crate::report::verdict::RunVerdict;

#[derive(Debug, Clone, Copy)]
pub struct About<'a> {
    pub stated: Stated,
    pub work: &'a Work,
    pub tolerance: Tolerance,
    pub choice: &'a str,
    pub verdict: &'a RunVerdict,
    pub frame: &'a StatedFrame,
    /// Least and largest coordinates of the table's nodes, base frame, mm; `None` without a table.
    pub bounds: Option<[[f64; 3]; 2]>,
    pub counts: &'a [StageCount],
    pub written: &'a [Written],
    pub said: &'a Statements,
}

pub fn content(rows: RunRows, sessions: Vec<SessionRows>, about: &About<'_>) -> Content {
    let key = about.work.key();
    let (verdict, frame, stated) = (about.verdict, about.frame, about.stated);
    let next = Next::of(verdict, frame, &about.tolerance, stated, about.said.doubts_set_up);
    let command = next.command(&in_lake(next.table(), &key));
    let (tip, figures): (Vec<AccuracyRow>, Vec<AccuracyRow>) =
        rows.accuracy.rows.into_iter().partition(|figure| figure.point == Point::Tip);
    Content {
        over_time: page_over_time(&key.robot).ok(),
        key,
        tolerance: about.tolerance,
        verdict: about.verdict.clone(),
        frame: *about.frame,
        next,
        command,
        said: about.said.clone(),
        bounds: about.bounds,
        choice: about.choice.to_owned(),
        steps: rows.steps.rows,
        figures,
        tip,
        semivariograms: rows.semivariograms.rows,
        joint_errors: rows.joint_errors.rows,
        parameters: rows.parameters.rows,
        calibrations: rows.calibrations.rows,
        sessions: in_order(sessions, about.work),
        counts: about.counts.to_vec(),
        work: about.work.clone(),
        written: about.written.to_vec(),
    }
}

/// The file of a run's table as it is named beside the folder `lake`; folders have no character that a shell acts on.
fn in_lake(table: &str, key: &RunKey) -> String {
    let place = Lake::new("lake").place(table, key);
    place.map_or_else(|_| format!("lake/{table}/…/{}.parquet", key.run), |place| place.to_string())
}

/// The sessions in the order of the work, those that trained first.
fn in_order(sessions: Vec<SessionRows>, work: &Work) -> Vec<Session> {
    let trained = |name: &String| work.sessions.contains(name);
    let place = |name: &String| {
        let mut names = work.sessions.iter().chain(&work.test_sessions);
        names.position(|own| own == name)
    };
    let mut sessions = sessions;
    sessions.sort_by_key(|session| place(&session.name));
    let session = |own: SessionRows| {
        Some(Session {
            trained: trained(&own.name),
            dwells: dwells(&own),
            clock: own.clocks.rows.into_iter().next()?,
            rejects: own.rejects.rows,
            name: own.name,
        })
    };
    sessions.into_iter().filter_map(session).collect()
}

fn dwells(session: &SessionRows) -> Vec<(PairingVerdict, Option<Unpaired>, usize)> {
    let mut dwells = BTreeMap::new();
    for station in &session.stations.rows {
        let words = (station.verdict.word(), station.dwell.reason.map(Unpaired::word));
        dwells.entry(words).or_insert((station.verdict, station.dwell.reason, 0)).2 += 1;
    }
    dwells.into_values().collect()
}
