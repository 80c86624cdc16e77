//! The identified geometry as URDF, m and rad, cut at the joint variables. `base_link` is the controller's base and
//! `flange` its flange, in the error reference frame ([`posegrid_numerics::method::compensation`]), not the ends of the
//! identified chain, which a fit may move by millimetres along directions that are not identifiable.

use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;

use nalgebra::{Isometry3, Vector3};

use super::limits::Limits;
use super::{ExportError, ExportErrorKind, controller_base};
use crate::calibrations_table::{self, PublishedArm};
use crate::compensation::IdentifiedArm;
use crate::geometry::rpy;
use crate::kinematics::{Chain, Element, Joint, Motion};
use crate::manifest::RunKey;
use crate::report::frame::StatedFrame;

/// Writes the geometry in a file of table `calibrations`; gives remarks for a person, a line each.
pub fn write(path: &Path, mut sink: impl Write) -> Result<Vec<String>, ExportError> {
    let PublishedArm { key, arm, error_frame, .. } = calibrations_table::read_geometry(path)?;
    let pieces = Pieces::of(&arm).map_err(|problem| ExportErrorKind::NoUrdf(problem).at(path))?;
    let limits = Limits::of(path);
    let urdf = text(&key, &arm, &error_frame, &pieces, &limits.words());
    sink.write_all(urdf.as_bytes())?;
    Ok(vec![limits.not_identified])
}

struct Pieces {
    joints: Vec<(Isometry3<f64>, Vector3<f64>)>,
    flange: Isometry3<f64>,
}

impl Pieces {
    fn of(arm: &IdentifiedArm) -> Result<Self, &'static str> {
        let count = arm.arm.joints().len();
        if arm.arm.axes_from_joints() != nalgebra::DMatrix::identity(count, count) {
            return Err("has coupled joints");
        }
        let (base_from_root, chain, flange) = controller_base::carried(arm)?;
        let cut = Self::cut(base_from_root, chain)?;
        Ok(Self { flange: cut.flange * flange, ..cut })
    }

    fn cut(before: Isometry3<f64>, chain: &Chain) -> Result<Self, &'static str> {
        let mut joints = Vec::new();
        let mut since = before;
        for element in chain.elements() {
            match element {
                Element::Fixed(placement) => since *= placement,
                Element::Free { motion, nominal, .. } => since *= motion.by(*nominal),
                Element::Joint { joint, .. } if *joint != joints.len() => {
                    return Err("has joints that do not follow one another");
                }
                Element::Joint { motion: Motion::Translation(_), .. } => {
                    return Err("has a joint that slides");
                }
                Element::Joint { motion, sign, .. } => {
                    joints.push((since, motion.axis() * *sign));
                    since = Isometry3::identity();
                }
            }
        }
        Ok(Self { joints, flange: since })
    }
}

fn text(
    key: &RunKey,
    arm: &IdentifiedArm,
    error_frame: &StatedFrame,
    pieces: &Pieces,
    limits: &str,
) -> String {
    let mut urdf = String::from("<?xml version=\"1.0\" encoding=\"utf-8\"?>\n");
    let RunKey { robot, session, run } = key;
    let (frame, model) = (error_frame.words(), arm.arm.model());
    let remark = format!(
        "{frame}. Identified geometry of arm {model:?}, robot {robot:?}, session {session:?}, by posegrid run {run}. {limits} base_link is \
         the controller's base, flange its flange, tool its own tool point. Effort and velocity are not known and 0."
    );
    line(&mut urdf, &format!("<!-- {} -->", in_comment(&remark)));
    line(&mut urdf, &format!("<robot name=\"{}\">", escaped(robot)));
    line(&mut urdf, "  <link name=\"base_link\"/>");
    let mut parent = "base_link".to_owned();
    let joints = arm.arm.joints();
    for (number, (joint, (origin, axis))) in (1..).zip(joints.iter().zip(&pieces.joints)) {
        let child = format!("link_{number}");
        let axis = three((*axis).into());
        let inside = format!("    <axis xyz=\"{axis}\"/>\n{}", limit(joint));
        push_joint(&mut urdf, &joint.name, "revolute", [&parent, &child], origin, &inside);
        parent = child;
    }
    for (child, origin) in [("flange", pieces.flange), ("tool", *arm.flange_from_tool.isometry())] {
        let name = fixed_name(child, joints);
        push_joint(&mut urdf, &name, "fixed", [&parent, child], &origin, "");
        child.clone_into(&mut parent);
    }
    line(&mut urdf, "</robot>");
    urdf
}

