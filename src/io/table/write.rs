//! Tables → Parquet files.
//!
//! A file says in its metadata what it is: `posegrid.table`, `posegrid.schema_version`, `posegrid.units` and
//! `posegrid.frames` (JSON, column → unit or frame), and `posegrid.robot`, `.session` and `.run`. It holds no time, no
//! host and no path, so the same table gives the same bytes. Snappy: every reader has it, and it is the cheaper of the
//! two to write, which counts most for decoded logs.

use std::collections::BTreeMap;
use std::io::Write;

use parquet::arrow::arrow_writer::{ArrowWriter, ArrowWriterOptions};
use parquet::basic::{Compression, Encoding};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{WriterProperties, WriterPropertiesBuilder};
use parquet::schema::types::ColumnPath;

use super::Table;
use crate::io::schema::{ColumnSchema, ColumnType, TableSchema};

/// Rows in a row group: a reader that wants one column of one group reads little, and a writer holds little.
pub const ROW_GROUP_ROWS: usize = 131_072;

/// Writes a table as a Parquet file into `sink` and gives `sink` back.
pub fn write<W: Write + Send>(table: &Table, sink: W) -> Result<W, ParquetError> {
    let mut writer = writer(table, sink)?;
    writer.write(&table.batch)?;
    writer.into_inner()
}

/// A writer of `table` and whatever other parts it has, each a batch of its own.
pub fn writer<W: Write + Send>(table: &Table, sink: W) -> Result<ArrowWriter<W>, ParquetError> {
    let properties = whole_numbers(table.schema)
        .set_created_by(concat!("posegrid version ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_compression(Compression::SNAPPY)
        .set_max_row_group_row_count(Some(ROW_GROUP_ROWS))
        .set_key_value_metadata(Some(metadata(table)))
        .build();
    // The units and frames stand in the metadata in words; Arrow's own copy of the schema would add nothing.
    let options = ArrowWriterOptions::new()
        .with_properties(properties)
        .with_skip_arrow_metadata(true);
    ArrowWriter::try_new_with_options(sink, table.batch.schema(), options)
}

/// Whole numbers are counts, places and stamps that rise from row to row: their differences take the least space, and no
/// dictionary of them is ever looked up twice.
fn whole_numbers(schema: &TableSchema) -> WriterPropertiesBuilder {
    let whole = schema
        .columns
        .iter()
        .filter(|column| column.kind == ColumnType::Int64);
    whole.fold(WriterProperties::builder(), |properties, column| {
        let path = ColumnPath::from(column.name.as_str());
        properties
            .set_column_dictionary_enabled(path.clone(), false)
            .set_column_encoding(path, Encoding::DELTA_BINARY_PACKED)
    })
}

fn metadata(table: &Table) -> Vec<KeyValue> {
    let schema = table.schema;
    let entry = |name: &str, value: String| KeyValue::new(format!("posegrid.{name}"), value);
    let mut entries = vec![
        entry("table", schema.table.clone()),
        entry("schema_version", schema.version.to_string()),
        entry("units", by_column(schema, |column| column.unit.as_deref())),
        entry(
            "frames",
            by_column(schema, |column| column.frame.as_deref()),
        ),
    ];
    if let Some(key) = &table.key {
        entries.push(entry("robot", key.robot.clone()));
        entries.push(entry("session", key.session.clone()));
        entries.push(entry("run", key.run.clone()));
    }
    entries
}

fn by_column<'a>(
    schema: &'a TableSchema,
    property: impl Fn(&'a ColumnSchema) -> Option<&'a str>,
) -> String {
    let stated = |column: &'a ColumnSchema| Some((column.name.as_str(), property(column)?));
    let map: BTreeMap<&str, &str> = schema.columns.iter().filter_map(stated).collect();
    serde_json::to_string(&map).expect("a map of texts is JSON")
}
