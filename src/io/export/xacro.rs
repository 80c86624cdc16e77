//! The identified geometry as xacro properties, for descriptions that are written in xacro.
//!
//! Output: properties `JOINT_xyz` and `JOINT_rpy`, m and rad, for each joint whose origin is the arm's. A description includes the
//! file and has `<origin xyz="${JOINT_xyz}" rpy="${JOINT_rpy}"/>` in its joints. The joints are those of a URDF, as
//! [`super::corrected_urdf`] changes them, or those of [`super::urdf`] without one.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;

use nalgebra::Isometry3;

use super::controller_base::InControllerBase;
use super::corrected_urdf::{GivenUrdf, origins, read};
use super::limits::Limits;
use super::urdf::{self, in_comment, three};
use super::urdf_chain;
use super::{ExportError, ExportErrorKind};
use crate::geometry::rpy;
use crate::units::MM_PER_M;

/// Writes the geometry in a file of table `calibrations`: for the joints of a URDF, or for those of `--format urdf` without one; gives
/// remarks for a person, a line each.
pub fn write(
    path: &Path,
    given: Option<&GivenUrdf<'_>>,
    mut sink: impl Write,
) -> Result<Vec<String>, ExportError> {
    let own = InControllerBase::read(path)?;
    let joints = match given {
        Some(given) => of_urdf(&own, given)?,
        None => urdf::placed(&own.published.arm)
            .map_err(|problem| ExportErrorKind::NoUrdf(problem).at(path))?,
    };
    let limits = Limits::of(path);
    sink.write_all(text(&own, &joints, &limits.words()).as_bytes())?;
    Ok(vec![limits.not_identified])
}

/// Names and new origins of the joints of a URDF.
fn of_urdf(
    own: &InControllerBase,
    given: &GivenUrdf<'_>,
) -> Result<Vec<(String, Isometry3<f64>)>, ExportError> {
    let text = read(given.path)?;
    let refused = |source| ExportErrorKind::NoChain(source).at(given.path);
    let document = urdf_chain::document(&text).map_err(refused)?;
    let steps = urdf_chain::steps(&document, given.ends).map_err(refused)?;
    let found = origins(own, &steps, given.path)?;
    let named = steps.iter().zip(&found.joints);
    let named = named.filter_map(|(step, origin)| Some((step.joint.name.clone(), (*origin)?)));
    let rest = found.rest.map(|rest| ("tip_to_flange".to_owned(), rest));
    Ok(named.chain(rest).collect())
}

fn text(own: &InControllerBase, joints: &[(String, Isometry3<f64>)], limits: &str) -> String {
    let key = &own.published.key;
    let mut xacro = String::from("<?xml version=\"1.0\" encoding=\"utf-8\"?>\n");
    let remark = format!(
        "{}. Joint origins of the identified geometry of robot {:?}, session {:?}, by posegrid run {}, m and rad; joint offsets are in \
         them. Include this file and write <origin xyz=\"${{NAME_xyz}}\" rpy=\"${{NAME_rpy}}\"/>. {limits}",
        own.published.error_frame.words(),
        key.robot,
        key.session,
        key.run
    );
    let _ = writeln!(xacro, "<!-- {} -->", in_comment(&remark));
    xacro.push_str("<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\">\n");
    let mut taken = BTreeSet::new();
    for (name, origin) in joints {
        let name = unlike(property(name), &mut taken);
        let xyz = three((origin.translation.vector / MM_PER_M).into());
        for (part, value) in [("xyz", xyz), ("rpy", three(rpy(&origin.rotation)))] {
            let _ = writeln!(xacro, "  <xacro:property name=\"{name}_{part}\" value=\"{value}\"/>");
        }
    }
    xacro.push_str("</robot>\n");
    xacro
}

/// A name that an expression of xacro can hold: ASCII letters, digits and underscores, no digit first.
fn property(joint: &str) -> String {
    let letter = |letter: char| {
        if letter.is_ascii_alphanumeric() { letter } else { '_' }
    };
    let name: String = joint.chars().map(letter).collect();
    // Two underscores first are refused by xacro.
    let name = name.trim_start_matches('_');
    if name.starts_with(|first: char| first.is_ascii_alphabetic()) {
        name.to_owned()
    } else {
        format!("joint_{name}")
    }
}

/// The name, or with underscores behind it one that is not taken.
fn unlike(mut name: String, taken: &mut BTreeSet<String>) -> String {
    while !taken.insert(name.clone()) {
        name.push('_');
    }
    name
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_properties_are_names_of_variables() {
        let mut taken = BTreeSet::new();
        let names = ["wrist_3-flange", "A 1", "A-1", "1", "__x", "ä"];
        let names = names.map(|name| unlike(property(name), &mut taken));
        assert_eq!(names, ["wrist_3_flange", "A_1", "A_1_", "joint_1", "x", "joint_"]);
    }
}
