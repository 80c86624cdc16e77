//! The posterior of single joints and single columns: error curves with their standard deviation, covariances.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::FullModel;
use super::layout::Block;
use crate::linalg::gram;

/// The error of one joint at one angle; in mm throughout where the joint slides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointError {
    pub angle: f64,
    pub curve: f64,
    pub gear_lines: f64,
    /// Standard deviation of both together, rad.
    pub sd: f64,
}

#[derive(Debug, Clone)]
pub struct JointCurves {
    pairs: Vec<Pair>,
    /// Mean of the columns of all pairs, rad, or mm where the joint slides.
    mean: DVector<f64>,
    /// A square root `HᵀH` of their covariance, a column for each.
    half: DMatrix<f64>,
}

/// Cosine and sine of one joint at one number of cycles: two columns of the model.
#[derive(Debug, Clone, Copy)]
struct Pair {
    joint: usize,
    /// Whether it is a gear line, and no part of the smooth curve.
    is_line: bool,
    /// The column of the cosine; that of the sine follows.
    column: usize,
    /// Cycles per turn; 2π times those per mm where the joint slides.
    cycles: f64,
}

impl JointError {
    /// Smooth curve and gear lines together, rad.
    pub fn error(&self) -> f64 {
        self.curve + self.gear_lines
    }
}

impl FullModel {
    pub fn joint_curves(&self) -> JointCurves {
        let blocks = self.trained.layout.blocks();
        let pairs = blocks.flat_map(|(block, columns)| self.pairs(block, columns));
        let pairs: Vec<Pair> = pairs.collect();
        let columns = pairs.iter().flat_map(|pair| [pair.column, pair.column + 1]);
        let columns: Vec<usize> = columns.collect();
        JointCurves {
            mean: self.trained.mean.select_rows(&columns),
            half: self.posterior.half_of(&columns),
            pairs,
        }
    }

    /// The pairs of a block's columns; none where it is no part of a joint's curve in all sessions.
    fn pairs(&self, block: Block, columns: Range<usize>) -> Vec<Pair> {
        let pair = |joint: usize, is_line: bool, place: usize, cycles: f64| Pair {
            joint,
            is_line,
            column: columns.start + 2 * place,
            cycles,
        };
        match block {
            Block::Curve(joint) => {
                let unit = self.trained.layout.curve_unit(joint);
                let smooth = |place: usize| pair(joint, false, place, (place + 1) as f64 / unit);
                (0..columns.len() / 2).map(smooth).collect()
            }
            Block::Line { joint, cycles } => vec![pair(joint, true, 0, cycles)],
            _ => Vec::new(),
        }
    }

    /// The smooth error curve of `joint` (from 0) at `angles` (axis variable, rad; mm where the joint slides) per unit of every
    /// column: a row for each angle, zero without a curve.
    pub fn curve_rows(&self, joint: usize, angles: &[f64]) -> DMatrix<f64> {
        let mut rows = DMatrix::zeros(angles.len(), self.trained.layout.size());
        let columns = self.trained.layout.columns(Block::Curve(joint)).unwrap_or(0..0);
        for pair in self.pairs(Block::Curve(joint), columns) {
            pair.fill(&mut rows, pair.column, angles);
        }
        rows
    }

    pub fn covariance_of_rows(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        gram(&self.posterior.half(rows).as_view())
    }

    /// Posterior means of combinations of columns, a row each; of an unknown, without the offset where its column is evaluated.
    pub fn means_of_rows(&self, rows: &DMatrix<f64>) -> DVector<f64> {
        rows * &self.trained.mean
    }

    /// Posterior mean of the column at `place`; for an unknown, its whole offset.
    pub fn column_mean(&self, place: usize) -> f64 {
        let unknowns =
            self.trained.layout.columns(Block::Unknowns).filter(|own| own.contains(&place));
        unknowns.map_or(0.0, |own| self.trained.offsets[place - own.start])
            + self.trained.mean[place]
    }
}

impl JointCurves {
    /// The error curve of `joint` (from 0) at `angles` (axis variable, rad; mm where the joint slides).
    ///
    /// It excludes the joint's constant offset, which is the geometry's θ.
    pub fn errors(&self, joint: usize, angles: &[f64]) -> Vec<JointError> {
        let own = (0..self.pairs.len()).filter(|&pair| self.pairs[pair].joint == joint);
        let (lines, smooth): (Vec<usize>, Vec<usize>) =
            own.partition(|&pair| self.pairs[pair].is_line);
        let own = [&smooth[..], &lines[..]].concat();
        let columns: Vec<usize> = own.iter().flat_map(|pair| [2 * pair, 2 * pair + 1]).collect();
        let mut rows = DMatrix::zeros(angles.len(), columns.len());
        for (place, &pair) in own.iter().enumerate() {
            self.pairs[pair].fill(&mut rows, 2 * place, angles);
        }
        let mean = self.mean.select_rows(&columns);
        let (smooth, lines) = (2 * smooth.len(), 2 * lines.len());
        let curve = rows.columns(0, smooth) * mean.rows(0, smooth);
        let gear_lines = rows.columns(smooth, lines) * mean.rows(smooth, lines);
        let covariance = gram(&self.half.select_columns(&columns).as_view());
        let spread = &rows * covariance;
        let error = |(place, &angle): (usize, &f64)| JointError {
            angle,
            curve: curve[place],
            gear_lines: gear_lines[place],
            // Rounding may leave less than nothing of a curve that is known for certain.
            sd: rows.row(place).dot(&spread.row(place)).max(0.0).sqrt(),
        };
        angles.iter().enumerate().map(error).collect()
    }
}

impl Pair {
    /// Fills the columns `first` and `first + 1` with its cosine and sine at `angles`.
    fn fill(&self, rows: &mut DMatrix<f64>, first: usize, angles: &[f64]) {
        for (row, angle) in angles.iter().enumerate() {
            let (sin, cos) = (self.cycles * angle).sin_cos();
            rows[(row, first)] = cos;
            rows[(row, first + 1)] = sin;
        }
    }
}
