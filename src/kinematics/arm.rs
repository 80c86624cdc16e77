//! A robot file made into a chain: links in standard DH, joint names, limits and coupling.
//!
//! Standard DH (the seed paper's Eq. 2): `A_i = Rot(z,θ_i) Trans(z,d_i) Trans(x,a_i) Rot(x,α_i)`, `θ_i = s_i q_i + offset_i`.
//! Where the next axis is nominally parallel, `d_i` is fixed and Hayati's `Rot(y,β_i)` is added.

use nalgebra::{DMatrix, Isometry3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::chain::{Chain, Element};
use super::motion::{Axis, Motion};
use super::parameter::{LinkQuantity, Parameter};
use super::twist::Twist;
use crate::geometry::{Base, Flange, Transform};

/// Two axes count as parallel when the sine of the twist between them is below this: half a degree. Nominal arms are
/// drawn with exact right angles and parallels, so anything between is a typing error or a truly skew axis.
const PARALLEL_SINE: f64 = 0.0087;

/// A nominal arm as `pipelines/robots/*.toml` states it.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct RobotFile {
    /// The robot model's name for display: `"KUKA KR 210 R2700 extra"`.
    pub model: String,
    /// The source of the numbers: a data sheet or drawing.
    pub source: String,
    /// The convention that the link values follow.
    pub convention: Convention,
    /// The joints from base to flange.
    pub joint: Vec<JointFile>,
    /// A pose that can be checked at the cell, reported angles in degrees: `posegrid check` prints the nominal flange there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub home_deg: Option<Vec<f64>>,
    /// Coupling of the axes: row i gives axis i as a linear combination of the reported joint angles. Identity when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_map: Option<Vec<Vec<f64>>>,
}

/// Conventions a robot file may be written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Convention {
    /// Standard (distal) Denavit–Hartenberg.
    StandardDh,
}

/// One joint of a robot file, with the DH link it moves.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct JointFile {
    /// The name under which the controller reports it.
    pub name: String,
    /// Link length a, mm.
    pub a_mm: f64,
    /// Link twist α, degrees.
    pub alpha_deg: f64,
    /// Link offset d, mm.
    pub d_mm: f64,
    /// Joint offset, degrees.
    pub offset_deg: f64,
    /// +1 or −1: which way the controller counts.
    pub sign: i8,
    /// Lower and upper limit of the reported angle, degrees.
    pub limits_deg: [f64; 2],
}

/// One joint: its name in the controller and its limits.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// The name under which the controller reports it.
    pub name: String,
    /// Lower limit of the reported angle, rad.
    pub lower: f64,
    /// Upper limit of the reported angle, rad.
    pub upper: f64,
}

/// A nominal arm: its joints and its chain from base to flange.
#[derive(Debug, Clone, PartialEq)]
pub struct Arm {
    model: String,
    joints: Vec<Joint>,
    home: Option<Box<[f64]>>,
    map: Option<DMatrix<f64>>,
    chain: Chain,
    parallel: Vec<usize>,
}

/// A fault of a robot file.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ArmError {
    /// No joints, or too many to be an arm.
    #[error(
        "the robot file has {found} joints; an arm has 1 to 16: add a [[joint]] table for each"
    )]
    JointCount {
        /// Number of joints found.
        found: usize,
    },
    /// A sign other than ±1.
    #[error("joint {joint:?}: sign = {found}, but a sign is 1 or -1")]
    Sign {
        /// The joint's name.
        joint: String,
        /// The sign found.
        found: i8,
    },
    /// Limits in the wrong order or not finite.
    #[error(
        "joint {joint:?}: limits_deg = [{lower}, {upper}]; the lower limit comes first and both are finite"
    )]
    Limits {
        /// The joint's name.
        joint: String,
        /// The lower limit found.
        lower: f64,
        /// The upper limit found.
        upper: f64,
    },
    /// A link value that is not a number.
    #[error("joint {joint:?}: {quantity} is not a finite number")]
    NotFinite {
        /// The joint's name.
        joint: String,
        /// The key of the value.
        quantity: &'static str,
    },
    /// A joint's name appears twice.
    #[error("joint {joint:?} appears twice in the robot file; each joint needs a name of its own")]
    DuplicateJoint {
        /// The joint's name.
        joint: String,
    },
    /// A home pose that is not one of this arm.
    #[error("home_deg = {found:?}; give one finite angle for each of the {joints} joints")]
    Home {
        /// The angles found, degrees.
        found: Vec<f64>,
        /// Number of joints in the file.
        joints: usize,
    },
    /// A joint map of the wrong shape, or one that cannot be inverted.
    #[error("joint_map has to be an invertible matrix of {joints} rows of {joints} numbers")]
    JointMap {
        /// Number of joints in the file.
        joints: usize,
    },
}

