//! The numbers by which the columns of a joint's curves and gear lines scale its motion.
//!
//! All curves of a joint have the same shapes `cos k q, sin k q`, whether of all sessions, of one, of the time before a repair or of a step
//! of years: they differ in their length, in a constant, and in a share that is the same for a whole session. So each number is found
//! once a station, sums over stations are products of these alone, and columns are written from them.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::design::curve_pairs;
use super::layout::{Block, Layout};

/// The shapes of one joint that the stations of a session see, and the columns that have them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct JointShapes {
    /// Number of pairs of the longest curve; they come first.
    pairs: usize,
    /// Cycles per turn of each gear line; behind the pairs.
    lines: Vec<f64>,
    /// Whether some curve has a constant; it comes last.
    has_constant: bool,
    pub runs: Vec<Run>,
}

/// Columns beside each other that have shapes beside each other, all times the same share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Run {
    pub place: usize,
    pub shape: usize,
    pub count: usize,
    pub share: f64,
}

impl JointShapes {
    /// The shapes of `joint` in a session, for the blocks that the session sees; `place` is that of a column of the model.
    pub fn of(
        blocks: &[(Block, Range<usize>)],
        layout: &Layout,
        session: usize,
        joint: usize,
        place: impl Fn(usize) -> usize,
    ) -> Self {
        let own = blocks.iter().filter(|(block, _)| block.shapes() == Some(joint));
        let mut shapes = Self::default();
        for (block, columns) in own.clone() {
            match block {
                Block::Line { cycles, .. } => shapes.lines.push(*cycles),
                _ => shapes.pairs = shapes.pairs.max(columns.len() / 2),
            }
            shapes.has_constant |= block.has_constant();
        }
        let mut line = 2 * shapes.pairs;
        let constant = line + 2 * shapes.lines.len();
        for (block, columns) in own.filter(|(_, columns)| !columns.is_empty()) {
            let share = block.share(layout, session);
            let mut push = |column: usize, shape: usize, count: usize| {
                if share > 0.0 && count > 0 {
                    shapes.runs.push(Run { place: place(column), shape, count, share });
                }
            };
            if let Block::Line { .. } = block {
                push(columns.start, line, 2);
                line += 2;
                continue;
            }
            let constants = usize::from(block.has_constant());
            push(columns.start, constant, constants);
            push(columns.start + constants, 0, columns.len() - constants);
        }
        shapes
    }

    pub const fn count(&self) -> usize {
        2 * (self.pairs + self.lines.len()) + self.has_constant as usize
    }

    /// The numbers of all shapes where the axis variable is `angle`, which is divided by `unit` for the pairs.
    pub fn numbers(&self, angle: f64, unit: f64) -> DVector<f64> {
        let mut numbers = Vec::with_capacity(self.count());
        curve_pairs(angle / unit, self.pairs, |_, cos, sin| {
            numbers.extend([cos, sin]);
        });
        for cycles in &self.lines {
            let (sin, cos) = (cycles * angle).sin_cos();
            numbers.extend([cos, sin]);
        }
        numbers.extend(self.has_constant.then_some(1.0));
        DVector::from_vec(numbers)
    }

    /// The entries of the columns that are not zero, by place, from the numbers of the shapes.
    pub fn entries<'n>(
        &'n self,
        numbers: &'n DVector<f64>,
    ) -> impl Iterator<Item = (usize, f64)> + 'n {
        let of_run = |run: &'n Run| {
            let own = &numbers.as_slice()[run.shape..][..run.count];
            (run.place..).zip(own).map(|(place, number)| (place, run.share * number))
        };
        self.runs.iter().flat_map(of_run)
    }

    pub fn gathered(&self, columns: &DVector<f64>) -> DVector<f64> {
        let mut gathered = DVector::zeros(self.count());
        for run in &self.runs {
            let own = columns.rows(run.place, run.count);
            gathered.rows_mut(run.shape, run.count).axpy(run.share, &own, 1.0);
        }
        gathered
    }

    /// The covariance of other columns, by their places, with the coefficients of the shapes, from that of all columns.
    pub fn covariance_with(&self, covariance: &DMatrix<f64>, others: &[usize]) -> DMatrix<f64> {
        let mut gathered = DMatrix::zeros(others.len(), self.count());
        for run in &self.runs {
            for own in 0..run.count {
                let column = covariance.column(run.place + own);
                for (entry, &row) in gathered.column_mut(run.shape + own).into_iter().zip(others) {
                    *entry += run.share * column[row];
                }
            }
        }
        gathered
    }

    /// The covariance of the coefficients of the shapes of this joint and another, from that of all columns.
    pub fn covariance(&self, covariance: &DMatrix<f64>, other: &Self) -> DMatrix<f64> {
        let mut gathered = DMatrix::zeros(self.count(), other.count());
        for columns in &other.runs {
            for rows in &self.runs {
                let size = (rows.count, columns.count);
                let block = covariance.view((rows.place, columns.place), size);
                let share = rows.share * columns.share;
                let mut into = gathered.view_mut((rows.shape, columns.shape), size);
                into.zip_apply(&block, |own, entry| *own += share * entry);
            }
        }
        gathered
    }
}

