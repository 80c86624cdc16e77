use super::StationTableErrorKind;
use crate::ingest::{
    CovarianceColumns, LengthColumns, OrientationColumns, ReadingColumns, StationsSettings,
};
use crate::measured_table::{Cell, ColumnError, MeasuredTable};

/// Columns, each with its sign, and a number.
#[derive(Debug, Clone, PartialEq)]
pub struct Sum {
    terms: Vec<(f64, usize)>,
    constant: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value<'t> {
    Number(f64),
    /// A cell is blank, not a number, or one of the numbers that stand for a missing reading.
    Missing(usize),
    Text(usize, &'t str),
}

#[derive(Debug)]
pub struct Columns {
    pub joints: Vec<Sum>,
    pub station: Option<usize>,
    pub target: Option<usize>,
    pub time: Option<usize>,
    pub temperature: Option<Sum>,
    pub commanded: Option<Pose>,
    pub measured: Vec<Measured>,
    pub references: Vec<Vec<Sum>>,
    pub lengths: Vec<Length>,
}

#[derive(Debug)]
pub struct Length {
    pub reading: Sum,
    /// Its standard deviation; `None` where it is stated.
    pub sd: Option<Sum>,
}

#[derive(Debug)]
pub struct Pose {
    pub position: Vec<Sum>,
    /// The numbers of the orientation, in the order of its form.
    pub orientation: Option<Vec<Sum>>,
}

#[derive(Debug)]
pub struct Measured {
    pub pose: Pose,
    pub sd: Vec<Sum>,
    pub covariance: Vec<Sum>,
    pub samples: Option<Sum>,
    pub orientation_sd: Vec<Sum>,
    pub orientation_covariance: Vec<Sum>,
}

type Found<T> = Result<T, StationTableErrorKind>;

impl Columns {
    pub fn find(table: &MeasuredTable, settings: &StationsSettings) -> Found<Self> {
        let named = |key: &'static str, column: &Option<String>| {
            let column = column.as_ref();
            column.map(|column| one(table, key, column)).transpose()
        };
        let measured = settings.measured.iter().map(|own| Measured::find(table, own));
        let references = settings.references.iter();
        let references = references.filter_map(|own| own.position.as_ref());
        let references = references.map(|own| sums(table, "references.position", own));
        let lengths = settings.lengths.iter().map(|own| Length::find(table, own));
        let commanded = settings.commanded.as_ref();
        let temperature = settings.temperature.as_ref();
        let columns = Self {
            joints: sums(table, "joints", &settings.joints)?,
            station: named("station", &settings.station)?,
            target: named("target", &settings.target)?,
            time: named("time", &settings.time.as_ref().map(|time| time.column.clone()))?,
            temperature: temperature.map(|own| Sum::find(table, "temperature", own)).transpose()?,
            commanded: commanded
                .map(|own| Pose::find(table, "commanded", &own.position, own.orientation.as_ref()))
                .transpose()?,
            measured: measured.collect::<Found<_>>()?,
            references: references.collect::<Found<_>>()?,
            lengths: lengths.collect::<Found<_>>()?,
        };
        match columns.read_twice() {
            // Where a column names the target of a row, what is read of all of them stands in the same columns.
            Some((key, place)) if columns.target.is_none() => {
                Err(StationTableErrorKind::Twice { key, column: table.columns()[place].clone() })
            }
            _ => Ok(columns),
        }
    }

