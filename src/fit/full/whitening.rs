//! Rows of all stations, whitened by their noise: kept where they are few beside the columns, summed otherwise.
//!
//! Sums of the shapes of two joints j and l are `Σ_i (J_jᵀ N⁻¹ J_l)_i φ_j(i) φ_l(i)ᵀ`: one number a station weighs a product of two lists,
//! however many rows the station has ([`super::partition::Seen`]).

use std::sync::Arc;

use nalgebra::{DMatrix, DMatrixViewMut, DVector};
use rayon::prelude::*;

use super::partition::Seen;
use super::regression::few_rows::{ByMotion, FewRows, Shapes};
use super::regression::sessions::SessionSums;
use super::regression::{Evidence, Sums};
use super::rows::{Around, Coefficients, Row, covariances};
use super::train::CHUNK;
use crate::linalg::{gram, stacked, transposed};

/// The evidence of all rows on the columns, on top of what was carried over; `None` where rounding made a matrix of that indefinite.
pub(super) fn evidence(around: &Around<'_>, prior_mean: &DVector<f64>) -> Option<Evidence> {
    if around.state.carries {
        let mut own = sums(around, prior_mean);
        if let Some(before) = &around.state.before {
            own.add(&before.sums(around, prior_mean)?, 1.0);
        }
        return Some(Evidence::Sums(own));
    }
    Some(of_rows(around, prior_mean))
}

/// The evidence of all rows on the columns.
fn of_rows(around: &Around<'_>, prior_mean: &DVector<f64>) -> Evidence {
    let distances = around.problem.distances(&around.state.offsets).count();
    let partition = &around.partition;
    let own = partition.own.iter().map(Vec::len).max();
    // A pool is factored session by session: the columns are those that one session sees.
    let columns = partition.common.len() + own.unwrap_or(0);
    if FewRows::are_few(around.row_count() + distances, columns) {
        return Evidence::Rows(kept(around, prior_mean));
    }
    let sums = summed(around, prior_mean);
    if sums.own.len() > 1 {
        Evidence::Sessions(sums)
    } else {
        Evidence::Sums(sums.common)
    }
}

/// The sums of the rows of one session, whose columns are all shared.
pub(super) fn sums(around: &Around<'_>, prior_mean: &DVector<f64>) -> Sums {
    summed(around, prior_mean).common
}

/// The sums of all stations' rows and of known distances.
fn summed(around: &Around<'_>, prior_mean: &DVector<f64>) -> SessionSums {
    let mut sums = SessionSums::zero(&around.partition);
    for (session, stations) in around.batches() {
        let rows = around.rows(&stations);
        let own = sums_of(around, (session, &stations), &rows, prior_mean);
        sums.add(session, &own, 1.0);
    }
    for (session, row, value) in distances(around) {
        let seen = around.seen(session);
        let expected = prior_mean.select_rows(&seen.columns);
        let values = DVector::from_element(1, value - row.dot(&expected));
        let row = DMatrix::from_row_slice(1, row.len(), row.as_slice());
        sums.add(session, &Sums::new(&row, &values, 0.0), 1.0);
    }
    sums
}

/// The sums of the rows of some stations of one session, over the columns that the session sees.
pub(super) fn sums_of(
    around: &Around<'_>,
    (session, stations): (usize, &[usize]),
    rows: &[Row],
    prior_mean: &DVector<f64>,
) -> Sums {
    let whitened = whitened(around, (session, stations), rows, prior_mean);
    Summing::of(around.seen(session), rows, &whitened).sums()
}

/// The rows of some stations of one session, whitened.
fn whitened(
    around: &Around<'_>,
    (session, stations): (usize, &[usize]),
    rows: &[Row],
    prior_mean: &DVector<f64>,
) -> Vec<Whitened> {
    let expected = Coefficients::of(around.seen(session), prior_mean);
    let noise = covariances(around.state, rows, stations);
    let stations = rows.par_iter().zip(&noise).with_min_len(CHUNK);
    let whitened = stations.map(|(row, noise)| Whitened::of(row, noise, &expected));
    whitened.collect()
}

/// The whitened rows of one station, as [`Row`] has them.
struct Whitened {
    /// Rows of the plain columns.
    plain: DMatrix<f64>,
    /// The motion of the rows by each joint.
    joints: DMatrix<f64>,
    values: DVector<f64>,
    ln_noise: f64,
}

impl Whitened {
    /// A station's rows and values, less those expected, times the inverse of its noise's Cholesky factor.
    fn of(row: &Row, noise: &DMatrix<f64>, expected: &Coefficients) -> Self {
        let (inverse, ln_noise) = whitening(noise);
        Self {
            plain: &inverse * &row.plain,
            joints: &inverse * &row.noise.joints,
            values: inverse * (&row.value - row.times(expected)),
            ln_noise,
        }
    }

