//! `grid_steps`: every step, node source, interpolation and judgement, and the chosen one.

use super::PublishContext;
use super::words::{self, TableVerdict};
use crate::figures::{Figures, bound_rank, least_count};
use crate::grid::{Covered, Interpolation, Judged, Judgement, Picked, Refusal, Source};
use crate::kinematics::Configuration;
use crate::report::{Angles, Model, Split};
use crate::table::row;
use crate::tables::outcome::Outcome;

row! {
    /// A judged step.
    pub struct StepRow of "grid_steps" {
        /// Source of node values.
        source: Source,
        /// Interpolation inside a cell.
        interpolation: Interpolation,
        /// The power of inverse distance weighting; `None` for other interpolations.
        idw_power: Option<f64>,
        /// The model, where node values come from one.
        model: Option<Model>,
        /// The joint angles that it was given.
        angles: Angles,
        /// By the table itself, or by cells around each station.
        judgement: Judgement,
        /// The way in which the stations that judge were kept from training.
        split: Split,
        /// The session whose stations judge.
        of_session: String,
        /// Number of the table's orientation; there is one.
        orientation: Option<i64>,
        /// The table's arm configuration.
        configuration: Option<String>,
        /// The step asked for, mm.
        step_mm: f64,
        /// The pitch of nodes along each axis of the base frame, mm; `None` where the step does not fit.
        pitch_mm as [pitch_x_mm, pitch_y_mm, pitch_z_mm]: Option<[f64; 3]>,
        /// Number of nodes of the table; for local cells, eight for each cell.
        nodes: Option<usize>,
        /// Nodes without a value.
        nodes_refused: Option<usize>,
        /// Number of cells.
        cells: usize,
        /// Cells at a singularity.
        cells_singular: usize,
        /// Cells whose nodes are of several configurations or branches.
        cells_mixed: usize,
        /// Cells that are not reached or not measured.
        cells_unreachable: usize,
        /// Phases of the lattice: not given.
        phases: Option<i64>,
        /// Held-out poses that judged.
        held_out: usize,
        /// Visits of them.
        visits: usize,
        /// Number of errors that the bound counts.
        errors: usize,
        /// Held-out stations whose cell has no value.
        held_out_refused: usize,
        /// Held-out stations outside of the box.
        held_out_outside: usize,
        /// Held-out stations of another orientation or configuration.
        held_out_unlike: usize,
        /// Number of measured stations that the table covers; `None` where there is no table.
        stations_covered: Option<usize>,
        /// Their share of all measured stations.
        stations_covered_share: Option<f64>,
        /// Their share of the stations of the table's orientation and configuration.
        like_covered_share: Option<f64>,
        /// The share of the box that the table covers.
        box_covered_share: Option<f64>,
        /// How much of the interpolation error the stations can show; `None` of local cells.
        interpolation_shown_share: Option<f64>,
        /// Blocks that the poses come from.
        blocks: Option<usize>,
        /// Mean error left, mm.
        mean_mm: Option<f64>,
        /// Root mean square, mm.
        rms_mm: Option<f64>,
        /// 95th percentile, mm.
        p95_mm: Option<f64>,
        /// 99th percentile, mm.
        p99_mm: Option<f64>,
        /// Largest, mm.
        max_mm: Option<f64>,
        /// Mean and three standard deviations, mm.
        mean_plus_3sd_mm: Option<f64>,
        /// Upper tolerance bound with between-session variation, mm.
        bound_mm: Option<f64>,
        /// Upper tolerance bound of the session as it was measured, mm.
        bound_of_session_mm: Option<f64>,
        /// Upper tolerance bound of what the model itself leaves on the same stations, mm.
        model_bound_mm: Option<f64>,
        /// The share of errors that the bound covers.
        bound_share: f64,
        /// Its confidence.
        bound_confidence: f64,
        /// Rank of the bound among the sorted errors, from 1.
        bound_rank: Option<usize>,
        /// Poses that the bound needs.
        held_out_needed: i64,
        /// Expanded uncertainty of the measurement, mm.
        expanded_uncertainty_mm: Option<f64>,
        /// The tolerance, mm.
        tolerance_mm: Option<f64>,
        /// Whether it is met.
        verdict: TableVerdict,
        /// The reason why it is not met or not shown.
        reason: Option<String>,
        /// Whether its table is published.
        chosen: bool,
        /// Why the rule `within` chooses this step, in words; `None` where it does not.
        choice_within: Option<String>,
        /// Why the rule `fewest-nodes` chooses this step, in words; `None` where it does not.
        choice_fewest_nodes: Option<String>,
        /// Mean error beyond that of the model without a grid, mm.
        excess_mm: Option<f64>,
        /// Its standard error, mm.
        excess_se_mm: Option<f64>,
    }
}

/// The rows of all judged steps.
pub fn rows(outcome: &Outcome<'_>, context: &PublishContext<'_>) -> Vec<StepRow> {
    let judged = outcome.grids.judged.iter().enumerate();
    judged
        .map(|(place, judged)| {
            let choice = &outcome.grids.choice;
            let why = |picked: &Option<Picked>| {
                let own = picked.as_ref().filter(|picked| picked.row == place)?;
                Some(own.words.clone())
            };
            StepRow {
                choice_within: why(&choice.within),
                choice_fewest_nodes: why(&choice.fewest_nodes),
                ..row(judged, outcome, context)
            }
        })
        .collect()
}

fn row(judged: &Judged, outcome: &Outcome<'_>, context: &PublishContext<'_>) -> StepRow {
    let is_table = judged.judgement == Judgement::Table;
    let (verdict, reason) = verdict(judged, outcome);
    let (coverage, figures) = (context.tolerance.coverage(), judged.figures.as_ref());
    let (held_out, counted) = (&judged.held_out, judged.held_out.counted());
    let (excess, covered) = (held_out.excess(), judged.covered.as_ref());
    let cells = |of: &[Refusal]| refused_cells(judged, of);
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
        configuration: outcome
            .grids
            .configuration
            .as_ref()
            .filter(|_| is_table)
            .map(Configuration::to_string),
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
        choice_within: None,
        choice_fewest_nodes: None,
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
        let table = outcome.verdict.table();
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
