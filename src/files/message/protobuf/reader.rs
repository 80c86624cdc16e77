//! Message types + wanted paths → for each message type on the way, the action for each field number.

use std::sync::Arc;

use super::descriptor::{Descriptors, Field, Kind, Type};
use crate::message::cell::Cell;
use crate::message::path::{Segment, Want, by_element};
use crate::message::row::Target;
use crate::message::{FieldPath, Parsed, SchemaError};

#[derive(Debug, Clone, PartialEq)]
pub struct ProtobufReader {
    /// The first one is the message itself.
    pub(super) nodes: Vec<Node>,
    /// Wanted elements of repeated numbers and strings: slot of the list, index, slot of the value.
    pub(super) picks: Vec<(usize, usize, usize)>,
    /// Slots of the row: the wanted ones and those needed on the way.
    pub(super) slots: usize,
    /// Tells whether a message was read by this reader.
    pub(super) identity: Arc<()>,
}

#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Node {
    pub(super) entries: Vec<Entry>,
    /// Initial values, before anything is read.
    pub(super) defaults: Vec<(Target, Cell)>,
    /// Lists that begin empty.
    pub(super) lists: Vec<usize>,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Entry {
    pub(super) number: u32,
    /// Values that it removes: those of the other members of its oneof.
    pub(super) ousts: Vec<Target>,
    pub(super) action: Action,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Action {
    Skip,
    Value(Target, Kind),
    /// The values of a repeated field are added to the list in a slot.
    Values(usize, Kind),
    Message(usize),
    Messages(Messages),
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Messages {
    /// Slot in which elements are counted.
    pub(super) counter: usize,
    pub(super) each: usize,
    pub(super) picked: Vec<(usize, usize)>,
    pub(super) lists: Vec<usize>,
}

struct Resolving<'d> {
    descriptors: &'d Descriptors,
    wanted: &'d [FieldPath],
    reader: ProtobufReader,
}

impl ProtobufReader {
    pub fn resolve(descriptors: &Descriptors, wanted: &[FieldPath]) -> Parsed<Self> {
        let reader = Self {
            nodes: Vec::new(),
            picks: Vec::new(),
            slots: wanted.len(),
            identity: Arc::new(()),
        };
        let mut resolving = Resolving { descriptors, wanted, reader };
        let wants = wanted.iter().enumerate().map(|(slot, path)| path.want(slot));
        resolving.node(descriptors.root, &wants.collect::<Vec<_>>())?;
        Ok(resolving.reader)
    }
}

impl Resolving<'_> {
    /// Adds the node of a message type and those below it; returns its index.
    fn node(&mut self, index: usize, wants: &[Want<'_>]) -> Parsed<usize> {
        let of: &Type = &self.descriptors.types[index];
        let has = |name: &str| of.fields.iter().any(|field| field.name == name);
        let choices: Vec<_> = wants.iter().map(|want| want.choice(has)).collect();
        if let Some(missing) = choices.iter().position(Option::is_none) {
            return Err(SchemaError::NoField {
                path: self.wanted[wants[missing].slot].to_string(),
                message: self.descriptors.types[self.descriptors.root].name.clone(),
                fields: self.descriptors.leaves().join(", "),
            });
        }
        let place = self.reader.nodes.len();
        self.reader.nodes.push(Node::default());
        let mut node = Node::default();
        // Members of oneofs with their wanted values, which the other members remove.
        let mut members = Vec::new();
        for field in &of.fields {
            let chosen = wants.iter().zip(&choices);
            let chosen = chosen.filter(|(_, choice)| **choice == Some(field.name.as_str()));
            let inner: Vec<_> = chosen.map(|(want, _)| want.inner()).collect();
            let action = if inner.is_empty() {
                Action::Skip
            } else {
                members.extend(inner.iter().map(|want| (field.oneof, field.number, want.target())));
                self.action(field, &inner, &mut node)?
            };
            let (number, ousts) = (field.number, Vec::new());
            node.entries.push(Entry { number, ousts, action });
        }
        for (entry, field) in node.entries.iter_mut().zip(&of.fields) {
            let others = members.iter().filter(|(oneof, number, _)| {
                oneof.is_some() && *oneof == field.oneof && *number != field.number
            });
            entry.ousts = others.map(|(.., target)| *target).collect();
        }
        node.entries.retain(|entry| entry.action != Action::Skip || !entry.ousts.is_empty());
        self.reader.nodes[place] = node;
        Ok(place)
    }

    fn action(&mut self, field: &Field, wants: &[Want<'_>], node: &mut Node) -> Parsed<Action> {
        match (field.kind, field.repeated) {
            (Kind::Message(inner), false) => {
                if let Some(want) = wants.iter().find(|want| want.rest.is_empty()) {
                    return Err(self.wrong_type(want, "a message"));
                }
                self.node(inner, wants).map(Action::Message)
            }
            (Kind::Message(inner), true) => self.messages(inner, wants, node).map(Action::Messages),
            (kind, false) => match wants {
                [want] if want.rest.is_empty() => {
                    let target = want.target();
                    if field.default != Cell::Absent {
                        node.defaults.push((target, field.default));
                    }
                    Ok(Action::Value(target, kind))
                }
                _ => Err(self.wrong_type(&wants[wants.len() - 1], "a single value")),
            },
            (kind, true) => {
                let slot = self.repeated(wants)?;
                node.lists.push(slot);
                Ok(Action::Values(slot, kind))
            }
        }
    }

    /// The slot of the list that gathers a repeated number or string.
    fn repeated(&mut self, wants: &[Want<'_>]) -> Parsed<usize> {
        if let [want] = wants
            && matches!(want.rest, [] | [Segment::Each])
            && !want.each
        {
            return Ok(want.slot);
        }
        let list = self.new_slot();
        for want in wants {
            match want.rest {
                [Segment::Element(index)] if !want.each => {
                    self.reader.picks.push((list, *index, want.slot));
                }
                _ => return Err(self.wrong_type(want, "an array")),
            }
        }
        Ok(list)
    }

    /// A repeated message: some elements may be wanted, or a field of each of them.
    fn messages(&mut self, inner: usize, wants: &[Want<'_>], node: &mut Node) -> Parsed<Messages> {
        let is_map = self.descriptors.types[inner].is_map_entry;
        let (mut each, mut indices) = (Vec::new(), Vec::new());
        for want in wants {
            match want.rest {
                _ if is_map => return Err(self.wrong_type(want, "a map")),
                [Segment::Each, _, ..] => each.push(want.inner()),
                [Segment::Element(index), _, ..] => indices.push(*index),
                _ => return Err(self.wrong_type(want, "an array of messages")),
            }
        }
        let lists: Vec<_> = each.iter().map(|want| want.slot).collect();
        node.lists.extend(&lists);
        let (counter, own) = (self.new_slot(), self.node(inner, &each)?);
        let mut messages = Messages { counter, each: own, picked: Vec::new(), lists };
        for (index, here) in by_element(indices, &each, wants) {
            messages.picked.push((index, self.node(inner, &here)?));
        }
        Ok(messages)
    }

    fn new_slot(&mut self) -> usize {
        self.reader.slots += 1;
        self.reader.slots - 1
    }

    fn wrong_type(&self, want: &Want<'_>, found: &str) -> SchemaError {
        SchemaError::WrongType { path: self.wanted[want.slot].to_string(), found: found.to_owned() }
    }
}