    /// Writes its rows of all columns of the model, transposed: a row of the regression in each column of `into`, which is zero.
    fn spread(&self, row: &Row, seen: &Seen, into: &mut DMatrixViewMut<'_, f64>) {
        for (own, mut column) in into.column_iter_mut().enumerate() {
            let entries = self.plain.row(own);
            for (&place, entry) in seen.plain.iter().zip(&entries) {
                column[seen.columns[place]] = *entry;
            }
            for (joint, places) in seen.of_joints.iter().enumerate() {
                let motion = self.joints[(own, joint)];
                for (&place, shape) in places.iter().zip(&row.shapes[joint]) {
                    column[seen.columns[place]] = shape * motion;
                }
            }
        }
    }

    /// Adds its rows, which begin at `first`, to those that are seen by what moves them; `places` has the place of each column among
    /// its joint's.
    fn part(
        &self,
        row: &Row,
        seen: &Seen,
        places: &[usize],
        (first, into): (usize, &mut ByMotion),
    ) {
        let (station, size) = (into.stations.len(), self.values.len());
        into.stations.push(first..first + size);
        for (joint, own) in into.joints.iter_mut().enumerate() {
            let motions = self.joints.column(joint);
            own.motions.rows_mut(first, size).copy_from(&motions);
            for (&place, number) in seen.of_joints[joint].iter().zip(&row.shapes[joint]) {
                own.numbers[(places[seen.columns[place]], station)] = *number;
            }
        }
    }
}

/// The inverse of the Cholesky factor of a station's noise, and `ln |N|`.
fn whitening(noise: &DMatrix<f64>) -> (DMatrix<f64>, f64) {
    let factor = noise_factor(noise);
    let ln_noise = 2.0 * factor.diagonal().map(f64::ln).sum();
    let size = factor.nrows();
    let inverse = factor
        .solve_lower_triangular(&DMatrix::identity(size, size))
        .expect("a factor has no zero pivot");
    (inverse, ln_noise)
}

/// Cholesky factor of a station's noise.
pub(super) fn noise_factor(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    covariance
        .clone()
        .cholesky()
        .expect("an instrument's covariance plus repeatability is positive")
        .l()
}

/// The whitened stations of one session that are summed.
struct Summing<'s> {
    seen: &'s Seen,
    stations: &'s [Whitened],
    /// The numbers of each joint's shapes: a column for each station.
    shapes: Vec<DMatrix<f64>>,
    /// `shapes` transposed: a row for each station.
    by_station: Vec<DMatrix<f64>>,
    /// The products of the motions of two joints: a row for each station, a column for each [pair](pairs).
    weights: DMatrix<f64>,
}

/// The pairs of joints, each once.
pub(super) fn pairs(joints: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..joints).flat_map(move |j| (j..joints).map(move |l| (j, l)))
}

impl<'s> Summing<'s> {
    fn of(seen: &'s Seen, rows: &[Row], stations: &'s [Whitened]) -> Self {
        let shapes = Row::shapes_of(rows, seen);
        let joints = shapes.len();
        let mut weights = DMatrix::zeros(stations.len(), pairs(joints).count());
        for (own, mut row) in stations.iter().zip(weights.row_iter_mut()) {
            for (weight, (j, l)) in row.iter_mut().zip(pairs(joints)) {
                *weight = own.joints.column(j).dot(&own.joints.column(l));
            }
        }
        let by_station = shapes.par_iter().map(|own| transposed(&own.as_view()));
        Self {
            by_station: by_station.collect(),
            seen,
            stations,
            shapes,
            weights,
        }
    }

    fn sums(&self) -> Sums {
        let mut sums = Sums::zero(self.seen.columns.len());
        let of_joints = &self.seen.of_joints;
        let joints = of_joints.len();
        let pairs: Vec<_> = pairs(joints).collect();
        let numbered = pairs.par_iter().enumerate();
        let blocks = numbered.map(|(pair, &(j, l))| self.of_joints(pair, j, l));
        for (&(j, l), block) in pairs.iter().zip(blocks.collect::<Vec<_>>()) {
            put(
                &mut sums.information,
                (&of_joints[j], &of_joints[l]),
                &block,
            );
        }
        let parts = (0..joints)
            .into_par_iter()
            .map(|joint| self.of_joint(joint));
        let parts: Vec<_> = parts.collect();
        for (joint, (with_plain, moment)) in parts.into_iter().enumerate() {
            let (plain, own) = (&self.seen.plain, &of_joints[joint]);
            put(&mut sums.information, (plain, own), &with_plain);
            put_values(&mut sums.moment, own, &moment);
        }
        self.add_plain(&mut sums);
        sums.ln_noise = self.stations.iter().map(|own| own.ln_noise).sum();
        sums
    }

