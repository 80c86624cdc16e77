//! Rows of all stations at the current geometry.
//!
//! The readings of one station (several targets, several instruments) are of one pose that the arm attained, so their noise is
//! correlated ([`super::noise`]): their rows stand one below the other, and are whitened
//! ([`super::whitening`]), weighted and left out together.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, Matrix3, Point3, Vector3};
use rayon::prelude::*;

use super::design::PoseView;
use super::layout::Block;
use super::noise::{NoisyReading, StationNoise};
use super::train::{CHUNK, State};
use crate::fit::frames::{Frames, PerChannel};
use crate::fit::observation::Observation;
use crate::fit::observation::measured::Shown;
use crate::fit::problem::Problem;
use crate::kinematics::{HeldChain, Twist};

/// One station's rows and residual at the current offsets.
pub struct Row {
    /// Unwhitened rows.
    pub rows: DMatrix<f64>,
    /// Measured minus predicted, mm and rad.
    pub value: DVector<f64>,
    /// The noise of its readings.
    pub noise: StationNoise,
}

/// One reading's rows and residual.
struct ReadingRow {
    /// The part of the target's motion that the reading shows.
    shown: Shown,
    /// Unwhitened rows.
    rows: DMatrix<f64>,
    /// Measured minus predicted, mm and rad.
    value: DVector<f64>,
    /// Motion of the target per unit of each joint.
    joints: Vec<Twist>,
    /// Rotation from the base's axes to the source's.
    base: Matrix3<f64>,
}

/// The readings of each station, as ranges of observations: those beside each other of one session and station.
pub(super) fn stations(observations: &[Observation]) -> Vec<Range<usize>> {
    let one = |a: &Observation, b: &Observation| (a.session, a.station) == (b.session, b.station);
    let groups = observations.chunk_by(one);
    let ranges = groups.scan(0, |next, group| {
        let first = *next;
        *next += group.len();
        Some(first..*next)
    });
    ranges.collect()
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

/// The rows of each station, in the order of [`stations`].
pub(super) fn rows(problem: &Problem<'_>, state: &State, up: Option<Vector3<f64>>) -> Vec<Row> {
    let around = Around {
        frames: problem.frames(&state.offsets),
        chains: problem.held(&state.offsets),
        problem,
        state,
        up,
    };
    let observations = problem.observations();
    stations(observations)
        .into_par_iter()
        .with_min_len(CHUNK)
        .map(|own| around.station(&observations[own]))
        .collect()
}

/// The values that the rows of all readings have in common.
struct Around<'p> {
    problem: &'p Problem<'p>,
    state: &'p State,
    up: Option<Vector3<f64>>,
    frames: Vec<Frames>,
    chains: PerChannel<HeldChain>,
}

impl Around<'_> {
    fn station(&self, readings: &[Observation]) -> Row {
        let mut rows: Vec<ReadingRow> = readings.iter().map(|own| self.reading(own)).collect();
        let noisy = readings.iter().zip(&rows);
        let noisy = noisy.map(|(observation, row)| NoisyReading {
            observation,
            shown: &row.shown,
            joints: &row.joints,
            base: row.base,
        });
        let noise = StationNoise::of(&noisy.collect::<Vec<_>>());
        let (rows, value) = match (rows.pop(), &rows[..]) {
            (Some(only), []) => (only.rows, only.value),
            (last, others) => below(others.iter().chain(&last), self.state.layout.size()),
        };
        Row { rows, value, noise }
    }

    fn reading(&self, observation: &Observation) -> ReadingRow {
        let (problem, state) = (self.problem, self.state);
        let view = self
            .chains
            .of(observation.channel())
            .view(&observation.axes);
        let base = self.frames[observation.session].tracker_from_base(observation.source);
        let root = base.isometry().rotation;
        let base_axes = *root.to_rotation_matrix().matrix();
        let pose = PoseView {
            unknowns: &view.unknowns,
            joints: &view.joints,
            axes: &view.axes,
            end: view.end.translation.vector.into(),
            up: self.up.map(|up| root * up),
            base: base_axes,
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
        ReadingRow {
            shown,
            rows,
            value: DVector::from_vec(residual),
            joints: view.joints,
            base: base_axes,
        }
    }
}

/// The rows and residuals of several readings, one below the other.
fn below<'r>(
    readings: impl Iterator<Item = &'r ReadingRow> + Clone,
    columns: usize,
) -> (DMatrix<f64>, DVector<f64>) {
    let count = readings.clone().map(|own| own.value.len()).sum();
    let (mut rows, mut value) = (DMatrix::zeros(count, columns), DVector::zeros(count));
    let mut first = 0;
    for own in readings {
        let size = own.value.len();
        rows.rows_mut(first, size).copy_from(&own.rows);
        value.rows_mut(first, size).copy_from(&own.value);
        first += size;
    }
    (rows, value)
}

/// Covariance of a station's noise at its weight.
pub(super) fn covariance(state: &State, row: &Row, weight: f64) -> DMatrix<f64> {
    let counted = weight * state.tails.information(row.value.len() as f64);
    state.repeatability.covariance(&row.noise) / counted
}

/// Covariance of each station's noise at its weight, as [`super::whitening`] returns them.
pub(super) fn covariances(state: &State, rows: &[Row]) -> Vec<DMatrix<f64>> {
    let weighted = rows.iter().zip(&state.weights);
    weighted
        .map(|(row, weight)| covariance(state, row, *weight))
        .collect()
}
