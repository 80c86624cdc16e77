//! Mistakes about the links: a length or a twist with the wrong sign.

use super::Hypothesis;
use crate::kinematics::{Arm, Axis, Chain, Convention, Element, Motion, Parameter};
use crate::setup::set_up::SetUp;

/// Every constant of the chain with the opposite sign.
pub(super) fn links(stated: &SetUp) -> Vec<Hypothesis> {
    let elements = stated.arm.chain().elements();
    let turned = |(place, element): (usize, &Element)| {
        let (opposite, what) = opposite(element)?;
        let mut elements = elements.to_vec();
        elements[place] = opposite;
        let joint = link_of(&stated.arm, place);
        let named = joint_name(&stated.arm, joint);
        let arm = stated.arm.with_chain(Chain::new(elements));
        let mistake = format!("the {what} of link {joint} ({named}) has the wrong sign");
        let edit = format!("robot file, {}: {what} with the opposite sign", table(&named));
        Some(Hypothesis::new(mistake, edit, SetUp { arm, ..stated.clone() }))
    };
    elements.iter().enumerate().filter_map(turned).collect()
}

/// The joint whose link the chain's element at `place` belongs to, by its number in parameters, from 1.
///
/// A constant stands before the free elements of its link where the convention places frames, and behind those of the joint before
/// elsewhere.
fn link_of(arm: &Arm, place: usize) -> usize {
    let elements = arm.chain().elements();
    let link = |element: &Element| match element.parameter() {
        Some(Parameter::Link { joint, .. }) => Some(joint),
        _ => None,
    };
    let ahead = || elements[place..].iter().find_map(link);
    let behind = || elements[..=place].iter().rev().find_map(link);
    let places_frames =
        matches!(arm.convention(), Convention::Urdf | Convention::Poe | Convention::MinimalPoe);
    let own = if places_frames { ahead().or_else(behind) } else { behind().or_else(ahead) };
    own.unwrap_or(1)
}

/// The joint with this number in parameters, from 1: its name, or the joint that it follows.
pub(in crate::setup) fn joint_name(arm: &Arm, number: usize) -> String {
    let joints = arm.joints();
    if let Some(joint) = joints.get(number - 1) {
        return format!("{:?}", joint.name);
    }
    let followed = followed(arm).get(number - joints.len() - 1).copied();
    let name = followed.and_then(|followed| joints.get(followed));
    let name = name.map_or("", |joint| joint.name.as_str());
    format!("{FOLLOWS} {name:?}")
}

const FOLLOWS: &str = "the joint that follows";

/// The table of a robot file that states the joint of [`joint_name`].
pub(in crate::setup) fn table(named: &str) -> String {
    format!("[[joint]] {}", named.trim_start_matches("the joint "))
}

/// For each joint that follows another, in the order of the chain, the place of that other among the reported joints.
///
/// Reported joints stand in the order of their variables, so an element out of that order is of a joint that follows.
fn followed(arm: &Arm) -> Vec<usize> {
    let variables = arm.chain().elements().iter().filter_map(Element::joint);
    let mut reported = 0;
    let follows = |variable: &usize| {
        let is_next = *variable == reported;
        reported += usize::from(is_next);
        !is_next
    };
    variables.filter(follows).collect()
}

/// Lengths below this and angles below a tenth of a degree have no sign to mistake.
const LEAST_MM: f64 = 1.0;
const LEAST_RAD: f64 = 0.002;

/// The element with its constant negated, and the constant's name in a robot file.
fn opposite(element: &Element) -> Option<(Element, &'static str)> {
    match element {
        Element::Free { motion, nominal, parameter } => {
            let least = if matches!(motion, Motion::Rotation(_)) { LEAST_RAD } else { LEAST_MM };
            let what = named(*motion);
            let element =
                Element::Free { motion: *motion, nominal: -nominal, parameter: *parameter };
            (nominal.abs() > least).then_some((element, what))
        }
        Element::Fixed(fixed) => {
            let opposite = Element::Fixed(fixed.inverse());
            (fixed.translation.vector.norm() > LEAST_MM)
                .then_some((opposite, named(Motion::Translation(Axis::Z))))
        }
        Element::Joint { .. } => None,
    }
}

const fn named(motion: Motion) -> &'static str {
    match motion {
        Motion::Translation(Axis::X) => "a_mm",
        Motion::Translation(_) => "d_mm",
        Motion::Rotation(Axis::Z) => "offset_deg",
        Motion::Rotation(_) => "alpha_deg",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::RobotFile;

    fn palletiser() -> SetUp {
        let file: RobotFile =
            toml::from_str(include_str!("../../../../tests/robots/parallelogram.toml"))
                .expect("a robot file");
        SetUp::of_arm(file.arm().expect("an arm"))
    }

    #[test]
    fn a_length_is_that_of_its_joint_behind_one_that_follows() {
        // The parallelogram, which follows a2, stands between a2 and a3 in the chain.
        let edits: Vec<String> = links(&palletiser()).into_iter().map(|own| own.edit).collect();
        let tables = edits.iter().map(|edit| {
            let (table, _) = edit.split_once(": ").expect("a key");
            table.trim_start_matches("robot file, [[joint]] ").to_owned()
        });
        // The origins of a1, a2, the parallelogram, a4, a5 and a6; that of a3 is zero.
        let expected = ["\"a1\"", "\"a2\"", "that follows \"a2\"", "\"a4\"", "\"a5\"", "\"a6\""];
        assert_eq!(tables.collect::<Vec<_>>(), expected);
    }

    #[test]
    fn joints_are_named_by_their_number_in_parameters() {
        let arm = palletiser().arm;
        let names: Vec<String> = (1..=7).map(|number| joint_name(&arm, number)).collect();
        assert_eq!(names[2], "\"a3\"");
        assert_eq!(names[6], "the joint that follows \"a2\"");
        assert_eq!(table(&names[6]), "[[joint]] that follows \"a2\"");
    }
}
