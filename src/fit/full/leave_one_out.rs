//! Leave-one-out residuals in closed form, and the weights and gear lines derived from them.
//!
//! A station is left out with all its readings: what the arm did there is common to them, so the other readings of a station would
//! predict its errors.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::layout::{Block, Layout};
use super::lines::{self, FoundLine};
use super::noise::NoiseEvidence;
use super::regression::Posterior;
use super::rows::{Row, stations};
use super::settings::FullSettings;
use super::student::Tails;
use super::train::{CHUNK, FEW_HARMONICS, State};
use super::whitening::noise_factor;
use crate::fit::problem::Problem;

/// Gear lines taken per joint in one round.
const LINES_PER_ROUND: usize = 3;

/// The leave-one-out result of one station.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// Measured minus predicted by all other stations, mm and rad; its readings one below the other.
    pub residual: DVector<f64>,
    /// Inverse of its covariance.
    pub information: DMatrix<f64>,
    /// Squared Mahalanobis distance at weight 1, of all rows together.
    pub distance_squared: f64,
    /// Its evidence on the sizes of the noise.
    pub noise: NoiseEvidence,
}

impl LeftOut {
    /// The robust weight: small for a station far from the prediction of all others.
    pub(super) fn weight(&self, tails: Tails) -> f64 {
        tails.weight(self.distance_squared, self.residual.len() as f64)
    }

    /// The residual of each of its readings, mm and rad.
    pub(super) fn of_readings(&self) -> impl Iterator<Item = DVector<f64>> {
        let readings = self.noise.station.firsts();
        readings.map(|(first, own)| {
            let rows = self.residual.rows(first, own.rows());
            rows.into_owned()
        })
    }
}

/// The residual of each observation as predicted without its station, and its station's weight.
pub(super) fn of_observations(
    left_out: &[LeftOut],
    weights: &[f64],
) -> (Vec<DVector<f64>>, Vec<f64>) {
    let stations = left_out.iter().zip(weights);
    let each = stations.flat_map(|(station, weight)| {
        let readings = station.of_readings();
        readings.map(|residual| (residual, *weight))
    });
    each.unzip()
}

/// Leave-one-out residuals in closed form: `r₋ = K⁻¹ α`, `α = N⁻¹ r`, `K = N⁻¹ − N⁻¹ H N⁻¹`.
pub(super) fn leave_one_out(
    state: &State,
    rows: &[Row],
    prior_mean: &DVector<f64>,
    covariances: &[DMatrix<f64>],
    posterior: &Posterior,
) -> Vec<LeftOut> {
    let mean = posterior.mean() + prior_mean;
    let open = left_open(posterior, covariances);
    let firsts = firsts(rows);
    let chunk = |chunk: usize| {
        let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(rows.len());
        let explained = open.as_ref().map_or_else(
            || explained(&rows[range.clone()], posterior),
            |open| explained_of_few(&covariances[range.clone()], open, firsts[range.start]),
        );
        let stations = range.zip(explained);
        let left_out = stations.map(|(place, explained)| {
            let row = &rows[place];
            let counts = (
                state.weights[place],
                state.tails.information(row.value.len() as f64),
            );
            left_out_of(row, &mean, &covariances[place], &explained, counts)
        });
        left_out.collect::<Vec<_>>()
    };
    (0..rows.len().div_ceil(CHUNK))
        .into_par_iter()
        .flat_map_iter(chunk)
        .collect()
}

/// Covariance of each station's rows that the model explains, mm² and rad².
fn explained(rows: &[Row], posterior: &Posterior) -> Vec<DMatrix<f64>> {
    let half = posterior.half(&stack(rows.iter()));
    let stations = rows.iter().zip(firsts(rows));
    let explained = stations.map(|(row, first)| {
        let own = half.columns(first, row.value.len());
        own.tr_mul(&own)
    });
    explained.collect()
}

/// A square root `OᵀO` of the covariance of all rows that the model leaves open, mm and rad, a column for each row; `None` where the
/// rows were summed.
pub(super) fn left_open(
    posterior: &Posterior,
    covariances: &[DMatrix<f64>],
) -> Option<DMatrix<f64>> {
    let mut open = posterior.open_of_rows()?;
    let mut first = 0;
    for noise in covariances {
        let mut own = open.columns_mut(first, noise.nrows());
        let coloured = &own * noise_factor(noise).transpose();
        own.copy_from(&coloured);
        first += noise.nrows();
    }
    Some(open)
}

/// Covariance of each station's rows that the model explains, mm² and rad²: the noise without what `open` leaves open, whose columns
/// from `first` on are the stations'.
fn explained_of_few(
    covariances: &[DMatrix<f64>],
    open: &DMatrix<f64>,
    mut first: usize,
) -> Vec<DMatrix<f64>> {
    let explained = covariances.iter().map(|noise| {
        let own = open.columns(first, noise.nrows());
        first += noise.nrows();
        noise - own.tr_mul(&own)
    });
    explained.collect()
}

/// The place of each station's first row, all rows one below the other.
pub(super) fn firsts<'r>(rows: impl IntoIterator<Item = &'r Row>) -> Vec<usize> {
    let places = rows.into_iter().scan(0, |next, row| {
        let first = *next;
        *next += row.value.len();
        Some(first)
    });
    places.collect()
}

fn left_out_of(
    row: &Row,
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
            station: row.noise.clone(),
            weight,
            information: share,
        },
        residual,
        information,
        distance_squared,
    }
}

/// The rows of stations, one below the other.
pub(super) fn stack<'r>(rows: impl Iterator<Item = &'r Row> + Clone) -> DMatrix<f64> {
    let count = rows.clone().map(|row| row.value.len()).sum();
    let columns = rows.clone().next().map_or(0, |row| row.rows.ncols());
    let mut stacked = DMatrix::zeros(count, columns);
    for (row, first) in rows.clone().zip(firsts(rows)) {
        stacked
            .rows_mut(first, row.value.len())
            .copy_from(&row.rows);
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
    let joints = rows.first().map_or(0, |row| row.noise.joints.len());
    let angles = stations(problem.observations()).into_iter();
    let angles = angles.map(|own| &problem.observations()[own.start].axes);
    let angles: Vec<&Vec<f64>> = angles.collect();
    let of_joint = |joint: usize| {
        let stations = angles.iter().zip(rows).zip(left_out);
        let stations = stations.map(|((angles, row), left_out)| {
            lines::evidence(
                &row.noise.joints[joint],
                &left_out.residual,
                &left_out.information,
                angles[joint],
            )
        });
        let stations: Vec<_> = stations.collect();
        lines::find(
            joint,
            &stations,
            &layout.lines(joint),
            settings.line_threshold,
            LINES_PER_ROUND,
        )
    };
    // A joint that hardly moves the target has no evidence on its gears.
    let moves = |joint: &usize| {
        let curve = layout.columns(Block::Curve(*joint));
        curve.is_some_and(|own| own.len() > 2 * FEW_HARMONICS * layout.period_turns() as usize)
    };
    (0..joints).filter(moves).flat_map(of_joint).collect()
}
