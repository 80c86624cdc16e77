use std::fmt;
use std::str::FromStr;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use serde::{Deserialize, Serialize};

use super::named::UnknownName;

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Axis {
    X,
    Y,
    Z,
}

impl Axis {
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    pub fn unit(self) -> UnitVector3<f64> {
        match self {
            Self::X => Vector3::x_axis(),
            Self::Y => Vector3::y_axis(),
            Self::Z => Vector3::z_axis(),
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Motion {
    Translation(Axis),
    Rotation(Axis),
}

impl fmt::Display for Motion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Motion {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        let known = Self::ALL.into_iter().find(|motion| motion.name() == name);
        known.ok_or_else(|| UnknownName { what: "motion", name: name.to_owned() })
    }
}

impl Motion {
    pub const ALL: [Self; 6] = [
        Self::Translation(Axis::X),
        Self::Rotation(Axis::X),
        Self::Translation(Axis::Y),
        Self::Rotation(Axis::Y),
        Self::Translation(Axis::Z),
        Self::Rotation(Axis::Z),
    ];

    /// The motion's name in tables and saved models: `x` along x, `rx` about x.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Translation(Axis::X) => "x",
            Self::Translation(Axis::Y) => "y",
            Self::Translation(Axis::Z) => "z",
            Self::Rotation(Axis::X) => "rx",
            Self::Rotation(Axis::Y) => "ry",
            Self::Rotation(Axis::Z) => "rz",
        }
    }

    pub fn axis(self) -> Vector3<f64> {
        match self {
            Self::Translation(axis) | Self::Rotation(axis) => axis.unit().into_inner(),
        }
    }

    /// Moves a frame by `amount` (mm or rad): [`Self::by`], which most free parameters do not need, as they are zero.
    pub fn carry(self, frame: &mut Isometry3<f64>, amount: f64) {
        if amount == 0.0 {
            return;
        }
        match self {
            Self::Translation(axis) => {
                frame.translation.vector += frame.rotation * (axis.unit().into_inner() * amount);
            }
            Self::Rotation(axis) => {
                frame.rotation *= UnitQuaternion::from_axis_angle(&axis.unit(), amount);
            }
        }
    }

    /// The transform of this motion by `amount` (mm or rad).
    pub fn by(self, amount: f64) -> Isometry3<f64> {
        match self {
            Self::Translation(_) => Translation3::from(self.axis() * amount).into(),
            Self::Rotation(axis) => Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::from_axis_angle(&axis.unit(), amount),
            ),
        }
    }
}
