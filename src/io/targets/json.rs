//! Targets in JSON: an array of objects, or `{ "targets": [ … ] }`; the keys are the columns of CSV, `q1_deg` … included.
//!
//! Rows are checked one by one as they are read, so the first wrong one ends it. A text is taken into memory up to a
//! limit, and the parser's own limit of depth stands.

use std::collections::BTreeSet;
use std::fmt;
use std::path::Path;

use serde::de::{
    DeserializeSeed, Deserializer, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor,
};

use super::angles::{self, AngleColumns};
use super::{Place, Row, RowProblem, Rows, TargetsError, bounded};
use crate::compensation::TargetJoints;
use crate::ingest::AngleUnit;

const TARGETS: &str = "targets";

/// Reads the rows.
pub(super) fn rows(path: &Path) -> Result<Rows, TargetsError> {
    let bytes = bounded::read(path)?;
    let mut found = Found::default();
    let mut parser = serde_json::Deserializer::from_slice(&bytes);
    let read = Document(&mut found).deserialize(&mut parser);
    let read = read.and_then(|()| parser.end());
    // A wrong row ends the reading by an error whose text is of no interest.
    if let Some((place, problem)) = found.wrong {
        return Err(problem.at(path, place));
    }
    read.map_err(|source| TargetsError::Json {
        path: path.to_owned(),
        source,
    })?;
    Ok(Rows {
        placed: found.placed,
        unused: found.unused.into_iter().collect(),
        angle_unit: found.unit.unwrap_or(AngleUnit::Rad),
        list: None,
    })
}

/// What was read so far.
#[derive(Default)]
struct Found {
    placed: Vec<(Place, Row)>,
    unused: BTreeSet<String>,
    unit: Option<AngleUnit>,
    wrong: Option<(Place, RowProblem)>,
}

impl Found {
    fn take(&mut self, object: Object) -> Result<(), ()> {
        let place = Place::Row(self.placed.len());
        match object.and_then(|cells| self.row(cells)) {
            Ok(row) => {
                self.placed.push((place, row));
                Ok(())
            }
            Err(problem) => {
                self.wrong = Some((place, problem));
                Err(())
            }
        }
    }

    fn row(&mut self, cells: Vec<(String, Cell)>) -> Result<Row, RowProblem> {
        let mut keys = Keys(cells);
        let target = keys.text("target")?;
        let row = Row {
            target: target.ok_or(RowProblem::NoValue { column: "target" })?,
            position: keys.numbers(["x_mm", "y_mm", "z_mm"])?,
            joints: self.joints(&mut keys)?,
            quaternion: keys.numbers(["qx", "qy", "qz", "qw"])?,
            configuration: keys.text("configuration")?,
            tool: keys.text("tool")?,
            table_id: keys.text("table_id")?,
        };
        self.unused.extend(keys.0.into_iter().map(|(key, _)| key));
        Ok(row)
    }

    fn joints(&mut self, keys: &mut Keys) -> Result<Option<TargetJoints>, RowProblem> {
        let names: Vec<String> = keys.0.iter().map(|(key, _)| key.clone()).collect();
        let columns = AngleColumns::of(&names).map_err(RowProblem::Angles)?;
        let Some(AngleColumns { unit, places }) = columns else {
            return Ok(None);
        };
        self.unit.get_or_insert(unit);
        let mut angles = Vec::with_capacity(places.len());
        for &place in &places {
            angles.push(keys.number(&names[place])?.ok_or(place));
        }
        if angles.iter().all(Result::is_err) {
            return Ok(None);
        }
        let angles: Result<Vec<f64>, usize> = angles.into_iter().collect();
        let angles = angles.map_err(|place| RowProblem::PartOfJoints {
            missing: names[place].clone(),
        })?;
        let radians = |angle| angles::radians(angle, unit);
        Ok(Some(TargetJoints {
            names: Vec::new(),
            angles: angles.into_iter().map(radians).collect(),
        }))
    }
}

/// What is left of an object's keys.
struct Keys(Vec<(String, Cell)>);

impl Keys {
    fn cell(&mut self, key: &str) -> Cell {
        let place = self.0.iter().position(|(own, _)| own == key);
        place.map_or(Cell::Absent, |place| self.0.remove(place).1)
    }

    fn text(&mut self, key: &'static str) -> Result<Option<String>, RowProblem> {
        match self.cell(key) {
            Cell::Absent => Ok(None),
            Cell::Text(text) if text.is_empty() => Ok(None),
            Cell::Text(text) => Ok(Some(text)),
            other => Err(other.wrong(key, "a text")),
        }
    }

    fn number(&mut self, key: &str) -> Result<Option<f64>, RowProblem> {
        match self.cell(key) {
            Cell::Absent => Ok(None),
            Cell::Number(number) if number.is_finite() => Ok(Some(number)),
            other => Err(other.wrong(key, "a finite number")),
        }
    }

    fn numbers<const N: usize>(&mut self, keys: [&str; N]) -> Result<[Option<f64>; N], RowProblem> {
        let mut numbers = [None; N];
        for (number, key) in numbers.iter_mut().zip(keys) {
            *number = self.number(key)?;
        }
        Ok(numbers)
    }
}

/// A value of an object.
#[derive(Debug, Clone, PartialEq)]
enum Cell {
    Absent,
    Number(f64),
    Text(String),
    Other(&'static str),
}

impl Cell {
    fn wrong(&self, key: &str, wanted: &'static str) -> RowProblem {
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
type Object = Result<Vec<(String, Cell)>, RowProblem>;

/// The whole text.
struct Document<'a>(&'a mut Found);

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

#[cfg(test)]
mod tests;
