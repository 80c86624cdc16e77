//! JSON messages (RFC 8259, and `NaN`, `Infinity`, `-Infinity`, which Python writes): wanted paths → a tree of the
//! names on the way → the wanted values of each message in one pass. `null` is no value; where a name is given twice
//! the last value counts. A JSON Schema is not needed; it shows the fields. Where a message has the same template as
//! the one before, only the numbers are read ([`template`](super::template)).

mod bytes;
mod number;
mod read;
mod scan;
mod schema;

use std::sync::Arc;

use super::FieldPath;
use super::path::{Segment, Want};

pub(super) use read::NumberSlot;
pub use schema::JsonSchema;

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JsonReader {
    /// The first one is the message itself.
    nodes: Vec<Node>,
    wanted: usize,
    /// Tells whether a message was read by this reader.
    identity: Arc<()>,
}

#[derive(Debug, Clone, PartialEq, Eq, Default)]
struct Node {
    /// The value itself, a number, a string or an array of either: the slots, and whether it is added to a list there.
    slots: Vec<(usize, bool)>,
    names: Vec<(String, usize)>,
    elements: Vec<(usize, usize)>,
    /// The child for every element of an array, and the lists that it is added to.
    each: Option<(usize, Vec<usize>)>,
    /// All slots at or below it, and whether they are added to a list that begins above it.
    below: Vec<(usize, bool)>,
}

impl JsonReader {
    pub fn new(wanted: &[FieldPath]) -> Self {
        let mut reader =
            Self { nodes: vec![Node::default()], wanted: wanted.len(), identity: Arc::new(()) };
        for (slot, path) in wanted.iter().enumerate() {
            reader.add(0, path.want(slot));
        }
        reader
    }

    fn add(&mut self, node: usize, want: Want<'_>) {
        self.nodes[node].below.push((want.slot, want.each));
        let Some(segment) = want.rest.first() else {
            self.nodes[node].slots.push((want.slot, want.each));
            return;
        };
        match segment {
            // All names of a choice are searched: nothing states which one the message has.
            Segment::Field(names) => {
                for name in names {
                    let child = self.child(node, |node| {
                        node.names.iter().find(|(known, _)| known == name).map(|(_, child)| *child)
                    });
                    let names = &mut self.nodes[node].names;
                    if !names.iter().any(|(known, _)| known == name) {
                        names.push((name.clone(), child));
                    }
                    self.add(child, want.inner());
                }
            }
            Segment::Element(index) => {
                let child = self.child(node, |node| {
                    node.elements.iter().find(|(known, _)| known == index).map(|(_, child)| *child)
                });
                let elements = &mut self.nodes[node].elements;
                if !elements.iter().any(|(known, _)| known == index) {
                    elements.push((*index, child));
                }
                self.add(child, want.inner());
            }
            Segment::Each => {
                let child = self.child(node, |node| node.each.as_ref().map(|(child, _)| *child));
                let (_, lists) = self.nodes[node].each.get_or_insert((child, Vec::new()));
                lists.push(want.slot);
                self.add(child, want.inner());
            }
        }
    }

    fn child(&mut self, node: usize, find: impl FnOnce(&Node) -> Option<usize>) -> usize {
        find(&self.nodes[node]).unwrap_or_else(|| {
            self.nodes.push(Node::default());
            self.nodes.len() - 1
        })
    }
}

/// The text of a string with JSON escapes; `None` where they are not valid.
pub(super) fn unescaped(bytes: &[u8]) -> Option<String> {
    let text = str::from_utf8(bytes).ok()?;
    serde_json::from_str(&format!("\"{text}\"")).ok()
}
