//! Definition + wanted paths → a flat list of steps over a message of CDR or ROS 1: nested messages are expanded in place, arrays
//! of them are one repeated step. Fields after the last wanted one are still walked: a message that does not end where
//! its schema ends is damaged.

use std::sync::Arc;

use super::path::{Segment, Want, by_element};
use super::{
    Definition, Extensibility, Field, FieldPath, FieldType, MessageType, Parsed, Primitive,
    SchemaError, Serialization, Shape,
};

/// More fields than any real message has; it stops a hostile schema from expanding without end.
const MOST_STEPS: usize = 20_000;
/// More levels than any real message has; it stops a type that contains itself from overflowing the stack.
const MOST_LEVELS: usize = 32;

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CdrReader {
    pub(super) serialization: Serialization,
    pub(super) plain: Vec<Step>,
    /// For encodings in which each message and nested message begins with its length.
    pub(super) delimited: Vec<Step>,
    pub(super) wide: bool,
    pub(super) wanted: usize,
    /// Tells whether a message was read by this reader.
    pub(super) identity: Arc<()>,
}

/// One step over the bytes of a message. `slot` is the place of the path among the wanted ones; `count` is absent where the message
/// states it. A sequence is a count and that many elements. `Pick` takes some numbers of an array by index and slot, and puts `each`
/// into its slot's list where the array is in an element of another.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Step {
    Skip { of: Primitive, count: u32 },
    SkipSequence(Primitive),
    SkipText,
    SkipWideText,
    Repeat(Box<Repeat>),
    Delimited(Vec<Step>),
    Number { slot: usize, of: Primitive },
    Text { slot: usize },
    AddNumber { slot: usize, of: Primitive },
    AddText { slot: usize },
    Numbers { slot: usize, of: Primitive, count: Option<u32> },
    Texts { slot: usize, count: Option<u32> },
    Pick { of: Primitive, count: Option<u32>, picks: Vec<(usize, usize)>, each: bool },
}

/// Elements of a nested type, or strings.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Repeat {
    pub(super) count: Option<u32>,
    pub(super) steps: Vec<Step>,
    /// The steps of single elements with other wanted values, by index.
    pub(super) picked: Vec<(usize, Vec<Step>)>,
    pub(super) lists: Vec<usize>,
}

struct Unfolding<'d> {
    definition: &'d Definition,
    wanted: &'d [FieldPath],
    delimited: bool,
    wide: bool,
    left: usize,
    level: usize,
}

impl CdrReader {
    pub fn resolve(definition: &Definition, wanted: &[FieldPath]) -> Parsed<Self> {
        if let Some(mutable) = mutable(definition) {
            return Err(SchemaError::Mutable { name: mutable.name.clone() });
        }
        let unfold = |delimited| {
            let (wide, left, level) = (false, MOST_STEPS, 0);
            let mut unfolding = Unfolding { definition, wanted, delimited, wide, left, level };
            let wants = wanted.iter().enumerate().map(|(slot, path)| path.want(slot));
            let steps = unfolding.message(0, &wants.collect::<Vec<_>>())?;
            Ok((steps, unfolding.wide))
        };
        let (plain, wide) = unfold(false)?;
        let (delimited, _) = unfold(true)?;
        Ok(Self {
            serialization: definition.serialization,
            plain,
            delimited: vec![Step::Delimited(delimited)],
            wide,
            wanted: wanted.len(),
            identity: Arc::new(()),
        })
    }
}

/// A type whose fields may be in any order; `None` where there is none.
fn mutable(definition: &Definition) -> Option<&MessageType> {
    let mut types = definition.types.iter();
    types.find(|message| message.extensibility == Extensibility::Mutable)
}

