//! Columns of a row besides its numbers: time, temperature, session.

use std::collections::BTreeSet;

use super::columns::{ColumnSummary, number};
use super::names::Sense;
use crate::ingest::{TableTime, TimeColumn};
use crate::measured_table::{Cell, MeasuredTable};
use crate::station_table::{date_ns, name};

const MOST_SESSIONS: usize = 100;
/// Temperatures of places where people measure, °C.
const TEMPERATURES: (f64, f64) = (-30.0, 80.0);

/// The column of times, and why its unit is unsure; a note where it cannot be used, and `None` where no name says it.
pub fn time(
    table: &MeasuredTable,
    columns: &[ColumnSummary],
    used: &[usize],
) -> Option<Result<(TimeColumn, Option<String>), String>> {
    let named = |column: &usize| columns[*column].named.has(Sense::Time) && !used.contains(column);
    let column = (0..columns.len()).find(named)?;
    let name = columns[column].name.clone();
    Some(match unit(table, &columns[column], column) {
        Ok((unit, doubt)) => Ok((TimeColumn { column: name, unit }, doubt)),
        Err(reason) => Err(format!(
            "{name} is named as a time, but {reason}; stations are in the order of the rows"
        )),
    })
}

/// The unit of times, with why it is unsure; or why they are none.
fn unit(
    table: &MeasuredTable,
    summary: &ColumnSummary,
    column: usize,
) -> Result<(TableTime, Option<String>), String> {
    if summary.texts > summary.numbers {
        let dates = [TableTime::Iso8601, TableTime::MonthDay, TableTime::DayMonth];
        let found = dates.into_iter().find(|form| are_dates(table, column, *form));
        let is_month_first = found == Some(TableTime::MonthDay);
        let doubt = is_month_first.then(|| "its dates are taken with the month first".to_owned());
        return found.map(|form| (form, doubt)).ok_or_else(|| {
            "its texts are no dates and times as 2026-11-23T08:30:00Z, 11/23/26 08:30:00 or 23.11.2026 08:30:00"
                .to_owned()
        });
    }
    let times: Vec<f64> =
        (0..table.row_count()).filter_map(|row| number(table, row, column)).collect();
    let different: BTreeSet<u64> = times.iter().map(|time| time.to_bits()).collect();
    let (Some((low, high)), true) = (summary.range, different.len() > 1) else {
        return Err("all rows have the same time: digits of it are lost".to_owned());
    };
    if different.len() < times.len() {
        return Err("rows have the same time as others: digits of it are lost".to_owned());
    }
    if times.iter().all(|time| is_written_date(*time)) {
        return Err(
            "its numbers are dates written in digits (20260714164124), which is no unit of time"
                .to_owned(),
        );
    }
    let since_1970 =
        [(1e9, TableTime::S), (1e12, TableTime::Ms), (1e15, TableTime::Us), (1e18, TableTime::Ns)];
    // From the year 2001 to 2128.
    let found = since_1970.into_iter().find(|(scale, _)| low >= *scale && high < 5.0 * scale);
    Ok(match found {
        Some((_, unit)) => (unit, None),
        None => (TableTime::S, Some(format!("its numbers are {low} to {high}: s, ms, us or ns"))),
    })
}

/// Whether a number has the digits of a date and time.
fn is_written_date(number: f64) -> bool {
    let [year, month, day] = [1e10, 1e8, 1e6].map(|unit| (number / unit).floor());
    (1970.0..2100.0).contains(&year)
        && (1.0..13.0).contains(&(month % 100.0))
        && (1.0..32.0).contains(&(day % 100.0))
}

fn are_dates(table: &MeasuredTable, column: usize, form: TableTime) -> bool {
    (0..table.row_count()).all(|row| match table.cell(row, column) {
        Cell::Text(text) => date_ns(text.trim(), form).is_some(),
        Cell::Blank | Cell::Number(_) => false,
    })
}

pub fn temperature(columns: &[ColumnSummary], used: &[usize]) -> Option<usize> {
    let fits = |column: &usize| {
        let own = &columns[*column];
        let is_usual =
            own.range.is_some_and(|(low, high)| low > TEMPERATURES.0 && high < TEMPERATURES.1);
        own.named.has(Sense::Temperature) && own.is_numeric() && is_usual && !used.contains(column)
    };
    (0..columns.len()).find(fits)
}

/// The column of sessions, by its name: each session is some rows one after another. With their names, in order.
pub fn session(
    table: &MeasuredTable,
    columns: &[ColumnSummary],
    used: &[usize],
) -> Option<(usize, Vec<String>)> {
    let named =
        |column: &usize| columns[*column].named.has(Sense::Session) && !used.contains(column);
    (0..columns.len()).filter(named).find_map(|column| {
        let names: Option<Vec<String>> =
            (0..table.row_count()).map(|row| name(table.cell(row, column))).collect();
        let names = names?;
        let different: BTreeSet<&String> = names.iter().collect();
        let runs = 1 + names.windows(2).filter(|pair| pair[0] != pair[1]).count();
        let is_session = (2..=MOST_SESSIONS).contains(&different.len())
            && runs == different.len()
            && 2 * different.len() <= names.len();
        is_session.then(|| (column, different.into_iter().cloned().collect()))
    })
}
