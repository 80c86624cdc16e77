//! Every struct of rows against its schema.

use std::collections::BTreeSet;

use super::*;
use crate::lake::{AskedRow, CorrectionRow};
use crate::schema;
use crate::targets::{CorrectedRow, TargetRow};

/// That the struct of a table's rows says what its schema says: names, types, nulls and words. Gives the table.
fn as_schema<R: Row>() -> &'static str {
    let schema = R::schema();
    let fields = R::columns(&[]);
    // Robot, session and run are outside the rows, or are fields of their own.
    let of_rows = |name: &&str| fields.iter().any(|field| field.name == *name);
    let outside = schema::KEY_COLUMNS.into_iter().filter(|name| !of_rows(name));
    let outside: BTreeSet<&str> = outside.filter(|name| schema.column(name).is_some()).collect();
    let of = |name| format!("{}.{name}", R::TABLE);
    let names = schema.columns.iter().map(|column| column.name.as_str());
    let names: BTreeSet<&str> = names.filter(|name| !outside.contains(name)).collect();
    let own: BTreeSet<&str> = fields.iter().map(|field| field.name).collect();
    assert_eq!(own, names, "{}", R::TABLE);
    assert_eq!(fields.len(), own.len(), "{}: a column has two fields", R::TABLE);
    for field in &fields {
        let (_, column) = schema.column(field.name).expect("its names are the schema's");
        assert_eq!(field.kind, column.kind, "{}", of(field.name));
        assert_eq!(field.nullable, column.nullable, "{}", of(field.name));
        let is_enumeration = (field.knows)("").is_some();
        assert_eq!(is_enumeration, column.values.is_some(), "{}", of(field.name));
        for word in column.values.iter().flatten() {
            assert_eq!((field.knows)(word), Some(true), "{}: {word}", of(field.name));
        }
    }
    R::TABLE
}

#[test]
fn the_rows_of_every_table_say_what_its_schema_says() {
    let mut tables = vec![
        as_schema::<readings::ReadingRow>(),
        as_schema::<joined_sessions::JoinedSessionRow>(),
        as_schema::<estimates::EstimateRow>(),
        as_schema::<residuals::EstimateResidualRow>(),
        as_schema::<grids::GridsRow>(),
        as_schema::<grids::GridErrorRow>(),
        as_schema::<StationRow>(),
        as_schema::<RejectRow>(),
        as_schema::<ClockRow>(),
        as_schema::<CalibrationRow>(),
        as_schema::<ParameterRow>(),
        as_schema::<ScaleRow>(),
        as_schema::<sources::SourceRow>(),
        as_schema::<ReferenceRow>(),
        as_schema::<MotionRow>(),
        as_schema::<JointErrorRow>(),
        as_schema::<ResidualRow>(),
        as_schema::<length_residuals::LengthResidualRow>(),
        as_schema::<SemivariogramRow>(),
        as_schema::<StepRow>(),
        as_schema::<NodeRow>(),
        as_schema::<AccuracyRow>(),
        as_schema::<runs::RunRow>(),
        as_schema::<history::HistoryRow>(),
        as_schema::<drift::DriftRow>(),
        as_schema::<sampling_plan::VisitRow>(),
        as_schema::<plan_figures::FigureRow>(),
        as_schema::<logs::tests::LogRow>(),
        as_schema::<AskedRow>(),
        as_schema::<CorrectionRow>(),
        as_schema::<CorrectedRow>(),
        as_schema::<TargetRow>(),
    ];
    tables.sort_unstable();
    let mut all: Vec<&str> = schema::all().iter().map(|own| own.table.as_str()).collect();
    all.sort_unstable();
    assert_eq!(tables, all, "every table has a struct of its rows");
}
