//! Mistakes about the links: a length or a twist with the wrong sign.

use super::Hypothesis;
use crate::kinematics::{Arm, Chain, Convention, Element, LinkQuantity, Motion, Parameter};
use crate::setup::set_up::SetUp;

/// Every constant of the chain with the opposite sign.
pub(super) fn links(stated: &SetUp) -> Vec<Hypothesis> {
    let elements = stated.arm.chain().elements();
    let turned = |(place, element): (usize, &Element)| {
        let (opposite, what, edit) = opposite(&stated.arm, element)?;
        let mut elements = elements.to_vec();
        elements[place] = opposite;
        let joint = link_of(&stated.arm, place);
        let named = joint_name(&stated.arm, joint);
        let arm = stated.arm.with_chain(Chain::new(elements));
        let mistake = format!("the {what} of link {joint} ({named}) has the wrong sign");
        let edit = format!("robot file, {}: {edit}", table(&named));
        Some(Hypothesis::new(mistake, edit, SetUp { arm, ..stated.clone() }))
    };
    elements.iter().enumerate().filter_map(turned).collect()
}

/// The joint whose link the chain's element at `place` belongs to, by its number in parameters, from 1.
///
/// A constant stands before its link's free elements where the convention places frames, else behind those of the joint before.
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

/// The element with its constant negated, the constant's name in a robot file, and what to write.
fn opposite(arm: &Arm, element: &Element) -> Option<(Element, &'static str, String)> {
    match element {
        Element::Free { motion, nominal, parameter } => {
            let least = if matches!(motion, Motion::Rotation(_)) { LEAST_RAD } else { LEAST_MM };
            let Parameter::Link { quantity, .. } = parameter else { return None };
            let edit = to_write(arm, *parameter, -2.0 * nominal);
            let element =
                Element::Free { motion: *motion, nominal: -nominal, parameter: *parameter };
            (nominal.abs() > least).then_some((element, key(*quantity), edit))
        }
        Element::Fixed(fixed) => {
            let edit = "its constant length with the opposite sign".to_owned();
            let opposite = (Element::Fixed(fixed.inverse()), "constant", edit);
            (fixed.translation.vector.norm() > LEAST_MM).then_some(opposite)
        }
        Element::Joint { .. } => None,
    }
}

/// The key of a robot file that states the quantity, or words for what no key states.
pub(in crate::setup) const fn key(quantity: LinkQuantity) -> &'static str {
    match quantity {
        LinkQuantity::D => "d_mm",
        LinkQuantity::A => "a_mm",
        LinkQuantity::Theta => "offset_deg",
        LinkQuantity::Alpha => "alpha_deg",
        LinkQuantity::Beta => "(parallel axes)",
        LinkQuantity::Gamma => "gamma_deg",
        LinkQuantity::B => "b_mm",
        LinkQuantity::X => "the place of the axis along x",
        LinkQuantity::Y => "the place of the axis along y",
        LinkQuantity::Rx => "the axis' direction about x",
        LinkQuantity::Ry => "the axis' direction about y",
    }
}

/// The key of a link quantity with the stated value plus `change` (mm or rad); of what no key of the convention states, the change.
pub(in crate::setup) fn to_write(arm: &Arm, parameter: Parameter, change: f64) -> String {
    let Parameter::Link { quantity, .. } = parameter else { return String::new() };
    let unit = if quantity.is_angle() { 1.0_f64.to_degrees() } else { 1.0 };
    let digits = if quantity.is_angle() { 3 } else { 2 };
    let is_table = matches!(
        arm.convention(),
        Convention::StandardDh | Convention::MdH | Convention::ModifiedDh | Convention::SModel
    );
    let is_key = is_table && key(quantity).contains('_') || quantity == LinkQuantity::Theta;
    if !is_key {
        return format!("{} moved by {:+.digits$}", key(quantity), unit * change);
    }
    let value = unit * (stated(arm, parameter) + change);
    let value = if quantity.is_angle() { 180.0 - (180.0 - value).rem_euclid(360.0) } else { value };
    let text = format!("{value:.digits$}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    format!("{} = {}", key(quantity), if text == "-0" { "0" } else { text })
}

/// The value of a link quantity in the robot file, mm or rad. An offset may stand apart, as the constant before the joint.
fn stated(arm: &Arm, parameter: Parameter) -> f64 {
    let mut elements = arm.chain().elements().iter();
    let found = elements.find_map(|element| match element {
        Element::Free { nominal, parameter: own, .. } if *own == parameter => Some(*nominal),
        _ => None,
    });
    let apart = match elements.next() {
        Some(Element::Fixed(zero)) if zero.translation.vector.norm() == 0.0 => {
            zero.rotation.scaled_axis().z
        }
        _ => 0.0,
    };
    let is_offset = matches!(parameter, Parameter::Link { quantity: LinkQuantity::Theta, .. });
    found.unwrap_or(0.0) + if is_offset { apart } else { 0.0 }
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

    #[test]
    fn an_edit_is_the_value_to_write() {
        let text = r#"
            model = "m"
            source = "s"
            convention = "modified-dh"
            joint = [
              { name = "a", a_mm = 0, alpha_deg = 0, d_mm = 400, offset_deg = -90, sign = -1, limits_deg = [-170, 170] },
              { name = "b", a_mm = 25.5, alpha_deg = -90, d_mm = 0, offset_deg = 0, sign = 1, limits_deg = [-170, 170] },
            ]"#;
        let file: RobotFile = toml::from_str(text).expect("a robot file");
        let arm = file.arm().expect("an arm");
        let of = |joint, quantity| Parameter::Link { joint, quantity };
        let half = std::f64::consts::FRAC_PI_2;
        assert_eq!(to_write(&arm, of(1, LinkQuantity::Theta), -half), "offset_deg = 180");
        assert_eq!(to_write(&arm, of(1, LinkQuantity::Theta), half), "offset_deg = 0");
        assert_eq!(to_write(&arm, of(2, LinkQuantity::A), -51.0), "a_mm = -25.5");
        // A URDF states the offset apart, before the joint.
        let palletiser = palletiser().arm;
        let offset = to_write(&palletiser, of(2, LinkQuantity::Theta), half);
        assert!(offset.starts_with("offset_deg = "), "{offset}");
    }
}
