//! Covariances as messages and tables state them → those that can be used, and the counts of all others by their reason.
//!
//! A publisher that does not know a covariance writes zeros (`geometry_msgs`) or −1 in front (`sensor_msgs`); some write a matrix that is
//! no covariance at all. The reading stays: where its covariance falls, the instrument's stated uncertainty takes its place.

use nalgebra::{DMatrix, Matrix3, Matrix6};

use crate::geometry::pose_covariance::is_covariance;
use crate::geometry::{PoseCovariance, TurnCovariance, upper};

/// The covariance of one reading as it is stated, row by row.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "those of a block at most, and of one kind")]
pub enum LoggedCovariance {
    /// Of x, y, z.
    Position([f64; 9]),
    /// Of x, y, z and the rotation about X, Y and Z.
    Pose([f64; 36]),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Unusable {
    AllZero,
    /// −1 in the first entry.
    MinusOne,
    /// It is not symmetric and positive semi-definite (of an orientation: positive definite), or not finite.
    NotPositive,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CovarianceCounts {
    position: Outcomes,
    orientation: Outcomes,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Outcomes {
    read: u64,
    unusable: [u64; 3],
}

/// Names of the counts of positions and of orientations: read, and for each reason.
pub const COUNTED: [[&str; 4]; 2] = [
    [
        "position_covariances",
        "position_covariances_all_zero",
        "position_covariances_minus_one",
        "position_covariances_not_positive",
    ],
    [
        "orientation_covariances",
        "orientation_covariances_all_zero",
        "orientation_covariances_minus_one",
        "orientation_covariances_not_positive",
    ],
];

impl LoggedCovariance {
    pub(super) fn is_finite(&self) -> bool {
        self.position().iter().all(|entry| entry.is_finite())
    }

    pub(super) fn is_zero(&self) -> bool {
        let entries = match self {
            Self::Position(entries) => &entries[..],
            Self::Pose(entries) => &entries[..],
        };
        entries.iter().all(|entry| *entry == 0.0)
    }

    fn position(&self) -> Matrix3<f64> {
        match self {
            Self::Position(rows) => Matrix3::from_row_slice(rows),
            Self::Pose(rows) => Matrix6::from_row_slice(rows).fixed_view::<3, 3>(0, 0).into_owned(),
        }
    }

    /// The whole matrix; `None` where it is of a position alone.
    fn whole(&self) -> Option<Matrix6<f64>> {
        match self {
            Self::Position(_) => None,
            Self::Pose(rows) => Some(Matrix6::from_row_slice(rows)),
        }
    }

    /// What can be used of it, in the units that it is stated in; the orientation's part only where `with_orientation`.
    pub fn judged(&self, with_orientation: bool, counts: &mut CovarianceCounts) -> PoseCovariance {
        let position = counts.position.counted(position_of(self));
        let whole = self.whole().filter(|_| with_orientation);
        let turn = whole.map(|whole| turn_of(&whole, position.is_some()));
        let turn = turn.and_then(|turn| counts.orientation.counted(turn));
        PoseCovariance { position, turn }
    }
}

/// The orientation's part that is stated without a position's, rad²; `None` where it cannot be used.
pub fn judged_turn(own: &Matrix3<f64>, counts: &mut CovarianceCounts) -> Option<TurnCovariance> {
    let mut whole = Matrix6::zeros();
    whole.fixed_view_mut::<3, 3>(3, 3).copy_from(own);
    counts.orientation.counted(turn_of(&whole, false))
}

fn position_of(logged: &LoggedCovariance) -> Result<[f64; 6], Unusable> {
    let position = logged.position();
    unknown(&position)?;
    is_covariance(&dynamic(&position)).then(|| upper(&position)).ok_or(Unusable::NotPositive)
}

/// The orientation's part; `has_position` says whether the position's can be used, otherwise the orientation's stands alone.
fn turn_of(whole: &Matrix6<f64>, has_position: bool) -> Result<TurnCovariance, Unusable> {
    if is_minus_one(whole[(0, 0)]) {
        return Err(Unusable::MinusOne);
    }
    let own: Matrix3<f64> = whole.fixed_view::<3, 3>(3, 3).into_owned();
    unknown(&own)?;
    let turn = TurnCovariance {
        with_position: if has_position {
            TurnCovariance::of(whole).with_position
        } else {
            [0.0; 9]
        },
        own: upper(&own),
    };
    // An orientation that is exact about some axis has no weight.
    let has_turn = is_covariance(&dynamic(&own)) && own.cholesky().is_some();
    let is_whole =
        !has_position || is_covariance(&DMatrix::from_column_slice(6, 6, whole.as_slice()));
    (has_turn && is_whole).then_some(turn).ok_or(Unusable::NotPositive)
}

/// What publishers write that do not know a covariance.
fn unknown(block: &Matrix3<f64>) -> Result<(), Unusable> {
    if block.iter().all(|entry| *entry == 0.0) {
        return Err(Unusable::AllZero);
    }
    if is_minus_one(block[(0, 0)]) {
        return Err(Unusable::MinusOne);
    }
    Ok(())
}

fn is_minus_one(entry: f64) -> bool {
    entry.to_bits() == (-1.0_f64).to_bits()
}

fn dynamic(block: &Matrix3<f64>) -> DMatrix<f64> {
    DMatrix::from_column_slice(3, 3, block.as_slice())
}

impl Outcomes {
    const NONE: Self = Self { read: 0, unusable: [0; 3] };

    fn counted<T>(&mut self, judged: Result<T, Unusable>) -> Option<T> {
        self.read += 1;
        judged.map_err(|why| self.unusable[why as usize] += 1).ok()
    }
}

impl CovarianceCounts {
    pub const NONE: Self = Self { position: Outcomes::NONE, orientation: Outcomes::NONE };

    /// The counts by their names ([`COUNTED`]); none of a kind that was not read.
    pub fn named(&self) -> impl Iterator<Item = (&'static str, u64)> {
        let all = [self.position, self.orientation].into_iter().zip(COUNTED);
        all.filter(|(own, _)| own.read > 0).flat_map(|(own, names)| {
            let [zero, minus_one, not_positive] = own.unusable;
            names.into_iter().zip([own.read, zero, minus_one, not_positive])
        })
    }
}

/// The mean of the covariances that readings state, each part over those that state it.
pub fn mean(all: &[PoseCovariance]) -> PoseCovariance {
    fn of<const N: usize>(parts: &[[f64; N]]) -> [f64; N] {
        std::array::from_fn(|entry| {
            parts.iter().map(|own| own[entry]).sum::<f64>() / parts.len() as f64
        })
    }
    let positions: Vec<[f64; 6]> = all.iter().filter_map(|own| own.position).collect();
    let turns: Vec<TurnCovariance> = all.iter().filter_map(|own| own.turn).collect();
    let own: Vec<[f64; 6]> = turns.iter().map(|turn| turn.own).collect();
    let cross: Vec<[f64; 9]> = turns.iter().map(|turn| turn.with_position).collect();
    PoseCovariance {
        position: (!positions.is_empty()).then(|| of(&positions)),
        turn: (!turns.is_empty())
            .then(|| TurnCovariance { own: of(&own), with_position: of(&cross) }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Millimetres and milliradians, with a correlation between x and the turn about Y.
    fn rows(correlation: f64) -> [f64; 36] {
        let mut rows = [0.0; 36];
        for axis in 0..6 {
            rows[7 * axis] = if axis < 3 { 1e-6 } else { 4e-6 };
        }
        rows[4] = correlation * 2e-6;
        rows[24] = rows[4];
        rows
    }

    fn judged(rows: &[f64; 36]) -> (PoseCovariance, Vec<(&'static str, u64)>) {
        let mut counts = CovarianceCounts::default();
        let found = LoggedCovariance::Pose(*rows).judged(true, &mut counts);
        let some = counts.named().filter(|(_, count)| *count > 0);
        (found, some.collect())
    }

    #[test]
    fn a_covariance_is_read_whole_in_the_order_of_ros() {
        let (found, counts) = judged(&rows(0.5));
        assert_eq!(found.position, Some([1e-6, 0.0, 0.0, 1e-6, 0.0, 1e-6]));
        let turn = TurnCovariance {
            own: [4e-6, 0.0, 0.0, 4e-6, 0.0, 4e-6],
            // The row of x, the column of the rotation about Y.
            with_position: [0.0, 1e-6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        };
        assert_eq!(found.turn, Some(turn));
        assert_eq!(counts, [("position_covariances", 1), ("orientation_covariances", 1)]);
        // m² → mm², m·rad → mm·rad, rad² stays.
        let mm = found.scaled(1000.0, 1.0);
        let turn = mm.turn.expect("stated");
        let found = (mm.position.expect("stated")[0], turn.own[0], turn.with_position[1]);
        assert_eq!(found, (1.0, 4e-6, 1e-3));
        // Without orientations nobody asks for their part.
        let mut counts = CovarianceCounts::default();
        let found = LoggedCovariance::Pose(rows(0.5)).judged(false, &mut counts);
        assert_eq!((found.turn, counts.orientation.read), (None, 0));
    }

    #[test]
    fn what_is_unknown_or_none_is_counted_by_its_reason() {
        let part = |from: usize, entry: f64| {
            let mut rows = rows(0.0);
            for (row, column) in (0..3).flat_map(|row| (0..3).map(move |column| (row, column))) {
                rows[6 * (from + row) + from + column] = 0.0;
            }
            rows[7 * from] = entry;
            rows
        };
        let both = |why: &str| {
            [format!("position_covariances_{why}"), format!("orientation_covariances_{why}")]
        };
        let mut minus_one = rows(0.0);
        minus_one[0] = -1.0;
        for (rows, why) in [([0.0; 36], "all_zero"), (minus_one, "minus_one")] {
            let (found, counts) = judged(&rows);
            assert_eq!(found, PoseCovariance::default());
            let reasons: Vec<&str> = counts.iter().map(|(name, _)| *name).collect();
            assert!(both(why).iter().all(|name| reasons.contains(&&**name)), "{reasons:?}");
        }
        for (entry, why) in [(0.0, "all_zero"), (-1.0, "minus_one"), (-2e-6, "not_positive")] {
            let (found, counts) = judged(&part(3, entry));
            assert!(found.position.is_some() && found.turn.is_none());
            assert!(counts.iter().any(|(name, _)| *name == both(why)[1]), "{counts:?}");
            let (found, counts) = judged(&part(0, entry));
            assert_eq!(found.position, None);
            assert!(counts.iter().any(|(name, _)| *name == both(why)[0]), "{counts:?}");
        }
        // A correlation above 1, one side that is not the other's, a turn that is exact about one axis, NaN among the turns.
        let mut one_sided = rows(0.5);
        one_sided[24] = 0.0;
        let mut exact = rows(0.0);
        exact[35] = 0.0;
        let mut nan = rows(0.0);
        nan[28] = f64::NAN;
        for rows in [rows(1.1), one_sided, exact, nan] {
            let (found, counts) = judged(&rows);
            assert!(found.position.is_some() && found.turn.is_none(), "{found:?}");
            assert!(counts.contains(&("orientation_covariances_not_positive", 1)), "{counts:?}");
        }
        // On the edge, in single precision.
        #[expect(clippy::cast_possible_truncation, reason = "what a publisher does")]
        let single = rows(1.0).map(|entry| f64::from(entry as f32));
        assert!(judged(&single).0.turn.is_some());
    }

    #[test]
    fn a_mean_is_of_those_that_state_it() {
        let mut counts = CovarianceCounts::default();
        let mut at = |scale: f64| {
            LoggedCovariance::Pose(rows(0.5).map(|entry| scale * entry)).judged(true, &mut counts)
        };
        let all = [at(1.0), at(3.0), at(0.0)];
        let found = mean(&all);
        let turn = found.turn.expect("two");
        let own = [found.position.expect("two")[0], turn.own[0], turn.with_position[1]];
        for (own, expected) in own.into_iter().zip([2e-6, 8e-6, 2e-6]) {
            assert!((own / expected - 1.0).abs() < 1e-12, "{own} {expected}");
        }
        assert_eq!(mean(&all[2..]), PoseCovariance::default());
    }
}
