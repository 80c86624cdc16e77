//! The error reference frame in which errors are stated: the nominal arm on a base that is surveyed or fitted
//! ([`crate::method::compensation`]).
//!
//! An error is attained minus commanded position in the controller's base frame. The controller's tool point follows from the
//! measured target by the lever between the two. The lever has the flange's measured orientation where one was measured,
//! otherwise the nominal arm's. An error reference frame is for one tool point, so it goes by one source and one target.

use nalgebra::{Isometry3, Matrix3, Point3, UnitQuaternion, Vector3};

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

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurveyedBase {
    pub tracker_from_base: Isometry3<f64>,
    pub sd_mm: Option<f64>,
    /// Standard deviation of its rotation about each axis, rad; absent where it is not stated.
    pub sd_rad: Option<f64>,
}

impl SurveyedBase {
    /// The uncertainty that the survey leaves, with that of a lever (`lever_sd_mm`, mm in each coordinate); what is not stated is zero.
    pub fn uncertainty(&self, lever_sd_mm: Option<f64>) -> FrameUncertainty {
        FrameUncertainty {
            origin_mm: self.sd_mm.unwrap_or_default(),
            rotation_rad: self.sd_rad.unwrap_or_default(),
            lever_mm: lever_sd_mm.unwrap_or_default(),
        }
    }
}

/// Standard uncertainty of a surveyed error reference frame, of where the base is, and of where the measured target is beside the
/// tool, along and about each axis alone. Zero where the frame was fitted, and where it is not stated.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FrameUncertainty {
    pub origin_mm: f64,
    /// Standard deviation of the base's rotation about each axis through its origin, rad.
    pub rotation_rad: f64,
    pub lever_mm: f64,
}

impl FrameUncertainty {
    /// Covariance of the error of a tool point at `position` in the base frame, mm²: `(origin² + lever²) I + rotation² (|p|² I − p pᵀ)`.
    /// Between two points it is alike where they are near: the frame is off by one motion, whatever is measured in it.
    pub fn covariance(&self, position: &Point3<f64>) -> Matrix3<f64> {
        let p = position.coords;
        let across = Matrix3::identity() * p.norm_squared() - p * p.transpose();
        Matrix3::identity() * (self.origin_mm.powi(2) + self.lever_mm.powi(2))
            + across * self.rotation_rad.powi(2)
    }

    /// Expanded uncertainty (k = 2) in the worst direction, which is across the way to the point, at `distance_mm` from the base's
    /// origin, mm: twice the root of the largest eigenvalue of [`Self::covariance`].
    pub fn expanded_uncertainty_mm(&self, distance_mm: f64) -> f64 {
        2.0 * self.covariance(&Point3::new(distance_mm, 0.0, 0.0)).m22.sqrt()
    }
}

#[derive(Debug, Clone)]
pub struct ErrorFrame<'a> {
    pub arm: &'a Arm,
    pub frames: FramePair,
    /// The controller's own tool in the flange frame, mm.
    pub flange_from_tool: Isometry3<f64>,
    pub tool_is_stated: bool,
    pub(crate) oriented: bool,
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
            tool_is_stated: flange_from_tool.is_some(),
            oriented,
        }
    }

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
        Some(self.frames.tracker_from_base.isometry().inverse_transform_point(&position))
    }

    pub fn nominal_target(&self, joints: &[f64]) -> Point3<f64> {
        self.arm.flange(joints).isometry()
            * Point3::from(self.frames.flange_from_target.isometry().translation.vector)
    }

    /// The attained position of the tool point, in the base frame, mm. `None` of a reading without a position.
    pub fn attained_tool(&self, joints: &[f64], reading: &Reading) -> Option<Point3<f64>> {
        let target = self.measured_target(reading)?;
        let flange = self.measured_flange(reading);
        let flange = flange.unwrap_or_else(|| self.arm.flange(joints).isometry().rotation);
        Some(target + flange * self.lever())
    }

    /// Error of the tool point in the base frame: attained minus commanded position, mm. `None` without a measurement.
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_survey_leaves_most_across_the_way_to_a_point() {
        let frame = FrameUncertainty { origin_mm: 0.03, rotation_rad: 2e-5, lever_mm: 0.04 };
        // 2 m along x: 0.05 mm everywhere, and 0.02 mrad at 2 m, 0.04 mm, along y and z.
        let along_x = frame.covariance(&Point3::new(2000.0, 0.0, 0.0));
        let expected = Vector3::new(0.0025, 0.0041, 0.0041);
        assert!((along_x - Matrix3::from_diagonal(&expected)).abs().max() < 1e-15);
        assert!((frame.expanded_uncertainty_mm(2000.0) - 2.0 * 0.0041_f64.sqrt()).abs() < 1e-12);
        // In any direction: the variance is least along the way, and the worst is what U counts.
        let at = Point3::new(-1200.0, 900.0, 500.0);
        let covariance = frame.covariance(&at);
        let way = at.coords.normalize();
        assert!((covariance * way - way * 0.0025).norm() < 1e-15);
        let worst = covariance.symmetric_eigenvalues().max();
        let u = frame.expanded_uncertainty_mm(at.coords.norm());
        assert!((2.0 * worst.sqrt() - u).abs() < 1e-12);
    }

    #[test]
    fn the_covariance_is_that_of_points_seen_from_a_base_that_is_off() {
        let frame = FrameUncertainty { origin_mm: 0.02, rotation_rad: 5e-6, lever_mm: 0.0 };
        let at = Point3::new(1500.0, -700.0, 900.0);
        // A base off by one standard deviation along or about each axis in turn: six independent parts, whose squares add up.
        let part = |axis: usize| {
            let mut six = [0.0; 6];
            six[axis] = if axis < 3 { 0.02 } else { 5e-6 };
            let shift = Vector3::new(six[0], six[1], six[2]);
            let turn = Vector3::new(six[3], six[4], six[5]);
            let off = Isometry3::new(shift, turn).inverse_transform_point(&at) - at;
            off * off.transpose()
        };
        let sum: Matrix3<f64> = (0..6).map(part).sum();
        assert!((sum - frame.covariance(&at)).abs().max() < 1e-8, "{sum}");
        assert_eq!(FrameUncertainty::default().covariance(&at), Matrix3::zeros());
    }
}
