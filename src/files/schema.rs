//! The contracts of the tables: `schemas/*.toml`, one file per table, built into the program.
//!
//! Columns that several tables have alike stand once in `schemas/groups.toml`, and a table includes them.
//!
//! A schema states what a table is, what a row is, and for each column its type, unit, frame, whether it may be null and
//! which words it allows. Writers are checked against it ([`super::table`]); readers find its version in every file. A
//! change of a schema raises its version by one and adds a line to its `changes`.

mod check;

use std::sync::{Arc, LazyLock};

use arrow_schema::{DataType, Field, TimeUnit};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::nearest::did_you_mean;

/// The time zone of moments, as their type states it.
pub const UTC: &str = "UTC";

/// The columns that every published table begins with.
pub const KEY_COLUMNS: [&str; 3] = ["robot", "session", "run"];

#[derive(Debug, Clone, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct TableSchema {
    /// Name of the table, also of its folder in a lake.
    pub table: String,
    /// Raised by one with every change.
    pub version: u32,
    /// The oldest version whose files are read as this version; absent where there is none. Later versions may have
    /// added columns, each of which states the version that added it and is null in older files, and removed those in `removed`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reads_from: Option<u32>,
    /// Whether posegrid writes or only reads it.
    pub role: Role,
    pub description: String,
    pub one_row_per: String,
    /// Columns that rows are sorted by; together they identify a row within a file. Empty: a file has one row.
    pub order: Vec<String>,
    /// The change of each version, first version first.
    pub changes: Vec<String>,
    /// Columns of versions since `reads_from` that this version no longer has: in older files they are passed over.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub removed: Vec<String>,
    #[serde(rename = "column")]
    pub columns: Vec<ColumnSchema>,
}

#[derive(Debug, Clone, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ColumnSchema {
    /// Name of the column, with the unit as suffix where the unit is fixed.
    pub name: String,
    #[serde(rename = "type")]
    pub kind: ColumnType,
    /// Unit of a number (`1` without dimension, `column c` where column c names it).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Frame or clock that the value is stated in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<String>,
    /// The version that added it; absent where files of older versions are not read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub since: Option<u32>,
    /// Whether a value may be absent. Absent is null, never a special number.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub nullable: bool,
    /// The words allowed, in the order that rows are sorted in; any text when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub values: Option<Vec<String>>,
    pub description: String,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Written to a lake by a run.
    Published,
    /// Read from a file of another program.
    Accepted,
}

/// Types of columns. Whole numbers are signed throughout: not every reader has unsigned ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
pub enum ColumnType {
    #[serde(rename = "float64")]
    Float64,
    #[serde(rename = "int64")]
    Int64,
    #[serde(rename = "bool")]
    Bool,
    /// Text, or one of the allowed words.
    #[serde(rename = "string")]
    String,
    /// A moment of wall time to the microsecond, with UTC in its type.
    #[serde(rename = "timestamp")]
    Timestamp,
    #[serde(rename = "list<float64>")]
    ListFloat64,
    #[serde(rename = "list<int64>")]
    ListInt64,
    #[serde(rename = "list<string>")]
    ListString,
}

#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SchemaError {
    #[error("schema: {message}")]
    Parse {
        /// The TOML reader's message, with line and column.
        message: String,
    },
    #[error("schema of table {table:?}, {place}: {rule}")]
    Rule {
        table: String,
        /// The column or key concerned.
        place: String,
        rule: &'static str,
    },
    #[error("there is no table {table:?}{}; the tables are {}; `posegrid schema views` has the views current_runs and sessions, `posegrid schema pipeline` and \
         `posegrid schema robot` the keys of those files", did_you_mean(table, known.iter().copied()), known.join(", "))]
    UnknownTable { table: String, known: Vec<&'static str> },
}

