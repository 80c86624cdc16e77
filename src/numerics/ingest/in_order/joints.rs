//! The buffer of joint angles.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use super::super::rows::{Place, RowFault, Rows};
use super::super::{DecodedJoints, JointAngles, Mapping, SpanClock};
use super::{Buffer, reordered};

#[derive(Debug)]
pub struct JointBuffer {
    factors: Vec<f64>,
    stamps: Vec<i64>,
    angles: JointAngles,
    unwrapped: Vec<bool>,
    /// Whether each joint jumped by a turn, and its largest angle.
    turned: Vec<(bool, f64)>,
    /// Stamp and angles of the last sample that is in order.
    last: Option<(i64, Vec<f64>)>,
}

/// A jump by more than this in less than [`AT_ONCE_NS`] is one by a whole turn, rad: from one end of (−π, π] to the other.
const TURN: f64 = 4.7;
const AT_ONCE_NS: i64 = 250_000_000;
/// The largest angle of a joint that is reported in (−π, π], rad.
const HALF_TURN: f64 = PI + 1e-3;

impl JointBuffer {
    pub fn of(mapping: &Mapping) -> Self {
        Self {
            factors: mapping.factors(),
            stamps: Vec::new(),
            angles: JointAngles::of(mapping.joints.len()),
            unwrapped: vec![false; mapping.joints.len()],
            turned: vec![(false, 0.0); mapping.joints.len()],
            last: None,
        }
    }

    /// The same with joints that an earlier reading found to be reported in (−π, π] beyond its ends.
    #[must_use]
    pub fn unwrapping(mut self, joints: &[usize]) -> Self {
        for (joint, unwrapped) in self.unwrapped.iter_mut().enumerate() {
            *unwrapped = joints.contains(&joint);
        }
        self
    }

    /// Stamps (ns) of some samples, and their angles (rad; mm where a joint slides) row after row.
    pub fn rows(&self, rows: Range<usize>) -> (&[i64], &[f64]) {
        (&self.stamps[rows.clone()], self.angles.of_rows(rows))
    }
}

impl Buffer for JointBuffer {
    type Block = DecodedJoints;
    /// Half a degree.
    const JUMP: f64 = 0.01;

    fn times_of(block: &mut DecodedJoints) -> (&mut [i64], &[i64]) {
        (&mut block.stamps, &block.logged)
    }

    fn clock(&self) -> SpanClock {
        SpanClock::Controller
    }

    fn judge(&self, block: &DecodedJoints, place: &Place<'_>) -> Rows {
        let faulty = RowFault::in_angles(&block.angles);
        Rows::judge(&block.stamps, place, SpanClock::Controller, |row| {
            let is_finite = || block.angles.row(row).iter().all(|angle| angle.is_finite());
            (faulty && !is_finite()).then_some(RowFault::Angle)
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

    fn settle(&mut self, count: usize) {
        for row in 0..count {
            let (stamp, own) = (self.stamps[row], self.angles.row_mut(row));
            let (before, last) = self.last.get_or_insert_with(|| (stamp, own.to_vec()));
            let is_at_once = (0..AT_ONCE_NS).contains(&stamp.saturating_sub(*before));
            for (joint, angle) in own.iter_mut().enumerate() {
                let (turned, largest) = &mut self.turned[joint];
                if self.unwrapped[joint] {
                    *angle -= TAU * ((*angle - last[joint]) / TAU).round();
                }
                *turned |= is_at_once && (*angle - last[joint]).abs() > TURN;
                *largest = largest.max(angle.abs());
            }
            *before = stamp;
            last.copy_from_slice(own);
        }
    }

    fn wrapped(&self) -> Vec<usize> {
        let turned = self.turned.iter().enumerate();
        let turned = turned.filter(|(_, (turned, largest))| *turned && *largest <= HALF_TURN);
        turned.map(|(joint, _)| joint).collect()
    }

    fn content(&self, row: usize) -> &[f64] {
        self.angles.row(row)
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

#[cfg(test)]
mod tests {
    use super::*;

    fn settled(angles: &[f64], unwrapped: bool) -> JointBuffer {
        let mut own = JointBuffer {
            factors: vec![1.0],
            stamps: (0..).zip(angles).map(|(row, _)| 20_000_000 * row).collect(),
            angles: JointAngles::of(1),
            unwrapped: vec![unwrapped],
            turned: vec![(false, 0.0)],
            last: None,
        };
        own.angles.append(angles);
        // In two pieces.
        own.settle(angles.len() / 2);
        let rest = own.angles.all()[angles.len() / 2..].to_vec();
        own.evict(angles.len() / 2);
        own.settle(rest.len());
        own
    }

    #[test]
    fn a_joint_that_is_reported_in_half_a_turn_to_both_sides_is_unwrapped() {
        let truth = |row: i32| 2.5 + 0.02 * f64::from(row);
        let reported: Vec<f64> =
            (0..200).map(|row| (truth(row) + PI).rem_euclid(TAU) - PI).collect();
        assert_eq!(settled(&reported, false).wrapped(), [0]);
        let own = settled(&reported, true);
        assert!((own.angles.all()[99] - truth(199)).abs() < 1e-12);
        assert!(own.wrapped().is_empty());
        // One that goes further than half a turn is not reported so, whatever it jumps by.
        let far: Vec<f64> = (0..200).map(|row| if row < 100 { -2.9 } else { 3.4 }).collect();
        assert!(settled(&far, false).wrapped().is_empty());
    }
}
