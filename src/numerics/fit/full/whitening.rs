//! Rows of all stations, whitened by their noise: kept where they are few beside the columns, summed otherwise ([`super::summing`]).

use std::sync::Arc;

use nalgebra::{DMatrix, DMatrixViewMut, DVector};
use rayon::prelude::*;

use super::CHUNK;
use super::partition::Seen;
use super::regression::few_rows::{ByMotion, FewRows, Shapes};
use super::regression::sessions::{Adding, SessionSums};
use super::regression::{Evidence, Sums};
use super::rows::{Around, Coefficients, Row, covariances};
use super::summing::{Summing, Whitened};

pub(super) fn evidence(around: &Around<'_>, prior_mean: &DVector<f64>) -> Evidence {
    let distances = around.problem.distances(&around.state.offsets).count();
    let partition = &around.partition;
    let own = partition.own.iter().map(Vec::len).max();
    // A pool is factored session by session: the columns are those that one session sees.
    let columns = partition.common.len() + own.unwrap_or(0);
    // Then each step on the rows costs less than one on the columns.
    if 2 * (around.row_count() + distances) <= columns {
        return Evidence::Rows(kept(around, prior_mean));
    }
    let sums = summed(around, prior_mean);
    if sums.own.len() > 1 { Evidence::Sessions(sums) } else { Evidence::Sums(sums.common) }
}

pub(super) fn summed(around: &Around<'_>, prior_mean: &DVector<f64>) -> SessionSums {
    let mut sums = SessionSums::zero(&around.partition);
    for (session, stations) in around.batches() {
        let rows = around.rows(&stations);
        add(around, session, &stations, &rows, prior_mean, sums.adding(session));
    }
    for (session, row, value) in distances(around) {
        let expected = prior_mean.select_rows(&around.seen(session).columns);
        let values = DVector::from_element(1, value - row.dot(&expected));
        let row = DMatrix::from_row_slice(1, row.len(), row.as_slice());
        sums.add(session, &Sums::new(&row, &values, 0.0));
    }
    sums.mirror();
    sums
}

/// Adds the rows of some stations of one session to sums, of which then the lower triangles are right.
pub(super) fn add(
    around: &Around<'_>,
    session: usize,
    stations: &[usize],
    rows: &[Row],
    prior_mean: &DVector<f64>,
    sums: Adding<'_>,
) {
    let whitened = whitened(around, session, stations, rows, prior_mean);
    Summing::of(around.seen(session), rows, &whitened).add_to(sums);
}

pub(super) fn whitened(
    around: &Around<'_>,
    session: usize,
    stations: &[usize],
    rows: &[Row],
    prior_mean: &DVector<f64>,
) -> Vec<Whitened> {
    let expected = Coefficients::of(around.seen(session), prior_mean);
    let noise = covariances(around.state, rows, stations);
    let stations = rows.par_iter().zip(&noise).with_min_len(CHUNK);
    stations.map(|(row, noise)| Whitened::of(row, noise, &expected)).collect()
}

impl Whitened {
    /// A station's rows and values, less those expected, times the inverse of its noise's Cholesky factor.
    fn of(row: &Row, noise: &DMatrix<f64>, expected: &Coefficients) -> Self {
        let (inverse, ln_noise) = whitening(noise);
        Self {
            plain: whitened_columns(&inverse, &row.plain),
            joints: &inverse * &row.noise.joints,
            values: inverse * (&row.value - row.times(expected)),
            ln_noise,
        }
    }

    /// Writes its rows of all columns of the model, transposed: a row of the regression in each column of `into`, which is zero.
    pub(super) fn spread(&self, row: &Row, seen: &Seen, into: &mut DMatrixViewMut<'_, f64>) {
        for (own, mut column) in into.column_iter_mut().enumerate() {
            let entries = self.plain.column(own);
            for (&place, entry) in seen.plain.iter().zip(&entries) {
                column[seen.columns[place]] = *entry;
            }
            for (joint, of_joint) in seen.of_joints.iter().enumerate() {
                let motion = self.joints[(own, joint)];
                let entries = of_joint.entries(&row.shapes[joint]);
                entries.for_each(|(place, number)| column[seen.columns[place]] = number * motion);
            }
        }
    }

    /// Adds its rows, from `first` on, to those seen by what moves them; `places` has each column's place among its joint's.
    fn part(&self, row: &Row, seen: &Seen, places: &[usize], first: usize, into: &mut ByMotion) {
        let (station, size) = (into.stations.len(), self.values.len());
        into.stations.push(first..first + size);
        for (joint, own) in into.joints.iter_mut().enumerate() {
            own.motions.rows_mut(first, size).copy_from(&self.joints.column(joint));
            for (place, number) in seen.of_joints[joint].entries(&row.shapes[joint]) {
                own.numbers[(places[seen.columns[place]], station)] = number;
            }
        }
    }
}

