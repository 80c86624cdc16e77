use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::arm_error::ArmError;
use super::chain::Chain;
use super::convention::Convention;
use super::parameter::{LinkQuantity, Parameter};
use super::twist::Twist;
use crate::geometry::{Base, Flange, Transform};

mod text;

use text::ArmText;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    pub name: String,
    /// Lower limit of the reported angle, rad (mm for a joint that slides).
    #[serde(rename = "lower_rad")]
    pub lower: f64,
    #[serde(rename = "upper_rad")]
    pub upper: f64,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub slides: bool,
}

/// A nominal arm: its joints and its chain from base to flange. Its JSON has no home.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "ArmText", into = "ArmText")]
pub struct Arm {
    pub(super) model: String,
    pub(super) convention: Convention,
    pub(super) joints: Vec<Joint>,
    pub(super) home: Option<Box<[f64]>>,
    pub(super) map: Option<DMatrix<f64>>,
    pub(super) chain: Chain,
}

/// The joint map as a matrix, `None` for the identity; an error unless it is square and invertible.
pub(super) fn joint_map(
    rows: &[Vec<f64>],
    joints: usize,
) -> Result<Option<DMatrix<f64>>, ArmError> {
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

fn rows(map: &DMatrix<f64>) -> Vec<Vec<f64>> {
    map.row_iter().map(|row| row.iter().copied().collect()).collect()
}

impl Arm {
    /// An arm of a saved model; `map` is the joint map, row by row. The chain reads a variable of each joint.
    pub fn new(
        model: String,
        convention: Convention,
        joints: Vec<Joint>,
        map: &[Vec<f64>],
        chain: Chain,
    ) -> Result<Self, ArmError> {
        let map = joint_map(map, joints.len())?;
        Ok(Self { model, convention, joints, home: None, map, chain })
    }

    #[must_use]
    pub fn with_chain(&self, chain: Chain) -> Self {
        Self { chain, ..self.clone() }
    }

    pub fn model(&self) -> &str {
        &self.model
    }

    pub const fn convention(&self) -> Convention {
        self.convention
    }

    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Reported angles of the pose that the robot file names as home, rad; `None` where it names none.
    pub fn home(&self) -> Option<&[f64]> {
        self.home.as_deref()
    }

    pub const fn chain(&self) -> &Chain {
        &self.chain
    }

    /// The parameter offsets of the nominal arm: zeros.
    pub fn no_offsets(&self) -> Vec<f64> {
        vec![0.0; self.chain.parameters().len()]
    }

    /// Joints (counted from 1) whose link has Hayati's β, because two axes are nominally parallel.
    pub fn parallel_joints(&self) -> Vec<usize> {
        let joint = |parameter| match parameter {
            Parameter::Link { joint, quantity: LinkQuantity::Beta } => Some(joint),
            _ => None,
        };
        self.chain.parameters().into_iter().filter_map(joint).collect()
    }

    /// The joint map, row by row, as a robot file states it; `None` for the identity.
    pub(super) fn map_rows(&self) -> Option<Vec<Vec<f64>>> {
        self.map.as_ref().map(rows)
    }

    /// The matrix from reported joint angles to axis variables: the joint map, or the identity.
    pub fn axes_from_joints(&self) -> DMatrix<f64> {
        let joints = self.joints.len();
        self.map.clone().unwrap_or_else(|| DMatrix::identity(joints, joints))
    }

    /// The axis variables at reported joint angles, which are as many as the joints.
    pub fn axes(&self, joints: &[f64]) -> Vec<f64> {
        assert_eq!(joints.len(), self.joints.len(), "one angle for each joint");
        match &self.map {
            None => joints.to_vec(),
            Some(map) => (0..joints.len())
                .map(|i| map.row(i).iter().zip(joints).map(|(m, q)| m * q).sum())
                .collect(),
        }
    }

    pub fn joint_twists(&self, axis_twists: &[Twist]) -> Vec<Twist> {
        let Some(map) = &self.map else { return axis_twists.to_vec() };
        let column = |joint: usize| {
            axis_twists.iter().enumerate().fold(Twist::zero(), |sum, (axis, twist)| Twist {
                linear: sum.linear + twist.linear * map[(axis, joint)],
                angular: sum.angular + twist.angular * map[(axis, joint)],
            })
        };
        (0..self.joints.len()).map(column).collect()
    }

    /// The nominal flange pose at reported joint angles (rad), which are as many as the joints.
    pub fn flange(&self, joints: &[f64]) -> Transform<Base, Flange> {
        Transform::claim(match &self.map {
            None => self.chain.nominal(joints),
            Some(_) => self.chain.nominal(&self.axes(joints)),
        })
    }
}
