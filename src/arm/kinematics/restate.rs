//! A robot file stated again in another convention. From the [lines of the axes](super::screws) follow common normals
//! for the tables (Denavit and Hartenberg 1955; Craig 1986), directions and shifts for CPC (Zhuang, Roth and Hamano
//! 1992), lines for products of exponentials. What a table cannot state stands in `[base]` and `[flange]`.

mod tables;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use thiserror::Error;

use super::arm::{Arm, Joint};
use super::convention::{Convention, lines};
use super::robot_file::{ArmError, JointFile, JointKind, Mimic, RobotFile};
use super::screws::{Line, Screw, Screws};
use crate::geometry::{EulerOrder, Placement, rpy};

/// Numbers below this are rounding, mm or rad.
const ROUNDING: f64 = 1e-12;

#[derive(Debug, Clone, PartialEq, Error)]
pub enum RestateError {
    #[error(transparent)]
    Arm(#[from] ArmError),
    #[error(
        "joints {joint:?} and the one behind it are {angle_deg:.2e}° from parallel: convention {convention:?} would put the link {distance_m:.0} m \
         away; make them exactly parallel, or use \"cpc\", \"poe\" or \"urdf\", which have no such place"
    )]
    NearlyParallel { joint: String, convention: &'static str, angle_deg: f64, distance_m: f64 },
}

impl RobotFile {
    /// The file of an arm in a convention. A joint that follows another is named after it.
    pub fn of_arm(arm: &Arm, convention: Convention) -> Result<Self, RestateError> {
        let screws = Screws::of(arm.chain(), &arm.no_offsets());
        let mut named = vec![false; arm.joints().len()];
        let mut joint = Vec::with_capacity(screws.axes.len());
        for screw in &screws.axes {
            let reported = &arm.joints()[screw.variable];
            let is_new = !std::mem::replace(&mut named[screw.variable], true);
            joint.push(joint_of(reported, screw, is_new, joint.len()));
        }
        let file = Self {
            model: arm.model().to_owned(),
            source: "an arm of posegrid".to_owned(),
            convention,
            home_deg: None,
            joint_map: arm.map_rows(),
            base: None,
            flange: None,
            joint,
        };
        file.with_links(&screws)
    }

    pub fn restated(&self, convention: Convention) -> Result<Self, RestateError> {
        let arm = self.arm()?;
        let screws = Screws::of(arm.chain(), &arm.no_offsets());
        let moving: Vec<&JointFile> =
            self.joint.iter().filter(|joint| joint.kind != JointKind::Fixed).collect();
        let file = Self {
            convention,
            base: None,
            flange: None,
            joint: moving.into_iter().map(unlinked).collect(),
            ..self.clone()
        };
        file.with_links(&screws)
    }

    fn with_links(mut self, screws: &Screws) -> Result<Self, RestateError> {
        match self.convention {
            Convention::StandardDh | Convention::MdH | Convention::SModel => {
                tables::standard(&mut self, screws)?;
            }
            Convention::ModifiedDh => tables::modified(&mut self, screws)?,
            Convention::Cpc => cpc(&mut self, screws),
            Convention::Poe | Convention::MinimalPoe => exponentials(&mut self, screws),
            Convention::Urdf => origins(&mut self, screws),
        }
        Ok(self)
    }
}

/// The joint of a screw, without its link. The first of a variable that turns one for one is the reported joint itself.
fn joint_of(reported: &Joint, screw: &Screw, is_new: bool, place: usize) -> JointFile {
    let is_reported = is_new && (screw.factor.abs() - 1.0).abs() < f64::EPSILON;
    let kind = if screw.slides { JointKind::Prismatic } else { JointKind::Revolute };
    let limits = |slides: bool| {
        let own =
            (is_reported && screw.slides == slides).then_some([reported.lower, reported.upper]);
        own.map(|limits| if slides { limits } else { limits.map(f64::to_degrees) })
    };
    let (joint, multiplier) = (reported.name.clone(), screw.factor);
    let mimic = Mimic { joint, multiplier, offset_deg: None, offset_mm: None };
    let numbered = format!("{} {}", reported.name, place + 1);
    JointFile {
        name: if is_reported { reported.name.clone() } else { numbered },
        kind,
        sign: Some(if is_reported && screw.factor < 0.0 { -1 } else { 1 }),
        limits_deg: limits(false),
        limits_mm: limits(true),
        mimic: (!is_reported).then_some(mimic),
        ..JointFile::default()
    }
}

