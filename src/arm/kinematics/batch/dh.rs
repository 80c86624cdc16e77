//! A chain reduced to the least that its joints allow: turns and slides along z with constant links between them.

use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};

use crate::kinematics::{Axis, Chain, Element, Motion};

/// A joint about or along z by `sign · variable + shift`.
#[derive(Debug, Clone, Copy)]
pub struct Joint {
    pub axis: usize,
    pub sign: f64,
    /// Constant turns about z next to the joint, rad; zero for a joint that slides.
    pub shift: f64,
    pub slides: bool,
}

#[derive(Debug, Clone, Copy)]
pub enum Link {
    /// A turn about x between two turning joints, whose angles include the constant turns about z.
    AboutX { sin: f64, cos: f64, origin: [f64; 3] },
    /// Any transform, anywhere else.
    Any { rotation: [[f64; 3]; 3], origin: [f64; 3] },
}

impl Link {
    pub const fn origin(&self) -> [f64; 3] {
        match self {
            Self::AboutX { origin, .. } | Self::Any { origin, .. } => *origin,
        }
    }

    fn any(transform: &Isometry3<f64>) -> Self {
        let matrix = transform.rotation.to_rotation_matrix();
        Self::Any {
            rotation: std::array::from_fn(|i| std::array::from_fn(|j| matrix[(i, j)])),
            origin: transform.translation.vector.into(),
        }
    }
}

pub fn links(chain: &Chain, offsets: &[f64]) -> (Vec<(Link, Joint)>, Isometry3<f64>) {
    let mut links: Vec<(Link, Joint)> = Vec::with_capacity(chain.joint_count());
    let mut constant = Isometry3::identity();
    let mut next = offsets.iter();
    for element in chain.elements() {
        match element {
            Element::Fixed(transform) => constant *= transform,
            Element::Free { motion, nominal, .. } => {
                let offset = next.next().expect("one offset for each free parameter");
                constant *= motion.by(nominal + offset);
            }
            Element::Joint { motion, joint, sign } => {
                let (turned, slides) = along_z(*motion);
                let mut joint = Joint { axis: *joint, sign: *sign, shift: 0.0, slides };
                let link = between(links.last_mut(), &(constant * turned), &mut joint);
                links.push((link, joint));
                constant = Isometry3::from_parts(Translation3::identity(), turned.inverse());
            }
        }
    }
    (links, constant)
}

fn along_z(motion: Motion) -> (UnitQuaternion<f64>, bool) {
    let (Motion::Translation(axis) | Motion::Rotation(axis)) = motion;
    let quarter = std::f64::consts::FRAC_PI_2;
    let turn = match axis {
        Axis::X => UnitQuaternion::from_axis_angle(&Vector3::y_axis(), quarter),
        Axis::Y => UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -quarter),
        Axis::Z => UnitQuaternion::identity(),
    };
    (turn, matches!(motion, Motion::Translation(_)))
}

/// The link before `joint`; where both joints turn, its turns about z are added to their angles.
fn between(
    before: Option<&mut (Link, Joint)>,
    constant: &Isometry3<f64>,
    joint: &mut Joint,
) -> Link {
    let Some((_, before)) = before.filter(|(_, before)| !before.slides && !joint.slides) else {
        return Link::any(constant);
    };
    let matrix = *constant.rotation.to_rotation_matrix().matrix();
    // Column z of Rot(z,φ) Rot(x,α) is sin α (sin φ, −cos φ), then cos α. With parallel axes any φ is right, since ψ
    // is computed from the φ chosen.
    let phi = matrix[(0, 2)].atan2(-matrix[(1, 2)]);
    let back = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -phi);
    let rest: Matrix3<f64> = back.to_rotation_matrix().matrix() * matrix;
    before.shift += phi;
    joint.shift += (-rest[(0, 1)]).atan2(rest[(0, 0)]);
    let (sin, cos) = (-rest[(1, 2)], rest[(2, 2)]);
    let norm = sin.hypot(cos);
    let origin = (back * constant.translation.vector).into();
    Link::AboutX { sin: sin / norm, cos: cos / norm, origin }
}