impl Unfolding<'_> {
    fn message(&mut self, index: usize, wants: &[Want<'_>]) -> Parsed<Vec<Step>> {
        let message: &MessageType = &self.definition.types[index];
        self.level += 1;
        let has = |name: &str| message.fields.iter().any(|field| field.name == name);
        let choices = wants.iter().map(|want| want.choice(has).ok_or_else(|| self.no_field(want)));
        let choices = choices.collect::<Result<Vec<_>, _>>()?;
        let mut steps = Vec::new();
        for field in &message.fields {
            if self.left == 0 || self.level > MOST_LEVELS {
                let name = message.name.clone();
                return Err(SchemaError::Unbounded { name, limit: MOST_STEPS });
            }
            self.left -= 1;
            let chosen = wants.iter().zip(&choices);
            let chosen = chosen.filter(|(_, choice)| **choice == field.name);
            let inner: Vec<_> = chosen.map(|(want, _)| want.inner()).collect();
            self.field(field, &inner, &mut steps)?;
        }
        self.level -= 1;
        Ok(steps)
    }

    fn field(&mut self, field: &Field, wants: &[Want<'_>], steps: &mut Vec<Step>) -> Parsed<()> {
        match (field.of, field.shape) {
            (FieldType::Message(inner), Shape::One) => {
                if let Some(want) = wants.iter().find(|want| want.rest.is_empty()) {
                    return Err(self.wrong_type(want, field));
                }
                steps.extend(self.nested(inner, wants)?);
            }
            (FieldType::Message(inner), shape) => {
                let repeat = self.repeat(inner, fixed_count(shape), field, wants)?;
                match repeat.count {
                    // Elements without fields have no bytes in ROS 1.
                    Some(_) if repeat.steps.is_empty() => {}
                    None if repeat.steps.is_empty() => {
                        steps.push(Step::Skip { of: Primitive::U32, count: 1 });
                    }
                    _ => steps.push(Step::Repeat(Box::new(repeat))),
                }
            }
            (FieldType::WideText, shape) => {
                if let Some(want) = wants.first() {
                    return Err(self.wrong_type(want, field));
                }
                self.wide = true;
                steps.push(once_or_repeated(Step::SkipWideText, shape));
            }
            (FieldType::Text, shape) => steps.push(self.text_step(field, shape, wants)?),
            (FieldType::Primitive(of), shape) => {
                steps.push(self.number_step(field, of, shape, wants)?);
            }
        }
        Ok(())
    }

    fn nested(&mut self, index: usize, wants: &[Want<'_>]) -> Parsed<Vec<Step>> {
        let steps = self.message(index, wants)?;
        let is_final = self.definition.types[index].extensibility == Extensibility::Final;
        Ok(if self.delimited && !is_final { vec![Step::Delimited(steps)] } else { steps })
    }

    /// An array of nested messages: some elements may be wanted, or a field of each of them.
    fn repeat(
        &mut self,
        inner: usize,
        count: Option<u32>,
        field: &Field,
        wants: &[Want<'_>],
    ) -> Parsed<Repeat> {
        let mut each = Vec::new();
        let mut indices = Vec::new();
        for want in wants {
            match want.rest.first() {
                Some(Segment::Each) if want.rest.len() > 1 => each.push(want.inner()),
                Some(Segment::Element(index)) if want.rest.len() > 1 => {
                    self.reach(*index, count, want)?;
                    indices.push(*index);
                }
                _ => return Err(self.wrong_type(want, field)),
            }
        }
        let steps = self.nested(inner, &each)?;
        let mut picked = Vec::new();
        for (index, here) in by_element(indices, &each, wants) {
            picked.push((index, self.nested(inner, &here)?));
        }
        Ok(Repeat { count, steps, picked, lists: each.iter().map(|want| want.slot).collect() })
    }

    fn text_step(&self, field: &Field, shape: Shape, wants: &[Want<'_>]) -> Parsed<Step> {
        let Some(want) = wants.first() else { return Ok(once_or_repeated(Step::SkipText, shape)) };
        let (slot, count) = (want.slot, fixed_count(shape));
        match (shape, want.rest) {
            _ if wants.len() > 1 => Err(self.wrong_type(&wants[1], field)),
            (Shape::One, []) if want.each => Ok(Step::AddText { slot }),
            (Shape::One, []) => Ok(Step::Text { slot }),
            (Shape::Fixed(_) | Shape::Sequence, [] | [Segment::Each]) if !want.each => {
                Ok(Step::Texts { slot, count })
            }
            _ => Err(self.wrong_type(want, field)),
        }
    }

    fn number_step(
        &self,
        field: &Field,
        of: Primitive,
        shape: Shape,
        wants: &[Want<'_>],
    ) -> Parsed<Step> {
        let count = fixed_count(shape);
        let Some(want) = wants.first() else {
            return Ok(match count {
                Some(count) => Step::Skip { of, count },
                None => Step::SkipSequence(of),
            });
        };
        let slot = want.slot;
        let is_element = |want: &Want<'_>| matches!(want.rest, [Segment::Element(_)]);
        match (shape, want.rest) {
            (Shape::One, []) if wants.len() == 1 && want.each => Ok(Step::AddNumber { slot, of }),
            (Shape::One, []) if wants.len() == 1 => Ok(Step::Number { slot, of }),
            (Shape::Fixed(_) | Shape::Sequence, [] | [Segment::Each])
                if wants.len() == 1 && !want.each =>
            {
                Ok(Step::Numbers { slot, of, count })
            }
            (Shape::Fixed(_) | Shape::Sequence, _)
                if wants.iter().all(|other| is_element(other) && other.each == want.each) =>
            {
                let mut picks = Vec::new();
                for want in wants {
                    let Segment::Element(index) = want.rest[0] else { continue };
                    self.reach(index, count, want)?;
                    picks.push((index, want.slot));
                }
                Ok(Step::Pick { of, count, picks, each: want.each })
            }
            _ => Err(self.wrong_type(wants.last().unwrap_or(want), field)),
        }
    }

    fn reach(&self, index: usize, count: Option<u32>, want: &Want<'_>) -> Parsed<()> {
        match count.and_then(|count| usize::try_from(count).ok()) {
            Some(count) if index >= count => {
                Err(SchemaError::NoElement { path: self.wanted[want.slot].to_string(), count })
            }
            _ => Ok(()),
        }
    }

    fn no_field(&self, want: &Want<'_>) -> SchemaError {
        SchemaError::NoField {
            path: self.wanted[want.slot].to_string(),
            message: self.definition.types[0].name.clone(),
            fields: leaves(self.definition).join(", "),
        }
    }

    fn wrong_type(&self, want: &Want<'_>, field: &Field) -> SchemaError {
        let (path, found) = (self.wanted[want.slot].to_string(), field.to_string());
        SchemaError::WrongType { path, found }
    }
}

const fn fixed_count(shape: Shape) -> Option<u32> {
    match shape {
        Shape::One => Some(1),
        Shape::Fixed(count) => Some(count),
        Shape::Sequence => None,
    }
}

fn once_or_repeated(step: Step, shape: Shape) -> Step {
    if shape == Shape::One {
        return step;
    }
    let (count, steps) = (fixed_count(shape), vec![step]);
    Step::Repeat(Box::new(Repeat { count, steps, picked: Vec::new(), lists: Vec::new() }))
}

/// Paths of the fields that can be wanted, for an error; not all of a very large message.
pub(super) fn leaves(definition: &Definition) -> Vec<String> {
    let mut found = Vec::new();
    let mut open = vec![(0_usize, String::new(), 0_usize)];
    while let Some((index, prefix, depth)) = open.pop() {
        for field in &definition.types[index].fields {
            let path = format!("{prefix}{}", field.name);
            let list = if field.shape == Shape::One { "" } else { "[]" };
            match field.of {
                FieldType::Message(inner)
                    if depth < 8 && (list.is_empty() || !prefix.contains(list)) =>
                {
                    open.push((inner, format!("{path}{list}."), depth + 1));
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
