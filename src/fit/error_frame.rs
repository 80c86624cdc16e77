//! The error reference frame in which errors are stated: the nominal arm on a base that is surveyed or fitted
//! ([`crate::method::compensation`]).
//!
//! An error is attained minus commanded position in the controller's base frame. The target is a point of its own; the
//! controller's tool point follows from it by the lever between the two, turned as the flange really is where the
//! target's orientation was measured, and as the nominal arm says where it was not. A error reference frame is for one tool point, so it goes by one
//! source and one target.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use super::frames::FramePair;
use crate::join::{Reading, Station};
use crate::kinematics::Arm;

/// The base frame that errors are stated in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ErrorBase {
    /// That of base + target: of use to a program whose base is set to it.
    Fitted,
    /// Surveyed: where the program's base stands.
    Surveyed(SurveyedBase),
}

/// A base that was measured by other means.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurveyedBase {
    /// Where the base stands in the tracker's frame, mm.
    pub tracker_from_base: Isometry3<f64>,
    /// Standard deviation of its origin, mm, where it is stated.
    pub sd_mm: Option<f64>,
    /// Standard deviation of its rotation, rad, where it is stated.
    pub sd_rad: Option<f64>,
}

impl SurveyedBase {
    /// Expanded uncertainty (k = 2) that the survey leaves at a point so far from the base's origin, mm: `2 √(sd² + (sd_rad · distance)²)`.
    /// What is not stated counts as none.
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
    /// The error reference frame of the nominal `arm` with the frames of a base + target fit.
    ///
    /// `flange_from_tool` is the controller's own tool point; without one it is the target itself. `oriented` says that
    /// the frames' target orientation was fitted, so that measured orientations mean something.
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

    /// The frames of the base + target fit, of the source and the target that errors are stated by.
    pub const fn frames(&self) -> &FramePair {
        &self.frames
    }

    /// The controller's own tool at the flange.
    pub const fn flange_from_tool(&self) -> &Isometry3<f64> {
        &self.flange_from_tool
    }

    /// From target to tool point, along the flange's axes, mm.
    pub fn lever(&self) -> Vector3<f64> {
        self.flange_from_tool.translation.vector
            - self.frames.flange_from_target.isometry().translation.vector
    }

    /// The nominal tool pose at reported joint angles, in the base frame.
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

    /// Where the nominal arm has the target at reported joint angles, in the base frame.
    pub fn nominal_target(&self, joints: &[f64]) -> Point3<f64> {
        self.arm.flange(joints).isometry()
            * Point3::from(self.frames.flange_from_target.isometry().translation.vector)
    }

    /// Error of the measured point: measured minus nominal target, mm. `None` of a reading without a position.
    pub fn target_error(&self, joints: &[f64], reading: &Reading) -> Option<Vector3<f64>> {
        Some(self.measured_target(reading)? - self.nominal_target(joints))
    }

    /// Where the tool point was attained, in the base frame. `None` of a reading without a position.
    pub fn attained_tool(&self, joints: &[f64], reading: &Reading) -> Option<Point3<f64>> {
        let target = self.measured_target(reading)?;
        Some(target + self.flange_rotation(joints, reading) * self.lever())
    }

    /// Error of the tool point against where it was commanded, in the base frame: attained minus commanded, mm. `None` for a
    /// station without a measurement.
    pub fn tool_error(&self, station: &Station, commanded: &Point3<f64>) -> Option<Vector3<f64>> {
        let attained = self.attained_tool(&station.joints, station.one_reading()?)?;
        Some(attained - commanded)
    }

    /// How the flange's axes stood in the base's; `None` where no orientation was measured, or none was fitted.
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
