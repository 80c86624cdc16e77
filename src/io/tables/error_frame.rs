//! The base in which a table's errors are stated, in the form of its rows.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use super::words::placement;
use crate::fit::ErrorBase;
use crate::io::table::words;
use crate::io::tables::outcome::Outcome;
use crate::kinematics::{Motion, Parameter};
use crate::report::Model;
use crate::report::frame::StatedFrame;

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

/// The frame that the columns `error_frame` and those that begin so state.
pub fn stated(
    name: ErrorFrameName,
    (origin, turn): ([f64; 3], [f64; 4]),
    [sd_mm, sd_deg]: [Option<f64>; 2],
) -> StatedFrame {
    let [x, y, z, w] = turn;
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    StatedFrame {
        is_surveyed: name == ErrorFrameName::Surveyed,
        tracker_from_base: Isometry3::from_parts(Translation3::from(origin), rotation),
        sd_mm,
        sd_deg,
    }
}

/// The frame that a run's results hold in.
pub fn of(outcome: &Outcome<'_>) -> StatedFrame {
    ErrorFrameOf::new(outcome).stated()
}

/// Values of the columns `error_frame` and those that begin so.
#[derive(Debug, Clone, Copy)]
pub(super) struct ErrorFrameOf {
    pub name: ErrorFrameName,
    /// Origin of the base in the tracker's frame, mm, and its orientation, x y z w.
    pub base: ([f64; 3], [f64; 4]),
    /// The measured target in the flange's frame, mm.
    pub target: [f64; 3],
    /// Standard deviation of the base's origin, mm: as stated, or of the fit.
    pub sd_mm: Option<f64>,
    /// Standard deviation of the base's rotation, degrees: as stated, or of the fit.
    pub sd_deg: Option<f64>,
}

/// Standard deviations of a fitted base's origin, mm, and rotation, degrees: roots of the sums of variances along three axes.
fn fitted_sd(outcome: &Outcome<'_>) -> (f64, f64) {
    let last = outcome.training.len() - 1;
    let base_target = outcome
        .calibrations
        .iter()
        .find(|(model, _)| *model == Model::BaseTarget);
    let mut variances = [0.0; 2];
    let calibration = base_target.map(|(_, calibration)| calibration);
    let unknowns = calibration
        .iter()
        .flat_map(|own| own.unknowns.iter().enumerate());
    for (place, unknown) in unknowns.filter(|(_, unknown)| unknown.session() == Some(last)) {
        let variance = calibration.map_or(0.0, |own| own.standard_error(place).powi(2));
        match unknown.parameter {
            Parameter::Base(Motion::Translation(_)) => variances[0] += variance,
            Parameter::Base(Motion::Rotation(_)) => variances[1] += variance,
            Parameter::Link { .. } | Parameter::Target(_) => {}
        }
    }
    (variances[0].sqrt(), variances[1].sqrt().to_degrees())
}

impl ErrorFrameOf {
    /// The frame in words and in the forms that people type.
    pub(super) fn stated(&self) -> StatedFrame {
        stated(self.name, self.base, [self.sd_mm, self.sd_deg])
    }

    pub(super) fn new(outcome: &Outcome<'_>) -> Self {
        let frames = outcome.error_frame.frames();
        let (name, sd_mm, sd_deg) = match &outcome.base {
            ErrorBase::Fitted => {
                let (sd_mm, sd_deg) = fitted_sd(outcome);
                (ErrorFrameName::Fitted, Some(sd_mm), Some(sd_deg))
            }
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
