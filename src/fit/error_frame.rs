//! The error reference frame in which errors are stated: the nominal arm on a base that is surveyed or fitted
//! ([`crate::method::compensation`]).
//!
//! An error is attained minus commanded position in the controller's base frame. The measured target is a separate point;
//! the controller's tool point is calculated from it with the lever between the two. The lever has the flange's measured
//! orientation where one was measured, otherwise the nominal arm's. An error reference frame is for one tool point, so it goes
//! by one source and one target.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use super::frames::FramePair;
use crate::join::{Reading, Station};
use crate::kinematics::Arm;

/// The base frame that errors are stated in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ErrorBase {
    /// The base of the base + target fit, for programs whose base is set to it.
    Fitted,
    /// The surveyed base, which is the program's base.
    Surveyed(SurveyedBase),
}

/// A base that was measured by other means.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurveyedBase {
    /// Pose of the base in the tracker frame, mm.
    pub tracker_from_base: Isometry3<f64>,
    /// Standard deviation of its origin, mm; absent where it is not stated.
    pub sd_mm: Option<f64>,
    /// Standard deviation of its rotation, rad; absent where it is not stated.
    pub sd_rad: Option<f64>,
}

impl SurveyedBase {
    /// Expanded uncertainty (k = 2) of the survey at a point at `distance_mm` from the base's origin, mm: `2 √(sd² + (sd_rad ·
    /// distance)²)`. A standard deviation that is not stated counts as zero.
    pub fn expanded_uncertainty_mm(&self, distance_mm: f64) -> f64 {
        let turned_mm = self.sd_rad.unwrap_or_default() * distance_mm;
        2.0 * self.sd_mm.unwrap_or_default().hypot(turned_mm)
    }
}

/// The error reference frame of one session.
#[derive(Debug, Clone)]
pub struct ErrorFrame<'a> {
    arm: &'a Arm,
    frames: FramePair,
    flange_from_tool: Isometry3<f64>,
    oriented: bool,
}

impl<'a> ErrorFrame<'a> {
    /// The error reference frame of the nominal `arm` with the `frames` that errors are stated in.
    ///
    /// `flange_from_tool` is the controller's own tool point; without one it is the measured target. `oriented` states whether
    /// the target's orientation on the flange was fitted, so that measured orientations can be used.
    pub fn new(
        arm: &'a Arm,
        frames: FramePair,
        flange_from_tool: Option<Isometry3<f64>>,
        oriented: bool,
    ) -> Self {
        let target = frames.flange_from_target.isometry().translation;
        let at_target = Isometry3::from_parts(target, UnitQuaternion::identity());
        Self {
            arm,
            frames,
            flange_from_tool: flange_from_tool.unwrap_or(at_target),
            oriented,
        }
    }

    /// The nominal arm.
    pub const fn arm(&self) -> &'a Arm {
        self.arm
    }

    /// The base, surveyed or fitted, and the measured target on the flange that errors are stated by.
    pub const fn frames(&self) -> &FramePair {
        &self.frames
    }

    /// The controller's own tool in the flange frame, mm.
    pub const fn flange_from_tool(&self) -> &Isometry3<f64> {
        &self.flange_from_tool
    }

    /// The vector from the measured target to the tool point, along the flange's axes, mm.
    pub fn lever(&self) -> Vector3<f64> {
        self.flange_from_tool.translation.vector
            - self.frames.flange_from_target.isometry().translation.vector
    }

    /// The nominal tool pose at reported joint angles (rad), in the base frame, mm.
    pub fn nominal_tool(&self, joints: &[f64]) -> Isometry3<f64> {
        self.arm.flange(joints).isometry() * self.flange_from_tool
    }

    /// The measured target in the base frame; `None` of a reading without a position, or of another source or target.
    fn measured_target(&self, reading: &Reading) -> Option<Point3<f64>> {
        let own = (reading.source, reading.target) == (self.frames.source, self.frames.target);
        let position = reading.position().filter(|_| own)?;
        let base = self.frames.tracker_from_base.isometry();
        Some(base.inverse_transform_point(&position))
    }

    /// The nominal arm's target position at reported joint angles (rad), in the base frame, mm.
    pub fn nominal_target(&self, joints: &[f64]) -> Point3<f64> {
        self.arm.flange(joints).isometry()
            * Point3::from(self.frames.flange_from_target.isometry().translation.vector)
    }

    /// Error of the measured point: measured minus nominal target, mm. `None` of a reading without a position.
    pub fn target_error(&self, joints: &[f64], reading: &Reading) -> Option<Vector3<f64>> {
        Some(self.measured_target(reading)? - self.nominal_target(joints))
    }

    /// The attained position of the tool point, in the base frame, mm. `None` of a reading without a position.
    pub fn attained_tool(&self, joints: &[f64], reading: &Reading) -> Option<Point3<f64>> {
        let target = self.measured_target(reading)?;
        Some(target + self.flange_rotation(joints, reading) * self.lever())
    }

    /// Error of the tool point in the base frame: attained minus commanded position, mm. `None` for a
    /// station without a measurement.
    pub fn tool_error(&self, station: &Station, commanded: &Point3<f64>) -> Option<Vector3<f64>> {
        let attained = self.attained_tool(&station.joints, station.one_reading()?)?;
        Some(attained - commanded)
    }

    /// The measured orientation of the flange in the base frame; `None` where no orientation was measured or fitted.
    pub fn measured_flange(&self, reading: &Reading) -> Option<UnitQuaternion<f64>> {
        let in_tracker = reading.orientation().filter(|_| self.oriented)?;
        let in_base = self.frames.tracker_from_base.isometry().rotation.inverse() * in_tracker;
        Some(in_base * self.frames.flange_from_target.isometry().rotation.inverse())
    }

    fn flange_rotation(&self, joints: &[f64], reading: &Reading) -> UnitQuaternion<f64> {
        self.measured_flange(reading)
            .unwrap_or_else(|| self.arm.flange(joints).isometry().rotation)
    }
}
