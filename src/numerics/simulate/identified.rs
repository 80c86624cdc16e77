//! Errors of an arm's axes in the form of an identified error model: curves of any period, any number of gear lines, the
//! deflection of each axis under weight, and the offset from the command after an approach.

use nalgebra::{Point3, Vector3};
use serde::Serialize;

use super::curve::{GearLine, JointCurve};
use crate::kinematics::Axes;

/// Errors of every axis beyond geometry.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AxisErrors {
    pub axes: Vec<AxisError>,
    /// Approach-direction offset of each joint; `None` when the model does not have it.
    pub approach: Option<Vec<ApproachOffset>>,
    /// Repeatability of each joint from visit to visit, a standard deviation, rad.
    pub repeatability_rad: Vec<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AxisError {
    /// Constant part, rad; mm where the joint slides, as are the curves.
    pub constant_rad: f64,
    /// Divisor of the axis variable before its curves: turns of their period, or mm per rad where the joint slides.
    pub curve_unit: f64,
    /// Curves, to be summed, as functions of the angle divided by `curve_unit`.
    pub curves: Vec<JointCurve>,
    pub lines: Vec<GearLine>,
    /// Compliance to a mass at each later axis' origin and, last, at the measured target: rad per m of lever.
    pub gives_way: Vec<f64>,
}

/// The true angle of a joint after an approach, relative to its reported and commanded angle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ApproachOffset {
    /// Command–feedback weight: the share of the way from reported to commanded angle.
    pub nearer_command: f64,
    /// Offset beyond that share, towards the command, rad (mm where the joint slides, as the settling error). It is whole when the settling error is at least `within_rad`, and
    /// in proportion below.
    pub beyond_rad: f64,
    /// The settling error, rad, from which on `beyond_rad` applies in full.
    pub within_rad: f64,
}

impl AxisErrors {
    /// Error of each axis at reported axis variables (rad), without the effect of weight, rad.
    pub(super) fn unloaded(&self, axes: &[f64]) -> Vec<f64> {
        let off = |(error, q): (&AxisError, &f64)| {
            let curves = error.curves.iter().map(|curve| curve.at(q / error.curve_unit));
            let lines = error.lines.iter().map(|line| line.at(*q));
            error.constant_rad + curves.chain(lines).sum::<f64>()
        };
        self.axes.iter().zip(axes).map(off).collect()
    }

    /// Deflection of each axis under weight, rad (mm where it slides): `joints` are those of the chain, then the target, mm.
    pub(super) fn deflections(
        &self,
        joints: &Axes,
        target: Point3<f64>,
        up: &Vector3<f64>,
    ) -> Vec<f64> {
        let of_axis = |(place, error): (usize, &AxisError)| {
            let forces = joints.forces(place, target, -up);
            forces.zip(&error.gives_way).map(|(force, way)| way * force).sum()
        };
        self.axes.iter().enumerate().map(of_axis).collect()
    }
}

impl ApproachOffset {
    /// True minus reported angle of a joint whose settling error is `short_rad`, rad.
    pub(super) fn true_minus_reported(&self, short_rad: f64) -> f64 {
        let share = (short_rad / self.within_rad).clamp(-1.0, 1.0);
        self.nearer_command * short_rad + self.beyond_rad * share
    }
}
