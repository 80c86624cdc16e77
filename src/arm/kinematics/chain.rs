//! A chain of elementary transforms, and its differential in geometric form (`posegrid::method::kinematics`, the seed
//! paper's Eqs. 3–7): a free element that moves by `ε` moves everything after it by `ε` times its unit twist, so a
//! column is that twist carried to the end.

use nalgebra::{Isometry3, Point3, Vector3};
use serde::{Deserialize, Serialize};

use super::axes::{Axes, AxisJoint};
use super::motion::Motion;
use super::parameter::Parameter;
use super::twist::{Twist, UnitMotion};

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Element {
    Fixed(Isometry3<f64>),
    /// A joint variable: the motion by `sign · q[joint]`.
    Joint {
        motion: Motion,
        joint: usize,
        /// Its motion per unit of the variable: +1 or −1, or any factor for a joint that follows another.
        sign: f64,
    },
    /// A constant with a free parameter: the motion by `nominal + offset`.
    Free {
        motion: Motion,
        /// The nominal value, mm or rad.
        nominal: f64,
        parameter: Parameter,
    },
}

#[derive(Debug, Clone, PartialEq)]
pub struct Differential {
    pub end: Isometry3<f64>,
    pub joints: Vec<Twist>,
    /// One twist per free parameter, in [`Chain::parameters`]' order.
    pub parameters: Vec<Twist>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Chain {
    elements: Vec<Element>,
    joints: usize,
}

impl Chain {
    pub fn new(elements: Vec<Element>) -> Self {
        let joints = elements.iter().filter_map(Element::joint).max().map_or(0, |last| last + 1);
        Self { elements, joints }
    }

    pub fn elements(&self) -> &[Element] {
        &self.elements
    }

    pub const fn joint_count(&self) -> usize {
        self.joints
    }

    /// The free parameters in the order of the parameter vector. This function alone owns that order.
    pub fn parameters(&self) -> Vec<Parameter> {
        self.elements.iter().filter_map(Element::parameter).collect()
    }

    #[must_use]
    pub fn extended(&self, before: Vec<Element>, after: Vec<Element>) -> Self {
        let mut elements = before;
        elements.extend_from_slice(&self.elements);
        elements.extend(after);
        Self::new(elements)
    }

    /// This chain with `offsets` (in [`Self::parameters`]' order) added to its nominal values.
    #[must_use]
    pub fn with_offsets(&self, offsets: &[f64]) -> Self {
        let mut next = offsets.iter();
        let elements = self.elements.iter().map(|element| match element {
            Element::Free { motion, nominal, parameter } => {
                let offset = next.next().expect("one offset for each free parameter");
                Element::Free { motion: *motion, nominal: nominal + offset, parameter: *parameter }
            }
            other => other.clone(),
        });
        Self { elements: elements.collect(), joints: self.joints }
    }

    /// The end in the root frame at the axis variables `q` (rad or mm), `offsets` added to the free parameters.
    pub fn forward(&self, q: &[f64], offsets: &[f64]) -> Isometry3<f64> {
        self.walk(q, offsets, |_, _| {})
    }

    /// The end of the nominal chain: [`Self::forward`] with no offsets.
    pub fn nominal(&self, q: &[f64]) -> Isometry3<f64> {
        let mut end = Isometry3::identity();
        for element in &self.elements {
            element.carry(&mut end, q, 0.0);
        }
        end
    }

    /// The origin and z axis of each axis variable's first joint in the root frame, at `q` with `offsets`.
    pub fn joint_axes(&self, q: &[f64], offsets: &[f64]) -> Vec<(Point3<f64>, Vector3<f64>)> {
        let mut axes = vec![None; self.joints];
        self.walk(q, offsets, |element, frame| {
            if let Element::Joint { motion, joint, .. } = element {
                let origin = Point3::from(frame.translation.vector);
                axes[*joint].get_or_insert((origin, frame.rotation * motion.axis()));
            }
        });
        let nowhere = (Point3::origin(), Vector3::z());
        axes.into_iter().map(|axis| axis.unwrap_or(nowhere)).collect()
    }

