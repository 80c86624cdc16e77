//! An arm as the lines of its axes at zero, in the base frame. The motion by a variable is the turn about, or the slide
//! along, its lines (the product of exponentials of Brockett 1984). Two arms with the same screws are the same arm.

use nalgebra::{Isometry3, Point3, UnitVector3};

use super::chain::{Chain, Element};
use super::motion::Motion;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// A point of it, mm.
    pub point: Point3<f64>,
    pub direction: UnitVector3<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Screw {
    pub variable: usize,
    pub factor: f64,
    pub slides: bool,
    pub line: Line,
}

/// The axes of an arm and its flange at zero, in the base frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Screws {
    pub axes: Vec<Screw>,
    pub flange: Isometry3<f64>,
}

impl Line {
    pub fn z_of(frame: &Isometry3<f64>) -> Self {
        Self {
            point: frame.translation.vector.into(),
            direction: UnitVector3::new_normalize(frame.rotation * nalgebra::Vector3::z()),
        }
    }

    pub fn nearest_to(&self, other: &Point3<f64>) -> Point3<f64> {
        self.point + self.direction.scale(self.direction.dot(&(other - self.point)))
    }
}

impl Screws {
    /// `offsets` are added to the free parameters.
    pub fn of(chain: &Chain, offsets: &[f64]) -> Self {
        let chain = chain.with_offsets(offsets);
        let zeros = vec![0.0; chain.joint_count()];
        let mut axes = Vec::with_capacity(zeros.len());
        let mut frame = Isometry3::identity();
        for element in chain.elements() {
            if let Element::Joint { motion, joint, sign } = element {
                let direction = frame.rotation * motion.axis();
                axes.push(Screw {
                    variable: *joint,
                    factor: *sign,
                    slides: matches!(motion, Motion::Translation(_)),
                    line: Line {
                        point: frame.translation.vector.into(),
                        direction: UnitVector3::new_normalize(direction),
                    },
                });
            }
            frame *= element.nominal(&zeros);
        }
        Self { axes, flange: frame }
    }
}
