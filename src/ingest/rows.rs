//! Which rows of a decoded stream are kept, and in which order.

use std::collections::BTreeMap;
use std::fmt;

use super::decoded::Origins;
use super::{JointAngles, LogReject, LossKind, SpanClock, StreamCounts};

/// Why a decoded row is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum RowFault {
    /// A joint angle is NaN or infinite.
    Angle,
    /// A coordinate is NaN or infinite.
    Position,
    /// A quaternion component is NaN or infinite.
    Orientation,
    /// The quaternion is zero.
    ZeroQuaternion,
    /// A temperature is NaN or infinite.
    Temperature,
}

impl RowFault {
    /// What is wrong with a row of joint angles.
    pub(super) fn of_angles(angles: &JointAngles, row: usize) -> Option<Self> {
        let finite = angles.row(row).iter().all(|angle| angle.is_finite());
        (!finite).then_some(Self::Angle)
    }

    /// Whether a row of joint angles has anything wrong. Looks at all exponents at once: only those of infinities and of
    /// what is no number are all ones.
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
            Self::Angle => "a joint angle is not a finite number",
            Self::Position => "the position is not finite numbers",
            Self::Orientation => "the orientation is not finite numbers",
            Self::ZeroQuaternion => {
                "the quaternion is zero (for a reflector without orientation set ignore_orientation = true)"
            }
            Self::Temperature => "the temperature is not a finite number",
        })
    }
}

/// The rows of one stream that are kept, ordered in time.
pub struct Rows {
    /// `None`: all of them, in the order they stand in.
    order: Option<Vec<usize>>,
    pub(super) rejects: Vec<LogReject>,
    pub(super) counts: StreamCounts,
}

impl Rows {
    /// Judges each row, then orders the kept ones by stamp; equal stamps stay in the order of the file.
    pub(super) fn judge(
        stamps: &[i64],
        origins: &Origins,
        clock: SpanClock,
        fault: impl Fn(usize) -> Option<RowFault>,
    ) -> Self {
        let faults: Vec<_> = (0..stamps.len())
            .filter_map(|row| fault(row).map(|fault| (row, fault)))
            .collect();
        let backward = stamps.windows(2).filter(|pair| pair[1] < pair[0]).count();
        let order = (!faults.is_empty() || backward > 0).then(|| kept_in_order(stamps, &faults));
        let kept = order.as_ref().map_or(stamps.len(), Vec::len);
        let mut rows = Self {
            order,
            rejects: rejects(stamps, origins, clock, &faults),
            counts: StreamCounts {
                kept: kept as u64,
                rejected: faults.len() as u64,
                backward_stamps: backward as u64,
                duplicate_stamps: 0,
            },
        };
        rows.counts.duplicate_stamps = rows.duplicates(stamps);
        rows
    }

    /// Adds the kept rows of a column, in order.
    pub(super) fn append<T: Copy>(&self, column: &[T], to: &mut Vec<T>) {
        match &self.order {
            None => to.extend_from_slice(column),
            Some(order) => to.extend(order.iter().map(|&row| column[row])),
        }
    }

    /// A column with the kept rows only, in order.
    pub(super) fn of<T: Copy>(&self, column: Vec<T>) -> Vec<T> {
        match &self.order {
            None => column,
            Some(order) => order.iter().map(|&row| column[row]).collect(),
        }
    }

    /// Adds the kept rows of joint angles, in order.
    pub(super) fn append_angles(&self, angles: &JointAngles, to: &mut JointAngles) {
        match &self.order {
            None => to.append(angles.all()),
            Some(order) => to.append(angles.picked(order).all()),
        }
    }

    /// The kept rows of joint angles, in order.
    pub(super) fn of_angles(&self, angles: JointAngles) -> JointAngles {
        match &self.order {
            None => angles,
            Some(order) => angles.picked(order),
        }
    }

