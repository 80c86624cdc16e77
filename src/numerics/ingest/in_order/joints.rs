//! The buffer of joint angles.

use std::ops::Range;

use super::super::rows::{Place, RowFault, Rows};
use super::super::{DecodedJoints, JointAngles, Mapping, SpanClock};
use super::{Buffer, reordered};

#[derive(Debug)]
pub struct JointBuffer {
    factors: Vec<f64>,
    stamps: Vec<i64>,
    angles: JointAngles,
}

impl JointBuffer {
    pub fn of(mapping: &Mapping) -> Self {
        Self {
            factors: mapping.factors(),
            stamps: Vec::new(),
            angles: JointAngles::of(mapping.joints.len()),
        }
    }

    /// Stamps (ns) of some samples, and their angles (rad; mm where a joint slides) row after row.
    pub fn rows(&self, rows: Range<usize>) -> (&[i64], &[f64]) {
        (&self.stamps[rows.clone()], self.angles.of_rows(rows))
    }
}

impl Buffer for JointBuffer {
    type Block = DecodedJoints;

    fn stamps_of(block: &DecodedJoints) -> &[i64] {
        &block.stamps
    }

    fn judge(&self, block: &DecodedJoints, place: &Place<'_>) -> Rows {
        let faulty = RowFault::in_angles(&block.angles);
        Rows::judge(&block.stamps, place, SpanClock::Controller, |row| {
            if faulty { RowFault::of_angles(&block.angles, row) } else { None }
        })
    }

    fn take(&mut self, rows: &Rows, block: &DecodedJoints) -> bool {
        let before = self.stamps.len();
        rows.append(&block.stamps, &mut self.stamps);
        rows.append_angles(&block.angles, &mut self.angles);
        self.angles.scale_from(before, &self.factors);
        true
    }

    fn stamps(&self) -> &[i64] {
        &self.stamps
    }

    fn reorder(&mut self, order: &[usize]) {
        self.stamps = reordered(&self.stamps, order);
        self.angles = self.angles.picked(order);
    }

    fn evict(&mut self, count: usize) {
        self.stamps.drain(..count);
        self.angles.evict(count);
    }
}