    /// The sums of the shapes of two joints, a pair.
    fn of_joints(&self, pair: usize, j: usize, l: usize) -> DMatrix<f64> {
        let weights = self.weights.column(pair);
        let (stations, shapes) = self.by_station[l].shape();
        let mut weighed = Vec::with_capacity(stations * shapes);
        for column in self.by_station[l].column_iter() {
            let entries = column.iter().zip(weights.iter());
            weighed.extend(entries.map(|(own, weight)| own * weight));
        }
        &self.shapes[j] * DMatrix::from_vec(stations, shapes, weighed)
    }

    /// The sums of the plain columns with a joint's shapes, and the moment of the shapes.
    fn of_joint(&self, joint: usize) -> (DMatrix<f64>, DVector<f64>) {
        let mut along = DMatrix::zeros(self.seen.plain.len(), self.stations.len());
        for (mut column, own) in along.column_iter_mut().zip(self.stations) {
            column.gemv_tr(1.0, &own.plain, &own.joints.column(joint), 0.0);
        }
        let pulls = self.numbers(|own| own.joints.column(joint).dot(&own.values));
        (along * &self.by_station[joint], &self.shapes[joint] * pulls)
    }

    fn add_plain(&self, sums: &mut Sums) {
        let plain = &self.seen.plain;
        let rows = stacked(self.stations.iter().map(|own| &own.plain), plain.len());
        let values = self.stations.iter().flat_map(|own| own.values.iter());
        let values = DVector::from_iterator(rows.nrows(), values.copied());
        put(
            &mut sums.information,
            (plain, plain),
            &gram(&rows.as_view()),
        );
        put_values(&mut sums.moment, plain, &rows.tr_mul(&values));
        sums.square = values.norm_squared();
    }

    /// One number of each station.
    fn numbers(&self, of: impl Fn(&Whitened) -> f64) -> DVector<f64> {
        DVector::from_iterator(self.stations.len(), self.stations.iter().map(of))
    }
}

/// Writes a block and its transpose.
fn put(all: &mut DMatrix<f64>, (rows, columns): (&[usize], &[usize]), block: &DMatrix<f64>) {
    put_one(all, (rows, columns), block);
    if rows != columns {
        put_one(all, (columns, rows), &transposed(&block.as_view()));
    }
}

fn put_one(all: &mut DMatrix<f64>, (rows, columns): (&[usize], &[usize]), block: &DMatrix<f64>) {
    // Nearly all places follow each other.
    let runs = rows.chunk_by(|own, next| own + 1 == *next);
    let runs: Vec<(usize, usize)> = runs.map(|run| (run[0], run.len())).collect();
    for (own, &into) in block.column_iter().zip(columns) {
        let mut column = all.column_mut(into);
        let mut first = 0;
        for &(place, count) in &runs {
            let mut own_run = column.rows_mut(place, count);
            own_run.copy_from(&own.rows(first, count));
            first += count;
        }
    }
}

fn put_values(all: &mut DVector<f64>, places: &[usize], values: &DVector<f64>) {
    for (&place, value) in places.iter().zip(values) {
        all[place] = *value;
    }
}

/// The rows of known distances between targets, which are whitened: each one's session, entries of the columns that the session
/// sees, and value.
fn distances(around: &Around<'_>) -> Vec<(usize, DVector<f64>, f64)> {
    let (problem, offsets) = (around.problem, &around.state.offsets);
    let row = |distance: crate::fit::problem::DistanceRow| {
        let (unknown, _) = distance.entries[0];
        let session = problem.unknowns()[unknown].session().unwrap_or(0);
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
fn kept(around: &Around<'_>, prior_mean: &DVector<f64>) -> FewRows {
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
        let whitened = whitened(around, (session, &stations), &rows, prior_mean);
        for (row, own) in rows.iter().zip(&whitened) {
            let size = own.values.len();
            own.spread(row, seen, &mut transposed.columns_mut(first, size));
            own.part(row, seen, &places, (first, &mut columns));
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
    FewRows {
        transposed,
        columns: Arc::new(columns),
        values,
        ln_noise,
    }
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
    ByMotion {
        plain,
        joints: of_joints.into_iter().map(shapes).collect(),
        stations: Vec::new(),
    }
}