    fn duplicates(&self, stamps: &[i64]) -> u64 {
        let count = match &self.order {
            None => stamps.windows(2).filter(|pair| pair[0] == pair[1]).count(),
            Some(order) => order
                .windows(2)
                .filter(|pair| stamps[pair[0]] == stamps[pair[1]])
                .count(),
        };
        count as u64
    }
}

fn kept_in_order(stamps: &[i64], faults: &[(usize, RowFault)]) -> Vec<usize> {
    let mut faulty = faults.iter().map(|&(row, _)| row).peekable();
    let mut order: Vec<_> = (0..stamps.len())
        .filter(|row| faulty.next_if_eq(row).is_none())
        .collect();
    order.sort_by_key(|&row| stamps[row]);
    order
}

/// One reject for each byte range and fault.
fn rejects(
    stamps: &[i64],
    origins: &Origins,
    clock: SpanClock,
    faults: &[(usize, RowFault)],
) -> Vec<LogReject> {
    let mut found: BTreeMap<(usize, u64, RowFault), LogReject> = BTreeMap::new();
    for &(row, fault) in faults {
        let origin = origins.of_row(row).expect("each row comes from a block");
        let reject = found
            .entry((origin.file, origin.byte_start, fault))
            .or_insert_with(|| LogReject {
                file: origins.files[origin.file].clone(),
                topic: Some(origins.topic.clone()),
                byte_start: origin.byte_start,
                byte_end: origin.byte_end,
                time_span_ns: None,
                clock,
                messages: Some(0),
                loss: LossKind::Unusable,
                reason: fault.to_string(),
            });
        reject.widen(stamps[row]);
    }
    found.into_values().collect()
}

#[cfg(test)]
mod tests {
    use super::super::decoded::Origin;
    use super::*;

    fn origins() -> Origins {
        let origin = |rows_end, byte_start| Origin {
            rows_end,
            file: 0,
            byte_start,
            byte_end: byte_start + 10,
        };
        Origins {
            files: vec!["f".to_owned()],
            topic: "/t".to_owned(),
            blocks: vec![origin(2, 100), origin(5, 200)],
        }
    }

    #[test]
    fn rows_are_kept_or_rejected_and_ordered() {
        // Row 3 is faulty; rows 0 and 4 share a stamp and keep their order.
        let stamps = [30, 10, 40, 20, 30];
        let rows = Rows::judge(&stamps, &origins(), SpanClock::Tracker, |row| {
            (row == 3).then_some(RowFault::Angle)
        });
        assert_eq!(rows.of(vec!['a', 'b', 'c', 'd', 'e']), ['b', 'a', 'e', 'c']);
        assert_eq!(
            rows.counts,
            StreamCounts {
                kept: 4,
                rejected: 1,
                backward_stamps: 2, // 30 → 10 and 40 → 20
                duplicate_stamps: 1,
            }
        );
        assert_eq!(rows.rejects.len(), 1);
        let reject = &rows.rejects[0];
        assert_eq!((reject.byte_start, reject.byte_end), (200, 210));
        assert_eq!(reject.time_span_ns, Some((20, 20)));
        assert_eq!(reject.clock, SpanClock::Tracker);
        assert_eq!(reject.messages, Some(1));
    }

    #[test]
    fn faults_of_one_block_and_kind_are_one_reject() {
        let stamps = [1, 2, 3, 4, 5];
        let rows = Rows::judge(&stamps, &origins(), SpanClock::Tracker, |_| {
            Some(RowFault::Position)
        });
        let summary: Vec<_> = rows
            .rejects
            .iter()
            .map(|reject| (reject.byte_start, reject.messages, reject.time_span_ns))
            .collect();
        assert_eq!(
            summary,
            [(100, Some(2), Some((1, 2))), (200, Some(3), Some((3, 5)))]
        );
        assert_eq!(rows.of(vec![0; 5]), Vec::<i32>::new());
    }
}
