//! The columns of an estimate, and their units.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::kinematics::{Axis, Motion, Parameter};

/// The largest change expected of a length, mm, and of an angle, mrad: the pipeline's own weak prior.
const UNIT: f64 = 3.0;
/// The largest change expected of a joint's curve or deflection, rad.
const CURVE_UNIT_RAD: f64 = 3e-4;

/// One column of an estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Column {
    /// A parameter of the measurement chain; base and target by a small motion after their frame.
    Chain(#[serde(with = "by_name")] Parameter),
    /// Deflection of a joint under gravity, by its place among the model's coefficients.
    Gravity(usize),
    /// A coefficient of a joint's error curve.
    Curve {
        /// The joint, from 1.
        joint: usize,
        /// Number of the coefficient, from 0: cos, sin of the first harmonic, and so on.
        coefficient: usize,
    },
}

impl Column {
    /// The joint that the column belongs to, from 1; `None` for base, target and gravity.
    pub const fn joint(&self) -> Option<usize> {
        match self {
            Self::Chain(Parameter::Link { joint, .. }) | Self::Curve { joint, .. } => Some(*joint),
            _ => None,
        }
    }

    /// The largest change expected of it, mm or rad.
    pub fn unit(&self) -> f64 {
        match self {
            Self::Chain(parameter) if parameter.is_angle() => 1e-3 * UNIT,
            Self::Chain(_) => UNIT,
            Self::Gravity(_) | Self::Curve { .. } => CURVE_UNIT_RAD,
        }
    }

    /// Whether it is a motion of base or target.
    pub(super) const fn is_of_a_frame(&self) -> bool {
        matches!(self, Self::Chain(Parameter::Base(_) | Parameter::Target(_)))
    }

    /// The name of the column's unit: `mm` or `rad`.
    pub const fn unit_name(&self) -> &'static str {
        match self {
            Self::Chain(parameter) => parameter.unit(),
            Self::Gravity(_) | Self::Curve { .. } => "rad",
        }
    }
}

impl fmt::Display for Column {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Chain(parameter) => parameter.fmt(f),
            Self::Gravity(place) => write!(f, "gravity_{}", place + 1),
            Self::Curve { joint, coefficient } => write!(f, "curve_{joint}_{}", coefficient + 1),
        }
    }
}

/// The motions of base and target, as parameters.
pub(super) fn frame_motions() -> impl Iterator<Item = Parameter> {
    let motions = || {
        let along = |of: fn(Axis) -> Motion| Axis::ALL.into_iter().map(of);
        along(Motion::Translation).chain(along(Motion::Rotation))
    };
    motions()
        .map(Parameter::Base)
        .chain(motions().map(Parameter::Target))
}

/// Parameters by their names.
mod by_name {
    use serde::{Deserialize as _, Deserializer, Serializer, de::Error as _};

    use crate::kinematics::{LinkQuantity, Parameter};

    pub fn serialize<S: Serializer>(parameter: &Parameter, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(parameter)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Parameter, D::Error> {
        let name = String::deserialize(from)?;
        super::frame_motions()
            .find(|own| own.to_string() == name)
            .or_else(|| link(&name))
            .ok_or_else(|| D::Error::custom(format!("{name:?} is no parameter")))
    }

    fn link(name: &str) -> Option<Parameter> {
        let (quantity, joint) = name.rsplit_once('_')?;
        let quantity = LinkQuantity::of_name(quantity)?;
        let joint = joint.parse().ok()?;
        Some(Parameter::Link { joint, quantity })
    }
}
