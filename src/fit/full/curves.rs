//! The posterior of single joints and single columns: error curves with their standard deviation, covariances.

use nalgebra::{DMatrix, DVector};

use super::FullModel;
use super::layout::Block;
use crate::linalg::gram;

/// The error of one joint at one angle; in mm throughout where the joint slides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointError {
    /// Axis variable, rad.
    pub angle: f64,
    /// The smooth curve, rad.
    pub curve: f64,
    /// The gear lines, rad.
    pub gear_lines: f64,
    /// Standard deviation of both together, rad.
    pub sd: f64,
}

impl JointError {
    /// Smooth curve and gear lines together, rad.
    pub fn error(&self) -> f64 {
        self.curve + self.gear_lines
    }
}

impl FullModel {
    /// After how many turns of a joint that turns its error curve repeats.
    pub const fn curve_period_turns(&self) -> u32 {
        self.layout.period_turns()
    }

    /// The error curve of `joint` (from 0), common to all sessions, at `angles` (axis variable, rad; mm where
    /// the joint slides).
    ///
    /// It excludes the joint's constant offset, which is the geometry's θ.
    pub fn joint_errors(&self, joint: usize, angles: &[f64]) -> Vec<JointError> {
        let curve = self.curve_rows(joint, angles);
        let mut lines = DMatrix::zeros(angles.len(), self.layout.size());
        for (block, columns) in self.layout.blocks() {
            match block {
                Block::Line { joint: own, cycles } if own == joint => {
                    fill(&mut lines, columns.start, angles, cycles);
                }
                _ => {}
            }
        }
        let (smooth, sines) = (&curve * &self.mean, &lines * &self.mean);
        let variances = self.variances(&(curve + lines));
        let error = |(place, &angle): (usize, &f64)| JointError {
            angle,
            curve: smooth[place],
            gear_lines: sines[place],
            sd: variances[place].sqrt(),
        };
        angles.iter().enumerate().map(error).collect()
    }

    /// The smooth error curve of `joint` (from 0) at `angles` (axis variable, rad; mm where the joint slides) per unit of every
    /// column: a row for each angle, zero without a curve.
    pub fn curve_rows(&self, joint: usize, angles: &[f64]) -> DMatrix<f64> {
        let mut rows = DMatrix::zeros(angles.len(), self.layout.size());
        let unit = self.layout.curve_unit(joint);
        let columns = self.layout.columns(Block::Curve(joint)).unwrap_or(0..0);
        for pair in 0..columns.len() / 2 {
            let first = columns.start + 2 * pair;
            fill(&mut rows, first, angles, (pair + 1) as f64 / unit);
        }
        rows
    }

    /// Posterior covariance of combinations of columns, a row each.
    pub fn covariance_of_rows(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        gram(&self.posterior.half(rows).as_view())
    }

    /// Prior covariance of combinations of columns, a row each.
    pub fn prior_covariance_of_rows(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        gram(&self.posterior.prior_half(rows).as_view())
    }

    /// Posterior means of combinations of columns, a row each; of an unknown, without the offset where its column is evaluated.
    pub fn means_of_rows(&self, rows: &DMatrix<f64>) -> DVector<f64> {
        rows * &self.mean
    }

    /// Posterior covariance of the columns at `places`.
    pub fn covariance_of(&self, places: &[usize]) -> DMatrix<f64> {
        self.posterior.covariance_of(places)
    }

    /// Posterior mean of the column at `place`; for an unknown, its whole offset.
    pub fn column_mean(&self, place: usize) -> f64 {
        let unknowns = self
            .layout
            .columns(Block::Unknowns)
            .filter(|own| own.contains(&place));
        unknowns.map_or(0.0, |own| self.offsets[place - own.start]) + self.mean[place]
    }

    /// Prior standard deviation of every column, found by the session's own likelihood.
    pub const fn prior_sd(&self) -> &DVector<f64> {
        &self.posterior.scale
    }

    fn variances(&self, rows: &DMatrix<f64>) -> Vec<f64> {
        let half = self.posterior.half(rows);
        half.column_iter()
            .map(|column| column.norm_squared())
            .collect()
    }
}

/// Fills the columns `first` and `first + 1` with `cos` and `sin` of `cycles` per turn.
fn fill(rows: &mut DMatrix<f64>, first: usize, angles: &[f64], cycles: f64) {
    for (row, angle) in angles.iter().enumerate() {
        let (sin, cos) = (cycles * angle).sin_cos();
        rows[(row, first)] = cos;
        rows[(row, first + 1)] = sin;
    }
}
