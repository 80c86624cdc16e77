//! The true arm: nominal chain plus parameter offsets, joint error curves, gear lines, backlash and sag.
//!
//! A true joint angle is `q + curve(q) + line(q) + visit`, where `visit` is the error that differs from visit to visit
//! (backlash, settling error, repeatability). Then each axis deflects under gravity: `compliance · torque`, the torque of point
//! masses halfway between neighbouring joint origins, and of a payload at the target ([`crate::method::error_model`]).

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3, Vector3};
use serde::Serialize;

use super::curve::{GearLine, JointCurve};
use super::identified::AxisErrors;
use super::random::{Ingredient, Stream};
use super::settings::{GeometryErrors, Gravity, SimulateSettings};
use crate::geometry::{isometry_from_rpy, rpy};
use crate::kinematics::{Arm, Joint};

/// Each link weighs this share of the one before it.
const LINK_SHARE: f64 = 0.6;
/// The payload's share of the first link's weight.
const PAYLOAD_SHARE: f64 = 0.2;

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ArmErrors {
    /// Offsets of the free parameters (mm, rad), in the chain's order.
    pub offsets: Vec<f64>,
    /// One error curve for each joint; where it slides, in m over its position as a share of twice its travel, as an angle.
    pub curves: Vec<JointCurve>,
    pub gear_lines: Vec<GearLine>,
    /// Backlash of each joint, rad; mm where it slides.
    pub backlash_rad: Vec<f64>,
    /// Compliance of each axis, rad per (unit of mass · mm).
    pub compliance: Vec<f64>,
    /// Mass of each link and, last, of the payload; they sum to 1.
    pub masses: Vec<f64>,
    pub up: [f64; 3],
    pub flange_from_target_mm: [f64; 3],
    /// True orientation of the measured target in the flange frame: fixed-axis roll, pitch, yaw, rad.
    pub flange_from_target_rpy: [f64; 3],
    /// Errors of the axes of an arm that was identified before, in addition to the above; absent for a drawn arm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub identified: Option<AxisErrors>,
}

impl ArmErrors {
    /// Draws the errors of the arm with the seed `settings.arm_seed`, or `settings.seed` without one.
    pub fn draw(arm: &Arm, settings: &SimulateSettings) -> Self {
        let joints = arm.joints().len();
        let stream =
            |ingredient| Stream::new(settings.arm_seed.unwrap_or(settings.seed), ingredient);
        let errors = &settings.joints;
        let mut curves = stream(Ingredient::JointCurves);
        let mut lines = stream(Ingredient::GearLines);
        let mut backlash = stream(Ingredient::Backlash);
        let mut target = stream(Ingredient::Target);
        let cell = &settings.cell;
        let moved = target.normal3() * cell.target_sd_mm;
        let masses = masses(joints);
        Self {
            offsets: offsets(arm, &settings.geometry, &mut stream(Ingredient::Geometry)),
            curves: (0..joints)
                .map(|_| {
                    JointCurve::draw(&mut curves, errors.slow_curve_rad, errors.fast_curve_rad)
                })
                .collect(),
            gear_lines: (0..joints)
                .map(|_| GearLine::draw(&mut lines, errors.gear_line_rad))
                .collect(),
            backlash_rad: (0..joints)
                .zip(arm.joints())
                .map(|(_, joint)| {
                    errors.backlash_rad * backlash.between(0.5, 1.5) * joint.per_radian()
                })
                .collect(),
            compliance: compliance(arm, settings, &masses, &mut stream(Ingredient::Gravity)),
            masses,
            up: settings.gravity.up,
            flange_from_target_mm: std::array::from_fn(|i| {
                cell.flange_from_target_mm[i] + moved[i]
            }),
            flange_from_target_rpy: cell.flange_from_target_rpy,
            identified: None,
        }
    }

    /// An arm whose only errors are `identified`.
    pub fn of_identified(
        offsets: Vec<f64>,
        identified: AxisErrors,
        flange_from_target: &Isometry3<f64>,
        up: [f64; 3],
    ) -> Self {
        let joints = identified.axes.len();
        Self {
            offsets,
            curves: vec![JointCurve::default(); joints],
            gear_lines: vec![GearLine::of(1.0, 0.0, 0.0); joints],
            backlash_rad: vec![0.0; joints],
            compliance: vec![0.0; joints],
            masses: masses(joints),
            up,
            flange_from_target_mm: flange_from_target.translation.vector.into(),
            flange_from_target_rpy: rpy(&flange_from_target.rotation),
            identified: Some(identified),
        }
    }