impl RobotFile {
    /// The arm that the file describes; an error where a value is wrong.
    pub fn arm(&self) -> Result<Arm, ArmError> {
        if self.joint.is_empty() || self.joint.len() > 16 {
            return Err(ArmError::JointCount {
                found: self.joint.len(),
            });
        }
        for (index, joint) in self.joint.iter().enumerate() {
            joint.check()?;
            if self.joint[..index]
                .iter()
                .any(|other| other.name == joint.name)
            {
                return Err(ArmError::DuplicateJoint {
                    joint: joint.name.clone(),
                });
            }
        }
        let parallel = self.parallel_joints();
        let link = match self.convention {
            Convention::StandardDh => JointFile::standard_dh,
        };
        let mut elements = Vec::new();
        for (index, joint) in self.joint.iter().enumerate() {
            elements.extend(link(joint, index, parallel.contains(&(index + 1))));
        }
        Ok(Arm {
            model: self.model.clone(),
            joints: self.joint.iter().map(JointFile::joint).collect(),
            home: self.home()?,
            map: self.map()?,
            chain: Chain::new(elements),
            parallel,
        })
    }

    /// Joints (counted from 1) whose axis is nominally parallel to the next one's. The last has no next.
    fn parallel_joints(&self) -> Vec<usize> {
        let last = self.joint.len() - 1;
        let is_parallel =
            |joint: &JointFile| joint.alpha_deg.to_radians().sin().abs() < PARALLEL_SINE;
        (1..=last)
            .filter(|&number| is_parallel(&self.joint[number - 1]))
            .collect()
    }

    /// The home pose, rad; an error unless it has a finite angle for each joint.
    fn home(&self) -> Result<Option<Box<[f64]>>, ArmError> {
        let Some(home) = &self.home_deg else {
            return Ok(None);
        };
        if home.len() != self.joint.len() || home.iter().any(|angle| !angle.is_finite()) {
            return Err(ArmError::Home {
                found: home.clone(),
                joints: self.joint.len(),
            });
        }
        Ok(Some(home.iter().map(|angle| angle.to_radians()).collect()))
    }

    fn map(&self) -> Result<Option<DMatrix<f64>>, ArmError> {
        let rows = self.joint_map.as_deref();
        rows.map_or(Ok(None), |rows| joint_map(rows, self.joint.len()))
    }
}

/// The joint map as a matrix, `None` for the identity; an error unless it is square and invertible.
fn joint_map(rows: &[Vec<f64>], joints: usize) -> Result<Option<DMatrix<f64>>, ArmError> {
    let wrong = ArmError::JointMap { joints };
    if rows.len() != joints || rows.iter().any(|row| row.len() != joints) {
        return Err(wrong);
    }
    let map = DMatrix::from_fn(joints, joints, |row, column| rows[row][column]);
    let inverse = map.clone().try_inverse();
    if inverse.is_none_or(|inverse| inverse.iter().any(|x| !x.is_finite())) {
        return Err(wrong);
    }
    Ok((map != DMatrix::identity(joints, joints)).then_some(map))
}

/// The joint (counted from 1) whose Hayati angle this parameter is; `None` for any other parameter.
const fn with_beta(parameter: Parameter) -> Option<usize> {
    match parameter {
        Parameter::Link {
            joint,
            quantity: LinkQuantity::Beta,
        } => Some(joint),
        _ => None,
    }
}

impl JointFile {
    fn check(&self) -> Result<(), ArmError> {
        let joint = || self.name.clone();
        if self.sign.abs() != 1 {
            return Err(ArmError::Sign {
                joint: joint(),
                found: self.sign,
            });
        }
        let [lower, upper] = self.limits_deg;
        if !(lower.is_finite() && upper.is_finite() && lower < upper) {
            return Err(ArmError::Limits {
                joint: joint(),
                lower,
                upper,
            });
        }
        let values = [
            ("a_mm", self.a_mm),
            ("alpha_deg", self.alpha_deg),
            ("d_mm", self.d_mm),
            ("offset_deg", self.offset_deg),
        ];
        match values.into_iter().find(|(_, value)| !value.is_finite()) {
            Some((quantity, _)) => Err(ArmError::NotFinite {
                joint: joint(),
                quantity,
            }),
            None => Ok(()),
        }
    }

    fn joint(&self) -> Joint {
        let [lower, upper] = self.limits_deg.map(f64::to_radians);
        Joint {
            name: self.name.clone(),
            lower,
            upper,
        }
    }