/// Places that follow each other, of shapes that do so too; nearly all do. None goes beyond the first `own` places and has some of them.
pub fn runs(places: &[usize], own: usize) -> Vec<Run> {
    let mut shape = 0;
    let runs = places.chunk_by(|place, next| place + 1 == *next && *next != own).map(|run| {
        let first = shape;
        shape += run.len();
        Run { place: run[0], shape: first, count: run.len(), share: 1.0 }
    });
    runs.collect()
}

impl Block {
    const fn has_constant(self) -> bool {
        matches!(self, Self::Earlier { .. } | Self::SessionCurve { .. } | Self::Ageing { .. })
    }

    /// The factor, from 0 to 1, by which a session's stations have the block's shapes; 0 of a gear that the session did not have.
    fn share(self, layout: &Layout, session: usize) -> f64 {
        let is_seen = match self {
            Self::Ageing { joint, step } => return layout.ageing(session, joint, step),
            Self::Curve(joint) | Self::Line { joint, .. } => layout.is_now(Some(session), joint),
            Self::Earlier { joint, to_come } => layout.to_come(Some(session), joint) == to_come,
            _ => true,
        };
        if is_seen { 1.0 } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Point3, Vector3};

    use super::*;
    use crate::fit::full::design::PoseView;
    use crate::kinematics::{Axes, Twist};

    /// Three sessions of one joint, repaired before the second, and the blocks that have its shapes.
    fn layout() -> Layout {
        let mut layout = Layout::new(1);
        layout.ages_years = vec![1.0, 0.2, 0.0];
        layout.repairs_to_come = vec![vec![1], vec![0], vec![0]];
        layout.push(Block::Curve(0), 8);
        layout.push(Block::Earlier { joint: 0, to_come: 1 }, 9);
        for session in 0..3 {
            layout.push(Block::SessionCurve { session, joint: 0 }, 5);
        }
        for step in 0..4 {
            layout.push(Block::Ageing { joint: 0, step }, 5);
        }
        layout.push(Block::Line { joint: 0, cycles: 20.5 }, 2);
        layout
    }

    #[test]
    fn columns_have_the_numbers_by_which_they_move_the_target() {
        let (layout, angle) = (layout(), 0.7);
        let joints = [Twist { linear: Vector3::x(), angular: Vector3::z() }];
        for session in 0..3 {
            let seen: Vec<_> = layout.blocks_in(session).collect();
            let shapes = JointShapes::of(&seen, &layout, session, 0, |column| column);
            assert_eq!(shapes.count(), 8 + 2 + 1);
            let mut found = vec![0.0; layout.size()];
            for (place, number) in shapes.entries(&shapes.numbers(angle, layout.curve_unit(0))) {
                found[place] = number;
            }
            let view = PoseView {
                unknowns: &[],
                joints: &joints,
                axes: &Axes::default(),
                end: Point3::origin(),
                up: None,
                base: Matrix3::identity(),
                angles: &[angle],
                settling_error: None,
                session: Some(session),
                time: None,
                middle: Point3::origin(),
            };
            let mut wanted = vec![0.0; layout.size()];
            view.walk(layout.blocks(), &layout, &mut |column, _, amount| {
                wanted[column] = amount;
            });
            assert_eq!(found, wanted, "session {session}");
        }
    }

    #[test]
    fn coefficients_of_shapes_are_those_of_their_columns_together() {
        let layout = layout();
        let seen: Vec<_> = layout.blocks_in(1).collect();
        let shapes = JointShapes::of(&seen, &layout, 1, 0, |column| column);
        let numbers = shapes.numbers(0.3, 1.0);
        let columns = DVector::from_fn(layout.size(), |row, _| (row as f64).sin());
        let by_columns: f64 =
            shapes.entries(&numbers).map(|(place, number)| number * columns[place]).sum();
        let by_shapes = shapes.gathered(&columns).dot(&numbers);
        assert!((by_columns - by_shapes).abs() < 1e-12);
        // The variance of the joint's error, likewise.
        let half = DMatrix::from_fn(layout.size(), layout.size(), |row, column| {
            ((3 * row + 7 * column) as f64).cos()
        });
        let covariance = &half * half.transpose();
        let mut row = DVector::zeros(layout.size());
        for (place, number) in shapes.entries(&numbers) {
            row[place] = number;
        }
        let wanted = row.dot(&(&covariance * &row));
        let found = numbers.dot(&(shapes.covariance(&covariance, &shapes) * &numbers));
        assert!((found - wanted).abs() < 1e-9 * wanted, "{found} {wanted}");
        let all: Vec<usize> = (0..layout.size()).collect();
        let found = shapes.covariance_with(&covariance, &all) * &numbers;
        assert!((found - covariance * row).amax() < 1e-9);
    }

    #[test]
    fn places_are_in_runs_that_end_where_own_columns_end() {
        let runs = runs(&[4, 5, 6, 7, 9, 2], 6);
        let found: Vec<_> = runs.iter().map(|run| (run.place, run.shape, run.count)).collect();
        assert_eq!(found, [(4, 0, 2), (6, 2, 2), (9, 4, 1), (2, 5, 1)]);
    }
}
