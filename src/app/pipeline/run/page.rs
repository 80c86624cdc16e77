//! What a run published and stated → the content of its page.

use std::collections::BTreeMap;

use crate::grid::Table;
use crate::io::lake::{Lake, page_over_time};
use crate::io::rows::Word as _;
use crate::io::tables::accuracy::AccuracyRow;
use crate::io::tables::counts::counts;
use crate::io::tables::stations::{PairingVerdict, Unpaired};
use crate::io::tables::{PublishContext, RunRows, SessionRows};
use crate::judgement::Outcome;
use crate::manifest::{RunKey, Work, Written};
use crate::page::Statements;
use crate::page::content::{Content, Session};
use crate::pipeline::summary::stated;
use crate::report::Point;
use crate::report::next::Next;

pub(super) fn content(
    outcome: &Outcome<'_>,
    rows: RunRows,
    sessions: Vec<SessionRows>,
    context: &PublishContext<'_>,
    work: &Work,
    written: &[Written],
    said: &Statements,
) -> Content {
    let (key, tolerance, frame) = (work.key(), context.tolerance, outcome.frame);
    let (stated, doubts) = (stated(outcome, context.arm), said.doubts_set_up);
    let next = Next::of(&outcome.verdict, &frame, &tolerance, stated, doubts);
    let (tip, figures): (Vec<AccuracyRow>, Vec<AccuracyRow>) =
        rows.accuracy.rows.into_iter().partition(|figure| figure.point == Point::Tip);
    Content {
        over_time: page_over_time(&key.robot).ok(),
        tolerance,
        verdict: outcome.verdict.clone(),
        frame,
        command: next.command(&in_lake(next.table(), &key)),
        next,
        key,
        said: said.clone(),
        bounds: outcome.grids.table.as_ref().map(corners),
        choice: outcome.grids.choice.words.clone(),
        steps: rows.steps.rows,
        figures,
        tip,
        semivariograms: rows.semivariograms.rows,
        joint_errors: rows.joint_errors.rows,
        parameters: rows.parameters.rows,
        calibrations: rows.calibrations.rows,
        sessions: in_order(sessions, work),
        counts: counts(outcome),
        work: work.clone(),
        written: written.to_vec(),
    }
}

/// Least and largest coordinates of a table's nodes, base frame, mm.
fn corners(table: &Table) -> [[f64; 3]; 2] {
    let lattice = &table.lattice;
    let last = lattice.node_count().saturating_sub(1);
    [0, last].map(|node| lattice.position(node).into())
}

/// The file of a run's table as it is named beside the folder `lake`; folders have no character that a shell acts on.
fn in_lake(table: &str, key: &RunKey) -> String {
    let place = Lake::new("lake").place(table, key);
    place.map_or_else(|_| format!("lake/{table}/…/{}.parquet", key.run), |place| place.to_string())
}

/// The sessions in the order of the work, those that trained first.
fn in_order(mut sessions: Vec<SessionRows>, work: &Work) -> Vec<Session> {
    let trained = |name: &String| work.sessions.contains(name);
    let place =
        |name: &String| work.sessions.iter().chain(&work.test_sessions).position(|own| own == name);
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