    /// The first column that two things are read from, and the key of the second: joints, targets, references and length instruments have each their own.
    fn read_twice(&self) -> Option<(&'static str, usize)> {
        let measured = self.measured.iter().flat_map(|own| &own.pose.position);
        let keyed = self.joints.iter().map(|own| ("joints", own));
        let keyed = keyed.chain(measured.map(|own| ("measured.position", own)));
        let references = self.references.iter().flatten();
        let keyed = keyed.chain(references.map(|own| ("references.position", own)));
        let keyed = keyed.chain(self.lengths.iter().map(|own| ("lengths.column", &own.reading)));
        let keyed: Vec<(&'static str, &Sum)> = keyed.collect();
        let twice = |place: &usize| keyed[..*place].iter().any(|(_, own)| *own == keyed[*place].1);
        let (key, sum) = keyed[(0..keyed.len()).find(twice)?];
        Some((key, sum.columns().next()?))
    }
}

impl Pose {
    fn find(
        table: &MeasuredTable,
        key: &str,
        position: &[String],
        orientation: Option<&OrientationColumns>,
    ) -> Found<Self> {
        let turn = |own: &OrientationColumns| {
            sums(table, &format!("{key}.orientation"), own.form.columns())
        };
        Ok(Self {
            position: sums(table, &format!("{key}.position"), position)?,
            orientation: orientation.map(turn).transpose()?,
        })
    }
}

impl Measured {
    fn find(table: &MeasuredTable, own: &ReadingColumns) -> Found<Self> {
        let sd = own.sd.as_ref().map_or(&[][..], |sd| sd);
        let covariance = own.covariance.as_ref().map_or(&[][..], CovarianceColumns::columns);
        let samples = own.samples.as_ref();
        let turn = own.orientation.as_ref();
        let turn_sd = turn.map_or(&[][..], |turn| &turn.sd);
        let turn_covariance = turn.map_or(&[][..], |turn| &turn.covariance);
        Ok(Self {
            pose: Pose::find(table, "measured", &own.position, own.orientation.as_ref())?,
            sd: sums(table, "measured.sd", sd)?,
            covariance: sums(table, "measured.covariance", covariance)?,
            samples: samples.map(|own| Sum::find(table, "measured.samples", own)).transpose()?,
            orientation_sd: sums(table, "measured.orientation.sd", turn_sd)?,
            orientation_covariance: sums(
                table,
                "measured.orientation.covariance",
                turn_covariance,
            )?,
        })
    }
}

impl Length {
    fn find(table: &MeasuredTable, own: &LengthColumns) -> Found<Self> {
        let sd = own.sd.as_ref();
        Ok(Self {
            reading: Sum::find(table, "lengths.column", &own.column)?,
            sd: sd.map(|column| Sum::find(table, "lengths.sd", column)).transpose()?,
        })
    }
}

fn sums(table: &MeasuredTable, key: &str, values: &[String]) -> Found<Vec<Sum>> {
    values.iter().map(|value| Sum::find(table, key, value)).collect()
}

pub(super) fn one(table: &MeasuredTable, key: &str, column: &str) -> Found<usize> {
    table.find(column).map_err(|source| no_column(key, column, source))
}

fn no_column(key: &str, value: &str, source: ColumnError) -> StationTableErrorKind {
    let (key, value) = (key.to_owned(), value.to_owned());
    StationTableErrorKind::Column { key, value, source: Box::new(source) }
}

impl Sum {
    /// The sum that `value` writes: a column of exactly that name, or columns and numbers with ` + ` and ` - ` between
    /// them.
    fn find(table: &MeasuredTable, key: &str, value: &str) -> Found<Self> {
        if let Ok(column) = table.find(value) {
            return Ok(Self::of(column));
        }
        let mut sum = Self { terms: Vec::new(), constant: 0.0 };
        for (sign, term) in terms(value) {
            match (table.find(term), term.parse::<f64>()) {
                (Ok(column), _) => sum.terms.push((sign, column)),
                (Err(_), Ok(number)) if number.is_finite() => sum.constant += sign * number,
                (Err(source), _) => return Err(no_column(key, value, source)),
            }
        }
        if sum.terms.is_empty() {
            let (key, value) = (key.to_owned(), value.to_owned());
            return Err(StationTableErrorKind::Empty { key, value });
        }
        Ok(sum)
    }

    pub fn of(column: usize) -> Self {
        Self { terms: vec![(1.0, column)], constant: 0.0 }
    }

    /// This with one column more, added or (−1) taken away.
    #[must_use]
    pub fn with(&self, sign: f64, column: usize) -> Self {
        Self { terms: [&self.terms[..], &[(sign, column)]].concat(), ..*self }
    }

    /// As `[stations]` writes a sum of columns alone.
    pub fn text(&self, names: &[String]) -> String {
        let mut text = String::new();
        for (place, &(sign, column)) in self.terms.iter().enumerate() {
            let operator = if sign < 0.0 { " - " } else { " + " };
            text += if place == 0 { "" } else { operator };
            text += &names[column];
        }
        text
    }

    pub fn columns(&self) -> impl Iterator<Item = usize> {
        self.terms.iter().map(|(_, column)| *column)
    }

    /// Its value in a row; a cell of one of these numbers is missing.
    pub fn value<'t>(&self, table: &'t MeasuredTable, row: usize, missing: &[f64]) -> Value<'t> {
        let mut sum = self.constant;
        for &(sign, column) in &self.terms {
            match table.cell(row, column) {
                Cell::Number(number) if number.is_finite() && !missing.contains(&number) => {
                    sum += sign * number;
                }
                Cell::Number(_) | Cell::Blank => return Value::Missing(column),
                Cell::Text(text) => return Value::Text(column, text),
            }
        }
        Value::Number(sum)
    }
}

/// The terms of a sum, each with its sign: an operator stands between blanks, and a minus may stand before the first
/// term.
fn terms(value: &str) -> Vec<(f64, &str)> {
    let mut rest = value.trim();
    let mut sign = 1.0;
    if let Some(after) = rest.strip_prefix("- ").or_else(|| rest.strip_prefix("-")) {
        (rest, sign) = (after.trim_start(), -1.0);
    }
    let mut terms = Vec::new();
    loop {
        let next = [(" + ", 1.0), (" - ", -1.0)];
        let next = next.iter().filter_map(|(mark, sign)| Some((rest.find(mark)?, *sign)));
        let Some((at, next_sign)) = next.min_by_key(|(at, _)| *at) else {
            terms.push((sign, rest.trim()));
            return terms;
        };
        terms.push((sign, rest[..at].trim()));
        (rest, sign) = (&rest[at + 3..], next_sign);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operators_stand_between_blanks() {
        assert_eq!(terms("x_t + x_dif"), [(1.0, "x_t"), (1.0, "x_dif")]);
        assert_eq!(terms("-a - b + 3.5"), [(-1.0, "a"), (-1.0, "b"), (1.0, "3.5")]);
        assert_eq!(terms("pos-x"), [(1.0, "pos-x")]);
    }
}
