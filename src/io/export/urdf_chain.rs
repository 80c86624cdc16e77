//! The chain of a URDF between two links, with the places of its origins in the text. It is read as a robot file is
//! ([`crate::robot::urdf`]), but every origin has to be one that can be changed: joints on the way up are fixed, none
//! follows another, and rotations are roll, pitch and yaw.

use nalgebra::UnitVector3;
use roxmltree::{Document, Node};
use thiserror::Error;

use super::origins::{ChainJoint, Moves};
use crate::kinematics::JointKind;
use crate::robot::Selection;
use crate::robot::urdf::{Joint, Tree, UrdfError, child};

#[derive(Debug, Clone, Copy)]
pub struct Ends<'a> {
    pub base: &'a str,
    pub tip: &'a str,
}

#[derive(Debug)]
pub(super) struct Step<'a, 'i> {
    pub joint: ChainJoint,
    pub node: Node<'a, 'i>,
}

#[derive(Debug, Error)]
pub enum UrdfChainError {
    #[error("it is not XML: line {line}, column {column}: {problem}")]
    Xml { line: u32, column: u32, problem: String },
    #[error(
        "it has in line {line} {found:?}, which is xacro; expand it first: xacro my.urdf.xacro > my.urdf"
    )]
    Xacro { line: u32, found: String },
    #[error("it has no link {link:?}; it has {}", links.join(", "))]
    NoLink { link: String, links: Vec<String> },
    #[error("line {line}: joint {joint:?} {problem}")]
    Joint { line: u32, joint: String, problem: String },
    #[error("{0}")]
    Urdf(Box<UrdfError>),
}

impl From<UrdfError> for UrdfChainError {
    fn from(fault: UrdfError) -> Self {
        match fault {
            UrdfError::Xml { line, column, problem } => Self::Xml { line, column, problem },
            UrdfError::Xacro { line, found } => Self::Xacro { line, found },
            UrdfError::NoSuchEnd { link, links, .. }
            | UrdfError::UnknownLink { link, links, .. } => Self::NoLink { link, links },
            UrdfError::Number { line, joint, key, found, wanted } => Self::Joint {
                line,
                joint,
                problem: format!("has {key} {found:?}, which are not {wanted}"),
            },
            other => Self::Urdf(Box::new(other)),
        }
    }
}

pub(super) fn steps<'a, 'i>(
    document: &'a Document<'i>,
    ends: Ends<'_>,
) -> Result<Vec<Step<'a, 'i>>, UrdfChainError> {
    let tree = Tree::of(document)?;
    let [base, tip] = [ends.base, ends.tip].map(|end| Some(end.to_owned()));
    let selection = Selection { base, tip, joints: None };
    let ends = tree.ends(&selection)?;
    let way = tree.steps(&ends).into_iter();
    way.map(|step| Ok(Step { joint: chain_joint(step.joint, step.is_up)?, node: step.joint.node }))
        .collect()
}

/// A joint on the way; `is_up` from its child to its parent.
fn chain_joint(joint: &Joint<'_, '_>, is_up: bool) -> Result<ChainJoint, UrdfChainError> {
    let stated = child(joint.node, "origin");
    if stated.is_some_and(|origin| origin.has_attribute("quat_xyzw")) {
        return Err(wrong(
            joint,
            "has an origin with quat_xyzw: write its rotation as rpy, which another origin is written in",
        ));
    }
    let origin = joint.origin()?.isometry();
    let moves = moves(joint)?;
    if is_up && moves.is_some() {
        return Err(wrong(
            joint,
            "moves and stands between the root and the base: give a base that the tip stands on",
        ));
    }
    let origin = if is_up { origin.inverse() } else { origin };
    Ok(ChainJoint { name: joint.name.to_owned(), origin, moves })
}

fn moves(joint: &Joint<'_, '_>) -> Result<Option<Moves>, UrdfChainError> {
    let kind = joint.kind()?;
    if kind == JointKind::Fixed {
        return Ok(None);
    }
    if joint.following()?.is_some() {
        return Err(wrong(joint, "follows another one, and its origin is not that of an axis"));
    }
    let axis = UnitVector3::new_normalize(joint.axis()?);
    Ok(Some(Moves { axis, slides: kind == JointKind::Prismatic }))
}

fn wrong(joint: &Joint<'_, '_>, problem: &str) -> UrdfChainError {
    let (line, problem) = (joint.line(), problem.to_owned());
    UrdfChainError::Joint { line, joint: joint.name.to_owned(), problem }
}
