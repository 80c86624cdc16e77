//! The encodings of a table's columns, and the metadata of its file.

use std::collections::BTreeMap;

use parquet::basic::{Compression, Encoding};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterPropertiesBuilder};
use parquet::schema::types::ColumnPath;

use crate::schema::{ColumnSchema, ColumnType, TableSchema};
use crate::table::Table;

/// If more than 4096 numbers differ in a row group nearly all do, and a dictionary costs half of the time to write
/// and a tenth of the file.
pub(super) const REPEATED_FLOATS: usize = 32 << 10;

/// The crate's own 1024 tests whether a page is full (a million bytes) more often than needed.
const VALUES_AT_ONCE: usize = 16_384;

/// Snappy: every reader has it, and it is the faster of the two to write, which matters most for decoded logs.
pub(super) fn properties(table: &Table) -> WriterProperties {
    let properties = WriterProperties::builder()
        .set_created_by(concat!("posegrid version ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_compression(Compression::SNAPPY)
        .set_write_batch_size(VALUES_AT_ONCE)
        .set_key_value_metadata(Some(metadata(table)));
    table.schema.columns.iter().fold(properties, encoding).build()
}

fn encoding(properties: WriterPropertiesBuilder, column: &ColumnSchema) -> WriterPropertiesBuilder {
    let path = || ColumnPath::from(column.name.as_str());
    match column.kind {
        // Counts, places and stamps that rise from row to row: their differences take the least space, and a dictionary
        // would have no repeated entry.
        ColumnType::Int64 => properties
            .set_column_dictionary_enabled(path(), false)
            .set_column_encoding(path(), Encoding::DELTA_BINARY_PACKED),
        ColumnType::Float64 => {
            properties.set_column_dictionary_page_size_limit(path(), REPEATED_FLOATS)
        }
        // Minimum and maximum of an arm's joints describe none of them. Snappy saved a twentieth of recorded angles,
        // and took more time than all the other work.
        ColumnType::ListFloat64 => properties
            .set_column_compression(elements(column), Compression::UNCOMPRESSED)
            .set_column_dictionary_page_size_limit(elements(column), REPEATED_FLOATS)
            .set_column_statistics_enabled(elements(column), EnabledStatistics::None),
        _ => properties,
    }
}

fn elements(column: &ColumnSchema) -> ColumnPath {
    let parts = [column.name.as_str(), "list", "element"];
    ColumnPath::new(parts.map(str::to_owned).to_vec())
}

fn metadata(table: &Table) -> Vec<KeyValue> {
    let schema = table.schema;
    let entry = |name: &str, value: String| KeyValue::new(format!("posegrid.{name}"), value);
    let mut entries = vec![
        entry("table", schema.table.clone()),
        entry("schema_version", schema.version.to_string()),
        entry("units", by_column(schema, |column| column.unit.as_deref())),
        entry("frames", by_column(schema, |column| column.frame.as_deref())),
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
