//! Field paths: `pose.position.x`, `joints[2].angle` (counted from 0), `joints[].position` of all elements. A name may
//! be a choice, `sec|seconds`: the first that the schema has is used.

use std::fmt;

use super::row::Target;
use super::{Parsed, SchemaError};

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FieldPath {
    text: String,
    pub(super) segments: Vec<Segment>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Segment {
    /// The field with the first of these names that exists.
    Field(Vec<String>),
    Element(usize),
    Each,
}

/// The remaining path to a wanted field, and the slot of its value.
#[derive(Debug, Clone, Copy)]
pub(super) struct Want<'p> {
    pub(super) rest: &'p [Segment],
    pub(super) slot: usize,
    /// The path went through [`Segment::Each`]: each value found is added to a list.
    pub(super) each: bool,
}

impl FieldPath {
    pub fn parse(text: &str) -> Parsed<Self> {
        let wrong = || SchemaError::Path { path: text.to_owned() };
        let mut segments = Vec::new();
        for part in text.split('.') {
            let (names, elements) = part.split_at(part.find('[').unwrap_or(part.len()));
            if !names.is_empty() {
                segments.push(field(names).ok_or_else(wrong)?);
            } else if elements.is_empty() || !segments.is_empty() {
                return Err(wrong());
            }
            for element in elements.split_terminator(']') {
                segments.push(self::element(element).ok_or_else(wrong)?);
            }
            if !elements.is_empty() && !elements.ends_with(']') {
                return Err(wrong());
            }
        }
        if segments.iter().filter(|s| **s == Segment::Each).count() > 1 {
            return Err(wrong());
        }
        Ok(Self { text: text.to_owned(), segments })
    }

    pub fn join(&self, inner: &str) -> Parsed<Self> {
        Self::parse(&format!("{}.{inner}", self.text))
    }

    /// Whether it can mean the field at `other`, which has no choices.
    pub(super) fn may_be(&self, other: &Self) -> bool {
        let same = |(mine, other): (&Segment, &Segment)| match (mine, other) {
            (Segment::Field(names), Segment::Field(other)) => names.contains(&other[0]),
            _ => mine == other,
        };
        self.segments.len() == other.segments.len()
            && self.segments.iter().zip(&other.segments).all(same)
    }

    pub(super) fn want(&self, slot: usize) -> Want<'_> {
        Want { rest: &self.segments, slot, each: false }
    }
}

impl fmt::Display for FieldPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl<'p> Want<'p> {
    pub(super) fn inner(self) -> Self {
        Self { rest: &self.rest[1..], each: self.each || self.rest[0] == Segment::Each, ..self }
    }

    pub(super) const fn target(&self) -> Target {
        if self.each { Target::Last(self.slot) } else { Target::Slot(self.slot) }
    }

    /// The first name of its next step, a choice of names, that `has` accepts; `None` without one.
    pub(super) fn choice(&self, has: impl Fn(&str) -> bool) -> Option<&'p str> {
        match self.rest.first() {
            Some(Segment::Field(names)) => names.iter().map(String::as_str).find(|name| has(name)),
            _ => None,
        }
    }
}

/// The wants that each of the elements `indices` has to serve: those of every element, then its own among `wants`.
pub(super) fn by_element<'p>(
    mut indices: Vec<usize>,
    each: &[Want<'p>],
    wants: &[Want<'p>],
) -> Vec<(usize, Vec<Want<'p>>)> {
    indices.sort_unstable();
    indices.dedup();
    let of = |index| {
        let is_own = |want: &&Want<'p>| want.rest[0] == Segment::Element(index);
        let own = wants.iter().filter(is_own).map(|want| want.inner());
        (index, each.iter().copied().chain(own).collect())
    };
    indices.into_iter().map(of).collect()
}

fn field(names: &str) -> Option<Segment> {
    let names: Vec<_> = names.split('|').map(str::to_owned).collect();
    let sound = |name: &String| {
        !name.is_empty() && name.trim() == name && !name.contains(']') && !name.contains('\n')
    };
    names.iter().all(sound).then_some(Segment::Field(names))
}

fn element(text: &str) -> Option<Segment> {
    let index = text.strip_prefix('[')?;
    if index.is_empty() {
        return Some(Segment::Each);
    }
    // No array of a real message is longer, and a list is never grown to an index.
    let index = index.parse().ok().filter(|&index| index < 100_000)?;
    Some(Segment::Element(index))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(name: &str) -> Segment {
        Segment::Field(vec![name.to_owned()])
    }

    #[test]
    fn names_elements_and_choices_are_read() {
        let segments = |text| FieldPath::parse(text).expect("sound").segments;
        assert_eq!(segments("x"), [one("x")]);
        assert_eq!(segments("joints[2].angle"), [one("joints"), Segment::Element(2), one("angle")]);
        assert_eq!(
            segments("[0][1].a[]"),
            [Segment::Element(0), Segment::Element(1), one("a"), Segment::Each]
        );
        let choice = Segment::Field(vec!["sec".to_owned(), "seconds".to_owned()]);
        assert_eq!(segments("stamp.sec|seconds"), [one("stamp"), choice]);
    }

    #[test]
    fn what_is_no_path_is_refused() {
        for text in [
            "",
            ".",
            "a.",
            ".a",
            "a..b",
            "a[",
            "a]",
            "a[x]",
            "a[-1]",
            "a[1",
            "a[1]b",
            "a.[1]",
            "a|",
            "a b ",
            "a[].b[]",
            "a[4294967296]",
        ] {
            assert!(FieldPath::parse(text).is_err(), "{text:?}");
        }
    }
}
