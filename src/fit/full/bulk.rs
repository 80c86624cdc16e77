//! Predictions with their covariance in bulk: what the posterior says of the joint curves, tabulated.
//!
//! A covariance is `R C Rᵀ`, R the three rows of a pose. A curve's columns enter R through one angle alone, so their share
//! is, for each pair of joints, a smooth function of two angles, and with all other columns one of one angle:
//! 1. once for a model: C; for each joint `C_other,curve φ(q)`; for each pair of joints `φ(q)ᵀ C φ(q')`, on a lattice of
//!    eight entries for the finest harmonic;
//! 2. for each pose: its few other columns, and cubic interpolation in the tables.
//!
//! The tables cost a second or less and tens of megabytes; from some thousands of poses on they pay.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, Matrix3, Point3, Vector3};
use rayon::prelude::*;

use super::layout::Block;
use super::{FullModel, Query};
use crate::linalg::gram;

/// Lattice entries for each harmonic. The variance of a pose has twice the harmonics: four times as many entries.
const ENTRIES_PER_HARMONIC: usize = 8;
/// Poses whose other columns are multiplied at once; fixed, so that results do not depend on the number of threads.
const AT_ONCE: usize = 64;

/// A predicted point in the tracker's frame of the query's session.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// mm.
    pub position: Point3<f64>,
    /// What the model leaves open, where joints stand against their command included, mm².
    pub covariance: Matrix3<f64>,
}

/// A model with tables of its posterior, for queries of one session, or of any.
#[derive(Debug)]
pub struct Bulk<'m> {
    model: &'m FullModel,
    session: Option<usize>,
    /// Where each column of the model stands among the other columns.
    places: Vec<Option<usize>>,
    others: DMatrix<f64>,
    joints: Vec<Joint>,
    /// For joints i < j, row-wise: covariance of their curves, angle of i down, angle of j across.
    pairs: Vec<DMatrix<f64>>,
    period: f64,
}

/// What the posterior says of one joint's curve.
#[derive(Debug)]
struct Joint {
    /// Covariance of the other columns with the curve, an angle a column.
    beside: DMatrix<f64>,
    /// Variance of the curve.
    variance: Vec<f64>,
}

/// One pose on its way to an estimate.
struct Pose {
    position: Point3<f64>,
    approach: Matrix3<f64>,
    /// How the point moves with each joint, mm/rad.
    joints: Vec<Vector3<f64>>,
}

impl FullModel {
    /// Tables for queries of one session (`own` true in the query) or of none.
    pub fn bulk(&self, session: Option<usize>) -> Bulk<'_> {
        Bulk::new(self, session)
    }
}

impl<'m> Bulk<'m> {
    fn new(model: &'m FullModel, session: Option<usize>) -> Self {
        let layout = &model.layout;
        let mut places = vec![None; layout.size()];
        let mut other_columns = Vec::new();
        for (block, columns) in layout
            .blocks()
            .filter(|(block, _)| applies(*block, session))
        {
            if !matches!(block, Block::Curve(_)) {
                for column in columns {
                    places[column] = Some(other_columns.len());
                    other_columns.push(column);
                }
            }
        }
        let covariance = covariance(model);
        let curves: Vec<Curve<'_>> = (0..)
            .map_while(|joint| layout.columns(Block::Curve(joint)))
            .map(|columns| Curve {
                covariance: &covariance,
                first: columns.start,
                harmonics: columns.len() / 2,
            })
            .collect();
        let pairs: Vec<(usize, usize)> = (0..curves.len())
            .flat_map(|i| (i + 1..curves.len()).map(move |j| (i, j)))
            .collect();
        Self {
            model,
            session,
            others: covariance
                .select_rows(&other_columns)
                .select_columns(&other_columns),
            joints: curves
                .par_iter()
                .map(|curve| curve.table(&other_columns))
                .collect(),
            pairs: pairs
                .par_iter()
                .map(|&(i, j)| curves[i].with(&curves[j]))
                .collect(),
            places,
            period: TAU * f64::from(layout.period_turns()),
        }
    }

