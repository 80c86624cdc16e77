//! The parameters that can be identified, as an enum: never a string or an index.

use std::fmt;

use super::motion::Motion;

/// One free parameter of the measurement chain `tracker_from_base · arm · flange_from_target`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Parameter {
    /// A small motion of the base, after `tracker_from_base`.
    Base(Motion),
    /// A quantity of a link.
    Link {
        /// The joint that moves the link, counted from 1 as in the literature.
        joint: usize,
        /// The quantity of that link.
        quantity: LinkQuantity,
    },
    /// A small motion of the measured target on the flange.
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

impl LinkQuantity {
    /// All quantities, in the order of a link's elements.
    pub const ALL: [Self; 5] = [Self::Theta, Self::D, Self::A, Self::Alpha, Self::Beta];

    /// The quantity's name in tables and saved models.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Theta => "theta",
            Self::D => "d",
            Self::A => "a",
            Self::Alpha => "alpha",
            Self::Beta => "beta",
        }
    }
}

impl Parameter {
    /// Whether the parameter is an angle (rad); otherwise it is a length (mm).
    pub const fn is_angle(self) -> bool {
        match self {
            Self::Base(motion) | Self::Target(motion) => matches!(motion, Motion::Rotation(_)),
            Self::Link { quantity, .. } => !matches!(quantity, LinkQuantity::D | LinkQuantity::A),
        }
    }

    /// The parameter's unit inside the crate and in the tables.
    pub const fn unit(self) -> &'static str {
        if self.is_angle() { "rad" } else { "mm" }
    }
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Base(motion) => write!(f, "base_{}", motion.name()),
            Self::Target(motion) => write!(f, "target_{}", motion.name()),
            Self::Link { joint, quantity } => write!(f, "{}_{joint}", quantity.name()),
        }
    }
}
