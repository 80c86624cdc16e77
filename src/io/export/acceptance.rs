//! The rows that an acceptance report is made of: by any table of a whole run in its lake.

use std::path::Path;

use super::{ExportError, ExportErrorKind};
use crate::common;
use crate::lake::Lake;
use crate::manifest::RunKey;
use crate::rows::Row as _;
use crate::schema;
use crate::table;
use crate::tables::accuracy::AccuracyRow;
use crate::tables::calibrations::{ArmColumns, CalibrationRow};
use crate::tables::runs::RunRow;

/// The tables that name a whole run.
pub const TABLES: [&str; 4] = ["runs", "accuracy", "calibrations", "compensation"];

#[derive(Debug, Clone)]
pub struct AcceptanceRows {
    pub key: RunKey,
    pub run: RunRow,
    pub accuracy: Vec<AccuracyRow>,
    pub arm: ArmColumns,
}

/// The rows of the run whose file of the table `name` is given; each table has to have its digest in the run's row.
pub fn rows(path: &Path, name: &str) -> Result<AcceptanceRows, ExportError> {
    let key = common::key(path, &table::read(path, schema::find(name)?)?)?;
    let no_lake = || ExportErrorKind::NotInLake.at(path);
    let lake = Lake::around(path, name, &key).ok_or_else(no_lake)?;
    let read = |table: &str| lake.read(table, &key);
    let run = RunRow::read(&read(RunRow::TABLE)?).pop();
    let arm = CalibrationRow::read(&read(CalibrationRow::TABLE)?).pop();
    let empty = || ExportErrorKind::Empty.at(path);
    Ok(AcceptanceRows {
        run: run.ok_or_else(empty)?,
        accuracy: AccuracyRow::read(&read(AccuracyRow::TABLE)?),
        arm: arm.ok_or_else(empty)?.of_arm,
        key,
    })
}
