//! The buffer of commanded poses or of readings.

use std::ops::Range;

use super::super::covariances::CovarianceCounts;
use super::super::poses;
use super::super::rows::{Place, RowFault, Rows};
use super::super::{
    CommandedSettings, DecodedPoses, LengthUnit, LoggedLength, PoseSamples, SpanClock,
    TrackerSettings,
};
use super::{Buffer, reordered};
use crate::geometry::PoseCovariance;
use crate::units::Stamp;

#[derive(Debug)]
pub struct PoseBuffer {
    clock: SpanClock,
    unit: LengthUnit,
    wants_orientations: bool,
    wants_covariances: bool,
    /// Whether poses are inverted: of a camera on the flange.
    inverted: bool,
    stamps: Vec<i64>,
    positions: Vec<[f64; 3]>,
    /// Unit quaternions x y z w; `None` when the messages have none.
    orientations: Option<Vec<[f64; 4]>>,
    covariances: Option<Vec<PoseCovariance>>,
    /// Stated covariances by what became of them.
    counted: CovarianceCounts,
    /// Whether messages have orientations and covariances; `None` before the first block.
    kind: Option<(bool, bool)>,
    not_unit: u64,
}

impl PoseBuffer {
    pub const fn commands(settings: &CommandedSettings) -> Self {
        Self::none(SpanClock::Controller, settings.unit, true, false)
    }

    pub fn readings(settings: &TrackerSettings) -> Self {
        let orientations = !settings.ignore_orientation;
        Self {
            inverted: settings.eye_in_hand,
            ..Self::none(SpanClock::Tracker, settings.unit, orientations, true)
        }
    }

    /// An empty buffer of an instrument of one length: each length as x, without y and z.
    pub const fn lengths(settings: &LoggedLength) -> Self {
        Self::none(SpanClock::Tracker, settings.unit, false, false)
    }

    const fn none(
        clock: SpanClock,
        unit: LengthUnit,
        wants_orientations: bool,
        wants_covariances: bool,
    ) -> Self {
        Self {
            clock,
            unit,
            wants_orientations,
            wants_covariances,
            inverted: false,
            stamps: Vec::new(),
            positions: Vec::new(),
            orientations: None,
            covariances: None,
            counted: CovarianceCounts::NONE,
            kind: None,
            not_unit: 0,
        }
    }

    /// Some of the samples, labelled with their clock `C`.
    pub fn rows<C: Copy>(&self, rows: Range<usize>) -> PoseSamples<C> {
        PoseSamples {
            stamps: self.stamps[rows.clone()].iter().map(|&ns| Stamp::from_ns(ns)).collect(),
            positions: self.positions[rows.clone()].to_vec(),
            orientations: self.orientations.as_ref().map(|all| all[rows.clone()].to_vec()),
            covariances: self.covariances.as_ref().map(|all| all[rows].to_vec()),
        }
    }

    /// Inverts the poses from the sample `first` on; zeros of a missing reading stay.
    fn invert_from(&mut self, first: usize) {
        let Some(orientations) = &mut self.orientations else { return };
        let rows = orientations[first..].iter_mut().zip(&mut self.positions[first..]);
        for (row, (quaternion, position)) in rows.enumerate() {
            let covariance = self.covariances.as_mut().and_then(|all| all.get_mut(first + row));
            poses::invert(position, quaternion, covariance);
        }
    }

    /// The block's orientations; `None` when they are absent or not wanted.
    fn orientations<'b>(&self, block: &'b DecodedPoses) -> Option<&'b Vec<[f64; 4]>> {
        block.orientations.as_ref().filter(|_| self.wants_orientations)
    }
}

impl Buffer for PoseBuffer {
    type Block = DecodedPoses;

    fn times_of(block: &mut DecodedPoses) -> (&mut [i64], &[i64]) {
        (&mut block.stamps, &block.logged)
    }

    fn clock(&self) -> SpanClock {
        self.clock
    }

    fn zero_lost(&self, block: &mut DecodedPoses) {
        if self.clock == SpanClock::Tracker {
            poses::zero_lost(block);
        }
    }

    fn judge(&self, block: &DecodedPoses, place: &Place<'_>) -> Rows {
        let orientations = self.orientations(block);
        let lacks = self.inverted && orientations.is_none();
        Rows::judge(&block.stamps, place, self.clock, |row| {
            if lacks {
                return Some(RowFault::NoOrientation);
            }
            poses::fault(
                block.positions[row],
                orientations.and_then(|all| all.get(row)),
                block.covariances.as_ref().and_then(|all| all.get(row)),
            )
        })
    }

    fn take(&mut self, rows: &Rows, block: &DecodedPoses) -> bool {
        let orientations = self.orientations(block);
        let count = block.stamps.len();
        let of_all = |found: Option<usize>| found.is_none_or(|found| found == count);
        let found = (orientations.map(Vec::len), block.covariances.as_ref().map(Vec::len));
        let kind = (found.0.is_some(), found.1.is_some());
        if !of_all(found.0) || !of_all(found.1) || *self.kind.get_or_insert(kind) != kind {
            return false;
        }
        let before = self.stamps.len();
        rows.append(&block.stamps, &mut self.stamps);
        rows.append(&block.positions, &mut self.positions);
        let to_mm = self.unit.to_mm();
        poses::scale(&mut self.positions[before..], to_mm);
        if let Some(more) = orientations {
            let all = self.orientations.get_or_insert_default();
            rows.append(more, all);
            let norms = all[before..].iter_mut().filter_map(poses::normalise);
            self.not_unit += norms.filter(|norm| (norm - 1.0).abs() > 1e-3).count() as u64;
        }
        if let Some(more) = &block.covariances
            && self.wants_covariances
        {
            let mut kept = Vec::with_capacity(rows.kept);
            rows.append(more, &mut kept);
            let with_orientation = self.orientations.is_some();
            let own = kept.iter().zip(&self.positions[before..]).map(|(logged, position)| {
                if position.iter().all(|&x| x == 0.0) && logged.is_zero() {
                    // Nothing was read, so nothing is stated of it.
                    return PoseCovariance::default();
                }
                let own = logged.judged(with_orientation, &mut self.counted);
                own.scaled(to_mm, 1.0)
            });
            self.covariances.get_or_insert_default().extend(own);
        }
        if self.inverted {
            self.invert_from(before);
        }
        true
    }

    fn stamps(&self) -> &[i64] {
        &self.stamps
    }

    fn content(&self, row: usize) -> &[f64] {
        &self.positions[row]
    }

    fn reorder(&mut self, order: &[usize]) {
        self.stamps = reordered(&self.stamps, order);
        self.positions = reordered(&self.positions, order);
        if let Some(column) = &mut self.orientations {
            *column = reordered(column, order);
        }
        if let Some(column) = &mut self.covariances {
            *column = reordered(column, order);
        }
    }

    fn evict(&mut self, count: usize) {
        self.stamps.drain(..count);
        self.positions.drain(..count);
        if let Some(column) = &mut self.orientations {
            column.drain(..count);
        }
        if let Some(column) = &mut self.covariances {
            column.drain(..count);
        }
    }

    fn further_counts(&self) -> Vec<(&'static str, u64)> {
        let oriented = self.kind.is_some_and(|(orientations, _)| orientations);
        let not_unit = oriented.then_some((poses::NOT_UNIT, self.not_unit));
        not_unit.into_iter().chain(self.counted.named()).collect()
    }
}
