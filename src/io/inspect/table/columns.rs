use std::collections::BTreeSet;

use super::names::Named;
use crate::figures::median;
use crate::ingest::MISSING;
use crate::measured_table::{Cell, MeasuredTable};
use crate::station_table::{Sum, Value};

const MOST_TEXTS: usize = 12;

#[derive(Debug, Clone, Default, PartialEq)]
pub struct ColumnSummary {
    pub name: String,
    pub named: Named,
    pub numbers: usize,
    pub not_finite: usize,
    pub blanks: usize,
    pub texts: usize,
    pub zeros: usize,
    /// Number of cells with 9999 or −9999, which stand for a missing reading.
    pub missing: usize,
    /// Least and largest number, those that stand for a missing reading left out; `None` without any.
    pub range: Option<(f64, f64)>,
    /// Its different texts, in order, up to twelve.
    pub different: BTreeSet<String>,
    pub has_more: bool,
}

impl ColumnSummary {
    pub(super) fn of(table: &MeasuredTable, column: usize) -> Self {
        let name = table.columns()[column].clone();
        let unit_line = table.units.as_ref().and_then(|units| units.get(column));
        let named = Named::of(&name, unit_line.map(String::as_str));
        let mut summary = Self { name, named, ..Self::default() };
        for row in 0..table.row_count() {
            summary.add(table.cell(row, column));
        }
        summary
    }

    fn add(&mut self, cell: Cell<'_>) {
        match cell {
            Cell::Blank => self.blanks += 1,
            Cell::Number(number) if !number.is_finite() => self.not_finite += 1,
            Cell::Number(number) => self.add_number(number),
            Cell::Text(text) => {
                self.texts += 1;
                self.has_more |=
                    self.different.len() == MOST_TEXTS && !self.different.contains(text);
                if self.different.len() < MOST_TEXTS {
                    self.different.insert(text.to_owned());
                }
            }
        }
    }

    fn add_number(&mut self, number: f64) {
        self.numbers += 1;
        self.zeros += usize::from(number == 0.0);
        if MISSING.contains(&number) {
            self.missing += 1;
            return;
        }
        let (low, high) = self.range.unwrap_or((number, number));
        self.range = Some((low.min(number), high.max(number)));
    }

    /// Whether it is one of numbers: more cells have one than a text.
    pub fn is_numeric(&self) -> bool {
        self.numbers > self.texts && self.range.is_some()
    }

    /// A note on a column without numbers in which a cell is a number but for characters before or behind it: `(1.5)`, `1.5 mm`. `None` of
    /// any other column.
    pub fn marked_digits(&self) -> Option<String> {
        let is_marked = |text: &&String| {
            let digits = text.trim_matches(|c: char| !c.is_ascii_digit());
            let is_name = text.starts_with(char::is_alphabetic) || !digits.contains(['.', ',']);
            !is_name && digits.replace(',', ".").parse::<f64>().is_ok()
        };
        let text = self.different.iter().find(is_marked).filter(|_| !self.is_numeric())?;
        let name = &self.name;
        Some(format!(
            "column {name:?} has no numbers: {text:?} has other characters beside its digits"
        ))
    }

    /// The largest absolute value; 0 without numbers.
    pub fn largest(&self) -> f64 {
        self.range.map_or(0.0, |(low, high)| low.abs().max(high.abs()))
    }

    pub fn varies(&self) -> bool {
        self.range.is_some_and(|(low, high)| low < high)
    }
}

/// The largest absolute value in several columns.
pub fn largest(columns: &[ColumnSummary], of: impl IntoIterator<Item = usize>) -> f64 {
    of.into_iter().map(|column| columns[column].largest()).fold(0.0, f64::max)
}

/// The number in a cell; `None` where a reading is missing there.
pub fn number(table: &MeasuredTable, row: usize, column: usize) -> Option<f64> {
    match table.cell(row, column) {
        Cell::Number(number) if number.is_finite() && !MISSING.contains(&number) => Some(number),
        Cell::Number(_) | Cell::Blank | Cell::Text(_) => None,
    }
}

/// A position as a table has it: x, y and z.
pub type Position = [Sum; 3];

/// The unit is that of the columns; `None` where a cell has no number, or all three are 0, which instruments write
/// where they measured nothing.
pub fn position(sums: &Position, table: &MeasuredTable, row: usize) -> Option<[f64; 3]> {
    let number = |sum: &Sum| match sum.value(table, row, &MISSING) {
        Value::Number(number) => Some(number),
        Value::Missing(_) | Value::Text(..) => None,
    };
    let [x, y, z] = sums;
    let at = [number(x)?, number(y)?, number(z)?];
    at.iter().any(|value| *value != 0.0).then_some(at)
}

/// Median distance from the median position, in the unit of the columns; 0 of nothing. Missing readings are left out.
pub fn spread(table: &MeasuredTable, sums: &Position) -> f64 {
    let points: Vec<[f64; 3]> =
        (0..table.row_count()).filter_map(|row| position(sums, table, row)).collect();
    let middle = [0, 1, 2].map(|axis| {
        median(&points.iter().map(|point| point[axis]).collect::<Vec<_>>()).unwrap_or(0.0)
    });
    let apart = |point: &[f64; 3]| {
        point.iter().zip(middle).map(|(own, middle)| (own - middle).powi(2)).sum::<f64>().sqrt()
    };
    median(&points.iter().map(apart).collect::<Vec<_>>()).unwrap_or(0.0)
}
