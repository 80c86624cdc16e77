//! A session that a table drove: the file of corrected targets, and the comparison with the table's promise.
//!
//! The corrected targets are in the session's folder (`[input] corrected_targets`), as `posegrid compensate` wrote them.
//! The table's promise, and its tool and temperatures, are in the lake under its run.

mod made;

use std::fmt::Write as _;

use super::configuration::SessionFiles;
use super::run::RunError;
use crate::compensation::Conditions;
use crate::history::table_state::Shown;
use crate::io::input::Bound;
use crate::io::lake::{Lake, LakeError};
use crate::io::log::Limits;
use crate::io::targets::driving;
use crate::join::Station;
use crate::judgement::{Driven, DrivenBy, JoinedSession, Outcome};
use crate::kinematics::Arm;
use crate::manifest::RunKey;
use crate::report::driven::{matched, promise_words};
use made::TableRun;

/// A command further than this from the one in the file is not the file's, mm: controllers round to one to ten micrometres.
const NOT_THE_FILES_MM: f64 = 0.05;

/// The corrected targets that drove a session; `None` where its folder has none.
pub(super) fn driven_by(
    files: &SessionFiles,
    stations: &[Station],
    limits: Limits,
) -> Result<Option<DrivenBy>, RunError> {
    let Some(path) = &files.corrected else {
        return Ok(None);
    };
    let file = driving::read(path, Bound::of(limits)).map_err(|source| RunError::Driving {
        session: files.name.clone(),
        source: Box::new(source),
    })?;
    let commands: Vec<_> = stations
        .iter()
        .map(|station| station.command.as_ref().map(|command| command.position))
        .collect();
    let matched = matched(&commands, &file.targets);
    Ok(Some(DrivenBy { file, matched }))
}

/// The findings of the last session about the table that drove it.
#[derive(Debug, Clone, Default)]
pub(super) struct DrivenWords {
    /// Whether the table still holds; `None` where none drove the session.
    pub(super) state: Option<String>,
    /// The state and all other findings, as lines for a person.
    pub(super) lines: Vec<String>,
}

/// The findings of the last session about the table that drove it.
pub(super) fn words(
    outcome: &Outcome<'_>,
    arm: &Arm,
    stated: &Conditions,
    lake: &Lake,
) -> Result<DrivenWords, LakeError> {
    let Some((driven, session)) = outcome.driven.as_ref().zip(outcome.training.last()) else {
        return Ok(DrivenWords::default());
    };
    let made = TableRun::read(driven, lake)?;
    let shown = Shown {
        application: &driven.application,
        promise: made.as_ref().map_err(Clone::clone).and_then(|made| made.promised()),
        after: driven.measured.as_ref().map(|measured| &measured.after),
        outside: made.as_ref().map_or_else(|_| Vec::new(), |made| made.outside(session, stated)),
    };
    let state = shown.state(|| match &made {
        Ok(made) => made.compared(outcome, arm),
        Err(why) => Err(why.to_string()),
    });
    let words = [
        Some(state.to_string()),
        Some(went(driven, session)),
        Some(driven.application.words()),
        shown.kept().ok().and_then(|kept| promise_words(&kept)),
    ];
    let RunKey { session, run, .. } = &driven.key;
    let line = |line| format!("driven by table {run} of session {session}: {line}");
    Ok(DrivenWords {
        lines: words.into_iter().flatten().map(line).collect(),
        state: Some(state.to_string()),
    })
}

/// The number of stations at each kind of place, as text.
fn went(driven: &Driven, session: &JoinedSession) -> String {
    let Some(by) = &session.driven_by else {
        return "no targets".to_owned();
    };
    let departed =
        driven.stations.iter().filter(|station| station.departure_mm() > NOT_THE_FILES_MM).count();
    let mut words = format!(
        "{} of {} stations measured at one of its {} targets",
        driven.stations.len(),
        session.joined.stations.len(),
        by.file.targets.len()
    );
    let others = [
        (by.matched.far, "far from every target: in another frame, or of another program"),
        (by.matched.between, "between two targets"),
        (departed, "commanded otherwise than the file states"),
        (by.file.refused, "targets had been refused"),
    ];
    for (count, what) in others.into_iter().filter(|(count, _)| *count > 0) {
        write!(words, "; {count} {what}").expect("a string");
    }
    words
}
