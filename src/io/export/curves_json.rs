//! The error curve of each joint as JSON: angle, error and its standard deviation, in rad, on whole degrees; in
//! mm, every 10 mm, for a joint that slides, which says `"unit": "mm"`.
//!
//! A controller or an off-line program that corrects joint angles subtracts `error_rad` at the angle that it is about to
//! command. The curve is relative to the identified geometry, and does not contain the constant offsets of joints.

use std::io::Write;
use std::path::Path;

use serde::Serialize;

use super::{ExportError, ExportErrorKind};
use crate::compensation::{Conditions, Validity};
use crate::fit::full::FullModel;
use crate::fit::full::curves::JointCurves;
use crate::io::calibrations_table::{self, PublishedArm};
use crate::io::common;
use crate::io::lake::read_given;
use crate::io::schema;
use crate::io::table::Row as _;
use crate::io::tables::joint_errors::{JointErrorRow, points};
use crate::io::tables::words::Unit;
use crate::kinematics::Arm;
use crate::manifest::RunKey;

/// The document.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Curves {
    format: &'static str,
    robot: String,
    session: String,
    run: String,
    unit: &'static str,
    angle: &'static str,
    error: &'static str,
    /// Null where the table does not have it.
    valid_for: Option<ValidFor>,
    joints: Vec<Curve>,
}

/// The conditions that the curves are valid for; null: not stated.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct ValidFor {
    #[serde(flatten)]
    conditions: Conditions,
    temperature_c: Option<[f64; 2]>,
    flange_from_target_xyz_mm: [f64; 3],
}

/// The curve of a joint.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
struct Curve {
    joint: usize,
    name: String,
    /// "mm" where the joint slides: then all its values are in mm; left out where they are in rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    unit: Option<&'static str>,
    /// Lowest and highest angle among the points within the measured range; null where there are none.
    measured_rad: Option<[f64; 2]>,
    angle_rad: Vec<f64>,
    error_rad: Vec<f64>,
    sd_rad: Vec<f64>,
    measured: Vec<bool>,
}

/// Writes the curves that a file of table `calibrations` holds.
pub fn of_calibrations(path: &Path, sink: impl Write) -> Result<(), ExportError> {
    let PublishedArm { key, arm, .. } = calibrations_table::read(path)?;
    let Some(model) = arm.model.is::<FullModel>() else {
        return Err(ExportErrorKind::NoCurves.at(path));
    };
    let target = arm.frames.flange_from_target.origin().coords();
    let valid_for = ValidFor::of(&arm.validity, target.into());
    let axes = axis_ranges(&arm.arm, &arm.measured);
    let joints = axes.iter().enumerate();
    let curves = model.joint_curves();
    let joints = joints.map(|(joint, range)| curve(&curves, &arm.arm, joint, *range));
    write(&key, Some(valid_for), joints.collect(), sink)
}

/// Writes the curves that a file of table `joint_errors` holds.
pub fn of_joint_errors(path: &Path, sink: impl Write) -> Result<(), ExportError> {
    let table = read_given(path, schema::find("joint_errors")?)?;
    if table.rows() == 0 {
        return Err(ExportErrorKind::Empty.at(path));
    }
    let key =
        common::key(path, &table).map_err(calibrations_table::CalibrationsTableError::from)?;
    let mut joints: Vec<Curve> = Vec::new();
    for row in JointErrorRow::read(&table) {
        if joints.last().is_none_or(|last| last.joint != row.joint) {
            joints.push(Curve {
                joint: row.joint,
                name: row.joint_name.to_string(),
                unit: (row.joint_unit == Some(Unit::Mm)).then_some("mm"),
                ..Curve::default()
            });
        }
        if let Some(curve) = joints.last_mut() {
            curve.push(row.angle_rad, row.error_rad, row.sd_rad, row.measured);
        }
    }
    write(&key, None, joints, sink)
}

fn write(
    key: &RunKey,
    valid_for: Option<ValidFor>,
    joints: Vec<Curve>,
    mut sink: impl Write,
) -> Result<(), ExportError> {
    let curves = Curves {
        format: "posegrid joint curves 1",
        robot: key.robot.clone(),
        session: key.session.clone(),
        run: key.run.clone(),
        unit: "rad",
        angle: "the axis variable: the reported angle, for coupled axes with the robot file's joint map applied",
        error: "attained minus reported angle, relative to the identified geometry; smooth curve and gear lines together",
        valid_for,
        joints,
    };
    serde_json::to_writer(&mut sink, &curves)?;
    Ok(sink.write_all(b"\n")?)
}

impl ValidFor {
    fn of(validity: &Validity, flange_from_target_xyz_mm: [f64; 3]) -> Self {
        Self {
            conditions: validity.conditions.clone(),
            temperature_c: validity.temperature_c,
            flange_from_target_xyz_mm,
        }
    }
}

impl Curve {
    fn push(&mut self, angle: f64, error: f64, sd: f64, measured: bool) {
        self.angle_rad.push(angle);
        self.error_rad.push(error);
        self.sd_rad.push(sd);
        self.measured.push(measured);
        if measured {
            let [low, high] = self.measured_rad.unwrap_or([angle; 2]);
            self.measured_rad = Some([low.min(angle), high.max(angle)]);
        }
    }
}

fn curve(curves: &JointCurves, arm: &Arm, joint: usize, [low, high]: [f64; 2]) -> Curve {
    let own = &arm.joints()[joint];
    let mut curve = Curve {
        joint: joint + 1,
        name: own.name.clone(),
        unit: own.slides.then_some("mm"),
        ..Curve::default()
    };
    for error in curves.errors(joint, &points(own.slides, low, high)) {
        let measured = (low..=high).contains(&error.angle);
        curve.push(error.angle, error.error(), error.sd, measured);
    }
    curve
}

/// Lowest and highest axis variables that joint angles within their ranges can have.
fn axis_ranges(arm: &Arm, joints: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut ranges = vec![[0.0; 2]; joints.len()];
    for (joint, span) in joints.iter().enumerate() {
        let mut unit = vec![0.0; joints.len()];
        unit[joint] = 1.0;
        for (range, share) in ranges.iter_mut().zip(arm.axes(&unit)) {
            let [a, b] = span.map(|q| share * q);
            *range = [range[0] + a.min(b), range[1] + a.max(b)];
        }
    }
    ranges
}
