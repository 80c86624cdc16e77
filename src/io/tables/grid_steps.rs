//! `grid_steps`: every step, node source, interpolation and judgement, and the chosen one.

use super::PublishContext;
use super::words::{self, TableVerdict};
use crate::figures::{Figures, bound_rank, least_count};
use crate::grid::{Covered, Interpolation, Judged, Judgement, Picked, Refusal, Source};
use crate::judgement::Outcome;
use crate::kinematics::Configuration;
use crate::report::{Angles, Model, Split};
use crate::rows::row;

row! {
    pub struct StepRow of "grid_steps" {
        source: Source,
        interpolation: Interpolation,
        idw_power: Option<f64>,
        model: Option<Model>,
        angles: Angles,
        judgement: Judgement,
        split: Split,
        of_session: String,
        orientation: Option<i64>,
        configuration: Option<String>,
        step_mm: f64,
        pitch_mm as [pitch: point]: Option<[f64; 3]>,
        nodes: Option<usize>,
        nodes_refused: Option<usize>,
        cells: usize,
        cells_singular: usize,
        cells_mixed: usize,
        cells_unreachable: usize,
        phases: Option<i64>,
        held_out: usize,
        visits: usize,
        errors: usize,
        held_out_refused: usize,
        held_out_outside: usize,
        held_out_unlike: usize,
        stations_covered: Option<usize>,
        stations_covered_share: Option<f64>,
        like_covered_share: Option<f64>,
        box_covered_share: Option<f64>,
        interpolation_shown_share: Option<f64>,
        blocks: Option<usize>,
        mean_mm: Option<f64>,
        rms_mm: Option<f64>,
        p95_mm: Option<f64>,
        p99_mm: Option<f64>,
        max_mm: Option<f64>,
        mean_plus_3sd_mm: Option<f64>,
        bound_mm: Option<f64>,
        bound_of_session_mm: Option<f64>,
        model_bound_mm: Option<f64>,
        bound_share: f64,
        bound_confidence: f64,
        bound_rank: Option<usize>,
        held_out_needed: i64,
        expanded_uncertainty_mm: Option<f64>,
        tolerance_mm: Option<f64>,
        verdict: TableVerdict,
        reason: Option<String>,
        chosen: bool,
        choice_within: Option<String>,
        choice_fewest_nodes: Option<String>,
        excess_mm: Option<f64>,
        excess_se_mm: Option<f64>,
    }
}

pub fn rows(outcome: &Outcome<'_>, context: &PublishContext<'_>) -> Vec<StepRow> {
    let judged = outcome.grids.judged.iter().enumerate();
    judged.map(|(place, judged)| row(place, judged, outcome, context)).collect()
}

fn row(
    place: usize,
    judged: &Judged,
    outcome: &Outcome<'_>,
    context: &PublishContext<'_>,
) -> StepRow {
    let choice = &outcome.grids.choice;
    let why = |picked: &Option<Picked>| {
        let own = picked.as_ref().filter(|picked| picked.row == place)?;
        Some(own.words.clone())
    };
    let is_table = judged.judgement == Judgement::Table;
    let (verdict, reason) = verdict(judged, outcome);
    let (coverage, figures) = (context.tolerance.coverage(), judged.figures.as_ref());
    let (held_out, counted) = (&judged.held_out, judged.held_out.counted());
    let (excess, covered) = (held_out.excess(), judged.covered.as_ref());
    let cells = |of: &[Refusal]| refused_cells(judged, of);
    let configuration = outcome.grids.configuration.as_ref().filter(|_| is_table);
    StepRow {
        source: judged.source,
        interpolation: judged.interpolation,
        idw_power: power(judged.interpolation, outcome.grids.idw_power),
        model: (judged.source == Source::Model).then_some(outcome.best),
        angles: Angles::Commanded,
        judgement: judged.judgement,
        split: match judged.of_test {
            None => Split::Blocks,
            Some(_) => Split::Session,
        },
        of_session: of_session(judged, outcome),
        orientation: is_table.then_some(0),
        configuration: configuration.map(Configuration::to_string),
        step_mm: judged.step_mm,
        pitch_mm: judged.pitch_mm,
        nodes: Some(judged.nodes),
        nodes_refused: (judged.covered.is_some() || !is_table)
            .then(|| judged.refused_nodes.values().sum()),
        cells: judged.cells,
        cells_singular: cells(&[Refusal::Singularity]),
        cells_mixed: cells(&[Refusal::OtherConfiguration, Refusal::Branches]),
        cells_unreachable: cells(&[Refusal::OutOfReach, Refusal::Unmeasured]),
        phases: None,
        held_out: counted.poses,
        visits: counted.visits,
        errors: held_out.norms.len(),
        held_out_refused: held_out.refused.values().sum(),
        held_out_outside: held_out.outside,
        held_out_unlike: held_out.unlike,
        stations_covered: covered.map(|own| own.stations),
        stations_covered_share: covered.map(Covered::of_stations),
        like_covered_share: covered.and_then(Covered::of_like),
        box_covered_share: covered.map(|own| own.of_box),
        interpolation_shown_share: judged.interpolation_shown,
        blocks: Some(held_out.blocks.len()),
        mean_mm: figures.map(|f| f.mean),
        rms_mm: figures.map(|f| f.rms),
        p95_mm: figures.map(|f| f.p95),
        p99_mm: figures.map(|f| f.p99),
        max_mm: figures.map(|f| f.max),
        mean_plus_3sd_mm: figures.map(Figures::mean_plus_3_sd),
        bound_mm: judged.bound,
        bound_of_session_mm: judged.bound_of_session,
        model_bound_mm: judged.model_bound,
        bound_share: coverage.share,
        bound_confidence: coverage.confidence,
        bound_rank: bound_rank(counted.poses, coverage),
        held_out_needed: whole(least_count(coverage)),
        expanded_uncertainty_mm: Some(outcome.grids.guard_mm),
        tolerance_mm: Some(context.tolerance.mm),
        verdict,
        reason,
        chosen: judged.chosen,
        choice_within: why(&choice.within),
        choice_fewest_nodes: why(&choice.fewest_nodes),
        excess_mm: excess.map(|(mm, _)| mm),
        excess_se_mm: excess.map(|(_, se_mm)| se_mm),
    }
}

/// The test session whose stations judged, or the last that trained.
fn of_session(judged: &Judged, outcome: &Outcome<'_>) -> String {
    let own = || Some(outcome.training.last()?.name.clone());
    judged.of_test.clone().or_else(own).expect("a run has a session that trained")
}

/// The power where values are weighted by inverse distance.
pub(super) fn power(interpolation: Interpolation, idw_power: f64) -> Option<f64> {
    (interpolation == Interpolation::Idw).then_some(idw_power)
}

/// Number of cells refused for one of these reasons.
fn refused_cells(judged: &Judged, of: &[Refusal]) -> usize {
    of.iter().filter_map(|refusal| judged.refused_cells.get(refusal)).sum()
}

/// The table that is published has the verdict of the table, which test sessions can make worse.
fn verdict(judged: &Judged, outcome: &Outcome<'_>) -> (TableVerdict, Option<String>) {
    if judged.chosen {
        let table = &outcome.verdict.table;
        return ((&table.verdict()).into(), table.reason());
    }
    let reason = words::reason(&judged.verdict).map(str::to_owned);
    ((&judged.verdict).into(), reason)
}

/// A count as a whole number.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a count; the cast saturates where a share of one asks for infinitely many"
)]
pub(super) const fn whole(count: f64) -> i64 {
    count as i64
}
