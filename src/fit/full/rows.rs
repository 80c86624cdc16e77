//! Rows of all observations at the current geometry, whitened and summed.

use nalgebra::{DMatrix, DVector, Point3, Vector3};
use rayon::prelude::*;

use super::design::PoseView;
use super::layout::Block;
use super::regression::Sums;
use super::train::{CHUNK, State};
use crate::fit::observation::Observation;
use crate::fit::observation::measured::Shown;
use crate::fit::problem::Problem;
use crate::kinematics::Twist;

/// One observation's rows and residual at the current offsets.
pub struct Row {
    /// The part of the target's motion that the reading shows.
    pub shown: Shown,
    /// Unwhitened rows.
    pub rows: DMatrix<f64>,
    /// Measured minus predicted, mm and rad.
    pub value: DVector<f64>,
    /// Motion of the target per unit of each joint.
    pub joints: Vec<Twist>,
    /// Covariance of the instrument.
    pub instrument: DMatrix<f64>,
}

/// The prior mean of the columns, relative to the offsets where the rows are evaluated.
pub(super) fn prior_mean(problem: &Problem<'_>, state: &State) -> DVector<f64> {
    let mut mean = DVector::zeros(state.layout.size());
    for (place, precision) in problem.prior_precision().iter().enumerate() {
        if *precision > 0.0 {
            mean[place] = problem.prior_mean()[place] - state.offsets[place];
        }
    }
    mean
}

pub(super) fn rows(problem: &Problem<'_>, state: &State, up: Option<Vector3<f64>>) -> Vec<Row> {
    let frames = problem.frames(&state.offsets);
    let chains = problem.held(&state.offsets);
    let row = |observation: &Observation| {
        let view = chains.of(observation.channel()).view(&observation.axes);
        let base = frames[observation.session].tracker_from_base(observation.source);
        let root = base.isometry().rotation;
        let pose = PoseView {
            unknowns: &view.unknowns,
            joints: &view.joints,
            axes: &view.axes,
            end: view.end.translation.vector.into(),
            up: up.map(|up| root * up),
            base: *root.to_rotation_matrix().matrix(),
            angles: &observation.axes,
            settling_error: observation.settling_error.as_ref(),
            session: Some(observation.session),
            time: Some(observation.station as f64 / state.span),
            middle: base.isometry() * state.middles[observation.session],
        };
        let gauge = problem.gauge(observation.channel(), &state.offsets);
        let end = Point3::from(view.end.translation.vector);
        let shown = observation.measured.shown(gauge.as_ref(), &end);
        let mut rows = pose.rows(&state.layout, &shown);
        // The unknowns are the first columns.
        for (unknown, by) in problem.by_parts(observation.channel(), gauge.as_ref(), &end) {
            rows[(0, unknown)] = by;
        }
        // The session's scale is that of the source of places.
        let scale = state.layout.columns(Block::Scale(observation.session));
        if let (Some(scale), Some(_)) = (scale, &gauge) {
            rows.column_mut(scale.start).fill(0.0);
        }
        let residual = observation.measured.residual(&view.end, gauge.as_ref());
        Row {
            shown,
            rows,
            value: DVector::from_vec(residual),
            joints: view.joints,
            instrument: observation.measured.instrument(),
        }
    };
    problem
        .observations()
        .par_iter()
        .with_min_len(CHUNK)
        .map(row)
        .collect()
}

/// Covariance of an observation's noise at its weight.
fn covariance(state: &State, observation: &Observation, row: &Row, weight: f64) -> DMatrix<f64> {
    let counted = weight * state.tails.information(row.value.len() as f64);
    let covariance = state
        .repeatability
        .covariance(observation, &row.shown, &row.joints);
    covariance / counted
}

/// Covariance of each observation's noise at its weight, as [`sums`] returns them.
pub(super) fn covariances(problem: &Problem<'_>, state: &State, rows: &[Row]) -> Vec<DMatrix<f64>> {
    let observations = problem.observations().iter();
    let weighted = observations.zip(rows).zip(&state.weights);
    weighted
        .map(|((observation, row), weight)| covariance(state, observation, row, *weight))
        .collect()
}

/// Observations that are whitened and summed at once: a whitened row takes as much memory as the row itself, and is needed
/// for its sum alone. Fixed, so that results do not depend on the number of threads.
const SUMMED_AT_ONCE: usize = 512;

/// Whitens all rows and sums them; also returns the covariance of each observation at its weight.
pub(super) fn sums(
    problem: &Problem<'_>,
    state: &State,
    rows: &[Row],
    prior_mean: &DVector<f64>,
) -> (Sums, Vec<DMatrix<f64>>) {
    let whiten = |((observation, row), weight): ((&Observation, &Row), &f64)| {
        let covariance = covariance(state, observation, row, *weight);
        let factor = covariance
            .clone()
            .cholesky()
            .expect("an instrument's covariance plus repeatability is positive")
            .l();
        let value = &row.value - &row.rows * prior_mean;
        let white = |matrix: &DMatrix<f64>| {
            factor
                .solve_lower_triangular(matrix)
                .expect("a factor has no zero pivot")
        };
        let value = factor
            .solve_lower_triangular(&value)
            .expect("a factor has no zero pivot");
        let ln = 2.0 * factor.diagonal().map(f64::ln).sum();
        (white(&row.rows), value, ln, covariance)
    };
    let mut sums = Sums::zero(state.layout.size());
    let mut covariances = Vec::with_capacity(rows.len());
    let batches = problem.observations().chunks(SUMMED_AT_ONCE);
    let others = rows
        .chunks(SUMMED_AT_ONCE)
        .zip(state.weights.chunks(SUMMED_AT_ONCE));
    for (observations, (rows, weights)) in batches.zip(others) {
        let observations = observations.par_iter().zip(rows).zip(weights);
        let parts: Vec<_> = observations.with_min_len(CHUNK).map(whiten).collect();
        sums.add(&stacked(parts, state.layout.size(), &mut covariances));
    }
    add_distances(&mut sums, problem, state, prior_mean);
    (sums, covariances)
}

/// Adds the rows of known distances between targets, which are whitened; the unknowns are the first columns.
fn add_distances(sums: &mut Sums, problem: &Problem<'_>, state: &State, prior_mean: &DVector<f64>) {
    for distance in problem.distances(&state.offsets) {
        let mut row = DMatrix::zeros(1, state.layout.size());
        for (unknown, by) in distance.entries {
            row[(0, unknown)] = by;
        }
        let value = DVector::from_element(1, distance.residual) - &row * prior_mean;
        sums.add(&Sums::new(&row, &value, 0.0));
    }
}

/// Whitened rows of one station, their whitened values, the logarithm of the covariance's determinant, and the covariance.
type Whitened = (DMatrix<f64>, DVector<f64>, f64, DMatrix<f64>);

/// The sums of whitened rows; their covariances are appended to `covariances`.
fn stacked(parts: Vec<Whitened>, columns: usize, covariances: &mut Vec<DMatrix<f64>>) -> Sums {
    let count: usize = parts.iter().map(|part| part.1.len()).sum();
    let mut stacked = DMatrix::zeros(count, columns);
    let mut values = DVector::zeros(count);
    let (mut first, mut ln_noise) = (0, 0.0);
    for (white, value, ln, covariance) in parts {
        stacked.rows_mut(first, value.len()).copy_from(&white);
        values.rows_mut(first, value.len()).copy_from(&value);
        first += value.len();
        ln_noise += ln;
        covariances.push(covariance);
    }
    Sums::new(&stacked, &values, ln_noise)
}
