//! `history`: figures of robots over their sessions, charted ones with their control limits.
//!
//! Charted figures come from the history itself; parameters and joint curves are those that the runs published.

use super::PublishError;
use crate::io::schema;
use crate::io::table::{Columns, Table};
use crate::pipeline::history::{Figure, PastSession};

/// The table of these figures, each with its session.
pub fn history(rows: &[(&PastSession, &Figure)]) -> Result<Table, PublishError> {
    let of = || rows.iter().map(|(_, figure)| *figure);
    let key = || rows.iter().map(|(session, _)| &session.key);
    let charted = || of().map(|figure| figure.charted.as_ref());
    Ok(Columns::new(schema::find("history")?, rows.len())
        .column("robot", key().map(|key| key.robot.as_str()))
        .column("session", key().map(|key| key.session.as_str()))
        .column("run", key().map(|key| key.run.as_str()))
        .column(
            "measured_at_ns",
            rows.iter().map(|(session, _)| session.measured_at_ns),
        )
        .column(
            "segment",
            rows.iter().map(|(session, _)| session.judged.segment),
        )
        .column("kind", of().map(|figure| figure.kind.word()))
        .column("name", of().map(|figure| figure.name.as_str()))
        .column("joint", of().map(|figure| figure.joint))
        .column("angle_rad", of().map(|figure| figure.angle_rad))
        .column("value", of().map(|figure| figure.value))
        .column("unit", of().map(|figure| figure.unit))
        .column("standard_error", of().map(|figure| figure.sd))
        .column("score", charted().map(|charted| charted?.score))
        .column("ewma", charted().map(|charted| charted?.average))
        .column(
            "control_limit",
            charted().map(|charted| Some(charted?.limit)),
        )
        .column(
            "verdict",
            charted().map(|charted| Some(verdict(charted?.is_out()))),
        )
        .finish()?)
}

const fn verdict(is_out: Option<bool>) -> &'static str {
    match is_out {
        Some(true) => "out_of_control",
        Some(false) => "in_control",
        None => "not_shown",
    }
}
