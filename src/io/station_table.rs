//! Tables of stations, as people have them instead of logs → rows for [`crate::join::tabled`], by `[stations]` of a pipeline file.
//!
//! 1. [`measured_table`] reads the file: named columns of cells, whatever its form.
//! 2. `columns`: each value of `[stations]` is found among the columns, a sum or difference of several where it is one.
//! 3. `rows`: rows become joint angles, commands and readings in rad, mm and ns. What cannot be used is left out with its line,
//!    its column and the reason: read = kept + rejected.
//!
//! A table may hold several sessions in a column: [`sessions`] names them, and [`of_session`] are the rows of one, which its run
//! follows from.

mod columns;
mod error;
mod rows;
#[cfg(test)]
mod tests;
mod write;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

use super::input::Bound;
use super::measured_table::{self, Cell, Form, MeasuredTable};
use crate::ingest::StationsSettings;
use crate::ingest::covariances::CovarianceCounts;
use crate::join::tabled::Rows;
use columns::Columns;

pub use error::{StationTableError, StationTableErrorKind};
pub use write::{LengthColumn, Read, csv};

/// What was read from a table of stations.
#[derive(Debug)]
pub struct StationTable {
    /// Its rows, and what was left out.
    pub rows: Rows,
    /// Number of rows read, those left out among them.
    pub read: u64,
    /// Covariances that its rows state, by what became of them.
    pub covariances: CovarianceCounts,
    /// What was found of the table's form.
    pub remarks: Vec<String>,
}

/// The rows of the stations in the table at `path`, those of `session` where the table has a column of sessions; `slides` says of each
/// joint whether it slides, in mm.
pub fn read(
    path: &Path,
    settings: &StationsSettings,
    session: Option<&str>,
    slides: &[bool],
    bound: Bound,
) -> Result<StationTable, StationTableError> {
    let table = open(path, settings, bound)?;
    let at = |kind: StationTableErrorKind| kind.at(path);
    let columns = Columns::find(&table, settings).map_err(at)?;
    let own = own_rows(&table, settings, session).map_err(at)?;
    let file = path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let read = rows::rows(&table, &columns, settings, &own, slides, file);
    if read.rows.rows.is_empty() {
        return Err(at(StationTableErrorKind::nothing(
            own.len(),
            read.rows.rejects.first(),
        )));
    }
    Ok(StationTable {
        remarks: table.remarks().to_vec(),
        ..read
    })
}

/// The names in the column of sessions, by name, and the rows that name none, by line.
pub fn sessions(
    path: &Path,
    settings: &StationsSettings,
    bound: Bound,
) -> Result<(Vec<String>, Vec<u64>), StationTableError> {
    let table = open(path, settings, bound)?;
    let Some(column) = session_column(&table, settings).map_err(|kind| kind.at(path))? else {
        return Ok((Vec::new(), Vec::new()));
    };
    let mut names: BTreeSet<String> = BTreeSet::new();
    let mut nameless: Vec<u64> = table.left_out().iter().map(|row| row.line).collect();
    for row in 0..table.row_count() {
        match name(table.cell(row, column)) {
            Some(name) => {
                names.insert(name);
            }
            None => nameless.push(table.line(row)),
        }
    }
    nameless.sort_unstable();
    Ok((names.into_iter().collect(), nameless))
}

/// The columns and cells of a session's own rows as text, which the digest of its input is made of: rows of other sessions, and the
/// form of the file, change nothing of it.
pub fn of_session(
    path: &Path,
    settings: &StationsSettings,
    session: &str,
    bound: Bound,
) -> Result<String, StationTableError> {
    let table = open(path, settings, bound)?;
    let own = own_rows(&table, settings, Some(session)).map_err(|kind| kind.at(path))?;
    let mut text = table.columns().join("\u{1f}");
    for row in own {
        text.push('\u{1e}');
        for column in 0..table.columns().len() {
            match table.cell(row, column) {
                Cell::Blank => {}
                Cell::Number(number) => {
                    write!(text, "{:016x}", number.to_bits()).expect("a string");
                }
                Cell::Text(words) => text.push_str(words),
            }
            text.push('\u{1f}');
        }
    }
    Ok(text)
}

fn open(
    path: &Path,
    settings: &StationsSettings,
    bound: Bound,
) -> Result<MeasuredTable, StationTableError> {
    let form = Form {
        separator: settings.separator,
        decimal: settings.decimal,
        sheet: settings.sheet.clone(),
        header: settings.header,
    };
    measured_table::read(path, bound, &form)
        .map_err(|error| StationTableError::Table(Box::new(error)))
}

fn session_column(
    table: &MeasuredTable,
    settings: &StationsSettings,
) -> Result<Option<usize>, StationTableErrorKind> {
    let named = settings.session.as_ref();
    named
        .map(|column| columns::one(table, "session", column))
        .transpose()
}

/// Numbers of the rows of a session; all of them where it names none.
fn own_rows(
    table: &MeasuredTable,
    settings: &StationsSettings,
    session: Option<&str>,
) -> Result<Vec<usize>, StationTableErrorKind> {
    let all = 0..table.row_count();
    match (session_column(table, settings)?, session) {
        (Some(column), Some(session)) => Ok(all
            .filter(|&row| name(table.cell(row, column)).as_deref() == Some(session))
            .collect()),
        _ => Ok(all.collect()),
    }
}

/// A cell as the name of a session, station or target; `None` where it is blank.
fn name(cell: Cell<'_>) -> Option<String> {
    match cell {
        Cell::Blank => None,
        Cell::Number(number) => Some(number.to_string()),
        Cell::Text(text) => Some(text.trim().to_owned()).filter(|text| !text.is_empty()),
    }
}
