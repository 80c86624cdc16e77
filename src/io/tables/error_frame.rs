//! The base in which a table's errors are stated, in the form of its rows.

use super::words::placement;
use crate::fit::ErrorBase;
use crate::io::table::words;
use crate::io::tables::outcome::Outcome;

/// The base in which errors are stated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorFrameName {
    /// The base of base + target: the program's base has to be set to it.
    Fitted,
    /// Surveyed: the program's own base.
    Surveyed,
}

words! {
    ErrorFrameName { Fitted: "fitted", Surveyed: "surveyed" }
}

/// Values of the columns `error_frame` and `error_frame_…`.
#[derive(Debug, Clone, Copy)]
pub(super) struct ErrorFrameOf {
    pub name: ErrorFrameName,
    /// Origin of the base in the tracker's frame, mm, and its orientation, x y z w.
    pub base: ([f64; 3], [f64; 4]),
    /// The measured target in the flange's frame, mm.
    pub target: [f64; 3],
    /// Standard deviation of a surveyed base's origin, mm.
    pub sd_mm: Option<f64>,
    /// Standard deviation of a surveyed base's rotation, degrees.
    pub sd_deg: Option<f64>,
}

impl ErrorFrameOf {
    pub(super) fn new(outcome: &Outcome<'_>) -> Self {
        let frames = outcome.error_frame.frames();
        let (name, sd_mm, sd_deg) = match &outcome.base {
            ErrorBase::Fitted => (ErrorFrameName::Fitted, None, None),
            ErrorBase::Surveyed(base) => (
                ErrorFrameName::Surveyed,
                base.sd_mm,
                base.sd_rad.map(f64::to_degrees),
            ),
        };
        Self {
            name,
            base: placement(frames.tracker_from_base.isometry()),
            target: placement(frames.flange_from_target.isometry()).0,
            sd_mm,
            sd_deg,
        }
    }
}
