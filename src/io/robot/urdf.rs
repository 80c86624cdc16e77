//! URDF → the chain from a base link to a tip link, as a [`RobotFile`] of convention `urdf`, mm and degrees.
//!
//! The way goes up to the link that base and tip stand on and down from there (`tree`); each of its joints becomes a
//! joint of the file (`chain`, `joint`). Everything else is counted and left out. A URDF is foreign text: no entities,
//! no files that it could name, and bounds on its size. `roxmltree` reads the XML, since it gives the place of a fault;
//! `urdf-rs` gives none.

mod chain;
mod error;
mod joint;
mod tree;

use std::path::Path;

use roxmltree::{Document, Node, ParsingOptions};

use super::Selection;
use crate::kinematics::RobotFile;

pub use error::UrdfError;
pub(crate) use tree::{Joint, Tree};

/// The most XML nodes of a file; a humanoid has ten thousand.
const MOST_NODES: u32 = 2_000_000;

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    pub base: String,
    pub tip: String,
    pub elements: Vec<(&'static str, usize)>,
    pub joints: usize,
    pub remarks: Vec<String>,
}

pub fn read(
    path: &Path,
    text: &str,
    selection: &Selection,
) -> Result<(RobotFile, LeftOut), Box<UrdfError>> {
    let document = document(text)?;
    let tree = Tree::of(&document)?;
    let ends = tree.ends(selection)?;
    let steps = tree.steps(&ends);
    let source = path.file_name().unwrap_or_default().to_string_lossy();
    let (file, remarks) = chain::robot_file(&tree, &steps, &ends, &source)?;
    let left_out = LeftOut {
        base: ends.base.to_owned(),
        tip: ends.tip.to_owned(),
        elements: unread(&document),
        joints: tree.joints.len() - steps.len(),
        remarks,
    };
    Ok((file, left_out))
}

/// The XML of a URDF: foreign text, so without entities and of a bounded size.
pub(crate) fn document(text: &str) -> Result<Document<'_>, UrdfError> {
    let options =
        ParsingOptions { allow_dtd: false, nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|source| UrdfError::of_xml(&source))
}

/// Elements of the robot, and of its links, that nothing reads.
fn unread(document: &Document<'_>) -> Vec<(&'static str, usize)> {
    const UNREAD: [&str; 8] = [
        "inertial",
        "visual",
        "collision",
        "material",
        "transmission",
        "gazebo",
        "sensor",
        "ros2_control",
    ];
    let robot = document.root_element();
    let own = robot.children().filter(Node::is_element);
    let links = own.clone().filter(|node| node.has_tag_name("link"));
    let parts: Vec<_> = own.chain(links.flat_map(|link| link.children())).collect();
    let counted = UNREAD.map(|name| {
        let is_it = |node: &&Node<'_, '_>| node.tag_name().name() == name;
        (name, parts.iter().filter(is_it).count())
    });
    counted.into_iter().filter(|(_, count)| *count > 0).collect()
}

/// The first child with that name, of the same XML namespace.
pub(crate) fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    children(node, name).next()
}

fn children<'a, 'i>(node: Node<'a, 'i>, name: &str) -> impl Iterator<Item = Node<'a, 'i>> {
    let space = node.tag_name().namespace();
    node.children().filter(move |own| {
        own.is_element() && own.tag_name().name() == name && own.tag_name().namespace() == space
    })
}

fn attribute<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    let mut all = node.attributes();
    let own = all.find(|own| own.namespace().is_none() && own.name() == name);
    own.map(|own| own.value())
}

fn line(node: Node<'_, '_>) -> u32 {
    node.document().text_pos_at(node.range().start).row
}

#[cfg(test)]
mod tests;