    /// Point and covariance of every query, on all cores.
    ///
    /// # Panics
    /// When a query is of another session than the tables are for.
    pub fn estimates(&self, queries: &[Query<'_>]) -> Vec<Estimate> {
        queries
            .par_chunks(AT_ONCE)
            .flat_map_iter(|queries| self.chunk(queries))
            .collect()
    }

    fn chunk(&self, queries: &[Query<'_>]) -> Vec<Estimate> {
        let mut rows = DMatrix::zeros(self.others.nrows(), 3 * queries.len());
        let poses: Vec<Pose> = queries
            .iter()
            .enumerate()
            .map(|(place, query)| self.pose(query, &mut rows.columns_mut(3 * place, 3)))
            .collect();
        let carried = &self.others * &rows;
        let estimate = |((place, pose), query): ((usize, &Pose), &Query<'_>)| {
            let own = rows.columns(3 * place, 3);
            let among = fixed(&own.tr_mul(&carried.columns(3 * place, 3)));
            let (beside, curves) = self.curves(query.axes, &pose.joints, &own);
            Estimate {
                position: pose.position,
                covariance: among + beside + beside.transpose() + curves + pose.approach,
            }
        };
        poses
            .iter()
            .enumerate()
            .zip(queries)
            .map(estimate)
            .collect()
    }

    /// A pose without its covariance; its other columns go into `rows`.
    fn pose(&self, query: &Query<'_>, rows: &mut DMatrixViewMut<'_, f64>) -> Pose {
        let session = query.own.then_some(query.session);
        assert_eq!(session, self.session, "the tables are of one session");
        let model = self.model;
        let target = model.viewed(query);
        let pose = model.pose(query, &target);
        pose.other_columns(&model.layout, &mut |column, twist, amount| {
            let other = self.places[column].expect("a column of this session");
            for axis in 0..3 {
                rows[(other, axis)] += twist.linear[axis] * amount;
            }
        });
        let (position, approach) = model.attained(query, &pose);
        Pose {
            position,
            approach,
            joints: target.joints.iter().map(|twist| twist.linear).collect(),
        }
    }

    /// Share of the curves with the other columns (one side of it) and among themselves, mm².
    fn curves(
        &self,
        angles: &[f64],
        twists: &[Vector3<f64>],
        rows: &DMatrixView<'_, f64>,
    ) -> (Matrix3<f64>, Matrix3<f64>) {
        let mut beside = Matrix3::zeros();
        let mut among = Matrix3::zeros();
        let share = |joint: usize| angles[joint] / self.period;
        for (i, (joint, twist)) in self.joints.iter().zip(twists).enumerate() {
            let place = Place::of(share(i), joint.beside.ncols());
            let mut with_others = Vector3::zeros();
            for (column, weight) in place.entries() {
                with_others +=
                    rows.tr_mul(&joint.beside.column(column)).fixed_rows::<3>(0) * weight;
            }
            beside += with_others * twist.transpose();
            let variance = Place::of(share(i), joint.variance.len());
            let variance: f64 = variance
                .entries()
                .map(|(at, weight)| joint.variance[at] * weight)
                .sum();
            among += twist * twist.transpose() * variance;
        }
        let joints = self.joints.len();
        let pairs = (0..joints).flat_map(|i| (i + 1..joints).map(move |j| (i, j)));
        for ((i, j), table) in pairs.zip(&self.pairs) {
            let (down, across) = (
                Place::of(share(i), table.nrows()),
                Place::of(share(j), table.ncols()),
            );
            let covariance: f64 = across
                .entries()
                .map(|(column, weight)| {
                    let entries = table.column(column);
                    weight
                        * down
                            .entries()
                            .map(|(row, weight)| entries[row] * weight)
                            .sum::<f64>()
                })
                .sum();
            let cross = twists[i] * twists[j].transpose() * covariance;
            among += cross + cross.transpose();
        }
        (beside, among)
    }
}

fn fixed(matrix: &DMatrix<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| matrix[(row, column)])
}

/// Whether a block's columns move the target in queries of `session`.
fn applies(block: Block, session: Option<usize>) -> bool {
    match block {
        Block::SessionCommandWeight(own)
        | Block::OwnCommandWeight(own)
        | Block::Drift(own)
        | Block::Scale(own)
        | Block::SessionCurve { session: own, .. } => Some(own) == session,
        Block::Unknowns
        | Block::Gravity
        | Block::CommandWeight
        | Block::ApproachOffset
        | Block::WarmUp
        | Block::Curve(_)
        | Block::Line { .. } => true,
    }
}

/// The posterior covariance of all columns: `√v L⁻ᵀ L⁻¹ √v`.
pub(super) fn covariance(model: &FullModel) -> DMatrix<f64> {
    let mut half = model.posterior.factor.inverse_lower();
    for (mut column, scale) in half.column_iter_mut().zip(&model.posterior.scale) {
        column *= *scale;
    }
    gram(&half.as_view())
}

/// The columns of one joint's curve in the covariance of all.
struct Curve<'c> {
    covariance: &'c DMatrix<f64>,
    first: usize,
    harmonics: usize,
}