    /// Origins and directions of the joints at `q` with `offsets`, in the root frame.
    pub fn axes(&self, q: &[f64], offsets: &[f64]) -> Axes {
        let mut joints = Vec::with_capacity(self.joints);
        self.walk(q, offsets, |element, frame| {
            if let Element::Joint { motion, joint, sign } = element {
                joints.push(AxisJoint {
                    variable: *joint,
                    slides: matches!(motion, Motion::Translation(_)),
                    factor: *sign,
                    origin: frame.translation.vector.into(),
                    axis: frame.rotation * motion.axis(),
                });
            }
        });
        Axes::of(joints, self.joints)
    }

    /// Whether the first joint of each axis variable slides.
    pub fn slides(&self) -> Vec<bool> {
        let first = |variable: usize| {
            let mut joints = self.elements.iter();
            joints.find_map(|element| match element {
                Element::Joint { motion, joint, .. } if *joint == variable => Some(motion),
                _ => None,
            })
        };
        let slides = |variable| matches!(first(variable), Some(Motion::Translation(_)));
        (0..self.joints).map(slides).collect()
    }

    /// The end and its twists at the axis variables `q` with `offsets` added to the free parameters.
    pub fn differential(&self, q: &[f64], offsets: &[f64]) -> Differential {
        let mut joints = Vec::with_capacity(self.joints);
        let mut parameters = Vec::with_capacity(offsets.len());
        let end = self.walk(q, offsets, |element, frame| match element {
            Element::Fixed(_) => {}
            Element::Joint { motion, joint, sign } => {
                joints.push((*joint, *sign, UnitMotion::of(*motion, frame)));
            }
            Element::Free { motion, .. } => parameters.push(UnitMotion::of(*motion, frame)),
        });
        let tip = end.translation.vector;
        let mut joint_twists = vec![Twist::zero(); self.joints];
        for (joint, sign, unit) in joints {
            joint_twists[joint].add(&unit.carried_to(&tip), sign);
        }
        let parameters = parameters.into_iter().map(|unit| unit.carried_to(&tip));
        Differential { end, joints: joint_twists, parameters: parameters.collect() }
    }

    fn walk(
        &self,
        q: &[f64],
        offsets: &[f64],
        mut at: impl FnMut(&Element, &Isometry3<f64>),
    ) -> Isometry3<f64> {
        let mut frame = Isometry3::identity();
        let mut next = offsets.iter();
        for element in &self.elements {
            at(element, &frame);
            let offset = match element {
                Element::Free { .. } => *next.next().expect("one offset for each free parameter"),
                _ => 0.0,
            };
            element.carry(&mut frame, q, offset);
        }
        frame
    }
}

impl Element {
    pub const fn parameter(&self) -> Option<Parameter> {
        match self {
            Self::Free { parameter, .. } => Some(*parameter),
            Self::Fixed(_) | Self::Joint { .. } => None,
        }
    }

    /// The axis variable that moves it, from 0; `None` where it does not move.
    pub const fn joint(&self) -> Option<usize> {
        match self {
            Self::Joint { joint, .. } => Some(*joint),
            Self::Fixed(_) | Self::Free { .. } => None,
        }
    }

    /// Carries a frame over the element, a free one with `offset` added to its nominal value.
    fn carry(&self, frame: &mut Isometry3<f64>, q: &[f64], offset: f64) {
        match self {
            Self::Fixed(isometry) => *frame *= isometry,
            Self::Joint { motion, joint, sign } => motion.carry(frame, sign * q[*joint]),
            Self::Free { motion, nominal, .. } => motion.carry(frame, nominal + offset),
        }
    }

    pub(super) fn nominal(&self, q: &[f64]) -> Isometry3<f64> {
        match self {
            Self::Fixed(isometry) => *isometry,
            Self::Joint { motion, joint, sign } => motion.by(sign * q[*joint]),
            Self::Free { motion, nominal, .. } => motion.by(*nominal),
        }
    }
}
