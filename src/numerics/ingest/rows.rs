//! The rows of a block that are kept, and their order.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::RangeInclusive;

use super::{JointAngles, LogReject, LossKind, SpanClock};

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum RowFault {
    Stamp,
    Angle,
    Position,
    Orientation,
    ZeroQuaternion,
    /// A position alone, where a camera on the flange measures poses.
    NoOrientation,
    Temperature,
}

/// Temperatures of places where arms are measured, °C: kelvins and most degrees Fahrenheit lie beyond.
pub const CELSIUS: RangeInclusive<f64> = -40.0..=60.0;

impl RowFault {
    /// Whether any row of angles has a fault, by all exponents at once: only those of infinities and NaN are all ones.
    pub(super) fn in_angles(angles: &JointAngles) -> bool {
        const EXPONENT: u64 = 0x7FF << 52;
        const CARRY: u64 = 1 << 52;
        let carried = |seen, angle: &f64| seen | ((angle.to_bits() & EXPONENT) + CARRY);
        angles.all().iter().fold(0, carried) >> 63 == 1
    }
}

impl fmt::Display for RowFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Stamp => "the stamp is 0 or far from those of the other messages: the publisher did not set it",
            Self::Angle => "a joint angle is not a finite number",
            Self::Position => "a coordinate of the position is not a finite number",
            Self::Orientation => "a component of the orientation is not a finite number",
            Self::ZeroQuaternion => {
                "the quaternion is zero (for a reflector without orientation set ignore_orientation = true)"
            }
            Self::NoOrientation => {
                "the message has no orientation, and the position alone of a camera on the flange says nothing"
            }
            Self::Temperature => "the temperature is none in °C of a place where arms are measured, −40 to 60",
        })
    }
}

/// The place in a log from which the rows of a block come.
#[derive(Debug, Clone, Copy)]
pub struct Place<'a> {
    pub file: &'a str,
    pub topic: &'a str,
    /// First byte of the block in the file as stored, and one past its last byte.
    pub bytes: (u64, u64),
}

pub struct Rows {
    /// Row numbers by stamp; `None` when all rows are kept and already in order.
    order: Option<Vec<usize>>,
    pub(super) kept: usize,
    pub(super) rejected: usize,
    /// Number of rows whose stamp is earlier than the previous row's.
    pub(super) backward_stamps: usize,
    pub(super) rejects: Vec<LogReject>,
}

impl Rows {
    /// Checks each row for faults, then orders the kept ones by stamp; equal stamps stay in the order of the file.
    pub(super) fn judge(
        stamps: &[i64],
        place: &Place<'_>,
        clock: SpanClock,
        fault: impl Fn(usize) -> Option<RowFault>,
    ) -> Self {
        let is_time = |row: usize| stamps[row] != i64::MIN;
        let fault = |row| if is_time(row) { fault(row) } else { Some(RowFault::Stamp) };
        let faults: Vec<_> =
            (0..stamps.len()).filter_map(|row| fault(row).map(|fault| (row, fault))).collect();
        let backward_stamps = stamps.windows(2).filter(|pair| pair[1] < pair[0]).count();
        let all_in_order = faults.is_empty() && backward_stamps == 0;
        Self {
            order: (!all_in_order).then(|| kept_in_order(stamps, &faults)),
            kept: stamps.len() - faults.len(),
            rejected: faults.len(),
            backward_stamps,
            rejects: rejects(stamps, place, clock, &faults),
        }
    }

    pub(super) fn append<T: Copy>(&self, column: &[T], to: &mut Vec<T>) {
        match &self.order {
            None => to.extend_from_slice(column),
            Some(order) => to.extend(order.iter().map(|&row| column[row])),
        }
    }

    pub(super) fn append_angles(&self, angles: &JointAngles, to: &mut JointAngles) {
        match &self.order {
            None => to.append(angles.all()),
            Some(order) => to.append(angles.picked(order).all()),
        }
    }
}

fn kept_in_order(stamps: &[i64], faults: &[(usize, RowFault)]) -> Vec<usize> {
    let mut faulty = faults.iter().map(|&(row, _)| row).peekable();
    let mut order: Vec<_> =
        (0..stamps.len()).filter(|row| faulty.next_if_eq(row).is_none()).collect();
    order.sort_by_key(|&row| stamps[row]);
    order
}

/// One reject for each kind of fault.
fn rejects(
    stamps: &[i64],
    place: &Place<'_>,
    clock: SpanClock,
    faults: &[(usize, RowFault)],
) -> Vec<LogReject> {
    let mut found: BTreeMap<RowFault, LogReject> = BTreeMap::new();
    for &(row, fault) in faults {
        let reject = found.entry(fault).or_insert_with(|| LogReject {
            file: place.file.to_owned(),
            topic: Some(place.topic.to_owned()),
            byte_start: place.bytes.0,
            byte_end: place.bytes.1,
            time_span_ns: None,
            clock,
            messages: Some(0),
            loss: LossKind::Unusable,
            reason: fault.to_string(),
        });
        if fault == RowFault::Stamp {
            reject.messages = reject.messages.map(|count| count + 1);
        } else {
            reject.widen(stamps[row]);
        }
    }
    found.into_values().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLACE: Place<'_> = Place { file: "f", topic: "/t", bytes: (200, 210) };

    fn judge(stamps: &[i64], fault: impl Fn(usize) -> Option<RowFault>) -> Rows {
        Rows::judge(stamps, &PLACE, SpanClock::Tracker, fault)
    }

    #[test]
    fn rows_are_kept_or_rejected_and_ordered() {
        // Row 3 is faulty; rows 0 and 4 share a stamp and keep their order.
        let stamps = [30, 10, 40, 20, 30];
        let rows = judge(&stamps, |row| (row == 3).then_some(RowFault::Angle));
        let mut kept = Vec::new();
        rows.append(&['a', 'b', 'c', 'd', 'e'], &mut kept);
        assert_eq!(kept, ['b', 'a', 'e', 'c']);
        // Backward: 30 → 10 and 40 → 20.
        assert_eq!((rows.kept, rows.rejected, rows.backward_stamps), (4, 1, 2));
        assert_eq!(rows.rejects.len(), 1);
        let reject = &rows.rejects[0];
        assert_eq!((reject.byte_start, reject.byte_end), (200, 210));
        assert_eq!(reject.time_span_ns, Some((20, 20)));
        assert_eq!(reject.clock, SpanClock::Tracker);
        assert_eq!(reject.messages, Some(1));
    }

    #[test]
    fn faults_of_one_kind_are_one_reject() {
        let rows = judge(&[1, 2, 3, 4, 5], |row| {
            Some(if row < 2 { RowFault::Orientation } else { RowFault::Position })
        });
        let summary: Vec<_> = rows
            .rejects
            .iter()
            .map(|reject| (reject.byte_start, reject.messages, reject.time_span_ns))
            .collect();
        // In the order of the kinds: positions first.
        assert_eq!(summary, [(200, Some(3), Some((3, 5))), (200, Some(2), Some((1, 2)))]);
        let mut kept: Vec<i32> = Vec::new();
        rows.append(&[0; 5], &mut kept);
        assert!(kept.is_empty());
    }
}
