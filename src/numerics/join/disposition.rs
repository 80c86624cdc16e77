//! Dispositions: the class of each reading → counts, and the runs of readings that are in no mean.

use std::collections::BTreeMap;
use std::ops::Range;

use super::{JoinError, JoinReject, ReadingCounts, RejectCode, Unmeasured};
use crate::units::{Stamp, Tracker};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Disposition {
    Kept,
    Settling,
    Outlier,
    Moving,
    Unpaired(Why),
    Missing,
    /// The last reading again while the arm moved.
    Repeated,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Why {
    NoArmDwell,
    WrongTarget,
    /// It is too far from the arm, as others in a row are: the instrument or the base stood elsewhere.
    InstrumentMoved,
    /// The target was at two positions during one dwell.
    Ambiguous,
    TooFew,
}

/// The reason of readings that are the last one again while the arm moved.
pub const REPEATED: &str =
    "repeated: the reading before it again, while the arm moved: the beam was lost";

impl Disposition {
    /// Why readings are left out, in a word and in full; `None` of those that are kept.
    const fn reason(self) -> Option<(RejectCode, &'static str)> {
        Some(match self {
            Self::Kept => return None,
            Self::Settling => {
                (RejectCode::Settling, "settling: before settle_s after the arm became stationary")
            }
            Self::Outlier => {
                (RejectCode::Outlier, "outlier: beyond mad_factor from the median of its dwell")
            }
            Self::Moving => (RejectCode::Moving, "moving: the target was not stationary"),
            Self::Missing => {
                (RejectCode::Missing, "missing: zeros or not a number, no measurement")
            }
            Self::Repeated => (RejectCode::Repeated, REPEATED),
            Self::Unpaired(why) => why.reason(),
        })
    }
}

impl Why {
    const fn reason(self) -> (RejectCode, &'static str) {
        match self {
            Self::NoArmDwell => (
                RejectCode::NoArmDwell,
                "unpaired: the target was stationary, but the arm was not, or the controller's log does not reach there",
            ),
            Self::WrongTarget => (
                RejectCode::WRONG_TARGET,
                "unpaired: too far from the arm's position: another reflector or a lost beam",
            ),
            Self::InstrumentMoved => (
                RejectCode::MOVED,
                "instrument_moved: too far from the arm's position, with which it agrees once the base is placed anew: the instrument or \
                 the base was moved, and no reference tells how",
            ),
            Self::Ambiguous => (
                RejectCode::SeveralCandidates,
                "unpaired: the target was stationary in more than one place during one dwell of the arm",
            ),
            Self::TooFew => (
                RejectCode::Unmeasured(Unmeasured::TooFewReadings),
                "unpaired: fewer than min_readings were left after settling and outliers",
            ),
        }
    }
}

#[derive(Debug, Clone, Default)]
pub struct Dispositions {
    /// Each run reaches from its first row to the next run's.
    runs: BTreeMap<usize, Disposition>,
    end: usize,
}

impl Dispositions {
    pub fn new(readings: usize) -> Self {
        Self { runs: BTreeMap::from([(0, Disposition::Moving)]), end: readings }
    }

    pub fn set(&mut self, rows: Range<usize>, disposition: Disposition) {
        if rows.is_empty() {
            return;
        }
        let behind = self.runs.range(..=rows.end).next_back().map(|(_, &disposition)| disposition);
        while let Some((&covered, _)) = self.runs.range(rows.clone()).next() {
            self.runs.remove(&covered);
        }
        self.runs.insert(rows.start, disposition);
        if let Some(behind) = behind.filter(|_| rows.end < self.end) {
            self.runs.entry(rows.end).or_insert(behind);
        }
    }

    /// Sets the dispositions of single rows, given in order.
    pub(super) fn set_each(&mut self, each: impl IntoIterator<Item = (usize, Disposition)>) {
        let mut run = (0..0, Disposition::Moving);
        for (row, disposition) in each {
            if run.0.end == row && run.1 == disposition {
                run.0.end += 1;
            } else {
                self.set(run.0, run.1);
                run = (row..row + 1, disposition);
            }
        }
        self.set(run.0, run.1);
    }

    fn runs(&self) -> Vec<(Range<usize>, Disposition)> {
        let ends = self.runs.keys().skip(1).copied().chain([self.end]);
        let mut runs: Vec<(Range<usize>, Disposition)> = Vec::new();
        for ((&start, &disposition), end) in self.runs.iter().zip(ends) {
            match runs.last_mut() {
                Some((rows, before)) if *before == disposition => rows.end = end,
                _ => runs.push((start..end, disposition)),
            }
        }
        runs.retain(|(rows, _)| !rows.is_empty());
        runs
    }

    /// Readings by verdict; the sum is the number of readings.
    pub fn counts(&self) -> ReadingCounts {
        let mut counts = ReadingCounts::default();
        for (rows, disposition) in self.runs() {
            *match disposition {
                Disposition::Kept => &mut counts.kept,
                Disposition::Settling => &mut counts.settling,
                Disposition::Outlier => &mut counts.outlier,
                Disposition::Moving => &mut counts.moving,
                Disposition::Unpaired(_) => &mut counts.unpaired,
                Disposition::Missing | Disposition::Repeated => &mut counts.missing,
            } += rows.len() as u64;
        }
        counts
    }

    /// One reject for each run of readings with the same disposition that were not kept; `stamp` is that of a row.
    pub fn rejects(
        &self,
        stamp: impl Fn(usize) -> Result<Stamp<Tracker>, JoinError>,
    ) -> Result<Vec<JoinReject>, JoinError> {
        let runs = self.runs().into_iter();
        let rejected = runs.filter_map(|(rows, own)| Some((rows, own.reason()?)));
        let reject = |(rows, (code, reason)): (Range<usize>, (RejectCode, &str))| {
            Ok(JoinReject {
                start: stamp(rows.start)?,
                end: stamp(rows.end - 1)?,
                readings: rows.len() as u64,
                is_of_reference: false,
                code,
                reason: reason.to_owned(),
            })
        };
        rejected.map(reject).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs set at random places equal an array with a disposition for each reading.
    #[test]
    fn runs_equal_an_array_with_a_disposition_for_each_reading() {
        const DISPOSITIONS: [Disposition; 4] =
            [Disposition::Kept, Disposition::Outlier, Disposition::Missing, Disposition::Settling];
        let mut state = 1_u64;
        let mut next = |below: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            usize::try_from(state >> 33).expect("31 bits") % below
        };
        for readings in [0, 1, 2, 50] {
            let (mut dispositions, mut each) =
                (Dispositions::new(readings), vec![Disposition::Moving; readings]);
            for _ in 0..300 {
                let (a, b) = (next(readings + 1), next(readings + 1));
                let (rows, disposition) =
                    (a.min(b)..a.max(b), DISPOSITIONS[next(DISPOSITIONS.len())]);
                dispositions.set(rows.clone(), disposition);
                each[rows].fill(disposition);
                let mut expected = Vec::new();
                let mut start = 0;
                for run in each.chunk_by(|a, b| a == b) {
                    expected.push((start..start + run.len(), run[0]));
                    start += run.len();
                }
                assert_eq!(dispositions.runs(), expected);
            }
        }
    }
}
