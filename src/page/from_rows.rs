//! The rows of a run's tables, as they are published, and what the run says besides → what its page tells.
//!
//! A figure on the page is the value of a row, so page and tables cannot differ.

use std::collections::BTreeMap;

use super::content::{Content, Count, Provenance, Residuals, Session};
use super::words;
use crate::grid::Tolerance;
use crate::io::table::Word as _;
use crate::io::tables::accuracy::AccuracyRow;
use crate::io::tables::residuals::ResidualRow;
use crate::io::tables::stations::{PairingVerdict, Unpaired};
use crate::io::tables::{RunRows, SessionRows};
use crate::manifest::{RunKey, StageCount, VERSION, Work, Written};
use crate::report::Point;
use crate::report::verdict::RunVerdict;

/// What a run says besides its tables.
#[derive(Debug, Clone, Copy)]
pub struct About<'a> {
    /// The work.
    pub work: &'a Work,
    /// What has to be met.
    pub tolerance: Tolerance,
    /// The choice of the step in words.
    pub choice: &'a str,
    /// Whether the tolerance is met, by what, and who says so.
    pub verdict: &'a RunVerdict,
    /// What came into each stage.
    pub counts: &'a [StageCount],
    /// Tables written.
    pub written: &'a [Written],
    /// What it says in words.
    pub said: &'a Statements,
}

/// What a run says in words.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Statements {
    /// Topics of which too much was rejected.
    pub warnings: Vec<String>,
    /// What else was found.
    pub notes: Vec<String>,
    /// Whether the table that drove the session still holds, where one did.
    pub table_state: Option<String>,
}

/// What the page of a run tells, from the rows of all its tables and what it says besides.
pub fn content(rows: RunRows, sessions: Vec<SessionRows>, about: &About<'_>) -> Content {
    let RunKey {
        robot,
        session,
        run,
    } = about.work.key();
    let (tip, figures): (Vec<AccuracyRow>, Vec<AccuracyRow>) = rows
        .accuracy
        .rows
        .into_iter()
        .partition(|figure| figure.point == Point::Tip);
    Content {
        robot,
        session,
        run,
        tolerance: about.tolerance,
        verdict: about.verdict.clone(),
        choice: about.choice.to_owned(),
        warnings: about.said.warnings.clone(),
        notes: about.said.notes.clone(),
        table_state: about.said.table_state.clone(),
        steps: rows.steps.rows,
        figures,
        tip,
        residuals: by_subject(rows.residuals.rows),
        semivariograms: rows.semivariograms.rows,
        joint_errors: rows.joint_errors.rows,
        parameters: rows.parameters.rows,
        calibrations: rows.calibrations.rows,
        sessions: in_order(sessions, about.work),
        counts: about.counts.iter().map(count).collect(),
        provenance: made_from(about.work, about.written),
    }
}

/// The table has them by fold; here they stand together by what they are of, in the order of the stations.
fn by_subject(rows: Vec<ResidualRow>) -> Vec<Residuals> {
    let mut sets: Vec<Residuals> = Vec::new();
    for row in rows {
        let subject = row.subject();
        match sets.iter_mut().find(|set| set.subject == subject) {
            Some(set) => set.stations.push(row),
            None => sets.push(Residuals {
                subject,
                stations: vec![row],
            }),
        }
    }
    for set in &mut sets {
        set.stations.sort_by_key(|station| station.station);
    }
    sets.sort_by(|a, b| words::order(&a.subject).cmp(&words::order(&b.subject)));
    sets
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

/// How many dwells have each verdict for each reason, in the alphabet of the words.
fn dwells(session: &SessionRows) -> Vec<(PairingVerdict, Option<Unpaired>, usize)> {
    let mut dwells = BTreeMap::new();
    for station in &session.stations.rows {
        let words = (station.verdict.word(), station.reason.map(Unpaired::word));
        let entry = dwells.entry(words);
        entry.or_insert((station.verdict, station.reason, 0)).2 += 1;
    }
    dwells.into_values().collect()
}

pub(super) fn count(count: &StageCount) -> Count {
    Count {
        stage: count.stage.to_owned(),
        of: count.of.to_owned(),
        read: count.read,
        kept: count.kept,
        rejected: count.rejected.clone().into_iter().collect(),
    }
}

pub(super) fn made_from(work: &Work, written: &[Written]) -> Provenance {
    let input =
        |input: &crate::manifest::Input| (input.name.clone(), input.bytes, input.digest.clone());
    let table = |file: &Written| {
        (
            format!("{}/{}", file.table, file.session),
            file.rows,
            file.digest.clone(),
        )
    };
    Provenance {
        pipeline: work.pipeline.clone(),
        version: VERSION.to_owned(),
        inputs: work.inputs.iter().map(input).collect(),
        tables: written.iter().map(table).collect(),
        settings: work.settings.clone(),
    }
}
