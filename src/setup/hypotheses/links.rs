//! Mistakes about the links: a length or a twist with the wrong sign.

use super::Hypothesis;
use crate::kinematics::{Axis, Chain, Element, Motion};
use crate::setup::set_up::SetUp;

/// Every constant of the chain with the opposite sign.
pub(super) fn links(stated: &SetUp) -> Vec<Hypothesis> {
    let elements = stated.arm.chain().elements();
    let turned = |(place, element): (usize, &Element)| {
        let (opposite, what) = opposite(element)?;
        let mut elements = elements.to_vec();
        elements[place] = opposite;
        let joint = elements[..place]
            .iter()
            .filter(|e| matches!(e, Element::Joint { .. }))
            .count();
        let name = stated
            .arm
            .joints()
            .get(joint.max(1) - 1)
            .map(|joint| joint.name.clone());
        let name = name.unwrap_or_default();
        let arm = stated.arm.with_chain(Chain::new(elements));
        let mistake = format!("the {what} of link {joint} ({name:?}) has the wrong sign");
        let edit = format!("robot file, [[joint]] {name:?}: {what} with the opposite sign");
        Some(Hypothesis::new(
            mistake,
            edit,
            SetUp {
                arm,
                ..stated.clone()
            },
        ))
    };
    elements.iter().enumerate().filter_map(turned).collect()
}

/// Lengths below this and angles below a tenth of a degree have no sign to mistake.
const LEAST_MM: f64 = 1.0;
const LEAST_RAD: f64 = 0.002;

/// The element with its constant negated, and the constant's name in a robot file.
fn opposite(element: &Element) -> Option<(Element, &'static str)> {
    match element {
        Element::Free {
            motion,
            nominal,
            parameter,
        } => {
            let least = if matches!(motion, Motion::Rotation(_)) {
                LEAST_RAD
            } else {
                LEAST_MM
            };
            let what = named(*motion);
            let element = Element::Free {
                motion: *motion,
                nominal: -nominal,
                parameter: *parameter,
            };
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
