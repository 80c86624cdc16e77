//! A session that a table drove: the file that says so, and what becomes of the table's promise.
//!
//! The corrected targets stand in the session's folder (`[input] corrected_targets`), as `posegrid compensate` wrote them. What the
//! table promised, and for which tool and temperatures, stands in the lake under its run.

use std::fmt::Write as _;
use std::path::Path;

use super::file::Validity;
use super::history;
use super::outcome::{Driven, DrivenBy, JoinedSession, Outcome};
use super::plan::SessionFiles;
use super::run::RunError;
use crate::compensation::UsedWith;
use crate::compensation::validity::Outside;
use crate::figures::extremes;
use crate::history::estimate::Estimate;
use crate::history::table_state::{NotShown, Shown};
use crate::history::{Judged, between};
use crate::io::common::{Common, CommonError};
use crate::io::lake::{Lake, LakeError};
use crate::io::table::Table;
use crate::io::targets::driving;
use crate::join::Station;
use crate::kinematics::Arm;
use crate::manifest::RunKey;
use crate::report::driven::{self, TablePromise, matched};

/// A command that is further than this from what the file says is not the file's, mm: controllers round to a micrometre or ten.
const NOT_THE_FILES_MM: f64 = 0.05;

/// What drove a session, where its folder has corrected targets.
pub(super) fn driven_by(
    files: &SessionFiles,
    stations: &[Station],
) -> Result<Option<DrivenBy>, RunError> {
    let Some(path) = &files.corrected else {
        return Ok(None);
    };
    let file = driving::read(path).map_err(|source| RunError::Driving {
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

/// What the last session says of the table that drove it.
#[derive(Debug, Clone, Default)]
pub(super) struct DrivenWords {
    /// Whether the table still holds; `None` where none drove the session.
    pub(super) state: Option<String>,
    /// That and everything else, in lines that a person reads.
    pub(super) lines: Vec<String>,
}

/// What the last session says of the table that drove it.
pub(super) fn words(
    outcome: &Outcome<'_>,
    arm: &Arm,
    stated: &Validity,
    lake: &Lake,
) -> Result<DrivenWords, LakeError> {
    let Some((driven, session)) = outcome.driven.as_ref().zip(outcome.training.last()) else {
        return Ok(DrivenWords::default());
    };
    let made = TableRun::read(driven, lake)?;
    let mut words = vec![went(driven, session), driven.application.words()];
    let (outside, untold) = match made.as_ref().map(|made| made.outside(session, stated)) {
        Some(Err(error)) => (
            Vec::new(),
            Some(format!("what the table is for cannot be told: {error}")),
        ),
        Some(Ok(outside)) => (outside, None),
        None => (Vec::new(), None),
    };
    let promise = made.as_ref().ok_or(NotShown::NoRun);
    let promise = promise.and_then(|made| made.promise.as_ref().ok_or(NotShown::NoPromise));
    let after = driven.measured.as_ref().map(|measured| &measured.after);
    let kept = promise.clone().ok().zip(after);
    words.extend(kept.and_then(|(promise, after)| Some(driven::kept(promise, after)?.words())));
    words.extend(untold);
    let shown = Shown {
        application: &driven.application,
        promise,
        after,
        outside,
    };
    let state = shown.state(|| {
        let made = made.as_ref().ok_or("the lake does not have its run")?;
        made.compared(outcome, arm)
    });
    words.insert(0, state.to_string());
    let table = format!(
        "driven by table {} of session {}: ",
        driven.key.run, driven.key.session
    );
    let lines = words.iter().map(|line| format!("{table}{line}"));
    Ok(DrivenWords {
        state: Some(state.to_string()),
        lines: lines.collect(),
    })
}

/// What the lake has of the run that made a table.
struct TableRun {
    key: RunKey,
    /// The table that drove.
    table: Table,
    calibrations: Table,
    promise: Option<TablePromise>,
}

impl TableRun {
    /// `None` where the lake does not have the run.
    fn read(driven: &Driven, lake: &Lake) -> Result<Option<Self>, LakeError> {
        let key = &driven.key;
        if !lake.exists(key)? {
            return Ok(None);
        }
        Ok(Some(Self {
            key: key.clone(),
            table: lake.read(&driven.table, key)?,
            calibrations: lake.read("calibrations", key)?,
            promise: promise(&driven.table, &lake.read("accuracy", key)?),
        }))
    }

    /// The arm as the session identified it, held against the arm as the table's run did.
    fn compared(&self, outcome: &Outcome<'_>, arm: &Arm) -> Result<Judged, String> {
        let model = self.calibrations.text("arm_model").value(0);
        if model != arm.model() {
            return Err(format!(
                "the table's arm is {model:?}, this one {:?}",
                arm.model()
            ));
        }
        if outcome.training.len() > 1 {
            return Err("the arm was identified from several sessions".to_owned());
        }
        let full = outcome
            .full
            .as_ref()
            .ok_or("there is no whole model of the session")?;
        let own = Estimate::of_full(full).ok_or("the covariance of the whole model is none")?;
        match history::session::estimate(&self.calibrations)? {
            ("full", earlier) => Ok(between(&earlier, &own)),
            _ => Err("the table's run has no whole model".to_owned()),
        }
    }

    /// What the table is not valid for of what the session was run with, as `compensate` holds it; at the lowest and the highest
    /// temperature that was met.
    fn outside(
        &self,
        session: &JoinedSession,
        stated: &Validity,
    ) -> Result<Vec<Outside>, CommonError> {
        let said = Common {
            path: Path::new(&self.key.run),
            table: &self.table,
        };
        let valid_for = said.validity()?;
        let stations = session.joined.stations.iter();
        let met = stations.filter_map(|station| station.attained.as_ref()?.temperature_c);
        let (low, high) = extremes(met).unzip();
        let outside = |temperature_c| {
            let used = UsedWith {
                tool: stated.tool.clone(),
                payload_kg: stated.payload_kg,
                mounting: stated.mounting.clone(),
                base: stated.base.clone(),
                controller_model: stated.controller_model.clone(),
                absolute_accuracy_option: stated.absolute_accuracy_option,
                temperature_c,
            };
            valid_for.hold(&used).outside
        };
        let mut outside: Vec<Outside> = [low, high].into_iter().flat_map(outside).collect();
        outside.sort_by(|a, b| a.words.cmp(&b.words));
        outside.dedup();
        Ok(outside)
    }
}

/// How many stations went where.
fn went(driven: &Driven, session: &JoinedSession) -> String {
    let Some(by) = &session.driven_by else {
        return "no targets".to_owned();
    };
    let departed = driven
        .stations
        .iter()
        .filter(|station| station.departure_mm() > NOT_THE_FILES_MM)
        .count();
    let mut words = format!(
        "{} of {} stations measured at one of its {} targets",
        driven.stations.len(),
        session.joined.stations.len(),
        by.file.targets.len()
    );
    let others = [
        (
            by.matched.far,
            "far from every target: in another frame, or of another program",
        ),
        (by.matched.between, "between two targets"),
        (departed, "commanded otherwise than the file says"),
        (by.file.refused, "targets had been refused"),
    ];
    for (count, what) in others.into_iter().filter(|(count, _)| *count > 0) {
        write!(words, "; {count} {what}").expect("a string");
    }
    words
}

/// What a run predicted of one of its tables, by stations that took no part.
fn promise(table: &str, figures: &Table) -> Option<TablePromise> {
    let model = if table == "compensation" {
        "table"
    } else {
        "full"
    };
    let text = |column: &str, row: usize| figures.text(column).value(row).to_owned();
    let is = |row: usize, name: &str| {
        let wanted = [
            ("model", model),
            ("angles", "commanded"),
            ("split", "blocks"),
            ("evidence", "predicted"),
            ("name", name),
        ];
        let of_the_table = text("point", row) != "tool_tip";
        of_the_table
            && wanted
                .iter()
                .all(|(column, word)| text(column, row) == *word)
    };
    let value = |name: &str, column: &str| {
        let row = (0..figures.rows()).find(|&row| is(row, name))?;
        figures.f64(column).iter().nth(row).flatten()
    };
    Some(TablePromise {
        mean_mm: value("mean", "value")?,
        bound_mm: value("bound", "value")?,
        share: value("bound", "share")?,
        confidence: value("bound", "confidence")?,
    })
}
