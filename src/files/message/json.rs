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
use super::row::Target;

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
    /// Where the value itself goes, a number, a string or an array of either.
    targets: Vec<Target>,
    names: Vec<(String, usize)>,
    elements: Vec<(usize, usize)>,
    /// The child for every element of an array, and the lists that it is added to.
    each: Option<(usize, Vec<usize>)>,
    /// The targets of all values at or below it.
    below: Vec<Target>,
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
        if node == self.nodes.len() {
            self.nodes.push(Node::default());
        }
        self.nodes[node].below.push(want.target());
        let Some(segment) = want.rest.first() else {
            self.nodes[node].targets.push(want.target());
            return;
        };
        match segment {
            // All names of a choice are searched: nothing states which one the message has.
            Segment::Field(names) => {
                for name in names {
                    let new = self.nodes.len();
                    let child = child(&mut self.nodes[node].names, name, new);
                    self.add(child, want.inner());
                }
            }
            Segment::Element(index) => {
                let new = self.nodes.len();
                let child = child(&mut self.nodes[node].elements, index, new);
                self.add(child, want.inner());
            }
            Segment::Each => {
                let new = self.nodes.len();
                let (child, lists) = self.nodes[node].each.get_or_insert((new, Vec::new()));
                let child = *child;
                lists.push(want.slot);
                self.add(child, want.inner());
            }
        }
    }
}

/// The child of a key; `new`, which is its child from now on, where it has none.
fn child<K: PartialEq + Clone>(children: &mut Vec<(K, usize)>, key: &K, new: usize) -> usize {
    if let Some((_, child)) = children.iter().find(|(known, _)| known == key) {
        return *child;
    }
    children.push((key.clone(), new));
    new
}

/// The text of a string with JSON escapes; `None` where they are not valid.
pub(super) fn unescaped(bytes: &[u8]) -> Option<String> {
    let text = str::from_utf8(bytes).ok()?;
    serde_json::from_str(&format!("\"{text}\"")).ok()
}
