//! The base in which a table's errors are stated, in the columns `error_frame` and those that begin so.

use nalgebra::{Isometry3, UnitQuaternion};

use crate::report::frame::StatedFrame;
use crate::rows::{columns, words};

words! {
    pub enum ErrorFrameName {
        /// The base of base + target: the program's base has to be set to it.
        Fitted: "fitted",
        /// Surveyed: the program's own base.
        Surveyed: "surveyed",
    }
}

columns! {
    /// Columns of a table whose errors are stated in one base.
    pub struct ErrorFrameColumns {
        error_frame: ErrorFrameName,
        error_frame_base as placement: Isometry3<f64>,
        error_frame_sd_mm: Option<f64>,
        error_frame_sd_deg: Option<f64>,
        error_frame_lever_sd_mm: Option<f64>,
    }
}

impl From<&StatedFrame> for ErrorFrameColumns {
    fn from(frame: &StatedFrame) -> Self {
        let is_surveyed = frame.is_surveyed;
        Self {
            error_frame: if is_surveyed {
                ErrorFrameName::Surveyed
            } else {
                ErrorFrameName::Fitted
            },
            error_frame_base: frame.tracker_from_base,
            error_frame_sd_mm: frame.sd_mm,
            error_frame_sd_deg: frame.sd_deg,
            error_frame_lever_sd_mm: frame.lever_sd_mm,
        }
    }
}

impl ErrorFrameColumns {
    pub fn stated(&self) -> StatedFrame {
        let Isometry3 { translation, rotation } = self.error_frame_base;
        let rotation = UnitQuaternion::from_quaternion(rotation.into_inner());
        StatedFrame {
            is_surveyed: self.error_frame == ErrorFrameName::Surveyed,
            tracker_from_base: Isometry3::from_parts(translation, rotation),
            sd_mm: self.error_frame_sd_mm,
            sd_deg: self.error_frame_sd_deg,
            lever_sd_mm: self.error_frame_lever_sd_mm,
            open_mm: None,
        }
    }
}
