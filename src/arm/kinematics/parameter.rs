//! The parameters that can be identified, as an enum: never a string or an index.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::motion::{Axis, Motion};
use super::named::UnknownName;

/// One free parameter of the measurement chain `tracker_from_base · arm · flange_from_target`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Parameter {
    Base(Motion),
    Link {
        /// The joint that moves the link, counted from 1 as in the literature.
        joint: usize,
        quantity: LinkQuantity,
    },
    Target(Motion),
    Gauge(GaugePart),
}

/// An instrument that reads one length: distances from an anchor, or heights above a plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum GaugePart {
    Place(Axis),
    /// Reading at no distance from the anchor.
    Offset,
    Tilt,
    /// The tilt of the plane's normal towards the second axis across it.
    OtherTilt,
    /// Distance of the plane from the base's origin along its normal.
    Height,
}

impl GaugePart {
    pub const ANCHOR: [Self; 4] =
        [Self::Place(Axis::X), Self::Place(Axis::Y), Self::Place(Axis::Z), Self::Offset];
    pub const PLANE: [Self; 3] = [Self::Tilt, Self::OtherTilt, Self::Height];

    /// Whether the part is an angle (rad); otherwise it is a length (mm).
    pub const fn is_angle(self) -> bool {
        matches!(self, Self::Tilt | Self::OtherTilt)
    }

    /// The part's name in tables and saved models.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Place(Axis::X) => "anchor_x",
            Self::Place(Axis::Y) => "anchor_y",
            Self::Place(Axis::Z) => "anchor_z",
            Self::Offset => "anchor_offset",
            Self::Tilt => "plane_tilt_1",
            Self::OtherTilt => "plane_tilt_2",
            Self::Height => "plane_height",
        }
    }
}

/// Quantities of a link in every convention. Θ and d are a joint's zero: turn about its axis and shift along it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum LinkQuantity {
    /// Joint offset, about z; a small turn about the joint's axis where the convention places axes.
    Theta,
    /// Link offset, along z; a small shift along the joint's axis where the convention places axes.
    D,
    A,
    Alpha,
    /// Hayati's angle about y, where two axes are nominally parallel.
    Beta,
    /// Turn about z behind the twist: γ of the S-model, β of CPC.
    Gamma,
    /// Shift along z behind the twist: b of the S-model, the third shift of CPC.
    B,
    /// Small shift of the joint's axis along its frame's x.
    X,
    /// Small shift of the joint's axis along its frame's y.
    Y,
    /// Small tilt of the joint's axis about its frame's x.
    Rx,
    Ry,
}

impl LinkQuantity {
    pub const ALL: [Self; 11] = [
        Self::Theta,
        Self::D,
        Self::A,
        Self::Alpha,
        Self::Beta,
        Self::Gamma,
        Self::B,
        Self::X,
        Self::Y,
        Self::Rx,
        Self::Ry,
    ];

    pub const fn name(self) -> &'static str {
        match self {
            Self::Theta => "theta",
            Self::D => "d",
            Self::A => "a",
            Self::Alpha => "alpha",
            Self::Beta => "beta",
            Self::Gamma => "gamma",
            Self::B => "b",
            Self::X => "x",
            Self::Y => "y",
            Self::Rx => "rx",
            Self::Ry => "ry",
        }
    }

    pub const fn is_angle(self) -> bool {
        match self {
            Self::Theta | Self::Alpha | Self::Beta | Self::Gamma | Self::Rx | Self::Ry => true,
            Self::D | Self::A | Self::B | Self::X | Self::Y => false,
        }
    }
}

impl Parameter {
    /// Whether the parameter is an angle (rad); otherwise it is a length (mm).
    pub const fn is_angle(self) -> bool {
        match self {
            Self::Base(motion) | Self::Target(motion) => matches!(motion, Motion::Rotation(_)),
            Self::Link { quantity, .. } => quantity.is_angle(),
            Self::Gauge(part) => part.is_angle(),
        }
    }

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
            Self::Gauge(part) => f.write_str(part.name()),
        }
    }
}

impl FromStr for Parameter {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        const MOST_JOINTS: usize = 16;
        let frames =
            Motion::ALL.into_iter().flat_map(|motion| [Self::Base(motion), Self::Target(motion)]);
        let links = (1..=MOST_JOINTS)
            .flat_map(|joint| LinkQuantity::ALL.map(|quantity| Self::Link { joint, quantity }));
        let gauges = GaugePart::ANCHOR.into_iter().chain(GaugePart::PLANE).map(Self::Gauge);
        let known = frames.chain(links).chain(gauges).find(|own| own.to_string() == name);
        known.ok_or_else(|| UnknownName { what: "parameter", name: name.to_owned() })
    }
}
