//! The tables of a run, as they are in memory when they are published → what its page tells.
//!
//! Inputs are the tables themselves and what only the run's row in `runs` says besides; output is a
//! [`report::page::Content`](crate::report::page::Content). A figure on the page is the value of a cell, so page and tables
//! cannot differ. [`plan`] is the same for the page of a plan.

mod calibration;
pub mod plan;
mod row;
mod session;

use std::collections::BTreeMap;

use super::table::Table;
use crate::grid::Tolerance;
use crate::manifest::{RunKey, StageCount, VERSION, Work, Written};
use crate::report::page::content::{
    Content, Count, Figure, JointError, Judge, Parameter, Provenance, Residual, Residuals, Step,
    Subject, Variogram, VariogramEntry,
};
use crate::report::verdict::{self, RunVerdict};
use calibration::calibration;
use row::{Row, rows};
use session::of_session;

/// What a run says besides its tables.
#[derive(Debug, Clone, Copy)]
pub struct About<'a> {
    /// The work.
    pub work: &'a Work,
    /// What has to be met.
    pub tolerance: Tolerance,
    /// The choice of the step in words.
    pub choice: &'a str,
    /// Whether the tolerance is met, and who says so.
    pub verdict: &'a RunVerdict,
    /// What came into each stage.
    pub counts: &'a [StageCount],
    /// Tables written.
    pub written: &'a [Written],
    /// What it says in words.
    pub said: &'a Said,
}

/// What a run says in words.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Said {
    /// Topics of which too much was rejected.
    pub warnings: Vec<String>,
    /// What else was found.
    pub notes: Vec<String>,
    /// Whether the table that drove the session still holds, where one did.
    pub table_state: Option<String>,
}

/// What the page of a run tells, from all its tables and what it says besides.
pub fn content(tables: &[Table], about: &About<'_>) -> Content {
    let RunKey {
        robot,
        session,
        run,
    } = about.work.key();
    let accuracy = |at_tip: bool| {
        let own = rows(tables, "accuracy");
        let own = own.filter(|row| (row.text("point") == "tool_tip") == at_tip);
        own.map(|row| figure(&row)).collect()
    };
    let names = about.work.sessions.iter().map(|name| (name, true));
    let names = names.chain(about.work.test_sessions.iter().map(|name| (name, false)));
    Content {
        robot,
        session,
        run,
        tolerance: about.tolerance,
        verdict: about.verdict.verdict(),
        judges: about.verdict.judges().iter().map(judge).collect(),
        choice: about.choice.to_owned(),
        warnings: about.said.warnings.clone(),
        notes: about.said.notes.clone(),
        table_state: about.said.table_state.clone(),
        steps: rows(tables, "grid_steps").map(|row| step(&row)).collect(),
        figures: accuracy(false),
        tip: accuracy(true),
        residuals: residuals(tables),
        semivariograms: rows(tables, "semivariograms")
            .filter_map(|row| variogram(&row))
            .collect(),
        joint_errors: rows(tables, "joint_errors")
            .map(|row| joint_error(&row))
            .collect(),
        parameters: rows(tables, "parameters")
            .map(|row| parameter(&row))
            .collect(),
        calibrations: rows(tables, "calibrations")
            .map(|row| calibration(&row))
            .collect(),
        sessions: names
            .filter_map(|(name, trained)| of_session(tables, name, trained))
            .collect(),
        counts: about.counts.iter().map(count).collect(),
        provenance: made_from(about.work, about.written),
    }
}

fn judge(judge: &verdict::Judge) -> Judge {
    Judge {
        stations: judge.stations.words(),
        verdict: verdict::word(&judge.verdict).to_owned(),
        words: judge.words.clone(),
        remark: judge.remark.clone(),
    }
}

fn step(row: &Row<'_>) -> Step {
    Step {
        split: row.text("split"),
        of_session: row.text("of_session"),
        source: row.text("source"),
        interpolation: row.text("interpolation"),
        judgement: row.text("judgement"),
        step_mm: row.number("step_mm"),
        nodes: row.optional_whole("nodes"),
        held_out: row.whole("held_out"),
        visits: row.whole("visits"),
        blocks: row.optional_whole("blocks"),
        mean_mm: row.optional_number("mean_mm"),
        p95_mm: row.optional_number("p95_mm"),
        max_mm: row.optional_number("max_mm"),
        bound_mm: row.optional_number("bound_mm"),
        uncertainty_mm: row.optional_number("expanded_uncertainty_mm"),
        verdict: row.text("verdict"),
        reason: row.optional_text("reason"),
        chosen: row.flag("chosen"),
    }
}

