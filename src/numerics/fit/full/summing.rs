//! Sums over whitened stations.
//!
//! Sums of the shapes of two joints j and l are `Σ_i (J_jᵀ N⁻¹ J_l)_i φ_j(i) φ_l(i)ᵀ`: one number a station weighs a product of two lists,
//! however many rows the station has ([`super::partition::Seen`]).

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::CHUNK;
use super::partition::Seen;
use super::regression::sessions::Adding;
use super::rows::Row;
use crate::linalg::{gram_of_columns, turned};

pub(super) struct Summing<'s> {
    seen: &'s Seen,
    stations: &'s [Whitened],
    /// The numbers of each joint's shapes: a column for each station.
    shapes: Vec<DMatrix<f64>>,
    /// The products of the motions of two joints: a row for each station, a column for each [pair](pairs).
    weights: DMatrix<f64>,
}

/// The pairs of joints, each once, the first the larger.
pub(super) fn pairs(joints: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..joints).flat_map(|j| (0..=j).map(move |l| (j, l)))
}

impl<'s> Summing<'s> {
    /// Stations with these rows, which are the same ones whitened.
    pub fn of(seen: &'s Seen, rows: &[Row], stations: &'s [Whitened]) -> Self {
        let shapes = Row::shapes_of(rows, seen);
        let joints = shapes.len();
        let mut weights = DMatrix::zeros(stations.len(), pairs(joints).count());
        for (own, mut row) in stations.iter().zip(weights.row_iter_mut()) {
            for (weight, (j, l)) in row.iter_mut().zip(pairs(joints)) {
                *weight = own.joints.column(j).dot(&own.joints.column(l));
            }
        }
        Self { seen, stations, shapes, weights }
    }

    /// Adds the sums, of which the lower triangles are right.
    pub fn add_to(&self, mut sums: Adding<'_>) {
        let of_joints = &self.seen.of_joints;
        let joints = of_joints.len();
        let pairs: Vec<_> = pairs(joints).collect();
        let blocks = pairs.par_iter().enumerate().map(|(pair, &(j, l))| self.of_joints(pair, j, l));
        for (&(j, l), block) in pairs.iter().zip(blocks.collect::<Vec<_>>()) {
            sums.block(&of_joints[j].runs, &of_joints[l].runs, &block);
        }
        let (plain, along) = (&self.seen.plain_runs, self.along());
        let parts = (0..joints).into_par_iter().map(|joint| self.of_joint(joint, &along));
        let parts: Vec<_> = parts.collect();
        for (own, (with_plain, moment)) in of_joints.iter().zip(parts) {
            sums.block(plain, &own.runs, &with_plain);
            sums.values(&own.runs, &moment);
        }
        let rows = self.stations.iter().map(|own| own.plain.as_slice());
        let values = self.stations.iter().map(|own| own.values.as_slice());
        let values = DVector::from_vec(values.collect::<Vec<_>>().concat());
        let width = self.seen.plain.len();
        let rows = DMatrix::from_vec(width, values.len(), rows.collect::<Vec<_>>().concat());
        sums.block(plain, plain, &gram_of_columns(&rows));
        sums.values(plain, &(rows * &values));
        let ln_noise = self.stations.iter().map(|own| own.ln_noise).sum();
        sums.squares(values.norm_squared(), ln_noise);
    }

    fn of_joints(&self, pair: usize, j: usize, l: usize) -> DMatrix<f64> {
        let stations = self.stations.len();
        let weights = &self.weights.as_slice()[pair * stations..][..stations];
        let mut weighed = self.shapes[l].clone();
        for (mut own, weight) in weighed.column_iter_mut().zip(weights) {
            own *= *weight;
        }
        &self.shapes[j] * turned(&weighed)
    }

    /// The motion of each station's rows by each joint along the plain columns: the columns of a station's joints beside each other.
    fn along(&self) -> DMatrix<f64> {
        let (width, joints) = (self.seen.plain.len(), self.shapes.len());
        let mut along = DMatrix::zeros(width, joints * self.stations.len());
        let of_stations = along.as_mut_slice().par_chunks_exact_mut((width * joints).max(1));
        let stations = self.stations.par_iter().zip(of_stations);
        stations.with_min_len(CHUNK).for_each(|(own, into)| own.add_along(into));
        along
    }

    /// The sums of the plain columns with a joint's shapes, and the moment of the shapes.
    fn of_joint(&self, joint: usize, along: &DMatrix<f64>) -> (DMatrix<f64>, DVector<f64>) {
        let (stations, joints) = (self.stations.len(), self.shapes.len());
        let along = along.columns_with_step(joint, stations, joints - 1);
        let pulls = self.stations.iter().map(|own| own.joints.column(joint).dot(&own.values));
        let pulls = DVector::from_iterator(stations, pulls);
        (along * turned(&self.shapes[joint]), &self.shapes[joint] * pulls)
    }
}

/// The whitened rows of one station, as [`Row`] has them.
pub(super) struct Whitened {
    /// Rows of the plain columns, transposed: a row of the regression in each column.
    pub plain: DMatrix<f64>,
    pub joints: DMatrix<f64>,
    pub values: DVector<f64>,
    /// `ln |N|` of the station's noise.
    pub ln_noise: f64,
}

impl Whitened {
    /// Adds the motions of the rows by each joint along the plain columns, which are those of `into` for one joint after the other.
    pub fn add_along(&self, into: &mut [f64]) {
        let width = self.plain.nrows();
        for (into, motion) in into.chunks_exact_mut(width.max(1)).zip(self.joints.column_iter()) {
            for (row, by) in self.plain.as_slice().chunks_exact(width).zip(&motion) {
                into.iter_mut().zip(row).for_each(|(entry, own)| *entry += by * own);
            }
        }
    }
}