/// The schema files, in the order of the stages that write them.
const FILES: [&str; 32] = [
    include_str!("../../schemas/readings.toml"),
    include_str!("../../schemas/joined_sessions.toml"),
    include_str!("../../schemas/estimates.toml"),
    include_str!("../../schemas/estimate_residuals.toml"),
    include_str!("../../schemas/grids.toml"),
    include_str!("../../schemas/grid_errors.toml"),
    include_str!("../../schemas/stations.toml"),
    include_str!("../../schemas/rejects.toml"),
    include_str!("../../schemas/clocks.toml"),
    include_str!("../../schemas/calibrations.toml"),
    include_str!("../../schemas/parameters.toml"),
    include_str!("../../schemas/scales.toml"),
    include_str!("../../schemas/sources.toml"),
    include_str!("../../schemas/references.toml"),
    include_str!("../../schemas/reference_motion.toml"),
    include_str!("../../schemas/joint_errors.toml"),
    include_str!("../../schemas/residuals.toml"),
    include_str!("../../schemas/length_residuals.toml"),
    include_str!("../../schemas/semivariograms.toml"),
    include_str!("../../schemas/grid_steps.toml"),
    include_str!("../../schemas/compensation.toml"),
    include_str!("../../schemas/accuracy.toml"),
    include_str!("../../schemas/runs.toml"),
    include_str!("../../schemas/asked.toml"),
    include_str!("../../schemas/logs.toml"),
    include_str!("../../schemas/sampling_plan.toml"),
    include_str!("../../schemas/plan_figures.toml"),
    include_str!("../../schemas/history.toml"),
    include_str!("../../schemas/drift.toml"),
    include_str!("../../schemas/corrections.toml"),
    include_str!("../../schemas/targets.toml"),
    include_str!("../../schemas/corrected_targets.toml"),
];

/// SQL statements for the views over a lake in the folder `lake`: the rows of `runs`, the current run of each session, and a row
/// of each session.
pub const VIEWS_SQL: &str =
    concat!(include_str!("schema/views.sql"), include_str!("schema/sessions.sql"));

/// SQL statements for the same views over the compact form of such a lake, and its rows of `accuracy`.
pub const COMPACT_VIEWS_SQL: &str = concat!(
    include_str!("schema/compact_views.sql"),
    include_str!("schema/sessions.sql"),
    include_str!("schema/newer_than_compact.sql")
);

/// The groups of columns that schema files include, by name.
static GROUPS: LazyLock<toml::Table> = LazyLock::new(|| {
    let groups = include_str!("../../schemas/groups.toml").parse();
    groups.expect("a test loads every schema file")
});

static SCHEMAS: LazyLock<Vec<TableSchema>> = LazyLock::new(|| {
    let parsed = |text: &&str| TableSchema::parse(text).expect("a test loads every schema file");
    FILES.iter().map(parsed).collect()
});

/// Every schema, in the order of the stages that write them.
pub fn all() -> &'static [TableSchema] {
    &SCHEMAS
}

/// The schema of a table; an error lists the existing tables.
pub fn find(table: &str) -> Result<&'static TableSchema, SchemaError> {
    let found = all().iter().find(|schema| schema.table == table);
    found.ok_or_else(|| SchemaError::UnknownTable {
        table: table.to_owned(),
        known: all().iter().map(|schema| schema.table.as_str()).collect(),
    })
}

impl TableSchema {
    pub fn parse(text: &str) -> Result<Self, SchemaError> {
        let schema = Self::expanded(text);
        let schema = schema.map_err(|error| SchemaError::Parse { message: error.to_string() })?;
        schema.check()?;
        Ok(schema)
    }

    /// Reads a schema file, every included group replaced by its columns.
    fn expanded(text: &str) -> Result<Self, toml::de::Error> {
        let mut file: toml::Table = text.parse()?;
        if let Some(toml::Value::Array(columns)) = file.get_mut("column") {
            *columns = columns.iter().flat_map(columns_of).collect();
        }
        file.try_into()
    }

    /// The position of a column and its contract; `None` where the table has none of this name.
    pub fn column(&self, name: &str) -> Option<(usize, &ColumnSchema)> {
        let place = self.columns.iter().position(|c| c.name == name)?;
        Some((place, &self.columns[place]))
    }