fn subject(row: &Row<'_>) -> Subject {
    Subject {
        split: row.text("split"),
        of_session: row.text("of_session"),
        base_refit: row.text("base_refit"),
        model: row.text("model"),
        angles: row.text("angles"),
    }
}

fn figure(row: &Row<'_>) -> Figure {
    Figure {
        subject: subject(row),
        evidence: row.text("evidence"),
        quantity: row.text("quantity"),
        name: row.text("name"),
        pose: row.optional_whole("pose"),
        value: row.optional_number("value"),
        unit: row.text("unit"),
        n: row.whole("n"),
        visits: row.optional_whole("visits"),
        n_needed: row.optional_whole("n_needed"),
        blocks: row.optional_whole("blocks"),
        verdict: row.optional_text("verdict"),
        reason: row.optional_text("reason"),
    }
}

/// The table has them by fold; here they stand together by what they are of, in the order of the stations.
fn residuals(tables: &[Table]) -> Vec<Residuals> {
    let mut sets: BTreeMap<Subject, Vec<Residual>> = BTreeMap::new();
    for row in rows(tables, "residuals") {
        sets.entry(subject(&row)).or_default().push(residual(&row));
    }
    let in_order = |(subject, mut stations): (Subject, Vec<Residual>)| {
        stations.sort_by_key(|station| station.station);
        Residuals { subject, stations }
    };
    sets.into_iter().map(in_order).collect()
}

fn residual(row: &Row<'_>) -> Residual {
    Residual {
        station: row.whole("station"),
        at: ["x_mm", "y_mm", "z_mm"].map(|column| row.number(column)),
        error: ["residual_x_mm", "residual_y_mm", "residual_z_mm"].map(|column| row.number(column)),
        used_for_refit: row.flag("used_for_refit"),
    }
}

/// A bin, or a fitted model; its entry says which columns it has.
fn variogram(row: &Row<'_>) -> Option<Variogram> {
    let number = |column| row.optional_number(column);
    let entry = match row.optional_text("variogram") {
        None => VariogramEntry::Bin {
            separation: number("separation")?,
            gamma_mm2: number("gamma_mm2")?,
        },
        Some(shape) => VariogramEntry::Fitted {
            shape,
            nugget_mm2: number("nugget_mm2")?,
            sill_mm2: number("sill_mm2")?,
            range: number("range")?,
            best: row.flag("best"),
        },
    };
    Some(Variogram {
        space: row.text("space"),
        errors: row.text("errors"),
        axis: row.text("axis"),
        entry,
        noise_mm2: number("noise_mm2"),
        similarity: row.text("similarity"),
    })
}

fn joint_error(row: &Row<'_>) -> JointError {
    JointError {
        joint: row.whole("joint"),
        name: row.text("joint_name"),
        angle_rad: row.number("angle_rad"),
        curve_rad: row.number("curve_rad"),
        sd_rad: row.number("sd_rad"),
        measured: row.flag("measured"),
    }
}

fn parameter(row: &Row<'_>) -> Parameter {
    Parameter {
        model: row.text("model"),
        name: row.text("parameter"),
        belongs_to: row.text("belongs_to"),
        of_session: row.optional_text("of_session"),
        unit: row.text("unit"),
        nominal: row.number("nominal"),
        offset: row.number("offset"),
        standard_error: row.optional_number("standard_error"),
        identifiability: row.text("identifiability"),
        confused_with: row.texts("confused_with"),
    }
}

fn count(count: &StageCount) -> Count {
    Count {
        stage: count.stage.to_owned(),
        of: count.of.to_owned(),
        read: count.read,
        kept: count.kept,
        rejected: count.rejected.clone().into_iter().collect(),
    }
}

fn made_from(work: &Work, written: &[Written]) -> Provenance {
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
