//! The errors of the join: what is wrong, where, both numbers, and what to try.

use thiserror::Error;

use crate::ingest::PosesError;

/// The reason why two logs cannot be joined.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum JoinError {
    /// A setting outside its range.
    #[error("[join] {key} = {found}, but it has to be {wanted}")]
    Setting {
        /// The setting's name in the pipeline file.
        key: &'static str,
        /// The value found.
        found: String,
        /// The allowed values.
        wanted: &'static str,
    },
    /// The joints that were logged are not the arm's.
    #[error(
        "the recording has {found} joint columns, but the arm {model:?} has {expected} joints: check [robot]"
    )]
    JointCount {
        /// The arm's model.
        model: String,
        /// Number of columns found.
        found: usize,
        /// Number of the arm's joints.
        expected: usize,
    },
    /// Samples that are not in order of time.
    #[error("{samples}: the stamps decrease at row {row}; they have to be in order of time")]
    OutOfOrder {
        /// The kind of samples.
        samples: &'static str,
        /// The first row whose stamp is before that of the row before it, from 0.
        row: usize,
    },
    /// Poses that were spilled to disk cannot be read back.
    #[error(transparent)]
    Poses(#[from] PosesError),
    /// A joint whose mean angle is not a number.
    #[error(
        "joint {joint:?} is not a finite number in the dwell that begins at sample {sample}: leave such messages out at ingest"
    )]
    AngleNotFinite {
        /// The joint's name.
        joint: String,
        /// The dwell's first sample, from 0.
        sample: usize,
    },
    /// Too few dwells to match anything.
    #[error(
        "{side} log: {found} dwells in {samples} samples over {span_s:.1} s (stationary: within {threshold} {unit} over \
         {window_s} s), but a join needs {needed}: check the topic and its unit, or set {key} in [join]"
    )]
    TooFewDwells {
        /// `controller` or `tracker`.
        side: &'static str,
        /// Dwells found.
        found: usize,
        /// Dwells needed.
        needed: usize,
        /// Number of samples.
        samples: usize,
        /// Time from the first to the last sample, s.
        span_s: f64,
        /// The stationary threshold used.
        threshold: f64,
        /// The threshold's unit.
        unit: &'static str,
        /// The stationary window, s.
        window_s: f64,
        /// The setting that changes it.
        key: &'static str,
    },
    /// No shift of the clocks explains the logs.
    #[error(
        "no clock offset makes the logs agree: of {arm_dwells} dwells of the arm and {target_dwells} of the target \
         the best shift leaves {pairs} pairs within {gate_mm} mm of the nominal arm (needed: {needed}{}). Do the logs \
         belong to one session, is it the right robot file, are positions in mm and angles in rad?",
        .median_mm.map_or(String::new(), |mm| format!("; median distance {mm:.1} mm"))
    )]
    NoCommonPattern {
        arm_dwells: usize,
        target_dwells: usize,
        /// Pairs that fit at the best shift.
        pairs: usize,
        /// Pairs needed.
        needed: usize,
        /// Median distance of all pairs at the best shift, mm; `None` where it could not be computed.
        median_mm: Option<f64>,
        /// The geometry gate, mm.
        gate_mm: f64,
    },
    /// Two shifts explain the logs equally well.
    #[error(
        "two clock offsets explain the logs equally well: {first_s:.3} s after the logs' starts ({first_pairs} pairs, \
         median {first_mm:.2} mm) and {second_s:.3} s ({second_pairs} pairs, {second_mm:.2} mm). Poses that repeat at \
         equal times cannot be distinguished: add an irregular move, or log the whole session on both sides"
    )]
    AmbiguousShift {
        /// First offset, tracker's first stamp against controller's first stamp, s.
        first_s: f64,
        /// Number of pairs at the first offset.
        first_pairs: usize,
        /// Median distance at the first offset, mm.
        first_mm: f64,
        /// Second offset, s.
        second_s: f64,
        /// Number of pairs at the second offset.
        second_pairs: usize,
        /// Median distance at the second offset, mm.
        second_mm: f64,
    },
}
