//! JSON messages: wanted paths → a tree of the names on the way → the wanted values of each message in one pass.
//!
//! JSON as RFC 8259 has it, with `NaN`, `Infinity` and `-Infinity` besides, which Python writes for what JSON cannot
//! say. `null` is no value. Of a name given twice the last counts, as in the readers in use. Nothing else of a message
//! is kept, and no schema is needed; where there is one (JSON Schema), it tells which fields there are.
//!
//! 1. [`JsonReader::new`]: paths → tree.
//! 2. [`JsonReader::read`]: payload → the wanted values in a row.
//!
//! Of a message worded as the one before, only the numbers are read ([`template`](super::template)).

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

/// How to read the wanted values of messages.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JsonReader {
    /// The first one is the message itself.
    nodes: Vec<Node>,
    wanted: usize,
    /// Tells whether a message was read by this reader.
    identity: Arc<()>,
}

/// What is wanted of one value on the way.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
struct Node {
    /// Itself, a number, a string or an array of either: the slots, and whether it is added to a list there.
    slots: Vec<(usize, bool)>,
    /// By name, of an object.
    names: Vec<(String, usize)>,
    /// By index, of an array.
    elements: Vec<(usize, usize)>,
    /// Every element of an array, and the lists that it is added to.
    each: Option<(usize, Vec<usize>)>,
    /// All slots at or below it, and whether they are added to a list outside of it.
    below: Vec<(usize, bool)>,
}

impl JsonReader {
    /// The reader that takes the fields at `wanted`, in that order.
    pub fn new(wanted: &[FieldPath]) -> Self {
        let mut reader = Self {
            nodes: vec![Node::default()],
            wanted: wanted.len(),
            identity: Arc::new(()),
        };
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
            // All names of a choice are looked for: nothing says which one is there.
            Segment::Field(names) => {
                for name in names {
                    let child = self.child(node, |node| {
                        node.names
                            .iter()
                            .find(|(known, _)| known == name)
                            .map(|(_, child)| *child)
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
                    node.elements
                        .iter()
                        .find(|(known, _)| known == index)
                        .map(|(_, child)| *child)
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

    /// The child that is there, or a new one.
    fn child(&mut self, node: usize, find: impl FnOnce(&Node) -> Option<usize>) -> usize {
        find(&self.nodes[node]).unwrap_or_else(|| {
            self.nodes.push(Node::default());
            self.nodes.len() - 1
        })
    }
}

/// What a string says whose escapes are JSON's; `None` where they are none.
pub(super) fn unescaped(bytes: &[u8]) -> Option<String> {
    let text = str::from_utf8(bytes).ok()?;
    serde_json::from_str(&format!("\"{text}\"")).ok()
}
