//! The chain of a URDF between two links, with the places of its origins in the text.
//!
//! The way goes up from the base link to the link that base and tip both stand on, through joints that do not move, and down from
//! there to the tip. Joints beside it are not read.

use nalgebra::{Isometry3, UnitVector3, Vector3};
use roxmltree::{Document, Node, ParsingOptions};
use thiserror::Error;

use super::origins::{ChainJoint, Moves};
use crate::geometry::isometry_from_rpy;
use crate::units::MM_PER_M;

/// The most XML nodes of a file; a humanoid has ten thousand.
const MOST_NODES: u32 = 2_000_000;

/// The two ends of a chain.
#[derive(Debug, Clone, Copy)]
pub struct Ends<'a> {
    /// The link that is the controller's base.
    pub base: &'a str,
    /// The link that is the controller's flange.
    pub tip: &'a str,
}

/// A joint of the chain.
#[derive(Debug)]
pub(super) struct Step<'a, 'i> {
    pub joint: ChainJoint,
    pub node: Node<'a, 'i>,
}

/// The reason why a URDF has no such chain.
#[derive(Debug, Error)]
pub enum UrdfChainError {
    /// No XML.
    #[error("is not XML: {0}")]
    Xml(#[from] roxmltree::Error),
    /// No URDF.
    #[error("is not a URDF: its root element is {found:?}, not \"robot\"")]
    NotRobot {
        /// The root element.
        found: String,
    },
    /// Properties and macros.
    #[error(
        "has in line {line} {found:?}, which is xacro; expand it first: xacro my.urdf.xacro > my.urdf (or give xacro the result of --format xacro)"
    )]
    Xacro {
        /// Where.
        line: u32,
        /// The text.
        found: String,
    },
    /// No such link.
    #[error("has no link {link:?}; it has {links}")]
    NoLink {
        /// The link asked for.
        link: String,
        /// The links that there are.
        links: String,
    },
    /// A circle of joints, or two trees.
    #[error("has no way from link {base:?} to link {tip:?}")]
    NoWay {
        /// The base link.
        base: String,
        /// The tip link.
        tip: String,
    },
    /// A joint that the way cannot go through.
    #[error("line {line}: joint {joint:?} {problem}")]
    Joint {
        /// Where.
        line: u32,
        /// The joint's name.
        joint: String,
        /// What is wrong with it.
        problem: String,
    },
}

/// The XML of a URDF: foreign text, so without entities and of a bounded size.
pub(super) fn document(text: &str) -> Result<Document<'_>, UrdfChainError> {
    let options = ParsingOptions {
        allow_dtd: false,
        nodes_limit: MOST_NODES,
        ..ParsingOptions::default()
    };
    let document = Document::parse_with_options(text, options)?;
    let root = document.root_element();
    if root.tag_name().name() != "robot" {
        return Err(UrdfChainError::NotRobot {
            found: root.tag_name().name().to_owned(),
        });
    }
    Ok(document)
}

/// The joints from the base link to the tip link.
pub(super) fn steps<'a, 'i>(
    document: &'a Document<'i>,
    ends: Ends<'_>,
) -> Result<Vec<Step<'a, 'i>>, UrdfChainError> {
    let (up, down) = (
        ways(document, ends, ends.base)?,
        ways(document, ends, ends.tip)?,
    );
    let shared = up.iter().rev().zip(down.iter().rev());
    let shared = shared.take_while(|(one, other)| one == other).count();
    let root_of = |way: &[Node<'_, '_>], link: &str| {
        let last = way.last().and_then(|joint| linked(*joint, "parent"));
        last.unwrap_or(link).to_owned()
    };
    if root_of(&up, ends.base) != root_of(&down, ends.tip) {
        return Err(no_way(ends));
    }
    let climbed = up[..up.len() - shared].iter();
    let mut steps: Vec<Step<'a, 'i>> = climbed
        .map(|node| upwards(*node))
        .collect::<Result<_, _>>()?;
    for node in down[..down.len() - shared].iter().rev() {
        steps.push(Step {
            joint: joint(*node)?,
            node: *node,
        });
    }
    Ok(steps)
}

/// The joints from a link to the root, the link's own first.
fn ways<'a, 'i>(
    document: &'a Document<'i>,
    ends: Ends<'_>,
    from: &str,
) -> Result<Vec<Node<'a, 'i>>, UrdfChainError> {
    let robot = document.root_element();
    let links = || elements(robot, "link").filter_map(|link| link.attribute("name"));
    if !links().any(|link| link == from) {
        return Err(UrdfChainError::NoLink {
            link: from.to_owned(),
            links: links().collect::<Vec<_>>().join(", "),
        });
    }
    let joints: Vec<Node<'a, 'i>> = elements(robot, "joint").collect();
    let (mut way, mut link) = (Vec::new(), Some(from));
    while let Some(joint) = joints.iter().find(|joint| linked(**joint, "child") == link) {
        if way.len() == joints.len() {
            return Err(no_way(ends));
        }
        way.push(*joint);
        link = linked(*joint, "parent");
    }
    Ok(way)
}

