//! Objects as the parser meets them, one after the other.

use std::collections::BTreeSet;
use std::fmt;

use serde::de::{
    DeserializeSeed, Deserializer, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor,
};

use super::super::RowProblem;
use super::Found;

const TARGETS: &str = "targets";

/// A value of an object.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Cell {
    Absent,
    Number(f64),
    Text(String),
    Other(&'static str),
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
                Self::Other(what) => what,
            },
        }
    }
}

/// The keys and values of an object in its order, or what is wrong with it.
pub(super) type Object = Result<Vec<(String, Cell)>, RowProblem>;

/// The whole text.
pub(super) struct Document<'a>(pub(super) &'a mut Found);

impl<'de> DeserializeSeed<'de> for Document<'_> {
    type Value = ();
    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<(), D::Error> {
        from.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Document<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an array of targets, or an object with the key \"targets\"")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut array: A) -> Result<(), A::Error> {
        while let Some(object) = array.next_element_seed(ObjectSeed)? {
            self.0
                .take(object)
                .map_err(|()| A::Error::custom("a wrong target"))?;
        }
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<(), A::Error> {
        let mut seen = false;
        while let Some(key) = object.next_key::<String>()? {
            if key != TARGETS {
                object.next_value::<IgnoredAny>()?;
                self.0.unused.insert(key);
                continue;
            }
            if seen {
                return Err(A::Error::custom("key \"targets\" stands twice"));
            }
            seen = true;
            object.next_value_seed(Document(&mut *self.0))?;
        }
        if seen {
            return Ok(());
        }
        Err(A::Error::custom(
            "no key \"targets\"; targets are an array of objects, by itself or under that key",
        ))
    }
}

/// One element of the array.
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
        // The object is read to its end even so: the parser stands nowhere else.
        while let Some(key) = object.next_key::<String>()? {
            let cell = object.next_value_seed(CellSeed)?;
            if !places.insert(key.clone()) {
                twice.get_or_insert(RowProblem::SameKey { key });
                continue;
            }
            cells.push((key, cell));
        }
        Ok(twice.map_or(Ok(cells), Err))
    }
}

/// One value.
struct CellSeed;

impl<'de> DeserializeSeed<'de> for CellSeed {
    type Value = Cell;
    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<Cell, D::Error> {
        from.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for CellSeed {
    type Value = Cell;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_unit<E>(self) -> Result<Cell, E> {
        Ok(Cell::Absent)
    }

    fn visit_bool<E>(self, _: bool) -> Result<Cell, E> {
        Ok(Cell::Other("true or false"))
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
        while array.next_element::<IgnoredAny>()?.is_some() {}
        Ok(Cell::Other("an array"))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<Cell, A::Error> {
        while object.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {}
        Ok(Cell::Other("an object"))
    }
}
