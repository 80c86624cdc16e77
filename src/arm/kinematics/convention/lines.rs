//! Links between lines: each joint has a frame with z along its axis, and small motions of that frame, counted from the
//! nominal, are what may be wrong: nearly parallel axes are like any others.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, UnitVector3, Vector3};

use super::super::chain::Element;
use super::super::motion::{Axis, Motion};
use super::super::parameter::LinkQuantity;
use super::Moving;

const SMALL: [(Motion, LinkQuantity); 6] = [
    (Motion::Translation(Axis::X), LinkQuantity::X),
    (Motion::Translation(Axis::Y), LinkQuantity::Y),
    (Motion::Translation(Axis::Z), LinkQuantity::D),
    (Motion::Rotation(Axis::X), LinkQuantity::Rx),
    (Motion::Rotation(Axis::Y), LinkQuantity::Ry),
    (Motion::Rotation(Axis::Z), LinkQuantity::Theta),
];

/// The turn that brings z to `axis` by the shortest way; half a turn about x where they are opposite.
pub fn z_to(axis: &UnitVector3<f64>) -> UnitQuaternion<f64> {
    // By the arctangent: the arccosine of a direction near z has half the digits.
    let across = axis.x.hypot(axis.y);
    let about = UnitVector3::try_new(Vector3::new(-axis.y, axis.x, 0.0), 0.0);
    UnitQuaternion::from_axis_angle(&about.unwrap_or_else(Vector3::x_axis), across.atan2(axis.z))
}

pub fn frame_along(point: Vector3<f64>, axis: &UnitVector3<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::from(point), z_to(axis))
}

/// The nominal way to a joint's frame, its six small motions, and the joint; `zero` is added to its variable.
pub fn placed(joint: &Moving, nominal: Isometry3<f64>, zero: f64) -> Vec<Element> {
    let mut elements = vec![Element::Fixed(nominal)];
    elements.extend(SMALL.map(|(motion, quantity)| joint.free(motion, 0.0, quantity)));
    elements.extend(own(joint, zero));
    elements
}

/// The link to a joint's frame with small motions that change its axis: four for a line, two for a slide's direction.
pub fn line(joint: &Moving, nominal: Isometry3<f64>, zero: f64) -> Vec<Element> {
    let mut elements = vec![Element::Fixed(nominal)];
    let changes_axis = |quantity: LinkQuantity| match quantity {
        LinkQuantity::Rx | LinkQuantity::Ry => true,
        LinkQuantity::X | LinkQuantity::Y => !joint.slides,
        _ => false,
    };
    let free = SMALL.into_iter().filter(|(_, own)| changes_axis(*own));
    elements.extend(free.map(|(motion, quantity)| joint.free(motion, 0.0, quantity)));
    elements.extend(own(joint, zero));
    elements
}

/// The joint, and CPC's link behind it: z turned to the next axis' direction, a turn γ about that and a shift.
pub fn cpc(
    joint: &Moving,
    next: &UnitVector3<f64>,
    gamma: f64,
    [x, y, z]: [f64; 3],
    zero: f64,
) -> Vec<Element> {
    let mut elements = own(joint, zero);
    elements.push(Element::Fixed(Isometry3::from_parts(Translation3::identity(), z_to(next))));
    elements.extend([
        joint.free(Motion::Rotation(Axis::X), 0.0, LinkQuantity::Rx),
        joint.free(Motion::Rotation(Axis::Y), 0.0, LinkQuantity::Ry),
        joint.free(Motion::Rotation(Axis::Z), gamma, LinkQuantity::Gamma),
        joint.free(Motion::Translation(Axis::X), x, LinkQuantity::X),
        joint.free(Motion::Translation(Axis::Y), y, LinkQuantity::Y),
        joint.free(Motion::Translation(Axis::Z), z, LinkQuantity::B),
    ]);
    elements
}

fn own(joint: &Moving, zero: f64) -> Vec<Element> {
    let motion =
        if joint.slides { Motion::Translation(Axis::Z) } else { Motion::Rotation(Axis::Z) };
    let mut elements = Vec::with_capacity(2);
    if zero != 0.0 {
        elements.push(Element::Fixed(motion.by(zero)));
    }
    elements.push(joint.variable(motion));
    elements
}
