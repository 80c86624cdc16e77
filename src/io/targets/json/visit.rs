//! Objects as the parser finds them, one after the other.

use std::collections::BTreeSet;
use std::fmt;

use serde::de::{
    Deserialize, DeserializeSeed, Deserializer, Error as _, MapAccess, SeqAccess, Visitor,
};

use super::super::RowProblem;
use super::super::names::{self, NamesProblem};
use super::Found;

const TARGETS: &str = "targets";
const NO_TARGETS: &str =
    "no key \"targets\"; targets are an array of objects, by itself or under that key";

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Cell {
    Absent,
    Number(f64),
    Text(String),
    Other { what: &'static str, mark: Option<Mark> },
}

/// A value under a key that has a value in commands only.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Mark {
    pub(super) key: String,
    pub(super) value: String,
}

impl Cell {
    pub(super) fn wrong(&self, key: &str, wanted: &'static str) -> RowProblem {
        RowProblem::WrongType {
            key: key.to_owned(),
            wanted,
            found: match self {
                Self::Absent => "nothing",
                Self::Number(_) => "a number",
                Self::Text(_) => "a text",
                Self::Other { what, .. } => what,
            },
        }
    }

    /// The value as text; `None` where there is none.
    pub(super) fn shown(&self) -> Option<String> {
        match self {
            Self::Absent => None,
            Self::Number(number) => Some(number.to_string()),
            Self::Text(text) => Some(text.clone()),
            Self::Other { what, .. } => Some((*what).to_owned()),
        }
    }

    fn mark(self, key: &str) -> Option<Mark> {
        let value = self.shown().filter(|value| !value.is_empty())?;
        if names::is_mark(key) {
            let key = key.to_owned();
            return Some(Mark { key, value });
        }
        match self {
            Self::Other { mark, .. } => mark,
            _ => None,
        }
    }
}

pub(super) type Object = Result<Vec<(String, Cell)>, RowProblem>;

pub(super) struct Document<'a>(pub(super) &'a mut Found);

impl<'de> DeserializeSeed<'de> for Document<'_> {
    type Value = ();
    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<(), D::Error> {
        from.deserialize_any(self)
    }
}

impl Document<'_> {
    fn refuse<E: serde::de::Error>(&mut self, problem: impl Into<RowProblem>) -> E {
        self.0.refuse(problem.into());
        E::custom("a wrong document")
    }
}

impl<'de> Visitor<'de> for Document<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an array of targets, or an object with the key \"targets\"")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, array: A) -> Result<(), A::Error> {
        Targets(self.0).visit_seq(array)
    }

    fn visit_map<A: MapAccess<'de>>(mut self, mut object: A) -> Result<(), A::Error> {
        let mut keys: Vec<String> = Vec::new();
        while let Some(key) = object.next_key::<String>()? {
            keys.push(key.clone());
            if let Some(problem) = problem_of(&keys) {
                return Err(self.refuse(problem));
            }
            if key == TARGETS {
                object.next_value_seed(Targets(&mut *self.0))?;
                continue;
            }
            let cell: Cell = object.next_value()?;
            if let Some(Mark { key, value }) = cell.mark(&key) {
                return Err(self.refuse(RowProblem::Marked { key, value }));
            }
            self.0.unused.insert(key);
        }
        let is_there = keys.iter().any(|key| key == TARGETS);
        if is_there { Ok(()) } else { Err(A::Error::custom(NO_TARGETS)) }
    }
}

/// The fault in the last of a document's keys.
fn problem_of(keys: &[String]) -> Option<NamesProblem> {
    let (last, before) = keys.split_last()?;
    let folded = last.trim().to_lowercase();
    if folded == TARGETS && last != TARGETS {
        return Some(NamesProblem::OtherLetters { found: last.clone(), known: folded });
    }
    let first = before.iter().find(|key| key.trim().to_lowercase() == folded)?;
    Some(if first == last {
        NamesProblem::Twice { name: last.clone() }
    } else {
        NamesProblem::Alike { first: first.clone(), second: last.clone() }
    })
}

struct Targets<'a>(&'a mut Found);

impl<'de> DeserializeSeed<'de> for Targets<'_> {
    type Value = ();
    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<(), D::Error> {
        from.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Targets<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an array of targets")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut array: A) -> Result<(), A::Error> {
        while let Some(object) = array.next_element_seed(ObjectSeed)? {
            self.0.take(object).map_err(|()| A::Error::custom("a wrong target"))?;
        }
        Ok(())
    }
}

struct ObjectSeed;

impl<'de> DeserializeSeed<'de> for ObjectSeed {
    type Value = Object;
    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<Object, D::Error> {
        from.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for ObjectSeed {
    type Value = Object;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a target: an object with the keys target, x_mm, y_mm, z_mm, …")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<Object, A::Error> {
        let mut cells = Vec::new();
        let mut places = BTreeSet::new();
        let mut twice = None;
        // The object is read to its end in any case: the parser cannot continue from another place.
        while let Some((key, cell)) = object.next_entry::<String, Cell>()? {
            if !places.insert(key.clone()) {
                twice.get_or_insert(NamesProblem::Twice { name: key });
                continue;
            }
            cells.push((key, cell));
        }
        Ok(twice.map_or(Ok(cells), |problem| Err(problem.into())))
    }
}

impl<'de> Deserialize<'de> for Cell {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_any(CellVisitor)
    }
}

struct CellVisitor;

impl<'de> Visitor<'de> for CellVisitor {
    type Value = Cell;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_unit<E>(self) -> Result<Cell, E> {
        Ok(Cell::Absent)
    }

    fn visit_bool<E>(self, _: bool) -> Result<Cell, E> {
        Ok(Cell::Other { what: "true or false", mark: None })
    }

    fn visit_f64<E>(self, number: f64) -> Result<Cell, E> {
        Ok(Cell::Number(number))
    }

    fn visit_i64<E>(self, number: i64) -> Result<Cell, E> {
        Ok(Cell::Number(number as f64))
    }

    fn visit_u64<E>(self, number: u64) -> Result<Cell, E> {
        Ok(Cell::Number(number as f64))
    }

    fn visit_str<E>(self, text: &str) -> Result<Cell, E> {
        Ok(Cell::Text(text.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut array: A) -> Result<Cell, A::Error> {
        let mut mark = None;
        while let Some(cell) = array.next_element::<Cell>()? {
            mark = mark.or(cell.mark(""));
        }
        let what = "an array";
        Ok(Cell::Other { what, mark })
    }

    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<Cell, A::Error> {
        let mut mark = None;
        while let Some((key, cell)) = object.next_entry::<String, Cell>()? {
            mark = mark.or(cell.mark(&key));
        }
        let what = "an object";
        Ok(Cell::Other { what, mark })
    }
}