    /// True minus reported angle of `joint`, rad, after a move in `direction` (±1, 0 for none yet) that ended with the
    /// settling error `short_rad` (rad); without the part that no visit repeats.
    pub(super) fn true_minus_reported(
        &self,
        joint: usize,
        short_rad: f64,
        direction: f64,
        nearer_command: f64,
    ) -> f64 {
        let slack = -direction * self.backlash_rad[joint] / 2.0;
        let approach = self.identified.as_ref().and_then(|i| i.approach.as_ref());
        slack
            + approach.map_or(nearer_command * short_rad, |approach| {
                approach[joint].true_minus_reported(short_rad)
            })
    }

    /// Repeatability of `joint` from visit to visit, a standard deviation, rad: the identified one where there is one.
    pub(super) fn repeatability_rad(&self, joint: usize, expected_rad: f64) -> f64 {
        self.identified.as_ref().map_or(expected_rad, |own| own.repeatability_rad[joint])
    }

    /// True pose of the measured target in the base frame when the controller reports `joints` (rad); `visit` (rad) is the
    /// error that differs from visit to visit.
    pub fn base_from_target(&self, arm: &Arm, joints: &[f64], visit: &[f64]) -> Isometry3<f64> {
        let beside = |(j, joint): (usize, &Joint)| {
            let q = joints[j];
            let curve = joint.per_radian() * self.curves[j].at(q / curve_unit(joint));
            q + curve + self.line(j, joint, q) + visit[j]
        };
        let actual: Vec<f64> = arm.joints().iter().enumerate().map(beside).collect();
        let mut axes = arm.axes(&actual);
        let flange_from_target =
            isometry_from_rpy(self.flange_from_target_mm, self.flange_from_target_rpy);
        if self.compliance.iter().any(|&c| c != 0.0) {
            let torques = self.torques(arm, &axes, &flange_from_target);
            for ((axis, torque), compliance) in axes.iter_mut().zip(torques).zip(&self.compliance) {
                *axis += compliance * torque;
            }
        }
        if let Some(identified) = &self.identified {
            self.add(identified, arm, &arm.axes(joints), &mut axes);
        }
        arm.chain().forward(&axes, &self.offsets) * flange_from_target
    }

    /// Error of a gear at `q`, rad; 0 for a joint that slides, which has none.
    fn line(&self, place: usize, joint: &Joint, q: f64) -> f64 {
        if joint.slides { 0.0 } else { self.gear_lines[place].at(q) }
    }

    /// Adds the identified errors of the axes at `reported` axis variables to `axes`.
    fn add(&self, identified: &AxisErrors, arm: &Arm, reported: &[f64], axes: &mut [f64]) {
        let chain = arm.chain();
        let end = chain.forward(reported, &self.offsets);
        let target = end * Point3::from(self.flange_from_target_mm);
        let joints = chain.axes(reported, &self.offsets);
        let way = identified.deflections(&joints, target, &Vector3::from(self.up));
        let off = identified.unloaded(reported).into_iter().zip(way);
        for (axis, (unloaded, way)) in axes.iter_mut().zip(off) {
            *axis += unloaded + way;
        }
    }

    /// Torque of gravity on each axis, in the sense of its reported angle (unit of mass · mm).
    fn torques(&self, arm: &Arm, axes: &[f64], flange_from_target: &Isometry3<f64>) -> Vec<f64> {
        let chain = arm.chain();
        let differential = chain.differential(axes, &self.offsets);
        let target = differential.end * flange_from_target;
        let mut origins: Vec<Point3<f64>> =
            chain.joint_axes(axes, &self.offsets).into_iter().map(|(origin, _)| origin).collect();
        origins.push(target.translation.vector.into());
        let down = -Vector3::from(self.up);
        let moment = |about: &Point3<f64>, point: &Point3<f64>| (point - about).cross(&down);
        let torque = |joint: usize| {
            let links = (joint..axes.len()).map(|link| {
                let centre = nalgebra::center(&origins[link], &origins[link + 1]);
                moment(&origins[joint], &centre) * self.masses[link]
            });
            let links: Vector3<f64> = links.sum();
            let payload = moment(&origins[joint], &origins[axes.len()]) * self.masses[axes.len()];
            differential.joints[joint].angular.dot(&(links + payload))
        };
        (0..axes.len()).map(torque).collect()
    }
}

/// Divisor of the variable of `joint` before its error curve: 1, or the mm per rad of twice the travel where it slides, so
/// that both ends are as far apart as they can be.
pub(super) fn curve_unit(joint: &Joint) -> f64 {
    if joint.slides { 2.0 * (joint.upper - joint.lower) / TAU } else { 1.0 }
}

fn offsets(arm: &Arm, errors: &GeometryErrors, stream: &mut Stream) -> Vec<f64> {
    arm.chain()
        .parameters()
        .iter()
        .map(|parameter| {
            let drawn = stream.normal();
            if parameter.is_angle() {
                errors.angle_sd_rad * drawn
            } else {
                errors.length_sd_mm * drawn
            }
        })
        .collect()
}

