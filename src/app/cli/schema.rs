//! `posegrid schema [TABLE]`: the tables, or the contract of one; and the keys of pipeline and robot files.

use clap::{Args, ValueEnum};
use thiserror::Error;

use crate::files::schema::{self, ColumnSchema, Role, SchemaError, TableSchema};
use crate::pipeline::keys::{self, KeyReference};

/// Show the tables, the contract of one, or every key of pipeline and robot files
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  posegrid schema stations
  posegrid schema pipeline      # every key of a pipeline file: type, unit, default
  posegrid schema robot         # every key of a robot file
  posegrid schema pipeline --format json-schema   # for an editor that completes keys and underlines wrong ones
  posegrid schema views         # SQL: the current run of each session, and a row of each session
  posegrid schema views --compact   # the same over what posegrid compact keeps by month")]
pub struct SchemaArgs {
    /// The table whose contract to show; `pipeline` or `robot` for the keys of these files; `views` for the SQL of views; all are
    /// listed without it
    pub table: Option<String>,
    /// Format of the output
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
    /// With `views`: read the tables by month that posegrid compact keeps
    #[arg(long)]
    pub compact: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// For people
    Text,
    /// For programs
    Json,
    /// For editors and validators, of pipeline and robot files
    JsonSchema,
}

#[derive(Debug, Error)]
pub enum ShowError {
    #[error(transparent)]
    Schema(#[from] SchemaError),
    #[error("--format json-schema is of `posegrid schema pipeline` and `posegrid schema robot`")]
    NoJsonSchema,
}

const VIEWS: &str = "views";

pub fn show(args: &SchemaArgs) -> Result<String, ShowError> {
    if let Some(keys) = args.table.as_deref().and_then(KeyReference::find) {
        return Ok(match args.format {
            Format::Text => keys.to_string(),
            Format::Json => json(keys),
            Format::JsonSchema => json(&keys.json_schema()),
        });
    }
    if args.format == Format::JsonSchema {
        return Err(ShowError::NoJsonSchema);
    }
    if args.table.as_deref() == Some(VIEWS) {
        let sql = if args.compact { schema::COMPACT_VIEWS_SQL } else { schema::VIEWS_SQL };
        let is_text = args.format == Format::Text;
        return Ok(if is_text { sql.to_owned() } else { json(&sql) });
    }
    match (&args.table, args.format) {
        (None, Format::Text) => Ok(list()),
        (None, _) => Ok(json(&schema::all())),
        (Some(table), Format::Text) => Ok(contract(schema::find(table)?)),
        (Some(table), _) => Ok(json(schema::find(table)?)),
    }
}

fn json(schema: &impl serde::Serialize) -> String {
    let text = serde_json::to_string_pretty(schema).expect("a schema is texts and numbers");
    text + "\n"
}

fn list() -> String {
    let line = |schema: &TableSchema| {
        let read = if schema.role == Role::Accepted { " (read)" } else { "" };
        let TableSchema { table, version, one_row_per, .. } = schema;
        format!("{table:<18} v{version}  one row per {one_row_per}{read}\n")
    };
    let keys = |file: &str| format!("{file:<18}     every key of a {file} file (read)\n");
    let tables = schema::all().iter().map(line);
    let views = format!("{VIEWS:<18}     SQL of the views current_runs and sessions, for DuckDB\n");
    tables.chain(keys::FILES.map(keys)).chain([views]).collect()
}

fn contract(schema: &TableSchema) -> String {
    let TableSchema { table, version, description, one_row_per, .. } = schema;
    let mut lines = vec![format!("{table}, version {version}: {description}")];
    lines.push(format!("One row per {one_row_per}."));
    if !schema.order.is_empty() {
        lines.push(format!("Sorted by {}, which name a row.", schema.order.join(", ")));
    }
    for column in &schema.columns {
        lines.push(format!("\n{}  {}", column.name, properties(column)));
        lines.push(format!("    {}", column.description));
        let words = column.values.as_ref();
        lines.extend(words.map(|words| format!("    one of: {}", words.join(", "))));
    }
    lines.push("\nChanges".to_owned());
    lines.extend(schema.changes.iter().map(|change| format!("    {change}")));
    lines.join("\n") + "\n"
}

fn properties(column: &ColumnSchema) -> String {
    let unit = column.unit.as_deref().filter(|unit| *unit != "1");
    let frame = column.frame.as_ref().map(|frame| format!("in frame: {frame}"));
    let nullable = column.nullable.then_some("may be null");
    let since = column.since.map(|version| format!("since version {version}"));
    let parts = [Some(column.kind.name()), unit, frame.as_deref(), nullable, since.as_deref()];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(table: Option<&str>, format: Format) -> Result<String, ShowError> {
        show(&SchemaArgs { table: table.map(str::to_owned), format, compact: false })
    }

    #[test]
    fn without_a_table_every_table_and_kind_of_file_is_a_line() {
        let text = shown(None, Format::Text).unwrap();
        assert_eq!(text.lines().count(), schema::all().len() + keys::FILES.len() + 1);
        assert!(text.contains("\nstations           v7  one row per dwell of the arm\n"), "{text}");
    }

    #[test]
    fn a_contract_shows_unit_frame_words_and_nulls() {
        let text = shown(Some("stations"), Format::Text).unwrap();
        let expected = "\nscatter_x_mm  float64, mm, in frame: tracker, may be null\n    Standard deviation of a single";
        assert!(text.contains(expected), "{text}");
        assert!(text.contains("    one of: paired, unmeasured, ambiguous\n"), "{text}");
    }

    #[test]
    fn json_is_the_schema_itself() {
        let text = shown(Some("targets"), Format::Json).unwrap();
        let back: TableSchema = serde_json::from_str(&text).unwrap();
        assert_eq!(&back, schema::find("targets").unwrap());
    }

    #[test]
    fn the_keys_of_files_show_type_unit_default_and_words() {
        let text = shown(Some("pipeline"), Format::Text).unwrap();
        for expected in [
            "\n[tracker]  required\n",
            "\n  repeatability_mm  number, mm, 0 or more and at most 10000, default 0.03\n    The arm's repeatability per axis",
            "\n  steps_mm  list of numbers, mm, 1e-6 or more, required\n",
            "    one of: header, publish, log\n",
            "\n  up  3 numbers, without it: gravity is left out of the model\n",
            "\nplacement of commanded.base_from_command, ",
        ] {
            assert!(text.contains(expected), "{expected}:\n{text}");
        }
        let text = shown(Some("robot"), Format::Text).unwrap();
        assert!(text.contains("\n[[joint]]  required\n"), "{text}");
        let json = shown(Some("robot"), Format::Json).unwrap();
        let back: KeyReference = serde_json::from_str(&json).unwrap();
        assert_eq!(&back, KeyReference::robot());
    }

    #[test]
    fn an_unknown_table_is_an_error() {
        assert!(shown(Some("station"), Format::Text).is_err());
    }
}
