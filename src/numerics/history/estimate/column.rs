//! The columns of an estimate, and their units.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::kinematics::{LinkQuantity, Parameter, named};
use crate::units::SLIDE_MM_PER_RAD;

/// The largest change expected of a length, mm, and of an angle, mrad: the pipeline's own weak prior.
const UNIT: f64 = 3.0;
/// The largest change expected of the curve or the deflection of a joint that turns, rad.
const CURVE_UNIT_RAD: f64 = 3e-4;
/// The largest change expected of the curve or the deflection of a joint that slides, mm.
const CURVE_UNIT_MM: f64 = CURVE_UNIT_RAD * SLIDE_MM_PER_RAD;

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Column {
    /// A parameter of the measurement chain; base and target by a small motion after their frame.
    Chain(#[serde(with = "named")] Parameter),
    /// Deflection of a joint that turns under gravity, by its place among the model's coefficients.
    Gravity(usize),
    /// A coefficient of the error curve of a joint that turns.
    Curve {
        joint: usize,
        /// Number of the coefficient, from 0: cos, sin of the first harmonic, and so on.
        coefficient: usize,
    },
    /// A parameter of the link of a joint that slides, whose zero is its shift and not its turn.
    Slide(#[serde(with = "named")] Parameter),
    /// Deflection of a joint that slides under the weight it carries, mm, by its place among the model's coefficients.
    SlideGravity(usize),
    /// The error curve of a joint that slides at one position, mm. The curve's period is that of its session's range, so two sessions
    /// have no coefficients in common, but their values are of one function.
    SlideCurve { joint: usize, at_mm: i64 },
}

impl Column {
    /// The column of a parameter; `slides` tells whether a joint, from 1, slides.
    pub(super) fn of(parameter: Parameter, slides: impl Fn(usize) -> bool) -> Self {
        match parameter {
            Parameter::Link { joint, .. } if slides(joint) => Self::Slide(parameter),
            _ => Self::Chain(parameter),
        }
    }

    /// The joint that the column belongs to, from 1; `None` for base, target and gravity.
    pub const fn joint(&self) -> Option<usize> {
        match self {
            Self::Chain(Parameter::Link { joint, .. })
            | Self::Slide(Parameter::Link { joint, .. })
            | Self::Curve { joint, .. }
            | Self::SlideCurve { joint, .. } => Some(*joint),
            _ => None,
        }
    }

    /// The joint, from 1, whose zero it is: the turn of a joint that turns, the shift of one that slides; `None` for others.
    pub const fn zero_of(&self) -> Option<usize> {
        match self {
            Self::Chain(Parameter::Link { joint, quantity: LinkQuantity::Theta })
            | Self::Slide(Parameter::Link { joint, quantity: LinkQuantity::D }) => Some(*joint),
            _ => None,
        }
    }

    /// The largest change expected of it, mm or rad.
    pub fn unit(&self) -> f64 {
        match self {
            Self::Chain(parameter) | Self::Slide(parameter) if parameter.is_angle() => 1e-3 * UNIT,
            Self::Chain(_) | Self::Slide(_) => UNIT,
            Self::Gravity(_) | Self::Curve { .. } => CURVE_UNIT_RAD,
            Self::SlideGravity(_) | Self::SlideCurve { .. } => CURVE_UNIT_MM,
        }
    }

    /// Whether it is a motion of base or target.
    pub(super) const fn is_of_a_frame(&self) -> bool {
        matches!(self, Self::Chain(Parameter::Base(_) | Parameter::Target(_)))
    }

    /// The name of the column's unit: `mm` or `rad`.
    pub const fn unit_name(&self) -> &'static str {
        match self {
            Self::Chain(parameter) | Self::Slide(parameter) => parameter.unit(),
            Self::Gravity(_) | Self::Curve { .. } => "rad",
            Self::SlideGravity(_) | Self::SlideCurve { .. } => "mm",
        }
    }
}

impl fmt::Display for Column {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Chain(parameter) | Self::Slide(parameter) => parameter.fmt(f),
            Self::Gravity(place) | Self::SlideGravity(place) => write!(f, "gravity_{}", place + 1),
            Self::Curve { joint, coefficient } => write!(f, "curve_{joint}_{}", coefficient + 1),
            Self::SlideCurve { joint, at_mm } => write!(f, "curve_{joint}_at_{at_mm}_mm"),
        }
    }
}