/// The shift that a joint that follows adds at zero is part of the lines.
fn unlinked(joint: &JointFile) -> JointFile {
    JointFile {
        name: joint.name.clone(),
        kind: joint.kind,
        sign: Some(joint.sign.unwrap_or(1)),
        limits_deg: joint.limits_deg,
        limits_mm: joint.limits_mm,
        mimic: joint.mimic.clone().map(|mimic| Mimic {
            offset_deg: None,
            offset_mm: None,
            ..mimic
        }),
        ..JointFile::default()
    }
}

/// The frame on the first axis where a base frame is stated: nearest to the base, turned as little as may be.
fn on_first_axis(first: &Line) -> Isometry3<f64> {
    lines::frame_along(first.nearest_to(&Point3::origin()).coords, &first.direction)
}

fn cpc(file: &mut RobotFile, screws: &Screws) {
    let Some(first) = screws.axes.first() else { return };
    let mut frame = on_first_axis(&first.line);
    file.base = placement(&frame);
    let nexts = screws.axes.iter().skip(1).map(|screw| screw.line);
    let nexts: Vec<Option<Line>> = nexts.map(Some).chain([None]).collect();
    for (joint, next) in file.joint.iter_mut().zip(nexts) {
        let line = next.unwrap_or_else(|| Line::z_of(&screws.flange));
        // As it is written: near −z the turn to it changes with the last digit.
        let direction = (frame.rotation.inverse() * line.direction.into_inner()).map(clean);
        let direction = UnitVector3::new_normalize(direction);
        let turned = frame.rotation * lines::z_to(&direction);
        let (gamma, end) = if let Some(line) = next {
            (0.0, line.nearest_to(&frame.translation.vector.into()))
        } else {
            let x = turned.inverse() * screws.flange.rotation * Vector3::x();
            (x.y.atan2(x.x), screws.flange.translation.vector.into())
        };
        let about_z = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), gamma);
        let rotation = turned * about_z;
        let shift = rotation.inverse() * (end - Point3::from(frame.translation.vector));
        joint.direction = Some(direction.into_inner().into());
        joint.gamma_deg = Some(degrees(gamma));
        joint.shift_mm = Some(shift.map(clean).into());
        frame = Isometry3::from_parts(Translation3::from(end), rotation);
    }
}

fn exponentials(file: &mut RobotFile, screws: &Screws) {
    for (joint, screw) in file.joint.iter_mut().zip(&screws.axes) {
        joint.axis = Some(screw.line.direction.into_inner().map(clean).into());
        joint.point_mm = Some(screw.line.point.coords.map(clean).into());
    }
    file.flange = Some(stated(&screws.flange));
}

fn origins(file: &mut RobotFile, screws: &Screws) {
    let mut before = Vector3::zeros();
    for (joint, screw) in file.joint.iter_mut().zip(&screws.axes) {
        let point = screw.line.point.coords;
        joint.axis = Some(screw.line.direction.into_inner().map(clean).into());
        joint.origin = Some(stated(&Isometry3::from_parts(
            Translation3::from(point - before),
            UnitQuaternion::identity(),
        )));
        before = point;
    }
    file.flange =
        placement(&(Isometry3::translation(-before.x, -before.y, -before.z) * screws.flange));
}

/// The placement as a file states it; `None` for one that changes nothing.
fn placement(isometry: &Isometry3<f64>) -> Option<Placement> {
    let stated = stated(isometry);
    let angles = stated.euler_deg.unwrap_or_default();
    stated.xyz_mm.iter().chain(&angles).any(|&number| number != 0.0).then_some(stated)
}

fn stated(isometry: &Isometry3<f64>) -> Placement {
    Placement {
        xyz_mm: isometry.translation.vector.map(clean).into(),
        quaternion_xyzw: None,
        euler_deg: Some(rpy(&isometry.rotation).map(degrees)),
        euler_order: Some(EulerOrder::FixedXyz),
    }
}

/// The number without what rounding left of a zero.
fn clean(value: f64) -> f64 {
    if value.abs() < ROUNDING { 0.0 } else { value }
}

/// An angle in degrees, exact where it is a right angle but for rounding.
fn degrees(angle: f64) -> f64 {
    let right = (angle / std::f64::consts::FRAC_PI_2).round();
    if (angle - right * std::f64::consts::FRAC_PI_2).abs() < ROUNDING {
        right * 90.0
    } else {
        angle.to_degrees()
    }
}

#[cfg(test)]
mod tests;
