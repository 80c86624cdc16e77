//! The identified geometry of a Universal Robots arm as the YAML that `ur_description` takes as its
//! `kinematics_params`: the frame of each joint, which turns about z, in the one before, m and rad. Sources:
//! `config/*/default_kinematics.yaml`, `urdf/inc/ur_common.xacro` and `urdf/ur_macro.xacro` of
//! `Universal_Robots_ROS2_Description`, and `ur_calibration` of `Universal_Robots_ROS2_Driver`. The description has its
//! flange, `tool0`, in the sixth frame itself; a flange off axis 6 is stated in a comment: it belongs to the tool.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;

use nalgebra::Isometry3;

use super::controller_base::InControllerBase;
use super::limits::Limits;
use super::origins::{ChainJoint, Origins, OriginsError, about_z};
use super::urdf::three;
use super::{ExportError, ExportErrorKind};
use crate::geometry::{isometry_from_rpy, rpy};
use crate::kinematics::{Arm, Screws};
use crate::manifest::RunKey;

const LINKS: [&str; 6] = ["shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"];

/// Writes the geometry in a file of table `calibrations`; gives remarks for a person, a line each.
pub fn write(path: &Path, mut sink: impl Write) -> Result<Vec<String>, ExportError> {
    let own = InControllerBase::read(path)?;
    let no_ur = |source| ExportErrorKind::NoUr(source).at(path);
    let chain = chain(&own.published.arm.arm).ok_or_else(|| no_ur(None))?;
    let origins = Origins::of(&own, &chain).map_err(|source| no_ur(Some(source)))?;
    let limits = Limits::of(path);
    let yaml = text(&own, &origins, &limits);
    sink.write_all(yaml.as_bytes())?;
    Ok(vec![limits.not_identified])
}

/// The controller's base in the arm's, and the six joints of a nominal UR with the lengths of this arm; `None` for an arm without six axes
/// and a link between each two. The arm's base is the controller's, `base`, in which the elbow of a UR has a negative x, or `base_link`
/// of the description, which is half a turn about z away.
fn chain(arm: &Arm) -> Option<Vec<ChainJoint>> {
    let screws = Screws::of(arm.chain(), &arm.no_offsets());
    let is_base_link = screws.axes.get(2)?.line.point.x > 0.0;
    let base = isometry_from_rpy([0.0; 3], [0.0, 0.0, if is_base_link { PI } else { 0.0 }]);
    let points: Vec<_> =
        screws.axes.iter().map(|screw| base.inverse() * screw.line.point).collect();
    let [_, lift, elbow, wrist_1, wrist_2, wrist_3] = points[..] else { return None };
    let flange = (base.inverse() * screws.flange).translation.vector;
    let frames = [
        ([0.0, 0.0, lift.z], 0.0),
        ([0.0, 0.0, 0.0], FRAC_PI_2),
        ([elbow.x, 0.0, 0.0], 0.0),
        ([wrist_1.x - elbow.x, 0.0, -wrist_2.y], 0.0),
        ([0.0, wrist_3.z - lift.z, 0.0], FRAC_PI_2),
        ([0.0, wrist_2.y - flange.y, 0.0], -FRAC_PI_2),
    ];
    let joint = |(name, (xyz, roll)): (&str, ([f64; 3], f64))| ChainJoint {
        name: name.to_owned(),
        origin: isometry_from_rpy(xyz, [roll, 0.0, 0.0]),
        moves: Some(about_z()),
    };
    let base = ChainJoint { name: "base".to_owned(), origin: base, moves: None };
    Some(std::iter::once(base).chain(LINKS.into_iter().zip(frames).map(joint)).collect())
}

fn text(own: &InControllerBase, origins: &Origins, limits: &Limits) -> String {
    let key = &own.published.key;
    let mut yaml = String::new();
    for remark in remarks(own, origins.rest.as_ref(), limits) {
        let _ = writeln!(yaml, "# {remark}");
    }
    yaml.push_str("kinematics:\n");
    for (link, origin) in LINKS.iter().zip(&origins.joints[1..]) {
        let origin = origin.unwrap_or_else(Isometry3::identity);
        let at = origin.translation.vector / 1000.0;
        let [roll, pitch, yaw] = rpy(&origin.rotation);
        let _ = writeln!(yaml, "  {link}:");
        let keys = ["x", "y", "z", "roll", "pitch", "yaw"];
        for (key, value) in keys.into_iter().zip([at.x, at.y, at.z, roll, pitch, yaw]) {
            let _ = writeln!(yaml, "    {key}: {}", value + 0.0);
        }
    }
    let _ = writeln!(yaml, "  hash: calib_posegrid_{}", key.run);
    yaml
}

fn remarks(own: &InControllerBase, rest: Option<&Isometry3<f64>>, limits: &Limits) -> Vec<String> {
    let RunKey { robot, session, run } = &own.published.key;
    let arm = own.published.arm.arm.model();
    let mut lines = vec![
        format!(
            "identified kinematics of arm {arm:?}, robot {robot:?}, session {session:?}, by posegrid run {run}"
        ),
        "for ur_description (kinematics_params): metres and radians, roll pitch yaw about fixed x y z, base = the controller's base"
            .to_owned(),
        "hash: of this run, not the controller's. The driver compares it with that of the factory calibration and reports that they differ"
            .to_owned(),
        own.published.error_frame.words(),
        limits.not_identified.clone(),
        limits.dropped.clone(),
    ];
    lines.extend(rest.map(left));
    lines
}

/// The flange in the sixth frame, which the file cannot say.
fn left(rest: &Isometry3<f64>) -> String {
    let at = rest.translation.vector;
    format!(
        "not in the six frames: the flange stands {:.4} mm off axis 6 and {:.6} deg tilted against it; add it to the tool: \
         tool0 to flange xyz=\"{}\" rpy=\"{}\" (m, rad)",
        at.norm(),
        rest.rotation.angle().to_degrees(),
        three((at / 1000.0).into()),
        three(rpy(&rest.rotation))
    )
}

pub(super) fn no_ur(source: Option<&OriginsError>) -> String {
    let why = source.map_or_else(|| "it has not six axes".to_owned(), ToString::to_string);
    format!(
        "the arm is not one of Universal Robots, as ur_description has them ({why}); use --format urdf"
    )
}

#[cfg(test)]
mod tests;
