//! Leave-one-out residuals in closed form, and the weights and gear lines derived from them.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::layout::{Block, Layout};
use super::lines::{self, FoundLine};
use super::noise::{NoiseEvidence, column, of_length};
use super::regression::Posterior;
use super::rows::Row;
use super::settings::FullSettings;
use super::student::Tails;
use super::train::{CHUNK, FEW_HARMONICS, State};
use crate::fit::observation::Observation;
use crate::fit::problem::Problem;

/// Gear lines taken per joint in one round.
const LINES_PER_ROUND: usize = 3;

/// The leave-one-out result of one observation.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// Measured minus predicted by all others, mm and rad.
    pub residual: DVector<f64>,
    /// Inverse of its covariance.
    pub information: DMatrix<f64>,
    /// Squared Mahalanobis distance at weight 1, of position and orientation together.
    pub distance_squared: f64,
    /// Its evidence on the sizes of the noise.
    pub noise: NoiseEvidence,
}

impl LeftOut {
    /// The robust weight: small for a station far from the prediction of all others.
    pub(super) fn weight(&self, tails: Tails) -> f64 {
        tails.weight(self.distance_squared, self.residual.len() as f64)
    }
}

/// Leave-one-out residuals in closed form: `r₋ = K⁻¹ α`, `α = N⁻¹ r`, `K = N⁻¹ − N⁻¹ H N⁻¹`.
pub(super) fn leave_one_out(
    state: &State,
    (observations, rows): (&[Observation], &[Row]),
    prior_mean: &DVector<f64>,
    covariances: &[DMatrix<f64>],
    posterior: &Posterior,
) -> Vec<LeftOut> {
    let mean = posterior.mean() + prior_mean;
    let chunk = |chunk: usize| {
        let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(rows.len());
        let stacked = stack(&rows[range.clone()]);
        let half = posterior.half(&stacked);
        let mut first = 0;
        let mut left_out = Vec::with_capacity(CHUNK);
        for place in range {
            let (row, of_length) = (&rows[place], of_length(&observations[place]));
            let own = half.columns(first, row.value.len());
            first += row.value.len();
            let noise = &covariances[place];
            let explained = own.tr_mul(&own);
            let counts = (
                state.weights[place],
                state.tails.information(row.value.len() as f64),
            );
            left_out.push(left_out_of(
                (row, of_length),
                &mean,
                noise,
                &explained,
                counts,
            ));
        }
        left_out
    };
    (0..rows.len().div_ceil(CHUNK))
        .into_par_iter()
        .flat_map_iter(chunk)
        .collect()
}

fn left_out_of(
    (row, of_length): (&Row, Option<usize>),
    mean: &DVector<f64>,
    noise: &DMatrix<f64>,
    explained: &DMatrix<f64>,
    (weight, share): (f64, f64),
) -> LeftOut {
    let inverse = |matrix: &DMatrix<f64>| {
        matrix
            .clone()
            .try_inverse()
            .expect("a positive definite covariance")
    };
    let noise_inverse = inverse(noise);
    let left = &row.value - &row.rows * mean;
    let alpha = &noise_inverse * left;
    let information = &noise_inverse - &noise_inverse * explained * &noise_inverse;
    let covariance = inverse(&information);
    let residual = &covariance * &alpha;
    let open = &covariance - noise;
    let at_weight_one = &open + noise * (weight * share);
    let distance_squared = residual.dot(&(inverse(&at_weight_one) * &residual));
    LeftOut {
        noise: NoiseEvidence {
            residual: residual.clone(),
            open,
            instrument: row.instrument.clone(),
            columns: row
                .joints
                .iter()
                .map(|twist| column(twist, &row.shown))
                .collect(),
            weight,
            information: share,
            of_length,
        },
        residual,
        information,
        distance_squared,
    }
}

fn stack(rows: &[Row]) -> DMatrix<f64> {
    let count = rows.iter().map(|row| row.value.len()).sum();
    let mut stacked = DMatrix::zeros(count, rows[0].rows.ncols());
    let mut first = 0;
    for row in rows {
        stacked
            .rows_mut(first, row.value.len())
            .copy_from(&row.rows);
        first += row.value.len();
    }
    stacked
}

pub(super) fn find_lines(
    problem: &Problem<'_>,
    layout: &Layout,
    rows: &[Row],
    left_out: &[LeftOut],
    settings: &FullSettings,
) -> Vec<FoundLine> {
    let joints = rows.first().map_or(0, |row| row.joints.len());
    let of_joint = |joint: usize| {
        let stations = problem.observations().iter().zip(rows).zip(left_out).map(
            |((observation, row), left_out)| {
                let column = column(&row.joints[joint], &row.shown);
                lines::evidence(
                    &column,
                    &left_out.residual,
                    &left_out.information,
                    observation.axes[joint],
                )
            },
        );
        let stations: Vec<_> = stations.collect();
        // A joint that hardly moves the target has no evidence on its gears.
        let moves = layout
            .columns(Block::Curve(joint))
            .is_some_and(|c| c.len() > 2 * FEW_HARMONICS * layout.period_turns() as usize);
        let most = if moves { LINES_PER_ROUND } else { 0 };
        lines::find(
            joint,
            &stations,
            &layout.lines(joint),
            settings.line_threshold,
            most,
        )
    };
    (0..joints).flat_map(of_joint).collect()
}
