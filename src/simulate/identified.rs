//! Errors of an arm's axes as an identified error model has them: curves of any period, any number of gear lines, what
//! each axis gives way, and where it comes to stand against its command.

use nalgebra::{Point3, Vector3};
use serde::Serialize;

use super::curve::{GearLine, JointCurve};
use crate::units::MM_PER_M;

/// Errors of every axis beyond geometry.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AxisErrors {
    /// One for each axis, in the arm's order.
    pub axes: Vec<AxisError>,
    /// After how many turns curves repeat.
    pub period_turns: f64,
    /// Where joints come to stand against their commands; `None` where the model does not know.
    pub approach: Option<Vec<ApproachOffset>>,
    /// What a visit of each joint does not repeat, as standard deviations, rad.
    pub repeatability_rad: Vec<f64>,
}

/// Errors of one axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AxisError {
    /// The same everywhere, rad.
    pub constant_rad: f64,
    /// Curves that add up, of the angle over the period.
    pub curves: Vec<JointCurve>,
    /// Gear lines.
    pub lines: Vec<GearLine>,
    /// What it gives way to a mass at each later axis' origin and, last, at the target: rad per m of lever.
    pub gives_way: Vec<f64>,
}

/// Where a joint comes to stand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ApproachOffset {
    /// Share of the way from reported to commanded angle.
    pub nearer_command: f64,
    /// Beyond that, on the side of the command, rad: all of it once the joint is `within_rad` short, less in proportion
    /// before.
    pub beyond_rad: f64,
    /// See `beyond_rad`.
    pub within_rad: f64,
}

impl AxisErrors {
    /// What each axis is off at reported axis variables (rad) without weight.
    pub(super) fn unloaded(&self, axes: &[f64]) -> Vec<f64> {
        let off = |(error, q): (&AxisError, &f64)| {
            let curves = error
                .curves
                .iter()
                .map(|curve| curve.at(q / self.period_turns));
            let lines = error.lines.iter().map(|line| line.at(*q));
            error.constant_rad + curves.chain(lines).sum::<f64>()
        };
        self.axes.iter().zip(axes).map(off).collect()
    }

    /// What each axis gives way, rad: `origins` are the axes' (origin, direction), then the target's, mm.
    pub(super) fn given_way(
        &self,
        origins: &[(Point3<f64>, Vector3<f64>)],
        target: Point3<f64>,
        up: &Vector3<f64>,
    ) -> Vec<f64> {
        let of_axis = |(place, error): (usize, &AxisError)| {
            let (origin, axis) = &origins[place];
            let later = origins[place + 1..].iter().map(|(origin, _)| *origin);
            let masses = later.chain([target]);
            masses
                .zip(&error.gives_way)
                .map(|(mass, way)| way * axis.dot(&(mass - origin).cross(&-up)) / MM_PER_M)
                .sum()
        };
        self.axes.iter().enumerate().map(of_axis).collect()
    }
}

impl ApproachOffset {
    /// True minus reported angle of a joint that reports to be `short_rad` short of its command.
    pub(super) fn beside_reported(&self, short_rad: f64) -> f64 {
        let share = (short_rad / self.within_rad).clamp(-1.0, 1.0);
        self.nearer_command * short_rad + self.beyond_rad * share
    }
}
