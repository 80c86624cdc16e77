//! Joint angles of many samples, one row after the other as in messages and in tables.

use std::ops::Range;
use std::slice::ChunksExact;

/// A row of joint angles for each sample, in the arm's order; in rad, in mm where a joint slides,
/// except in decoded blocks (the log's unit).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct JointAngles {
    joints: usize,
    values: Vec<f64>,
}

impl JointAngles {
    pub const fn of(joints: usize) -> Self {
        Self { joints, values: Vec::new() }
    }

    pub const fn joints(&self) -> usize {
        self.joints
    }

    pub fn len(&self) -> usize {
        self.values.len().checked_div(self.joints).unwrap_or(0)
    }

    pub const fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    pub fn rows(&self) -> ChunksExact<'_, f64> {
        self.values.chunks_exact(self.joints.max(1))
    }

    pub fn row(&self, row: usize) -> &[f64] {
        &self.values[self.places(row..row + 1)]
    }

    /// The angles of the sample `row`, for writing.
    pub fn row_mut(&mut self, row: usize) -> &mut [f64] {
        let places = self.places(row..row + 1);
        &mut self.values[places]
    }

    pub fn all(&self) -> &[f64] {
        &self.values
    }

    pub(super) fn of_rows(&self, rows: Range<usize>) -> &[f64] {
        &self.values[self.places(rows)]
    }

    #[inline]
    pub fn push(&mut self, row: impl IntoIterator<Item = f64>) {
        self.values.extend(row);
        debug_assert!(self.values.len().is_multiple_of(self.joints.max(1)));
    }

    /// Appends a row unless one of its angles is an error; then nothing is appended.
    pub fn try_push<E>(&mut self, row: impl IntoIterator<Item = Result<f64, E>>) -> Result<(), E> {
        let held = self.values.len();
        for angle in row {
            match angle {
                Ok(angle) => self.values.push(angle),
                Err(error) => {
                    self.values.truncate(held);
                    return Err(error);
                }
            }
        }
        Ok(())
    }

    pub fn append(&mut self, rows: &[f64]) {
        self.values.extend_from_slice(rows);
    }

    /// A copy of the rows with these numbers, in this order.
    #[must_use]
    pub fn picked(&self, rows: &[usize]) -> Self {
        let mut picked = Self::of(self.joints);
        picked.values.reserve_exact(rows.len() * self.joints);
        for &row in rows {
            picked.append(self.row(row));
        }
        picked
    }

    /// Multiplies each joint's value in the rows from `first` on by its factor.
    pub(super) fn scale_from(&mut self, first: usize, factors: &[f64]) {
        if !factors.iter().any(|&factor| (factor - 1.0).abs() > 0.0) {
            return;
        }
        let places = self.places(first..self.len());
        for row in self.values[places].chunks_exact_mut(self.joints.max(1)) {
            for (value, factor) in row.iter_mut().zip(factors) {
                *value *= factor;
            }
        }
    }

    pub(super) fn evict(&mut self, rows: usize) {
        self.values.drain(..rows * self.joints);
    }

    /// Removes all rows; the next ones have `joints` angles.
    pub fn clear(&mut self, joints: usize) {
        self.values.clear();
        self.joints = joints;
    }

    const fn places(&self, rows: Range<usize>) -> Range<usize> {
        rows.start * self.joints..rows.end * self.joints
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn three_rows() -> JointAngles {
        let mut angles = JointAngles::of(2);
        for row in [[1.0, -1.0], [2.0, -2.0], [3.0, -3.0]] {
            angles.push(row);
        }
        angles
    }

    #[test]
    fn rows_and_joints_are_distinguished() {
        let mut angles = three_rows();
        assert_eq!((angles.len(), angles.joints()), (3, 2));
        assert_eq!(angles.row(1), [2.0, -2.0]);
        assert!(angles.rows().map(|row| row[1]).eq([-1.0, -2.0, -3.0]));
        assert_eq!(angles.of_rows(1..3), [2.0, -2.0, 3.0, -3.0]);
        assert_eq!(angles.picked(&[2, 0]).all(), [3.0, -3.0, 1.0, -1.0]);
        angles.scale_from(2, &[10.0, 100.0]);
        angles.evict(1);
        assert_eq!(angles.all(), [2.0, -2.0, 30.0, -300.0]);
        angles = angles.picked(&[0]);
        assert_eq!(angles.rows().count(), 1);
    }

    #[test]
    fn a_row_with_a_fault_is_not_appended() {
        let mut angles = three_rows();
        assert_eq!(angles.try_push([Ok(4.0), Err("no number")]), Err("no number"));
        assert_eq!(angles, three_rows());
        assert_eq!(angles.try_push([Ok::<_, ()>(4.0), Ok(-4.0)]), Ok(()));
        assert_eq!(angles.row(3), [4.0, -4.0]);
    }

    #[test]
    fn without_joints_there_are_no_rows() {
        let none = JointAngles::default();
        assert_eq!((none.len(), none.rows().count()), (0, 0));
    }
}
