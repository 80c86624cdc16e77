//! Fates: what became of each reading → counts, and the runs of readings that no mean took.

use super::{JoinReject, ReadingCounts};
use crate::units::{Stamp, Tracker};

/// What became of one reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// Part of a station's mean.
    Kept,
    /// Before the settling time was over.
    Settling,
    /// An outlier of its dwell.
    Outlier,
    /// Taken while the target moved.
    Moving,
    /// At rest, but no station took it.
    Unpaired(Why),
    /// No measurement: zeros, or not a number.
    Missing,
}

/// Why no station took a reading at rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Why {
    /// The arm moved, or the controller's log does not reach there.
    NoArmDwell,
    /// Too far from where the arm was.
    WrongTarget,
    /// Two positions during one dwell.
    Ambiguous,
    /// Too few readings were left for a mean.
    TooFew,
}

impl Fate {
    const fn reason(self) -> &'static str {
        match self {
            Self::Kept => "kept",
            Self::Settling => "settling: before settle_s after the arm came to rest",
            Self::Outlier => "outlier: beyond mad_factor from the median of its dwell",
            Self::Moving => "moving: the target was not at rest",
            Self::Missing => "missing: zeros or not a number, no measurement",
            Self::Unpaired(Why::NoArmDwell) => {
                "unpaired: the target was at rest, but the arm was not, or the controller's log does not reach there"
            }
            Self::Unpaired(Why::WrongTarget) => {
                "unpaired: too far from where the arm was: another reflector or a lost beam"
            }
            Self::Unpaired(Why::Ambiguous) => {
                "unpaired: the target rested in more than one place during one dwell of the arm"
            }
            Self::Unpaired(Why::TooFew) => {
                "unpaired: fewer than min_readings were left after settling and outliers"
            }
        }
    }
}

/// Readings by verdict; the sum is the number of fates.
pub fn counts(fates: &[Fate]) -> ReadingCounts {
    let mut counts = ReadingCounts::default();
    for fate in fates {
        *match fate {
            Fate::Kept => &mut counts.kept,
            Fate::Settling => &mut counts.settling,
            Fate::Outlier => &mut counts.outlier,
            Fate::Moving => &mut counts.moving,
            Fate::Unpaired(_) => &mut counts.unpaired,
            Fate::Missing => &mut counts.missing,
        } += 1;
    }
    counts
}

/// One reject for each run of readings with the same fate that were not kept.
pub fn rejects(fates: &[Fate], stamps: &[Stamp<Tracker>]) -> Vec<JoinReject> {
    let mut rejects = Vec::new();
    let mut first = 0;
    for run in fates.chunk_by(|a, b| a == b) {
        let end = first + run.len();
        if run[0] != Fate::Kept {
            rejects.push(JoinReject {
                start: stamps[first],
                end: stamps[end - 1],
                readings: run.len() as u64,
                reason: run[0].reason().to_owned(),
            });
        }
        first = end;
    }
    rejects
}
