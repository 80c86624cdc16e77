//! Inspect: a table of measured stations → its columns, and how `[stations]` of a pipeline file would read them.
//!
//! 1. `columns` and `names`: values, words and unit of each column.
//! 2. `groups`, `matrices` and `roles`: positions, orientations, standard deviations, joints.
//! 3. `choices`: readings of the columns that may be meant; `long`: whether a row is a reading of one target.
//! 4. `by_arm`: the nominal arm decides between them; `turns` and `commands` tell the form of orientations and the
//!    frame of commanded poses.
//! 5. `guess`: the settings, with everything that is unsure, for a person to check.

mod by_arm;
mod choices;
mod columns;
mod commands;
mod groups;
mod guess;
mod long;
mod matrices;
mod names;
mod roles;
#[cfg(test)]
mod tests;
mod turns;
mod uses;

use std::path::Path;

use crate::input::Bound;
use crate::measured_table::{self, Form, MeasuredTable, MeasuredTableError};

pub use by_arm::{Arms, Differs, Tried, Verdict};
pub use choices::{Choice, Part};
pub use columns::ColumnSummary;
pub use commands::Commands;
pub use guess::{Doubt, Guess, Key};
pub use names::StatedUnit;

#[derive(Debug)]
pub struct TableInspection {
    pub rows: usize,
    pub remarks: Vec<String>,
    pub left_out: Vec<(u64, String)>,
    /// The word for what a line is: `line`, `row`, `record`.
    pub counted: &'static str,
    pub columns: Vec<ColumnSummary>,
    /// How `[stations]` would read it; what is missing where it would not.
    pub guess: Result<Guess, String>,
}

pub fn inspect(
    path: &Path,
    bound: Bound,
    arms: &Arms,
) -> Result<TableInspection, MeasuredTableError> {
    let table = measured_table::read(path, bound, &Form::default())?;
    Ok(of_table(&table, arms))
}

fn of_table(table: &MeasuredTable, arms: &Arms) -> TableInspection {
    let columns = (0..table.columns().len()).map(|column| ColumnSummary::of(table, column));
    let columns: Vec<ColumnSummary> = columns.collect();
    let left_out = table.left_out.iter().map(|row| (row.line, row.reason.to_string()));
    TableInspection {
        rows: table.row_count(),
        remarks: table.remarks.clone(),
        left_out: left_out.collect(),
        counted: table.counted.word(),
        guess: guess::guess(table, &columns, arms),
        columns,
    }
}
