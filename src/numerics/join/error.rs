//! The errors of the join: what is wrong, where, both numbers, and what to try.

use nalgebra::Vector3;
use thiserror::Error;

use super::moved::clock_words;
use crate::ingest::PosesError;
use crate::kinematics::Joint;
use crate::units::{Controller, Stamp};

#[derive(Debug, Clone, PartialEq, Error)]
pub enum JoinError {
    #[error(
        "the recording has {found} joint columns, but the arm {model:?} has {expected} joints: check [robot]"
    )]
    JointCount { model: String, found: usize, expected: usize },
    #[error("{samples}: the stamps decrease at row {row}; they have to be in order of time")]
    OutOfOrder {
        samples: &'static str,
        /// The first row whose stamp is before that of the row before it, from 0.
        row: usize,
    },
    #[error(transparent)]
    Poses(#[from] PosesError),
    #[error(
        "joint {joint:?} is not a finite number in the dwell that begins at sample {sample}: leave such messages out at ingest"
    )]
    AngleNotFinite { joint: String, sample: usize },
    #[error(
        "{side} log: {found} dwells in {samples} samples over {span_s:.1} s (stationary: within {threshold} {unit} over \
         {window_s} s), but a join needs {needed}: {advice}"
    )]
    TooFewDwells {
        side: &'static str,
        found: usize,
        needed: usize,
        samples: usize,
        span_s: f64,
        threshold: f64,
        unit: &'static str,
        window_s: f64,
        advice: String,
    },
    #[error(
        "no clock offset makes the logs agree: of {arm_dwells} dwells of the arm and {target_dwells} of the target \
         the best shift leaves {pairs} pairs within {gate_mm} mm of the nominal arm (needed: {needed}{}). Do the logs \
         belong to one session, is it the right robot file, are positions in mm and angles in rad?",
        .median_mm.map_or(String::new(), |mm| format!("; median distance {mm:.1} mm"))
    )]
    NoCommonPattern {
        arm_dwells: usize,
        target_dwells: usize,
        pairs: usize,
        needed: usize,
        /// Median distance of all pairs at the best shift, mm; `None` where it could not be computed.
        median_mm: Option<f64>,
        gate_mm: f64,
    },
    #[error(
        "two clock offsets explain the logs equally well: {first_s:.3} s after the logs' starts ({first_pairs} pairs, \
         median {first_mm:.2} mm) and {second_s:.3} s ({second_pairs} pairs, {second_mm:.2} mm). Poses that repeat at \
         equal times cannot be distinguished: add an irregular move, or log the whole session on both sides"
    )]
    AmbiguousShift {
        first_s: f64,
        first_pairs: usize,
        first_mm: f64,
        second_s: f64,
        second_pairs: usize,
        second_mm: f64,
    },
    #[error(
        "joint {joint:?} slipped before station {station}{at}{or}: behind it the readings agree with an arm whose joint stands {by} (two \
         standard errors) further than it reports. No calibration holds before and behind: master the joint, and measure again"
    )]
    Slipped {
        joint: String,
        by: String,
        station: usize,
        at: String,
        /// What the readings cannot distinguish from it, in words.
        or: &'static str,
    },
    #[error(
        "the target stands elsewhere on the flange from station {station}{at} on, by [{}] mm (two standard errors): another reflector, or it was \
         mounted anew. Give the stations on the two sides as two sessions, the second with its own [fit] target",
        by.join(", ")
    )]
    Remounted { by: [String; 3], station: usize, at: String },
    #[error(
        "what joint {joint:?} reports stepped by {by} before station {station}{at}, while its commands did not: its encoder slipped, the arm no \
         longer goes where it is commanded, or the controller's tool or base was changed by a turn about that axis. No calibration holds before \
         and behind: master the joint, and measure again, or leave out the stations on one side"
    )]
    ReportStepped { joint: String, by: String, station: usize, at: String },
}

impl JoinError {
    /// The target stands elsewhere from a station on, by a way and its standard deviations, mm.
    pub fn remounted(
        [by, sd]: [Vector3<f64>; 2],
        (station, at): (usize, Option<Stamp<Controller>>),
    ) -> Self {
        let by = [0, 1, 2].map(|axis| format!("{:.3} ± {:.3}", by[axis], 2.0 * sd[axis]));
        Self::Remounted { by, station, at: at.map_or_else(String::new, clock_words) }
    }

    /// A joint stands `by` further than it reports from a station on, with the standard deviation of that, rad; mm where it slides.
    pub fn slipped(
        joint: &Joint,
        (by, sd): (f64, f64),
        (station, at): (usize, Option<Stamp<Controller>>),
        or: &'static str,
    ) -> Self {
        let [by, two_sd] = [by, 2.0 * sd].map(|own| joint.shown(own));
        Self::Slipped {
            joint: joint.name.clone(),
            by: format!("{by:.4} ± {two_sd:.4}{}", joint.sign_of_unit()),
            station,
            at: at.map_or_else(String::new, clock_words),
            or,
        }
    }
}
