//! `grid_steps`: every step, node source, interpolation and judgement, and which was chosen.

use super::{PublishContext, PublishError, words};
use crate::figures::{Figures, bound_rank, least_count};
use crate::grid::{Grids, Interpolation, Judged, Judgement, Refusal, Source};
use crate::io::schema;
use crate::io::table::{Columns, Table};
use crate::kinematics::Configuration;
use crate::manifest::RunKey;
use crate::pipeline::outcome::Outcome;
use crate::report::Split;

/// The table of all judged steps.
pub fn grid_steps(
    outcome: &Outcome<'_>,
    context: &PublishContext<'_>,
    key: &RunKey,
) -> Result<Table, PublishError> {
    let grids = &outcome.grids;
    let judged = &grids.judged;
    let own = outcome.training.last().map(|session| &session.name);
    let split = |row: &Judged| match row.of_test {
        None => context.grid.split,
        Some(_) => Split::Session,
    };
    let configuration = grids
        .table
        .configuration
        .as_ref()
        .map(Configuration::to_string);
    let of_table = |row: &Judged| row.judgement == Judgement::Table;
    let model =
        |row: &Judged| (row.source == Source::Model).then(|| words::model(context.grid.model));
    let table = Columns::new(schema::find("grid_steps")?, judged.len())
        .key(key)
        .column("source", judged.iter().map(|row| row.source.name()))
        .column(
            "interpolation",
            judged.iter().map(|row| row.interpolation.name()),
        )
        .column(
            "idw_power",
            judged.iter().map(|row| power(row.interpolation, grids)),
        )
        .column("model", judged.iter().map(model))
        .same("angles", words::angles(context.grid.angles))
        .column("judgement", judged.iter().map(judgement))
        .column("split", judged.iter().map(|row| words::split(split(row))))
        .column(
            "of_session",
            judged.iter().map(|row| row.of_test.as_ref().or(own)),
        )
        .column(
            "orientation",
            judged.iter().map(|row| of_table(row).then_some(0_i64)),
        )
        .column(
            "configuration",
            judged
                .iter()
                .map(|row| configuration.clone().filter(|_| of_table(row))),
        )
        .column("step_mm", judged.iter().map(|row| row.step_mm))
        .group(
            ["step_x_mm", "step_y_mm", "step_z_mm"],
            judged.iter().map(|row| [row.step_mm; 3]),
        )
        .column("chosen", judged.iter().map(|row| row.chosen));
    Ok(verdicts(figures(counts(table, judged), judged), outcome, context).finish()?)
}

/// The power where values are weighted by inverse distance.
pub(super) fn power(interpolation: Interpolation, grids: &Grids) -> Option<f64> {
    (interpolation == Interpolation::Idw).then_some(grids.table.idw_power)
}

const fn judgement(row: &Judged) -> &'static str {
    match row.judgement {
        Judgement::LocalCell => "local_cell",
        Judgement::Table => "table",
    }
}

fn counts(columns: Columns, judged: &[Judged]) -> Columns {
    let cells = |row: &Judged, of: &[Refusal]| -> usize {
        of.iter()
            .filter_map(|refusal| row.refused_cells.get(refusal))
            .sum()
    };
    let mixed = [Refusal::OtherConfiguration, Refusal::Branches];
    let unreachable = [Refusal::OutOfReach, Refusal::Unmeasured];
    let all = || judged.iter();
    columns
        .column("nodes", all().map(|row| row.nodes))
        .column(
            "nodes_refused",
            all().map(|row| row.refused_nodes.values().sum::<usize>()),
        )
        .column("cells", all().map(|row| row.cells))
        .column(
            "cells_singular",
            all().map(|row| cells(row, &[Refusal::Singularity])),
        )
        .column("cells_mixed", all().map(|row| cells(row, &mixed)))
        .column(
            "cells_unreachable",
            all().map(|row| cells(row, &unreachable)),
        )
        .column("held_out", all().map(|row| row.held_out.counted().poses))
        .column("visits", all().map(|row| row.held_out.counted().visits))
        .column("errors", all().map(|row| row.held_out.norms.len()))
        .column(
            "held_out_refused",
            all().map(|row| row.held_out.refused.values().sum::<usize>()),
        )
        .column("held_out_outside", all().map(|row| row.held_out.outside))
        .column("held_out_unlike", all().map(|row| row.held_out.unlike))
        .column(
            "blocks",
            judged.iter().map(|row| Some(row.held_out.blocks.len())),
        )
        .absent(["phases"])
}

fn figures(columns: Columns, judged: &[Judged]) -> Columns {
    let figure =
        |of: fn(&Figures) -> f64| judged.iter().map(move |row| row.figures.as_ref().map(of));
    columns
        .column("mean_mm", figure(|f| f.mean))
        .column("rms_mm", figure(|f| f.rms))
        .column("p95_mm", figure(|f| f.p95))
        .column("p99_mm", figure(|f| f.p99))
        .column("max_mm", figure(|f| f.max))
        .column("mean_plus_3sd_mm", figure(Figures::mean_plus_3_sd))
        .column("bound_mm", judged.iter().map(|row| row.bound))
        .column(
            "bound_of_session_mm",
            judged.iter().map(|row| row.bound_of_session),
        )
        .column(
            "excess_mm",
            judged.iter().map(|row| Some(row.held_out.excess()?.0)),
        )
        .column(
            "excess_se_mm",
            judged.iter().map(|row| Some(row.held_out.excess()?.1)),
        )
}

fn verdicts(columns: Columns, outcome: &Outcome<'_>, context: &PublishContext<'_>) -> Columns {
    let judged = &outcome.grids.judged;
    // The table that is published has the verdict of the run.
    let (verdict, why) = (outcome.verdict.verdict(), outcome.verdict.reason());
    let verdict = |row: &Judged| {
        let own = if row.chosen { &verdict } else { &row.verdict };
        words::verdict(own)
    };
    let reason = |row: &Judged| {
        if row.chosen {
            why.clone()
        } else {
            words::reason(&row.verdict).map(str::to_owned)
        }
    };
    let coverage = context.tolerance.coverage();
    columns
        .same("bound_share", coverage.share)
        .same("bound_confidence", coverage.confidence)
        .column(
            "bound_rank",
            judged
                .iter()
                .map(|row| bound_rank(row.held_out.counted().poses, coverage)),
        )
        .same("held_out_needed", whole(least_count(coverage)))
        .same("expanded_uncertainty_mm", context.grid.guard_mm)
        .same("tolerance_mm", context.tolerance.mm)
        .column("verdict", judged.iter().map(verdict))
        .column("reason", judged.iter().map(reason))
}

/// A count as a whole number.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a count; the cast saturates where a share of one asks for infinitely many"
)]
pub(super) const fn whole(count: f64) -> i64 {
    count as i64
}
