//! A session that a table drove: the file that says so, and what becomes of the table's promise.
//!
//! The corrected targets stand in the session's folder (`[input] corrected_targets`), as `posegrid compensate` wrote them. What the
//! table promised, and for which tool and temperatures, stands in the lake under its run.

use std::fmt::Write as _;
use std::path::Path;

use super::file::Validity;
use super::outcome::{Driven, DrivenBy, JoinedSession, Outcome};
use super::plan::SessionFiles;
use super::run::RunError;
use crate::compensation::UsedWith;
use crate::figures::extremes;
use crate::io::common::{Common, CommonError};
use crate::io::lake::{Lake, LakeError};
use crate::io::table::Table;
use crate::io::targets::driving;
use crate::join::Station;
use crate::report::driven::{TablePromise, kept, matched};

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

/// What the last session says of the table that drove it, in lines that a person reads.
pub(super) fn words(
    outcome: &Outcome<'_>,
    stated: &Validity,
    lake: &Lake,
) -> Result<Vec<String>, LakeError> {
    let Some((driven, session)) = outcome.driven.as_ref().zip(outcome.training.last()) else {
        return Ok(Vec::new());
    };
    let mut words = vec![went(driven, session), driven.application.words()];
    // Of a run that another took the place of, the row may be all that was kept.
    let has = |table| lake.has(table, &driven.key);
    let known = has("runs")? && has("accuracy")? && has(&driven.table)?;
    if known {
        let figures = lake.read("accuracy", &driven.key)?;
        words.extend(against_promise(driven, &figures));
        let table = lake.read(&driven.table, &driven.key)?;
        words.extend(match outside(&table, driven, session, stated) {
            Ok(outside) => outside,
            Err(error) => vec![format!("what the table is for cannot be told: {error}")],
        });
    } else {
        words.push(
            "the lake does not have that table's run, or not its tables, so no promise is held against the session"
                .to_owned(),
        );
    }
    let table = format!(
        "driven by table {} of session {}: ",
        driven.key.run, driven.key.session
    );
    Ok(words
        .into_iter()
        .map(|line| format!("{table}{line}"))
        .collect())
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

/// The promise of the table's run, held against the stations that judge.
fn against_promise(driven: &Driven, figures: &Table) -> Option<String> {
    let Some(measured) = &driven.measured else {
        return Some("its stations do not span space, so no error after can be given".to_owned());
    };
    let Some(promise) = promise(&driven.table, figures) else {
        return Some(
            "its run predicted no bound, so there is no promise to hold against the session"
                .to_owned(),
        );
    };
    let kept = kept(&promise, &measured.after)?;
    let why = if kept.is_broken() && driven.application.is_sound() {
        "; the arm or its base has drifted since, or was changed: measure and correct anew"
    } else {
        ""
    };
    Some(format!("{}{why}", kept.words()))
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
        wanted
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

/// What the table is not valid for of what the session was run with, as `compensate` holds it; at the lowest and the highest
/// temperature that was met.
fn outside(
    table: &Table,
    driven: &Driven,
    session: &JoinedSession,
    stated: &Validity,
) -> Result<Vec<String>, CommonError> {
    let said = Common {
        path: Path::new(&driven.key.run),
        table,
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
    let mut words: Vec<String> = [low, high]
        .into_iter()
        .flat_map(outside)
        .map(|outside| format!("the session was not run with what the table is for: {outside}"))
        .collect();
    words.sort();
    words.dedup();
    Ok(words)
}
