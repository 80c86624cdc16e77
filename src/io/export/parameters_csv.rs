//! The identified parameters as CSV, in any convention, with standard errors, mm and degrees, after `#` lines with what
//! the numbers are. In another convention than the robot file's, the nominal arm as a robot file of it stands before
//! the rows too, and the errors are carried into it with their covariance ([`crate::fit::conversion`]).

use std::io::Write;
use std::path::Path;

use nalgebra::Isometry3;

use super::controller_base::InControllerBase;
use super::limits::Limits;
use super::{ExportError, ExportErrorKind};
use crate::fit::conversion::{Converted, converted};
use crate::kinematics::{Arm, Convention, Parameter, RobotFile};
use crate::manifest::RunKey;
use crate::tables::parameters::nominal;

const COLUMNS: &str = "parameter belongs_to joint joint_name quantity unit nominal offset identified \
     standard_error";

/// The robot file's convention without one. Gives remarks for a person, a line each.
pub fn write(
    path: &Path,
    convention: Option<Convention>,
    mut sink: impl Write,
) -> Result<Vec<String>, ExportError> {
    let own = InControllerBase::read(path)?;
    let from = &own.published.arm.arm;
    let convention = convention.unwrap_or_else(|| from.convention());
    let (to, file) = in_convention(from, convention).map_err(|kind| kind.at(path))?;
    let found = converted(from, &own.flange_errors(), &to, &Isometry3::identity());
    let limits = Limits::of(path);
    for line in remarks(&limits, &own, convention, &found) {
        writeln!(sink, "# {line}")?;
    }
    for line in nominal_file(file.as_ref()) {
        writeln!(sink, "# {line}")?;
    }
    let mut csv = csv::Writer::from_writer(sink);
    csv.write_record(COLUMNS.split(' '))?;
    for (place, parameter) in found.errors.parameters.iter().enumerate() {
        let (offset, sd) =
            (found.errors.offsets[place], found.errors.covariance[(place, place)].max(0.0).sqrt());
        csv.write_record(row(&to, *parameter, offset, sd))?;
    }
    csv.flush()?;
    Ok(vec![limits.not_identified])
}

/// The nominal arm in a convention, and its robot file of it; no file where that is the convention of the run's.
fn in_convention(
    arm: &Arm,
    convention: Convention,
) -> Result<(Arm, Option<RobotFile>), ExportErrorKind> {
    if convention == arm.convention() {
        return Ok((arm.clone(), None));
    }
    let file = RobotFile::of_arm(arm, convention).map_err(ExportErrorKind::Convention)?;
    let other = file.arm().map_err(|source| ExportErrorKind::Convention(source.into()))?;
    Ok((other, Some(file)))
}

fn nominal_file(file: Option<&RobotFile>) -> Vec<String> {
    let Some(file) = file else {
        return vec!["nominal: as the robot file of the run states it".to_owned()];
    };
    let mut lines = vec!["nominal, as a robot file of this convention:".to_owned()];
    let text = toml::to_string(file).unwrap_or_default();
    lines.extend(text.lines().map(|line| format!("  {line}")));
    lines
}

fn remarks(
    limits: &Limits,
    own: &InControllerBase,
    convention: Convention,
    Converted { left_mm, left_rad, .. }: &Converted,
) -> [String; 6] {
    let RunKey { robot, session, run, .. } = &own.published.key;
    let arm = own.published.arm.arm.model();
    [
        format!(
            "identified parameters of arm {arm:?}, robot {robot:?}, session {session:?}, by posegrid run {run}"
        ),
        format!("convention: {} ({})", convention.word(), convention.name()),
        format!(
            "lengths in mm, angles in degrees; offset = identified - nominal; what base and target still have is in their rows; \
             the conversion leaves {left_mm:.1e} mm and {left_rad:.1e} rad"
        ),
        own.published.error_frame.words(),
        limits.not_identified.clone(),
        limits.dropped.clone(),
    ]
}

/// The body that it belongs to, its joint and its quantity.
const fn named(parameter: Parameter) -> (&'static str, Option<usize>, &'static str) {
    match parameter {
        Parameter::Base(motion) => ("base", None, motion.name()),
        Parameter::Link { joint, quantity } => ("link", Some(joint), quantity.name()),
        Parameter::Target(motion) => ("target", None, motion.name()),
        Parameter::Gauge(part) => ("gauge", None, part.name()),
    }
}

fn row(arm: &Arm, parameter: Parameter, offset: f64, sd: f64) -> [String; 10] {
    let (unit, scale) =
        if parameter.is_angle() { ("deg", 1.0_f64.to_degrees()) } else { ("mm", 1.0) };
    let (belongs_to, joint, quantity) = named(parameter);
    let nominal = nominal(arm, parameter);
    let name = joint.and_then(|joint| arm.joints().get(joint - 1));
    let number = |value: f64| format!("{:.10}", value * scale + 0.0);
    [
        parameter.to_string(),
        belongs_to.to_owned(),
        joint.map_or_else(String::new, |joint| joint.to_string()),
        name.map_or_else(String::new, |joint| joint.name.clone()),
        quantity.to_owned(),
        unit.to_owned(),
        number(nominal),
        number(offset),
        number(nominal + offset),
        number(sd),
    ]
}
