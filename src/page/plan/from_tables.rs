//! The tables of a plan, as they are in memory when they are published → what its page tells.

use super::row::{Row, rows};
use crate::io::table::Table;
use crate::manifest::{StageCount, Work, Written};
use crate::page::from_rows::{count, made_from};
use crate::page::plan::content::{Content, Figure, Promise, Visit};

/// What a plan says besides its tables.
#[derive(Debug, Clone, Copy)]
pub struct About<'a> {
    /// The work.
    pub work: &'a Work,
    /// Candidates in and out.
    pub counts: &'a [StageCount],
    /// Tables written.
    pub written: &'a [Written],
}

/// What the page of a plan tells, from its tables and what it says besides.
pub fn content(tables: &[Table], about: &About<'_>) -> Content {
    let key = about.work.key();
    let visits = || rows(tables, "sampling_plan");
    Content {
        robot: key.robot,
        plan: key.run,
        promise: visits().next().map(|row| promise(&row)),
        figures: rows(tables, "plan_figures")
            .map(|row| figure(&row))
            .collect(),
        visits: visits().map(|row| visit(&row)).collect(),
        joints: visits()
            .next()
            .map(|row| row.texts("joint_names"))
            .unwrap_or_default(),
        counts: about.counts.iter().map(count).collect(),
        provenance: made_from(about.work, about.written),
    }
}

/// Every row says it; the first is asked.
fn promise(row: &Row<'_>) -> Promise {
    Promise {
        mean_mm: row.optional_number("promised_mean_mm"),
        bound_mm: row.optional_number("promised_bound_mm"),
        share: row.number("promised_share"),
        confidence: row.number("promised_confidence"),
        robots: row.whole("robots_simulated"),
        meet: row.whole("robots_meet"),
        tolerance_mm: row.number("tolerance_mm"),
        bound_share: row.number("bound_share"),
        bound_confidence: row.number("bound_confidence"),
    }
}

fn figure(row: &Row<'_>) -> Figure {
    Figure {
        study: row.text("study"),
        value: row.optional_number("value"),
        design: row.text("design"),
        source: row.text("source"),
        interpolation: row.optional_text("interpolation"),
        step_mm: row.optional_number("step_mm"),
        poses: row.whole("poses"),
        not_reached: row.whole("not_reached"),
        robots: row.whole("robots"),
        no_fit: row.whole("no_fit"),
        judged: row.whole("judged"),
        refused: row.whole("refused"),
        outside: row.whole("outside"),
        mean_mm: row.optional_number("mean_mm"),
        p95_mm: row.optional_number("p95_mm"),
        expected_mean_mm: row.optional_number("expected_mean_mm"),
        expected_share_mm: row.optional_number("expected_share_mm"),
        bound_mm: row.optional_number("bound_mm"),
        meet: row.whole("meet"),
        share_at_least: row.number("share_at_least"),
        share_asked: row.number("share_asked"),
        chosen: row.flag("chosen"),
    }
}

fn visit(row: &Row<'_>) -> Visit {
    Visit {
        pose: row.whole("pose"),
        target: row.text("target"),
        purpose: row.text("purpose"),
        repeats: row.optional_whole("repeats"),
        joints_rad: row.numbers("joints_rad"),
        at: ["x_mm", "y_mm", "z_mm"].map(|column| row.number(column)),
        chosen_as: row.optional_whole("chosen_as"),
        variance_left_mm2: row.optional_number("variance_left_mm2"),
    }
}
