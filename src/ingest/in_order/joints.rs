//! Joint angles that are held back.

use super::super::decoded::{DecodedJoints, Origins};
use super::super::rows::{RowFault, Rows};
use super::super::{AngleUnit, Mapping, SpanClock};
use super::{Held, reordered};

/// Joint samples, in rad.
#[derive(Debug)]
pub struct HeldJoints {
    unit: AngleUnit,
    stamps: Vec<i64>,
    angles: Vec<Vec<f64>>,
}

impl HeldJoints {
    /// Stamps and angles of some samples, a column a joint.
    pub fn rows(&self, rows: std::ops::Range<usize>) -> (&[i64], Vec<&[f64]>) {
        let angles = self.angles.iter().map(|column| &column[rows.clone()]);
        (&self.stamps[rows.clone()], angles.collect())
    }
}

impl Held for HeldJoints {
    type Block = DecodedJoints;

    fn none(mapping: &Mapping) -> Self {
        Self {
            unit: mapping.controller.unit,
            stamps: Vec::new(),
            angles: vec![Vec::new(); mapping.joints.len()],
        }
    }

    fn topic(mapping: &Mapping) -> &str {
        &mapping.controller.topic
    }

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
        for (column, more) in self.angles.iter_mut().zip(&block.angles) {
            rows.append(more, column);
            if self.unit != AngleUnit::Rad {
                let to_rad = self.unit.to_rad();
                column[held..].iter_mut().for_each(|angle| *angle *= to_rad);
            }
        }
        true
    }

    fn stamps(&self) -> &[i64] {
        &self.stamps
    }

    fn reorder(&mut self, order: &[usize]) {
        self.stamps = reordered(&self.stamps, order);
        for column in &mut self.angles {
            *column = reordered(column, order);
        }
    }

    fn let_go(&mut self, count: usize) {
        self.stamps.drain(..count);
        for column in &mut self.angles {
            column.drain(..count);
        }
    }
}