fn masses(joints: usize) -> Vec<f64> {
    let mut masses: Vec<f64> = (0..joints).map(|link| LINK_SHARE.powf(link as f64)).collect();
    masses.push(PAYLOAD_SHARE);
    let total: f64 = masses.iter().sum();
    masses.iter().map(|mass| mass / total).collect()
}

/// The torque about a joint of the weight behind it, with the arm stretched out: each link's mass in its middle, the payload at the end.
fn stretched_torque(origins: &[Point3<f64>], masses: &[f64], joint: usize) -> f64 {
    let (mut reach, mut torque) = (0.0, 0.0);
    for link in joint..origins.len() - 1 {
        let length = (origins[link + 1] - origins[link]).norm();
        torque += masses[link] * (reach + length / 2.0);
        reach += length;
    }
    torque + masses[origins.len() - 1] * reach
}

/// Compliances at which every axis deflects by `sag_rad`, half more or less, under the weight of the arm held out level.
fn compliance(
    arm: &Arm,
    settings: &SimulateSettings,
    masses: &[f64],
    stream: &mut Stream,
) -> Vec<f64> {
    let Gravity { sag_rad, .. } = settings.gravity;
    let zeros = vec![0.0; arm.joints().len()];
    let nominal = arm.no_offsets();
    let mut origins: Vec<Point3<f64>> =
        arm.chain().joint_axes(&zeros, &nominal).into_iter().map(|(origin, _)| origin).collect();
    let flange = Point3::from(arm.chain().nominal(&zeros).translation.vector);
    origins.push(flange + Vector3::from(settings.cell.flange_from_target_mm));
    let of_joint = |joint: usize| {
        let torque = stretched_torque(&origins, masses, joint);
        let drawn = sag_rad * stream.between(0.5, 1.5);
        // The last joints of an arm without a tool carry no weight and have no deflection.
        if torque > 1.0e-9 { drawn / torque } else { 0.0 }
    };
    (0..zeros.len()).map(of_joint).collect()
}

#[cfg(test)]
mod tests {
    use super::super::Poses;
    use super::*;
    use crate::kinematics::RobotFile;

    fn kr210() -> Arm {
        let text = include_str!("../../../pipelines/robots/kr210-r2700-extra.toml");
        let file: RobotFile = toml::from_str(text).expect("a robot file");
        file.arm().expect("a valid arm")
    }

    fn settings() -> SimulateSettings {
        let poses = Poses::Joints { count: 0, lower: vec![], upper: vec![] };
        SimulateSettings::exact(3, vec![], poses)
    }

    #[test]
    fn without_errors_it_is_the_nominal_arm() {
        let arm = kr210();
        let settings = settings();
        let joints = [0.1, -1.2, 1.5, 0.3, 0.8, -0.4];
        let found = ArmErrors::draw(&arm, &settings).base_from_target(&arm, &joints, &[0.0; 6]);
        let cell = settings.cell;
        let nominal = arm.chain().nominal(&joints)
            * isometry_from_rpy(cell.flange_from_target_mm, cell.flange_from_target_rpy);
        assert!((found.translation.vector - nominal.translation.vector).norm() < 1e-9);
    }

    #[test]
    fn an_identified_arm_keeps_the_target_turned_by_a_right_angle() {
        let arm = kr210();
        let turned = isometry_from_rpy([0.0; 3], [0.7, std::f64::consts::FRAC_PI_2 - 3e-8, -0.4]);
        let identified =
            AxisErrors { axes: Vec::new(), approach: None, repeatability_rad: Vec::new() };
        let offsets = arm.no_offsets();
        let errors = ArmErrors::of_identified(offsets, identified, &turned, [0.0, 0.0, 1.0]);
        let kept = isometry_from_rpy([0.0; 3], errors.flange_from_target_rpy);
        let off = kept.rotation.angle_to(&turned.rotation);
        assert!(off < 1e-12, "{off} rad");
    }

    #[test]
    fn gravity_pulls_down_and_most_when_stretched() {
        let arm = kr210();
        let mut settings = settings();
        settings.gravity.sag_rad = 3e-4;
        let errors = ArmErrors::draw(&arm, &settings);
        let exact = ArmErrors { compliance: vec![0.0; 6], ..errors.clone() };
        let sag = |joints: [f64; 6]| {
            let drop = errors.base_from_target(&arm, &joints, &[0.0; 6]).translation.z
                - exact.base_from_target(&arm, &joints, &[0.0; 6]).translation.z;
            -drop
        };
        // Stretched level 2.9 m before the arm: joint 2 alone gives 1.5e-4 to 4.5e-4 rad times 2.6 m.
        let stretched = sag([0.0, 0.0, 0.0, 0.0, 0.5, 0.0]);
        let upright = sag([0.0, -1.5, 1.5, 0.0, 0.5, 0.0]);
        assert!(stretched > 0.39 && stretched < 4.0, "{stretched}");
        assert!(upright > 0.0 && upright < stretched, "{upright} {stretched}");
    }
}