fn no_way(ends: Ends<'_>) -> UrdfChainError {
    UrdfChainError::NoWay {
        base: ends.base.to_owned(),
        tip: ends.tip.to_owned(),
    }
}

fn elements<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    let is_it = move |child: &Node<'_, '_>| child.is_element() && child.tag_name().name() == name;
    node.children().filter(is_it)
}

/// The first element of that name in a joint.
pub(super) fn part<'a, 'i>(joint: Node<'a, 'i>, name: &'static str) -> Option<Node<'a, 'i>> {
    elements(joint, name).next()
}

/// The link that a joint names.
fn linked<'a>(joint: Node<'a, '_>, role: &'static str) -> Option<&'a str> {
    part(joint, role)?.attribute("link")
}

/// A joint on the way up: from its child to its parent.
fn upwards<'a, 'i>(node: Node<'a, 'i>) -> Result<Step<'a, 'i>, UrdfChainError> {
    let down = joint(node)?;
    if down.moves.is_some() {
        return Err(wrong(
            node,
            "moves and stands between the root and the base: give a base that the tip stands on",
        ));
    }
    let origin = down.origin.inverse();
    Ok(Step {
        joint: ChainJoint { origin, ..down },
        node,
    })
}

fn joint(node: Node<'_, '_>) -> Result<ChainJoint, UrdfChainError> {
    Ok(ChainJoint {
        name: node.attribute("name").unwrap_or_default().to_owned(),
        origin: origin(node)?,
        moves: moves(node)?,
    })
}

fn moves(node: Node<'_, '_>) -> Result<Option<Moves>, UrdfChainError> {
    let slides = match node.attribute("type") {
        Some("fixed") => return Ok(None),
        Some("revolute" | "continuous") => false,
        Some("prismatic") => true,
        other => {
            let problem = format!(
                "is of type {:?}, which no arm's axis is",
                other.unwrap_or_default()
            );
            return Err(wrong(node, &problem));
        }
    };
    if part(node, "mimic").is_some() {
        return Err(wrong(
            node,
            "follows another one, and its origin is not that of an axis",
        ));
    }
    let axis = match part(node, "axis") {
        Some(axis) => three(node, axis, "xyz", [1.0, 0.0, 0.0])?,
        None => [1.0, 0.0, 0.0],
    };
    let axis = UnitVector3::try_new(Vector3::from(axis), 1e-9);
    let axis = axis.ok_or_else(|| wrong(node, "has an axis without a direction"))?;
    Ok(Some(Moves { axis, slides }))
}

/// The origin of a joint, mm; none changes nothing.
fn origin(node: Node<'_, '_>) -> Result<Isometry3<f64>, UrdfChainError> {
    let Some(origin) = part(node, "origin") else {
        return Ok(Isometry3::identity());
    };
    let xyz = three(node, origin, "xyz", [0.0; 3])?;
    let rpy = three(node, origin, "rpy", [0.0; 3])?;
    Ok(isometry_from_rpy(xyz.map(|metres| metres * MM_PER_M), rpy))
}

/// Three numbers of an attribute; `otherwise` where it is not there.
fn three(
    joint: Node<'_, '_>,
    node: Node<'_, '_>,
    name: &str,
    otherwise: [f64; 3],
) -> Result<[f64; 3], UrdfChainError> {
    let Some(text) = node.attribute(name) else {
        return Ok(otherwise);
    };
    if text.contains("${") || text.contains("$(") {
        return Err(UrdfChainError::Xacro {
            line: line(node),
            found: text.to_owned(),
        });
    }
    let numbers: Option<Vec<f64>> = text
        .split_whitespace()
        .map(|number| {
            number
                .parse()
                .ok()
                .filter(|number: &f64| number.is_finite())
        })
        .collect();
    let numbers = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
    numbers.ok_or_else(|| {
        wrong(
            joint,
            &format!("has {name} {text:?}, which are not three numbers"),
        )
    })
}

fn wrong(node: Node<'_, '_>, problem: &str) -> UrdfChainError {
    UrdfChainError::Joint {
        line: line(node),
        joint: node.attribute("name").unwrap_or_default().to_owned(),
        problem: problem.to_owned(),
    }
}

fn line(node: Node<'_, '_>) -> u32 {
    node.document().text_pos_at(node.range().start).row
}
