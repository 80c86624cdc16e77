//! One session's published tables → what the history asks of it.
//!
//! Each file is digested and held against the row of `runs` before it is believed. The model is the whole one where there is
//! one, else the geometry. Figures are those of held-out stations where the session has them.

use std::fs::File;
use std::path::Path;

use super::rows::Fact;
use arrow::array::Array as _;

use crate::fit::full::FullModel;
use crate::fit::full::saved::SavedFull;
use crate::fit::saved::SavedCalibration;
use crate::history::estimate::Estimate;
use crate::history::{AccuracyFigure, Basis, SessionFigures};
use crate::io::lake::Lake;
use crate::io::schema;
use crate::io::table::{self, Table};
use crate::manifest::digest;

/// What one session says; or, in words, why it says nothing.
pub(super) fn read(lake: &Lake, fact: &Fact) -> Result<SessionFigures, String> {
    let calibrations = checked(lake, fact, "calibrations", &fact.tables[0])?;
    let accuracy = checked(lake, fact, "accuracy", &fact.tables[1])?;
    let (model, estimate) = estimate(&calibrations)
        .map_err(|reason| format!("table calibrations of {}: {reason}", fact.key.session))?;
    Ok(SessionFigures {
        basis: Basis {
            pipeline: fact.pipeline.clone(),
            version: fact.version.clone(),
            robot_file: fact.robot_file.clone(),
            settings: fact.settings.clone(),
            model: model.to_owned(),
        },
        estimate,
        accuracy: figures(&accuracy, &fact.key.session),
    })
}

/// A table whose file is the one that the run wrote.
fn checked(lake: &Lake, fact: &Fact, name: &str, expected: &str) -> Result<Table, String> {
    let schema = schema::find(name).map_err(|error| error.to_string())?;
    let path = lake
        .path(schema, &fact.key)
        .map_err(|error| error.to_string())?
        .named();
    let found =
        digest_of(&path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    if found != expected {
        return Err(format!(
            "{} is not what the run wrote: its digest is {found}, the row of runs says {expected}; see posegrid verify",
            path.display()
        ));
    }
    table::read(&path, schema).map_err(|error| error.to_string())
}

fn digest_of(path: &Path) -> std::io::Result<String> {
    Ok(digest(File::open(path)?)?.0)
}

/// The best model's estimate, and which model it is.
pub(in crate::pipeline) fn estimate(
    calibrations: &Table,
) -> Result<(&'static str, Estimate), String> {
    let kinds = calibrations.text("model_kind");
    let text = |kind: &str| {
        let row = (0..kinds.len()).find(|&row| kinds.value(row) == kind)?;
        Some(calibrations.text("model").value(row))
    };
    if let Some(text) = text("full") {
        let saved = SavedFull::read(text).map_err(|error| error.to_string())?;
        let model = FullModel::from_saved(&saved).map_err(|error| error.to_string())?;
        let estimate = Estimate::of_full(&model).ok_or("the covariance of model full is none")?;
        return Ok(("full", estimate));
    }
    let text = text("geometric").ok_or("neither model full nor geometric is there")?;
    let saved = SavedCalibration::read(text).map_err(|error| error.to_string())?;
    let estimate = Estimate::of_geometric(&saved).map_err(|error| error.to_string())?;
    Ok((
        "geometric",
        estimate.ok_or("the covariance of model geometric is none")?,
    ))
}

/// Figures that are charted: mean and 95th percentile of held-out errors, before and after.
fn figures(accuracy: &Table, session: &str) -> Vec<AccuracyFigure> {
    let is = |column: &str, row: usize, word: &str| accuracy.text(column).value(row) == word;
    let charted = |&row: &usize| {
        is("of_session", row, session)
            && is("role", row, "held_out")
            && is("split", row, "blocks")
            && is("base_refit", row, "none")
            && !is("point", row, "tool_tip")
            && is("quantity", row, "position_error")
            && !is("model", row, "geometric")
            && (is("name", row, "mean") || is("name", row, "p95"))
            && !(is("model", row, "full") && is("angles", row, "commanded"))
    };
    let figure = |row: usize| {
        let text = |column: &str| accuracy.text(column).value(row);
        let value = accuracy.f64("value").iter().nth(row).flatten()?;
        let name = format!("{} {} {}", text("moment"), text("model"), text("name"));
        Some(AccuracyFigure { name, value })
    };
    let rows = (0..accuracy.rows()).filter(charted);
    let mut figures: Vec<AccuracyFigure> = rows.filter_map(figure).collect();
    figures.sort_by(|a, b| a.name.cmp(&b.name));
    figures.dedup_by(|a, b| a.name == b.name);
    figures
}