impl Curve<'_> {
    /// `cos kq, sin kq` at `entries` angles of a period, an angle a column.
    fn basis(&self, entries: usize) -> DMatrix<f64> {
        DMatrix::from_fn(2 * self.harmonics, entries, |row, entry| {
            let harmonic = row / 2 + 1;
            // A whole number of entries: the angle stays exact however high the harmonic.
            let angle = TAU * ((harmonic * entry) % entries) as f64 / entries as f64;
            if row % 2 == 0 {
                angle.cos()
            } else {
                angle.sin()
            }
        })
    }

    const fn entries(&self) -> usize {
        let entries = ENTRIES_PER_HARMONIC * self.harmonics;
        if entries < 4 { 4 } else { entries }
    }

    fn table(&self, other_columns: &[usize]) -> Joint {
        let size = 2 * self.harmonics;
        let beside = self
            .covariance
            .columns(self.first, size)
            .select_rows(other_columns);
        let basis = self.basis(4 * self.entries());
        let own = self.covariance.view((self.first, self.first), (size, size));
        let carried = own * &basis;
        let variance = basis.column_iter().zip(carried.column_iter());
        Joint {
            beside: beside * self.basis(self.entries()),
            variance: variance
                .map(|(basis, carried)| basis.dot(&carried))
                .collect(),
        }
    }

    fn with(&self, other: &Self) -> DMatrix<f64> {
        let size = (2 * self.harmonics, 2 * other.harmonics);
        let between = self.covariance.view((self.first, other.first), size);
        self.basis(self.entries())
            .tr_mul(&(between * other.basis(other.entries())))
    }
}

/// Four neighbouring entries of a periodic lattice and what each counts for in the cubic through them.
struct Place {
    first: usize,
    entries: usize,
    weights: [f64; 4],
}

impl Place {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a place of the lattice"
    )]
    fn of(share: f64, entries: usize) -> Self {
        let place = share.rem_euclid(1.0) * entries as f64;
        let t = place - place.floor();
        Self {
            first: (place as usize + entries - 1) % entries,
            entries,
            weights: [
                -t * (t - 1.0) * (t - 2.0) / 6.0,
                (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
                -(t + 1.0) * t * (t - 2.0) / 2.0,
                (t + 1.0) * t * (t - 1.0) / 6.0,
            ],
        }
    }

    fn entries(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let at = |(step, weight): (usize, &f64)| ((self.first + step) % self.entries, *weight);
        self.weights.iter().enumerate().map(at)
    }
}
