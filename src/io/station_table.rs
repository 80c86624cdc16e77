//! Tables of stations, as people have them instead of logs → rows for [`crate::join::tabled`], by `[stations]` of a
//! pipeline file. [`measured_table`] reads the file; each value is found among its columns (`columns`); rows become
//! joint angles, commands and readings in rad, mm and ns (`rows`). What cannot be used is left out with line, column
//! and reason.

mod columns;
mod error;
mod rows;
#[cfg(test)]
mod tests;
mod write;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

use crate::at::At;
use crate::ingest::StationsSettings;
use crate::ingest::covariances::CovarianceCounts;
use crate::input::Bound;
use crate::join::tabled::Rows;
use crate::measured_table::{self, Cell, Form, MeasuredTable};
use columns::Columns;

pub(crate) use columns::{Sum, Value};
pub use error::{StationTableError, StationTableErrorKind};
pub(crate) use rows::{date_ns, rotation_of_matrix};
pub use write::{LengthColumn, Read, csv};

#[derive(Debug)]
pub struct StationTable {
    pub rows: Rows,
    /// Number of rows read, those left out among them.
    pub read: u64,
    pub covariances: CovarianceCounts,
}

/// The robot and the session that a row names; each is absent where `[stations]` names no column of it.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Whose {
    pub robot: Option<String>,
    pub session: Option<String>,
}

/// The rows of the stations in the table at `path` that are of this robot and session; `slides` says of each joint
/// whether it slides, in mm.
pub fn read(
    path: &Path,
    settings: &StationsSettings,
    whose: &Whose,
    slides: &[bool],
    bound: Bound,
) -> Result<StationTable, StationTableError> {
    let table = open(path, settings, bound)?;
    let at = |kind| StationTableError::new(path.display(), kind);
    let columns = Columns::find(&table, settings).map_err(at)?;
    let own = own_rows(&table, settings, whose).map_err(at)?;
    let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let read = rows::rows(&table, &columns, settings, &own, slides, file);
    let (rows, rejects) = (&read.rows.rows, &read.rows.rejects);
    // Of readings that are all left out there is a reason; a table of lengths alone has none.
    let is_unmeasured = !rejects.is_empty() && rows.iter().all(|row| row.readings.is_empty());
    if rows.is_empty() || is_unmeasured || rejects.len() > rows::MOST_REJECTS {
        return Err(at(StationTableErrorKind::nothing(
            own.len() + table.left_out.len(),
            &read.rows,
        )));
    }
    Ok(read)
}

/// The robots and sessions that rows name, in order, and the rows that lack one of both names, by line.
pub fn named(
    path: &Path,
    settings: &StationsSettings,
    bound: Bound,
) -> Result<(BTreeSet<Whose>, Vec<u64>), StationTableError> {
    let table = open(path, settings, bound)?;
    let columns =
        NameColumns::of(&table, settings).map_err(|kind| At::new(path.display(), kind))?;
    let mut names = BTreeSet::new();
    let mut nameless: Vec<u64> = table.left_out.iter().map(|row| row.line).collect();
    for row in 0..table.row_count() {
        match columns.whose(&table, row) {
            Some(whose) => {
                names.insert(whose);
            }
            None => nameless.push(table.line(row)),
        }
    }
    nameless.sort_unstable();
    Ok((names, nameless))
}

/// The columns and cells of own rows as text, for the digest of a session's input: rows of others, and the form of the
/// file, change nothing of it.
pub fn own_text(
    path: &Path,
    settings: &StationsSettings,
    whose: &Whose,
    bound: Bound,
) -> Result<String, StationTableError> {
    let table = open(path, settings, bound)?;
    let own = own_rows(&table, settings, whose).map_err(|kind| At::new(path.display(), kind))?;
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
    measured_table::read(path, bound, &form).map_err(|error| At::new(error.place, error.kind))
}

struct NameColumns {
    robot: Option<usize>,
    session: Option<usize>,
}

impl NameColumns {
    fn of(
        table: &MeasuredTable,
        settings: &StationsSettings,
    ) -> Result<Self, StationTableErrorKind> {
        let column = |key, named: &Option<String>| {
            let named = named.as_ref();
            named.map(|column| columns::one(table, key, column)).transpose()
        };
        Ok(Self {
            robot: column("robot", &settings.robot)?,
            session: column("session", &settings.session)?,
        })
    }

    /// The robot and the session of a row; `None` where it lacks one.
    fn whose(&self, table: &MeasuredTable, row: usize) -> Option<Whose> {
        let named = |column: Option<usize>| match column {
            Some(column) => name(table.cell(row, column)).map(Some),
            None => Some(None),
        };
        Some(Whose { robot: named(self.robot)?, session: named(self.session)? })
    }
}

/// Numbers of the rows of a robot and session; a name that is absent is that of every row.
fn own_rows(
    table: &MeasuredTable,
    settings: &StationsSettings,
    whose: &Whose,
) -> Result<Vec<usize>, StationTableErrorKind> {
    let columns = NameColumns::of(table, settings)?;
    let is_own = |column: Option<usize>, wanted: &Option<String>, row| match (column, wanted) {
        (Some(column), Some(_)) => name(table.cell(row, column)) == *wanted,
        _ => true,
    };
    let own = |row: &usize| {
        is_own(columns.robot, &whose.robot, *row) && is_own(columns.session, &whose.session, *row)
    };
    Ok((0..table.row_count()).filter(own).collect())
}

/// A cell as the name of a session, station or target; `None` where it is blank.
pub(crate) fn name(cell: Cell<'_>) -> Option<String> {
    match cell {
        Cell::Blank => None,
        Cell::Number(number) => Some(number.to_string()),
        Cell::Text(text) => Some(text.trim().to_owned()).filter(|text| !text.is_empty()),
    }
}
