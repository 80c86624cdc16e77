//! Unit motions of a chain's elements, carried to its end.

use nalgebra::{Isometry3, Vector3};

use super::motion::Motion;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Twist {
    /// Velocity of the end's origin, mm per unit.
    pub linear: Vector3<f64>,
    /// Angular velocity, rad per unit.
    pub angular: Vector3<f64>,
}

impl Twist {
    pub fn zero() -> Self {
        Self { linear: Vector3::zeros(), angular: Vector3::zeros() }
    }

    pub fn add(&mut self, other: &Self, factor: f64) {
        self.linear += other.linear * factor;
        self.angular += other.angular * factor;
    }
}

/// The unit motion of an element before it is carried to the end: along a direction, or about a line.
#[derive(Debug, Clone, Copy)]
pub(super) enum UnitMotion {
    Translation(Vector3<f64>),
    Rotation { axis: Vector3<f64>, through: Vector3<f64> },
}

impl UnitMotion {
    pub(super) fn of(motion: Motion, frame: &Isometry3<f64>) -> Self {
        Self::along(motion, frame.rotation * motion.axis(), frame.translation.vector)
    }

    pub(super) const fn along(motion: Motion, axis: Vector3<f64>, through: Vector3<f64>) -> Self {
        match motion {
            Motion::Translation(_) => Self::Translation(axis),
            Motion::Rotation(_) => Self::Rotation { axis, through },
        }
    }

    pub(super) fn carried_to(self, end: &Vector3<f64>) -> Twist {
        match self {
            Self::Translation(direction) => Twist { linear: direction, angular: Vector3::zeros() },
            Self::Rotation { axis, through } => {
                Twist { linear: axis.cross(&(end - through)), angular: axis }
            }
        }
    }
}
