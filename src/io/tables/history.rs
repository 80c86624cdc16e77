//! `history`: figures of robots over their sessions, charted ones with their control limits.
//!
//! Charted figures come from the history itself; parameters and joint curves are those that the runs published.

use super::past::{Figure, Kind, PastSession};
use super::words::Unit;
use crate::manifest::RunKey;
use crate::rows::{row, words};

row! {
    pub struct HistoryRow of "history" {
        key: RunKey,
        measured_at_ns: i64,
        segment: usize,
        kind: Kind,
        name: String,
        joint: Option<usize>,
        angle_rad: Option<f64>,
        value: f64,
        unit: Unit,
        standard_error: Option<f64>,
        score: Option<f64>,
        ewma: Option<f64>,
        control_limit: Option<f64>,
        verdict: Option<Control>,
    }
}

words! {
    pub enum Control {
        InControl: "in_control",
        OutOfControl: "out_of_control",
        /// There are too few values.
        NotShown: "not_shown",
    }
}

pub fn rows(figures: &[(&PastSession, &Figure)]) -> Vec<HistoryRow> {
    let row = |(session, figure): &(&PastSession, &Figure)| row(session, figure);
    figures.iter().map(row).collect()
}

fn row(session: &PastSession, figure: &Figure) -> HistoryRow {
    let charted = figure.charted.as_ref();
    HistoryRow {
        key: session.key.clone(),
        measured_at_ns: session.measured_at_ns,
        segment: session.judged.segment,
        kind: figure.kind,
        name: figure.name.clone(),
        joint: figure.joint,
        angle_rad: figure.angle_rad,
        value: figure.value,
        unit: figure.unit,
        standard_error: figure.sd,
        score: charted.and_then(|charted| charted.score),
        ewma: charted.and_then(|charted| charted.average),
        control_limit: charted.map(|charted| charted.limit),
        verdict: charted.map(|charted| match charted.is_out() {
            Some(true) => Control::OutOfControl,
            Some(false) => Control::InControl,
            None => Control::NotShown,
        }),
    }
}
