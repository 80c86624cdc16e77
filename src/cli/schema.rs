//! `posegrid schema [TABLE]`: the tables, or the contract of one.

use std::fmt::Write as _;

use clap::{Args, ValueEnum};

use crate::io::schema::{self, ColumnSchema, Role, SchemaError, TableSchema};

/// Show the tables, or the contract of one.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  posegrid schema stations")]
pub struct SchemaArgs {
    /// The table whose contract to show; all tables are listed without it
    pub table: Option<String>,
    /// Format of the output
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
}

/// Formats of the output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// For people
    Text,
    /// For programs
    Json,
}

/// The text that the command prints.
pub fn show(args: &SchemaArgs) -> Result<String, SchemaError> {
    match (&args.table, args.format) {
        (None, Format::Text) => Ok(list()),
        (None, Format::Json) => Ok(json(&schema::all())),
        (Some(table), Format::Text) => Ok(contract(schema::find(table)?)),
        (Some(table), Format::Json) => Ok(json(schema::find(table)?)),
    }
}

fn json(schema: &impl serde::Serialize) -> String {
    let text = serde_json::to_string_pretty(schema).expect("a schema is texts and numbers");
    text + "\n"
}

fn list() -> String {
    let line = |schema: &TableSchema| {
        let read = if schema.role == Role::Accepted {
            " (read)"
        } else {
            ""
        };
        format!(
            "{:<15} v{}  one row per {}{read}\n",
            schema.table, schema.version, schema.one_row_per
        )
    };
    schema::all().iter().map(line).collect()
}

fn contract(schema: &TableSchema) -> String {
    let mut text = format!(
        "{}, version {}: {}\nOne row per {}.\n",
        schema.table, schema.version, schema.description, schema.one_row_per
    );
    if !schema.order.is_empty() {
        line(
            &mut text,
            &format!("Sorted by {}, which name a row.", schema.order.join(", ")),
        );
    }
    for column in &schema.columns {
        line(
            &mut text,
            &format!("\n{}  {}", column.name, properties(column)),
        );
        line(&mut text, &format!("    {}", column.description));
        if let Some(words) = &column.values {
            line(&mut text, &format!("    one of: {}", words.join(", ")));
        }
    }
    line(&mut text, "\nChanges");
    for change in &schema.changes {
        line(&mut text, &format!("    {change}"));
    }
    text
}

fn properties(column: &ColumnSchema) -> String {
    let unit = column.unit.as_deref().filter(|unit| *unit != "1");
    let frame = column
        .frame
        .as_ref()
        .map(|frame| format!("in frame: {frame}"));
    let nullable = column.nullable.then_some("may be null");
    let since = column
        .since
        .map(|version| format!("since version {version}"));
    let parts = [
        Some(column.kind.name()),
        unit,
        frame.as_deref(),
        nullable,
        since.as_deref(),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

fn line(text: &mut String, line: &str) {
    writeln!(text, "{line}").expect("writing to a string does not fail");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(table: Option<&str>, format: Format) -> Result<String, SchemaError> {
        show(&SchemaArgs {
            table: table.map(str::to_owned),
            format,
        })
    }

    #[test]
    fn without_a_table_every_table_is_a_line() {
        let text = shown(None, Format::Text).unwrap();
        assert_eq!(text.lines().count(), schema::all().len());
        assert!(
            text.starts_with("stations        v2  one row per dwell of the arm\n"),
            "{text}"
        );
    }

    #[test]
    fn a_contract_shows_unit_frame_words_and_nulls() {
        let text = shown(Some("stations"), Format::Text).unwrap();
        let expected = "\nscatter_x_mm  float64, mm, in frame: tracker, may be null\n    Standard deviation of a single";
        assert!(text.contains(expected), "{text}");
        assert!(
            text.contains("    one of: paired, unmeasured, ambiguous\n"),
            "{text}"
        );
    }

    #[test]
    fn json_is_the_schema_itself() {
        let text = shown(Some("targets"), Format::Json).unwrap();
        let back: TableSchema = serde_json::from_str(&text).unwrap();
        assert_eq!(&back, schema::find("targets").unwrap());
    }

    #[test]
    fn an_unknown_table_is_an_error() {
        assert!(shown(Some("station"), Format::Text).is_err());
    }
}
