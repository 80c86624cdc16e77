//! Rows of all stations, whitened by their noise: kept where they are few beside the columns, summed otherwise.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::regression::few_rows::FewRows;
use super::regression::{Evidence, Sums};
use super::rows::{Row, covariance};
use super::train::{CHUNK, State};
use crate::fit::problem::Problem;

/// Stations that are whitened and summed at once: a whitened row takes as much memory as the row itself, and is needed
/// for its sum alone. Fixed, so that results do not depend on the number of threads.
const SUMMED_AT_ONCE: usize = 512;

/// Whitened rows one below the other: those of stations, then those of known distances.
struct Whitened {
    rows: DMatrix<f64>,
    values: DVector<f64>,
    ln_noise: f64,
}

/// The evidence of all rows on the columns, and the covariance of each station at its weight.
pub(super) fn evidence(
    problem: &Problem<'_>,
    state: &State,
    rows: &[Row],
    prior_mean: &DVector<f64>,
) -> (Evidence, Vec<DMatrix<f64>>) {
    let columns = state.layout.size();
    let distances = distances(problem, state, prior_mean);
    let count = rows.iter().map(|row| row.value.len()).sum::<usize>() + distances.values.len();
    if !FewRows::are_few(count, columns) {
        let (sums, covariances) = summed(state, rows, prior_mean, &distances);
        return (Evidence::Sums(sums), covariances);
    }
    let (mut parts, covariances) = whitened(state, rows, &state.weights, prior_mean);
    parts.push(distances);
    let all = stacked(&parts, columns);
    let few = FewRows {
        transposed: all.rows.transpose(),
        values: all.values,
        ln_noise: all.ln_noise,
    };
    (Evidence::Rows(few), covariances)
}

/// The sums of all rows, and the covariance of each station at its weight.
pub(super) fn sums(
    problem: &Problem<'_>,
    state: &State,
    rows: &[Row],
    prior_mean: &DVector<f64>,
) -> (Sums, Vec<DMatrix<f64>>) {
    let distances = distances(problem, state, prior_mean);
    summed(state, rows, prior_mean, &distances)
}

/// The sums of stations' rows and those of known distances, and the covariance of each station at its weight.
fn summed(
    state: &State,
    rows: &[Row],
    prior_mean: &DVector<f64>,
    distances: &Whitened,
) -> (Sums, Vec<DMatrix<f64>>) {
    let columns = state.layout.size();
    let mut sums = Sums::zero(columns);
    let mut all = Vec::with_capacity(rows.len());
    let batches = rows.chunks(SUMMED_AT_ONCE);
    for (rows, weights) in batches.zip(state.weights.chunks(SUMMED_AT_ONCE)) {
        let (parts, covariances) = whitened(state, rows, weights, prior_mean);
        sums.add(&stacked(&parts, columns).sums());
        all.extend(covariances);
    }
    if !distances.values.is_empty() {
        sums.add(&distances.sums());
    }
    (sums, all)
}

impl Whitened {
    fn sums(&self) -> Sums {
        Sums::new(&self.rows, &self.values, self.ln_noise)
    }
}

/// The whitened rows of stations, and the covariance of each at its weight.
fn whitened(
    state: &State,
    rows: &[Row],
    weights: &[f64],
    prior_mean: &DVector<f64>,
) -> (Vec<Whitened>, Vec<DMatrix<f64>>) {
    let stations = rows.par_iter().zip(weights).with_min_len(CHUNK);
    let whiten = |(row, weight): (&Row, &f64)| {
        let covariance = covariance(state, row, *weight);
        (whiten(row, &covariance, prior_mean), covariance)
    };
    stations.map(whiten).unzip()
}

/// A station's rows and values times the inverse of its noise's Cholesky factor.
fn whiten(row: &Row, covariance: &DMatrix<f64>, prior_mean: &DVector<f64>) -> Whitened {
    let factor = noise_factor(covariance);
    let ln_noise = 2.0 * factor.diagonal().map(f64::ln).sum();
    let size = factor.nrows();
    let inverse = factor
        .solve_lower_triangular(&DMatrix::identity(size, size))
        .expect("a factor has no zero pivot");
    Whitened {
        rows: &inverse * &row.rows,
        values: inverse * (&row.value - &row.rows * prior_mean),
        ln_noise,
    }
}

/// Cholesky factor of a station's noise.
pub(super) fn noise_factor(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    covariance
        .clone()
        .cholesky()
        .expect("an instrument's covariance plus repeatability is positive")
        .l()
}

/// The rows of known distances between targets, which are whitened; the unknowns are the first columns.
fn distances(problem: &Problem<'_>, state: &State, prior_mean: &DVector<f64>) -> Whitened {
    let known: Vec<_> = problem.distances(&state.offsets).collect();
    let mut rows = DMatrix::zeros(known.len(), state.layout.size());
    let mut values = DVector::zeros(known.len());
    for (place, distance) in known.into_iter().enumerate() {
        for (unknown, by) in distance.entries {
            rows[(place, unknown)] = by;
        }
        values[place] = distance.residual;
    }
    Whitened {
        values: values - &rows * prior_mean,
        rows,
        ln_noise: 0.0,
    }
}

/// Whitened rows one below the other.
fn stacked(parts: &[Whitened], columns: usize) -> Whitened {
    let count = parts.iter().map(|part| part.values.len()).sum();
    let mut rows = DMatrix::zeros(count, columns);
    let mut values = DVector::zeros(count);
    let (mut first, mut ln_noise) = (0, 0.0);
    for part in parts {
        let size = part.values.len();
        rows.rows_mut(first, size).copy_from(&part.rows);
        values.rows_mut(first, size).copy_from(&part.values);
        first += size;
        ln_noise += part.ln_noise;
    }
    Whitened {
        rows,
        values,
        ln_noise,
    }
}
