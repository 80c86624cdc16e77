//! The base in which a table's errors are stated, in the columns `error_frame` and those that begin so.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use crate::report::frame::StatedFrame;
use crate::table::words;

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

impl From<&StatedFrame> for ErrorFrameName {
    fn from(frame: &StatedFrame) -> Self {
        if frame.is_surveyed { Self::Surveyed } else { Self::Fitted }
    }
}

/// The frame that the columns of a row state: the base's name, its origin in the tracker's frame (mm) and orientation (x y z w), and
/// the standard deviations of both (mm, degrees) and of the lever to the tool (mm).
pub(crate) fn stated(
    name: ErrorFrameName,
    (origin, [x, y, z, w]): ([f64; 3], [f64; 4]),
    [sd_mm, sd_deg, lever_sd_mm]: [Option<f64>; 3],
) -> StatedFrame {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    StatedFrame {
        is_surveyed: name == ErrorFrameName::Surveyed,
        tracker_from_base: Isometry3::from_parts(Translation3::from(origin), rotation),
        sd_mm,
        sd_deg,
        lever_sd_mm,
        open_mm: None,
    }
}
