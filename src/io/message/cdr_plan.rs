//! Definition + wanted paths → a flat list of steps over a CDR message.
//!
//! 1. Nested messages are unfolded in place; arrays of them become one repeated step.
//! 2. A wanted path becomes a step that lends a value; every other field becomes a step that skips.
//!
//! Fields after the last wanted one are still walked: a message that does not end where its schema says is damaged.

use super::{Definition, Field, FieldType, MessageType, Primitive, SchemaError, Shape};

/// More fields than any message of the field has; keeps a hostile schema from unfolding without end.
const MOST_STEPS: usize = 20_000;
/// More levels than any message of the field has; keeps a type that contains itself off the stack's end.
const MOST_LEVELS: usize = 32;

/// How to read the wanted values of one message type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CdrPlan {
    pub(super) steps: Vec<Step>,
    pub(super) wanted: usize,
}

/// One step over the bytes of a message. `slot` is the place of the path among the wanted ones.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Step {
    /// As many elements as the definition says.
    Skip { of: Primitive, count: u32 },
    /// A count and that many elements.
    SkipSequence(Primitive),
    /// One string.
    SkipText,
    /// The steps of a nested type, as often as the definition (or else the message) says.
    Repeat {
        count: Option<u32>,
        steps: Vec<Step>,
    },
    /// One number is lent.
    Number { slot: usize, of: Primitive },
    /// One string is lent.
    Text { slot: usize },
    /// An array of numbers is lent.
    Numbers {
        slot: usize,
        of: Primitive,
        count: Option<u32>,
    },
    /// An array of strings is lent.
    Texts { slot: usize, count: Option<u32> },
}

/// What is carried while a definition is unfolded.
struct Unfolding<'d> {
    definition: &'d Definition,
    wanted: &'d [&'d str],
    found: Vec<bool>,
    left: usize,
    level: usize,
}

impl CdrPlan {
    /// The plan that lends the fields at `wanted` (paths such as `pose.position.x`), in that order.
    pub fn resolve(definition: &Definition, wanted: &[&str]) -> Result<Self, SchemaError> {
        let mut unfolding = Unfolding {
            definition,
            wanted,
            found: vec![false; wanted.len()],
            left: MOST_STEPS,
            level: 0,
        };
        let steps = unfolding.message(0, "")?;
        if let Some(missing) = unfolding.found.iter().position(|&found| !found) {
            return Err(SchemaError::NoField {
                path: wanted[missing].to_owned(),
                message: definition.types[0].name.clone(),
                fields: leaves(definition).join(", "),
            });
        }
        Ok(Self {
            steps,
            wanted: wanted.len(),
        })
    }
}

impl Unfolding<'_> {
    fn message(&mut self, index: usize, prefix: &str) -> Result<Vec<Step>, SchemaError> {
        let message: &MessageType = &self.definition.types[index];
        self.level += 1;
        let mut steps = Vec::new();
        for field in &message.fields {
            if self.left == 0 || self.level > MOST_LEVELS {
                return Err(SchemaError::Unbounded {
                    name: message.name.clone(),
                    limit: MOST_STEPS,
                });
            }
            self.left -= 1;
            self.field(field, join(prefix, &field.name), &mut steps)?;
        }
        self.level -= 1;
        Ok(steps)
    }

    fn field(
        &mut self,
        field: &Field,
        path: String,
        steps: &mut Vec<Step>,
    ) -> Result<(), SchemaError> {
        let slot = self.wanted.iter().position(|wanted| *wanted == path);
        if let Some(slot) = slot {
            self.found[slot] = true;
        }
        match field.of {
            FieldType::Message(_) if slot.is_some() => {
                return Err(SchemaError::WrongType {
                    path,
                    found: field.to_string(),
                });
            }
            FieldType::Message(inner) if field.shape == Shape::One => {
                steps.extend(self.message(inner, &path)?);
            }
            FieldType::Message(inner) => steps.push(Step::Repeat {
                count: fixed_count(field.shape),
                // Elements of an array have no path of their own: `[]` never matches a wanted one.
                steps: self.message(inner, &format!("{path}[]"))?,
            }),
            FieldType::WideText => return Err(SchemaError::WideString { path }),
            FieldType::Text => steps.push(text_step(field.shape, slot)),
            FieldType::Primitive(of) => steps.push(number_step(of, field.shape, slot)),
        }
        Ok(())
    }
}

fn join(prefix: &str, name: &str) -> String {
    if prefix.is_empty() {
        name.to_owned()
    } else {
        format!("{prefix}.{name}")
    }
}

const fn fixed_count(shape: Shape) -> Option<u32> {
    match shape {
        Shape::One => Some(1),
        Shape::Fixed(count) => Some(count),
        Shape::Sequence => None,
    }
}

fn text_step(shape: Shape, slot: Option<usize>) -> Step {
    match (slot, shape) {
        (Some(slot), Shape::One) => Step::Text { slot },
        (Some(slot), _) => Step::Texts {
            slot,
            count: fixed_count(shape),
        },
        (None, Shape::One) => Step::SkipText,
        (None, _) => Step::Repeat {
            count: fixed_count(shape),
            steps: vec![Step::SkipText],
        },
    }
}

const fn number_step(of: Primitive, shape: Shape, slot: Option<usize>) -> Step {
    match (slot, shape, fixed_count(shape)) {
        (Some(slot), Shape::One, _) => Step::Number { slot, of },
        (Some(slot), _, count) => Step::Numbers { slot, of, count },
        (None, _, Some(count)) => Step::Skip { of, count },
        (None, _, None) => Step::SkipSequence(of),
    }
}

/// Paths of the fields that could be wanted, for an error; not all of a very large message.
fn leaves(definition: &Definition) -> Vec<String> {
    let mut found = Vec::new();
    let mut open = vec![(0_usize, String::new(), 0_usize)];
    while let Some((index, prefix, depth)) = open.pop() {
        for field in &definition.types[index].fields {
            let path = join(&prefix, &field.name);
            match field.of {
                FieldType::Message(inner) if field.shape == Shape::One && depth < 8 => {
                    open.push((inner, path, depth + 1));
                }
                _ => found.push(path),
            }
            if found.len() >= 40 || open.len() > 1000 {
                found.push("…".to_owned());
                return found;
            }
        }
    }
    found.sort();
    found
}
