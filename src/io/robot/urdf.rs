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

use std::borrow::Cow;
use std::path::Path;

use roxmltree::{Document, Node, ParsingOptions};

use super::Selection;
use crate::kinematics::RobotFile;

use error::Result;
pub use error::UrdfError;
pub(super) use error::printable;
pub(super) use joint::mm;
pub(crate) use tree::{Joint, Tree};
use tree::{is_xacro, refuse_xacro};

/// The most XML nodes of a file; a humanoid has ten thousand.
const MOST_NODES: u32 = 2_000_000;

/// The most quotes of an element, two for each attribute: the reader compares each name with all before it.
const MOST_QUOTES: usize = 2000;
/// The most prefixes without a declaration.
const MOST_PREFIXES: usize = 16;

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
    let text = declared(text);
    let document = document(&text)?;
    let read = of_document(path, &document, selection);
    // What xacro has not made yet may be what is missing.
    read.map_err(|fault| Box::new(refuse_xacro(document.root()).err().unwrap_or(fault)))
}

fn of_document(
    path: &Path,
    document: &Document<'_>,
    selection: &Selection,
) -> Result<(RobotFile, LeftOut)> {
    let tree = Tree::of(document)?;
    let ends = tree.ends(selection)?;
    let steps = tree.steps(&ends);
    let source = path.file_name().unwrap_or_default().to_string_lossy();
    let (file, remarks) = chain::robot_file(&tree, &steps, &ends, &source)?;
    let left_out = LeftOut {
        base: ends.base.to_owned(),
        tip: ends.tip.to_owned(),
        elements: unread(document),
        joints: tree.joints.len() - steps.len(),
        remarks,
    };
    Ok((file, left_out))
}

/// The XML of a URDF: foreign text, so without entities and of a bounded size.
pub(crate) fn document(text: &str) -> Result<Document<'_>> {
    let mut tags = text.split('<').enumerate();
    let quotes = |tag: &str| tag.bytes().filter(|byte| matches!(byte, b'"' | b'\'')).count();
    if let Some((place, _)) = tags.find(|(_, tag)| quotes(tag) > MOST_QUOTES) {
        let before: usize = text.split('<').take(place).map(|tag| tag.len() + 1).sum();
        let line = text[..before.min(text.len())].lines().count();
        return Err(UrdfError::Xml {
            line: u32::try_from(line).unwrap_or(u32::MAX),
            column: 1,
            problem: format!("an element has more than {} attributes", MOST_QUOTES / 2),
        });
    }
    let options =
        ParsingOptions { allow_dtd: false, nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|source| UrdfError::of_xml(&source))
}

/// The text with a declaration for each prefix that lacks one, as those of simulators do; its lines stay.
fn declared(text: &str) -> Cow<'_, str> {
    const ROBOT: &str = "<robot";
    let mut text = Cow::Borrowed(text);
    for _ in 0..MOST_PREFIXES {
        match document(&text) {
            Err(UrdfError::Prefix { prefix, .. }) if text.contains(ROBOT) => {
                let declaration = format!("{ROBOT} xmlns:{prefix}=\"undeclared-{prefix}\"");
                text = Cow::Owned(text.replacen(ROBOT, &declaration, 1));
            }
            _ => break,
        }
    }
    text
}

/// Elements of the robot, and of its links, that nothing reads.
fn unread(document: &Document<'_>) -> Vec<(&'static str, usize)> {
    const UNREAD: &str =
        "inertial visual collision material transmission gazebo sensor ros2_control";
    let robot = document.root_element();
    let xacro = robot.descendants().filter(is_xacro).count();
    let own = robot.children().filter(Node::is_element);
    let links = own.clone().filter(|node| node.has_tag_name("link"));
    let parts: Vec<_> = own.chain(links.flat_map(|link| link.children())).collect();
    let counted = UNREAD.split(' ').map(|name| {
        let is_it = |node: &&Node<'_, '_>| node.tag_name().name() == name;
        (name, parts.iter().filter(is_it).count())
    });
    counted.chain([("xacro", xacro)]).filter(|(_, count)| *count > 0).collect()
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