    /// The link in standard DH, with Hayati's β in the place of d where the next axis is parallel.
    fn standard_dh(&self, index: usize, next_is_parallel: bool) -> Vec<Element> {
        let free = |motion, nominal, quantity| Element::Free {
            motion,
            nominal,
            parameter: Parameter::Link {
                joint: index + 1,
                quantity,
            },
        };
        let z = Motion::Rotation(Axis::Z);
        let mut elements = vec![
            free(z, self.offset_deg.to_radians(), LinkQuantity::Theta),
            Element::Joint {
                motion: z,
                joint: index,
                sign: f64::from(self.sign),
            },
        ];
        let along_z = Motion::Translation(Axis::Z);
        if next_is_parallel {
            elements.push(Element::Fixed(along_z.by(self.d_mm)));
        } else {
            elements.push(free(along_z, self.d_mm, LinkQuantity::D));
        }
        elements.push(free(
            Motion::Translation(Axis::X),
            self.a_mm,
            LinkQuantity::A,
        ));
        elements.push(free(
            Motion::Rotation(Axis::X),
            self.alpha_deg.to_radians(),
            LinkQuantity::Alpha,
        ));
        if next_is_parallel {
            elements.push(free(Motion::Rotation(Axis::Y), 0.0, LinkQuantity::Beta));
        }
        elements
    }
}

impl Arm {
    /// An arm built from the joints and the chain of a saved model; `map` is the joint map, row by row.
    ///
    /// The chain must read as many joint variables as there are joints.
    pub fn new(
        model: String,
        joints: Vec<Joint>,
        map: &[Vec<f64>],
        chain: Chain,
    ) -> Result<Self, ArmError> {
        let parallel = chain.parameters().into_iter().filter_map(with_beta);
        Ok(Self {
            model,
            home: None,
            map: joint_map(map, joints.len())?,
            joints,
            parallel: parallel.collect(),
            chain,
        })
    }

    /// This arm with another chain on the same joints.
    ///
    /// The chain must read as many joint variables as there are joints.
    #[must_use]
    pub fn with_chain(&self, chain: Chain) -> Self {
        let parallel = chain.parameters().into_iter().filter_map(with_beta);
        Self {
            parallel: parallel.collect(),
            chain,
            ..self.clone()
        }
    }

    /// The model's name.
    pub fn model(&self) -> &str {
        &self.model
    }

    /// The joints from base to flange.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Reported angles of the pose that the robot file names as home, rad; `None` where it names none.
    pub fn home(&self) -> Option<&[f64]> {
        self.home.as_deref()
    }

    /// The chain from base to flange, on axis variables (see [`Self::axes`]).
    pub const fn chain(&self) -> &Chain {
        &self.chain
    }

    /// Joints (counted from 1) that carry Hayati's β because the next axis is nominally parallel.
    pub fn parallel_joints(&self) -> &[usize] {
        &self.parallel
    }

    /// The axis variables at reported joint angles: the joint map applied, or the angles themselves without one.
    ///
    /// # Panics
    /// When the number of angles is not the number of joints.
    pub fn axes(&self, joints: &[f64]) -> Vec<f64> {
        assert_eq!(joints.len(), self.joints.len(), "one angle for each joint");
        match &self.map {
            None => joints.to_vec(),
            Some(map) => (0..joints.len())
                .map(|i| map.row(i).iter().zip(joints).map(|(m, q)| m * q).sum())
                .collect(),
        }
    }

    /// Twists per reported joint angle, from twists per axis variable.
    pub fn joint_twists(&self, axis_twists: &[Twist]) -> Vec<Twist> {
        let Some(map) = &self.map else {
            return axis_twists.to_vec();
        };
        let column = |joint: usize| {
            axis_twists
                .iter()
                .enumerate()
                .fold(Twist::zero(), |sum, (axis, twist)| Twist {
                    linear: sum.linear + twist.linear * map[(axis, joint)],
                    angular: sum.angular + twist.angular * map[(axis, joint)],
                })
        };
        (0..self.joints.len()).map(column).collect()
    }

    /// The flange pose in the base frame of the nominal arm at reported joint angles, rad.
    ///
    /// # Panics
    /// When the number of angles is not the number of joints.
    pub fn flange(&self, joints: &[f64]) -> Transform<Base, Flange> {
        Transform::claim(self.nominal_isometry(joints))
    }

    /// Whether every angle lies within its joint's limits.
    pub fn within_limits(&self, joints: &[f64]) -> bool {
        self.joints
            .iter()
            .zip(joints)
            .all(|(joint, &q)| (joint.lower..=joint.upper).contains(&q))
    }

    fn nominal_isometry(&self, joints: &[f64]) -> Isometry3<f64> {
        match &self.map {
            None => self.chain.nominal(joints),
            Some(_) => self.chain.nominal(&self.axes(joints)),
        }
    }
}