    pub fn reads(&self, version: u32) -> bool {
        (self.reads_from.unwrap_or(self.version)..=self.version).contains(&version)
    }

    pub fn arrow(&self) -> arrow_schema::Schema {
        let field = |c: &ColumnSchema| Field::new(&c.name, c.kind.arrow(), c.nullable);
        arrow_schema::Schema::new(self.columns.iter().map(field).collect::<Vec<_>>())
    }
}

/// The columns of an entry: its own, or those of the group that it includes. An unknown group stays an unknown key.
fn columns_of(entry: &toml::Value) -> Vec<toml::Value> {
    let group = entry.get("include").and_then(toml::Value::as_str);
    match group.and_then(|name| GROUPS.get(name)).and_then(toml::Value::as_array) {
        None => vec![entry.clone()],
        Some(group) => group.iter().flat_map(|own| columns_of(&in_place(own, entry))).collect(),
    }
}

/// A group's column with the name, the description and the other keys of the entry that includes it.
fn in_place(own: &toml::Value, entry: &toml::Value) -> toml::Value {
    let of_entry = |key: &str| entry.get(key).and_then(toml::Value::as_str).unwrap_or_default();
    let mut column = entry.as_table().cloned().unwrap_or_default();
    column.remove("include");
    for (key, value) in own.as_table().into_iter().flatten() {
        let value = value.as_str().map_or_else(
            || value.clone(),
            |text| {
                let text = text.replace("{name}", of_entry("name"));
                let text = text.replace("{description}", of_entry("description"));
                text.trim_start_matches('_').into()
            },
        );
        column.insert(key.clone(), value);
    }
    column.into()
}

impl ColumnSchema {
    pub(super) fn is_in(&self, version: u32) -> bool {
        self.since.is_none_or(|since| since <= version)
    }
}

impl ColumnType {
    pub fn arrow(self) -> DataType {
        // "element" is the name that the Parquet format gives a list's values; they are never null.
        let list = |of| DataType::List(Arc::new(Field::new("element", of, false)));
        match self {
            Self::Float64 => DataType::Float64,
            Self::Int64 => DataType::Int64,
            Self::Bool => DataType::Boolean,
            Self::Timestamp => DataType::Timestamp(TimeUnit::Microsecond, Some(UTC.into())),
            Self::String => DataType::Utf8,
            Self::ListFloat64 => list(DataType::Float64),
            Self::ListInt64 => list(DataType::Int64),
            Self::ListString => list(DataType::Utf8),
        }
    }

    pub const fn name(self) -> &'static str {
        match self {
            Self::Float64 => "float64",
            Self::Int64 => "int64",
            Self::Bool => "bool",
            Self::Timestamp => "timestamp",
            Self::String => "string",
            Self::ListFloat64 => "list<float64>",
            Self::ListInt64 => "list<int64>",
            Self::ListString => "list<string>",
        }
    }

    /// Whether it holds numbers, or lists of them: these have a unit.
    pub(super) const fn is_number(self) -> bool {
        !matches!(self, Self::Bool | Self::String | Self::Timestamp | Self::ListString)
    }

    /// Whether it holds one value, not a list.
    pub const fn is_scalar(self) -> bool {
        !matches!(self, Self::ListFloat64 | Self::ListInt64 | Self::ListString)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_schema_file_loads_and_is_in_the_list() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../schemas");
        let mut files: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .filter(|name| name != "groups.toml" && name != "json")
            .collect();
        files.sort();
        let mut tables: Vec<_> =
            all().iter().map(|schema| format!("{}.toml", schema.table)).collect();
        tables.sort();
        assert_eq!(files, tables);
    }

    #[test]
    fn an_unknown_table_is_answered_with_the_known_ones() {
        let error = find("station").unwrap_err().to_string();
        assert!(
            error.starts_with(
                "there is no table \"station\" (did you mean \"stations\"?); the tables are readings, joined_sessions, estimates"
            ),
            "{error}"
        );
    }
}