/// Rows times the inverse of a factor, transposed.
fn whitened_columns(inverse: &DMatrix<f64>, rows: &DMatrix<f64>) -> DMatrix<f64> {
    let (height, width) = rows.shape();
    if height != 3 {
        return rows.transpose() * inverse.transpose();
    }
    // A station with one place, as nearly all are.
    let (columns, _) = rows.as_slice().as_chunks::<3>();
    let mut whitened = Vec::with_capacity(3 * width);
    for own in 0..3 {
        let [x, y, z] = [0, 1, 2].map(|of| inverse[(own, of)]);
        whitened.extend(columns.iter().map(|[a, b, c]| x * a + y * b + z * c));
    }
    DMatrix::from_vec(width, 3, whitened)
}

/// The inverse of the Cholesky factor of a station's noise, and `ln |N|`.
fn whitening(noise: &DMatrix<f64>) -> (DMatrix<f64>, f64) {
    let factor = noise_factor(noise);
    let ln_noise = 2.0 * factor.diagonal().map(f64::ln).sum();
    let size = factor.nrows();
    let inverse = factor.solve_lower_triangular(&DMatrix::identity(size, size));
    (inverse.expect("a factor has no zero pivot"), ln_noise)
}

pub(super) fn noise_factor(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let factor = covariance.clone().cholesky();
    factor.expect("an instrument's covariance plus repeatability is positive").l()
}

/// Whitened rows of known distances between targets: each one's session, entries of the columns that it sees, and value.
fn distances(around: &Around<'_>) -> Vec<(usize, DVector<f64>, f64)> {
    let (problem, offsets) = (around.problem, &around.state.offsets);
    let row = |distance: crate::fit::problem::DistanceRow| {
        let (unknown, _) = distance.entries[0];
        let session = problem.unknowns[unknown].session().unwrap_or(0);
        let seen = around.seen(session);
        let mut row = DVector::zeros(seen.columns.len());
        for (unknown, by) in distance.entries {
            row[seen.plain[seen.places[unknown]]] = by;
        }
        (session, row, distance.residual)
    };
    problem.distances(offsets).map(row).collect()
}

/// All whitened rows, those of stations, then those of known distances.
pub(super) fn kept(around: &Around<'_>, prior_mean: &DVector<f64>) -> FewRows {
    let size = around.state.layout.size();
    let distances = distances(around);
    let count = around.row_count() + distances.len();
    let mut transposed = DMatrix::zeros(size, count);
    let mut values = DVector::zeros(count);
    let mut columns = by_motion(around, count);
    let mut places = vec![0; size];
    for own in &columns.joints {
        for (place, &column) in own.columns.iter().enumerate() {
            places[column] = place;
        }
    }
    let (mut first, mut ln_noise) = (0, 0.0);
    for (session, stations) in around.batches() {
        let (seen, rows) = (around.seen(session), around.rows(&stations));
        let whitened = whitened(around, session, &stations, &rows, prior_mean);
        for (row, own) in rows.iter().zip(&whitened) {
            let size = own.values.len();
            own.spread(row, seen, &mut transposed.columns_mut(first, size));
            own.part(row, seen, &places, first, &mut columns);
            values.rows_mut(first, size).copy_from(&own.values);
            first += size;
            ln_noise += own.ln_noise;
        }
    }
    for (session, row, value) in distances {
        let mut column = transposed.column_mut(first);
        for (&place, entry) in around.seen(session).columns.iter().zip(&row) {
            column[place] = *entry;
        }
        values[first] = value - column.dot(prior_mean);
        first += 1;
    }
    FewRows { transposed, columns: Arc::new(columns), values, ln_noise }
}

/// The columns of the model by what they move, for `rows` rows, of which none is there yet.
fn by_motion(around: &Around<'_>, rows: usize) -> ByMotion {
    let joints = around.state.repeatability.joints.len();
    let (mut plain, mut of_joints) = (Vec::new(), vec![Vec::new(); joints]);
    for (block, columns) in around.state.layout.blocks() {
        match block.shapes() {
            Some(joint) => of_joints[joint].extend(columns),
            None => plain.extend(columns),
        }
    }
    let shapes = |columns: Vec<usize>| Shapes {
        numbers: DMatrix::zeros(columns.len(), around.count()),
        motions: DVector::zeros(rows),
        columns,
    };
    ByMotion { plain, joints: of_joints.into_iter().map(shapes).collect(), stations: Vec::new() }
}