fn line(text: &mut String, words: &str) {
    text.push_str(words);
    text.push('\n');
}

fn push_joint(
    urdf: &mut String,
    name: &str,
    kind: &str,
    [parent, child]: [&str; 2],
    origin: &Isometry3<f64>,
    inside: &str,
) {
    let metres = origin.translation.vector / 1000.0;
    let xyz = three(metres.into());
    let rpy = three(rpy(&origin.rotation));
    let name = escaped(name);
    let _ = write!(
        urdf,
        "  <joint name=\"{name}\" type=\"{kind}\">\n    <parent link=\"{parent}\"/>\n    <child link=\"{child}\"/>\n    \
         <origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>\n{inside}  </joint>\n  <link name=\"{child}\"/>\n"
    );
}

pub(super) fn three(numbers: [f64; 3]) -> String {
    let [a, b, c] = numbers.map(|number| number + 0.0);
    format!("{a} {b} {c}")
}

fn limit(joint: &Joint) -> String {
    let Joint { lower, upper, .. } = joint;
    format!("    <limit lower=\"{lower}\" upper=\"{upper}\" effort=\"0\" velocity=\"0\"/>\n")
}

fn fixed_name(child: &str, joints: &[Joint]) -> String {
    let mut own = format!("{child}_joint");
    while joints.iter().any(|joint| joint.name == own) {
        own.push('_');
    }
    own
}

/// The value of an attribute.
pub(super) fn escaped(text: &str) -> String {
    let written = |letter: char| match letter {
        '&' => "&amp;".to_owned(),
        '<' => "&lt;".to_owned(),
        '>' => "&gt;".to_owned(),
        '"' => "&quot;".to_owned(),
        '\'' => "&apos;".to_owned(),
        _ => character(letter).to_string(),
    };
    text.chars().map(written).collect()
}

/// A character, or a sign for one that XML 1.0 excludes: it has no form for most control characters.
fn character(letter: char) -> char {
    let is_none = letter.is_control() || matches!(letter, '\u{FFFE}' | '\u{FFFF}');
    if is_none { '\u{FFFD}' } else { letter }
}

/// A text inside a comment, which two hyphens would end.
fn in_comment(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for letter in text.chars() {
        if letter == '-' && out.ends_with('-') {
            out.push(' ');
        }
        out.push(character(letter));
    }
    out
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;
    use crate::geometry::isometry_from_rpy;
    use crate::kinematics::RobotFile;

    #[test]
    fn a_chain_cut_at_its_joints_is_the_same_chain() {
        let text = include_str!("../../../pipelines/robots/irb120.toml");
        let arm = toml::from_str::<RobotFile>(text).unwrap().arm().unwrap();
        let before = isometry_from_rpy([1.0, -2.0, 3.0], [0.1, 0.2, 0.3]);
        let pieces = Pieces::cut(before, arm.chain()).unwrap();
        let q = [0.3, -0.4, 0.5, 0.6, -0.7, 0.8];
        let turned = |(origin, axis): &(Isometry3<f64>, Vector3<f64>), q: f64| {
            origin * UnitQuaternion::from_scaled_axis(axis * q)
        };
        let joints = pieces.joints.iter().zip(q);
        let end = joints.fold(Isometry3::identity(), |end, (joint, q)| end * turned(joint, q));
        let apart = (end * pieces.flange).to_homogeneous()
            - (before * arm.chain().nominal(&q)).to_homogeneous();
        assert!(apart.abs().max() < 1e-12, "{apart}");
    }

    #[test]
    fn names_stay_names() {
        assert_eq!(escaped("a\"<b>&'\u{0}\n"), "a&quot;&lt;b&gt;&amp;&apos;\u{FFFD}\u{FFFD}");
        assert_eq!(in_comment("a ---> b-c"), "a - - -> b-c");
    }
}
