//! Joint angles that are held back.

use super::super::decoded::{DecodedJoints, Origins};
use super::super::rows::{RowFault, Rows};
use super::super::{AngleUnit, JointAngles, Mapping, SpanClock};
use super::{Held, reordered};

/// Joint samples, in rad.
#[derive(Debug)]
pub struct HeldJoints {
    unit: AngleUnit,
    stamps: Vec<i64>,
    angles: JointAngles,
}

impl HeldJoints {
    /// None yet.
    pub fn of(mapping: &Mapping) -> Self {
        Self {
            unit: mapping.controller.unit,
            stamps: Vec::new(),
            angles: JointAngles::of(mapping.joints.len()),
        }
    }

    /// Stamps of some samples, and their angles row behind row.
    pub fn rows(&self, rows: std::ops::Range<usize>) -> (&[i64], &[f64]) {
        (&self.stamps[rows.clone()], self.angles.of_rows(rows))
    }
}

impl Held for HeldJoints {
    type Block = DecodedJoints;

    fn stamps_of(block: &DecodedJoints) -> &[i64] {
        &block.stamps
    }

    fn judge(&self, block: &DecodedJoints, origins: &Origins) -> Rows {
        let faulty = RowFault::in_angles(&block.angles);
        Rows::judge(&block.stamps, origins, SpanClock::Controller, |row| {
            if faulty {
                RowFault::of_angles(&block.angles, row)
            } else {
                None
            }
        })
    }

    fn take(&mut self, rows: &Rows, block: &DecodedJoints) -> bool {
        let held = self.stamps.len();
        rows.append(&block.stamps, &mut self.stamps);
        rows.append_angles(&block.angles, &mut self.angles);
        if self.unit != AngleUnit::Rad {
            self.angles.scale_from(held, self.unit.to_rad());
        }
        true
    }

    fn stamps(&self) -> &[i64] {
        &self.stamps
    }

    fn reorder(&mut self, order: &[usize]) {
        self.stamps = reordered(&self.stamps, order);
        self.angles = self.angles.picked(order);
    }

    fn let_go(&mut self, count: usize) {
        self.stamps.drain(..count);
        self.angles.let_go(count);
    }
}
