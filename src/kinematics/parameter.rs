//! What can be identified, by name: never by a string or an index.

use std::fmt;

use super::chain::{Axis, Motion};

/// One free parameter of the measurement chain `tracker_from_base · arm · flange_from_target`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Parameter {
    /// A small motion of the base, after `tracker_from_base`.
    Base(Motion),
    /// A quantity of a link.
    Link {
        /// The joint that moves the link, counted from 1 as in the literature.
        joint: usize,
        /// Which quantity.
        quantity: LinkQuantity,
    },
    /// A small motion of the target at the flange.
    Target(Motion),
}

/// The quantities of a DH link with Hayati's extension.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum LinkQuantity {
    /// Joint offset, about z.
    Theta,
    /// Link offset, along z.
    D,
    /// Link length, along x.
    A,
    /// Link twist, about x.
    Alpha,
    /// Hayati's angle about y, where the next axis is nominally parallel.
    Beta,
}

impl Parameter {
    /// Whether the parameter is an angle (rad); otherwise it is a length (mm).
    pub const fn is_angle(self) -> bool {
        match self {
            Self::Base(motion) | Self::Target(motion) => matches!(motion, Motion::Rotation(_)),
            Self::Link { quantity, .. } => !matches!(quantity, LinkQuantity::D | LinkQuantity::A),
        }
    }

    /// The unit inside the crate and in the tables.
    pub const fn unit(self) -> &'static str {
        if self.is_angle() { "rad" } else { "mm" }
    }
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Base(motion) => write!(f, "base_{}", motion_name(*motion)),
            Self::Target(motion) => write!(f, "target_{}", motion_name(*motion)),
            Self::Link { joint, quantity } => write!(f, "{}_{joint}", quantity_name(*quantity)),
        }
    }
}

const fn motion_name(motion: Motion) -> &'static str {
    match motion {
        Motion::Translation(Axis::X) => "x",
        Motion::Translation(Axis::Y) => "y",
        Motion::Translation(Axis::Z) => "z",
        Motion::Rotation(Axis::X) => "rx",
        Motion::Rotation(Axis::Y) => "ry",
        Motion::Rotation(Axis::Z) => "rz",
    }
}

const fn quantity_name(quantity: LinkQuantity) -> &'static str {
    match quantity {
        LinkQuantity::Theta => "theta",
        LinkQuantity::D => "d",
        LinkQuantity::A => "a",
        LinkQuantity::Alpha => "alpha",
        LinkQuantity::Beta => "beta",
    }
}
