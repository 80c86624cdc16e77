//! Targets in JSON: an array of objects, or `{ "targets": [ … ] }`; the keys are the columns of CSV. The first wrong
//! row ends the reading.

mod visit;

use std::collections::BTreeSet;
use std::path::Path;

use serde::de::DeserializeSeed as _;

use super::angles::{AngleColumns, JointUnits};
use super::{Place, Row, RowProblem, Rows, TargetsError, TargetsErrorKind, bytes, names};
use crate::compensation::TargetJoints;
use crate::ingest::AngleUnit;
use crate::input::Bound;
use visit::{Cell, Document, Object};

pub(super) fn rows(path: &Path, bound: Bound) -> Result<Rows, TargetsError> {
    let bytes = bytes(path, bound)?;
    let mut found = Found::default();
    let mut parser = serde_json::Deserializer::from_slice(&bytes);
    let read = Document(&mut found).deserialize(&mut parser);
    let read = read.and_then(|()| parser.end());
    // A wrong row ends the reading with an error whose text is not used.
    if let Some((place, problem)) = found.wrong {
        return Err(match place {
            Some(place) => problem.at(path, place),
            None => TargetsErrorKind::Row(problem).at(path),
        });
    }
    read.map_err(|source| TargetsErrorKind::Json(source).at(path))?;
    let units = found.units.unwrap_or_else(|| AngleUnit::Rad.into());
    Ok(Rows { placed: found.placed, unused: found.unused.into_iter().collect(), units })
}

#[derive(Default)]
struct Found {
    placed: Vec<(Place, Row)>,
    unused: BTreeSet<String>,
    units: Option<JointUnits>,
    /// The fault, and its row; without a row it is a fault of the document.
    wrong: Option<(Option<Place>, RowProblem)>,
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
                self.wrong = Some((Some(place), problem));
                Err(())
            }
        }
    }

    fn refuse(&mut self, problem: RowProblem) {
        self.wrong = Some((None, problem));
    }

    fn row(&mut self, cells: Vec<(String, Cell)>) -> Result<Row, RowProblem> {
        names::check(cells.iter().map(|(key, _)| key.as_str()))?;
        let mut keys = Keys(cells);
        let table_id = keys.mark()?;
        let target = keys.text("target")?;
        let row = Row {
            target: target.ok_or(RowProblem::NoValue { column: "target" })?,
            position: keys.numbers(["x_mm", "y_mm", "z_mm"])?,
            joints: self.joints(&mut keys)?,
            quaternion: keys.numbers(["qx", "qy", "qz", "qw"])?,
            configuration: keys.text("configuration")?,
            tool: keys.text("tool")?,
            table_id,
        };
        self.unused.extend(keys.0.into_iter().map(|(key, _)| key));
        Ok(row)
    }

    fn joints(&mut self, keys: &mut Keys) -> Result<Option<TargetJoints>, RowProblem> {
        let names: Vec<String> = keys.0.iter().map(|(key, _)| key.clone()).collect();
        let columns = AngleColumns::of(&names).map_err(RowProblem::Angles)?;
        let Some(columns) = columns else { return Ok(None) };
        self.units.get_or_insert_with(|| columns.units.clone());
        columns.joints(&names, |place| keys.number(&names[place]))
    }
}

/// The keys of an object that are not used yet.
struct Keys(Vec<(String, Cell)>);

impl Keys {
    /// The mark of a command: a value under a mark's key, in upper or lower case and at any depth; `None` for a target.
    fn mark(&mut self) -> Result<Option<String>, RowProblem> {
        let mut found = None;
        for (key, cell) in &self.0 {
            match cell {
                Cell::Other { mark: Some(mark), .. } => {
                    let (key, value) = (mark.key.clone(), mark.value.clone());
                    return Err(RowProblem::Marked { key, value });
                }
                Cell::Absent => {}
                cell if names::is_mark(key) => {
                    let text = cell.shown();
                    found = found.or(text.filter(|text| !text.is_empty()));
                }
                _ => {}
            }
        }
        self.0.retain(|(key, _)| !names::is_mark(key));
        Ok(found)
    }

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

#[cfg(test)]
mod tests;
