//! Parquet files → tables.

use std::any::Any;
use std::collections::BTreeMap;
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, RecordBatch, new_null_array};
use arrow::compute::{CastOptions, cast_with_options, concat_batches};
use arrow::datatypes::DataType;
use parquet::arrow::arrow_reader::{ArrowReaderOptions, ParquetRecordBatchReaderBuilder};
use parquet::file::metadata::{ParquetMetaData, ParquetMetaDataReader};

use super::{FileError, Table, TableError, check};
use crate::io::schema::{ColumnSchema, Role, TableSchema};
use crate::manifest::RunKey;

/// The key-value metadata of a file.
type Entries = BTreeMap<String, String>;

/// Reads a Parquet file as `schema` says, and checks that it keeps that contract.
///
/// A published table has to say in its metadata which table and version it is. An accepted one may come from anywhere:
/// columns that may be null may be missing, others may be there, and narrower types are widened.
pub fn read(path: &Path, schema: &'static TableSchema) -> Result<Table, FileError> {
    let file = File::open(path).map_err(|source| FileError::Open {
        path: path.to_owned(),
        source,
    })?;
    read_open(file, path, schema)
}

/// The same of an open file, which is named `path` in errors.
pub fn read_open(
    file: File,
    path: &Path,
    schema: &'static TableSchema,
) -> Result<Table, FileError> {
    // The Parquet reader panics on some damaged pages. It owns nothing but the file, so nothing is left half done.
    let decoded = catch_unwind(AssertUnwindSafe(|| decode(path, file, schema)));
    let (entries, batch) = decoded.unwrap_or_else(|panic| {
        Err(FileError::Damaged {
            path: path.to_owned(),
            problem: panic_message(panic.as_ref()),
        })
    })?;
    let content = |source| FileError::Content {
        path: path.to_owned(),
        source,
    };
    let columns = columns(&batch, schema).map_err(content)?;
    check::table(schema, key(&entries), batch.num_rows(), columns, None).map_err(content)
}

/// The file's metadata entries and its rows, as the file has them.
fn decode(
    path: &Path,
    file: File,
    schema: &TableSchema,
) -> Result<(Entries, RecordBatch), FileError> {
    let parquet = |source| FileError::Parquet {
        path: path.to_owned(),
        source,
    };
    let values = |source| FileError::Values {
        path: path.to_owned(),
        source,
    };
    let options = ArrowReaderOptions::new().with_skip_arrow_metadata(true);
    let reader =
        ParquetRecordBatchReaderBuilder::try_new_with_options(file, options).map_err(parquet)?;
    let entries = entries(reader.metadata());
    if schema.role == Role::Published {
        check_version(path, schema, &entries)?;
    }
    let found = Arc::clone(reader.schema());
    let batches: Vec<_> = reader
        .build()
        .map_err(parquet)?
        .collect::<Result<_, _>>()
        .map_err(values)?;
    let batch = concat_batches(&found, &batches).map_err(values)?;
    Ok((entries, batch))
}

/// The table that a Parquet file says it holds; `None` where it is no table of posegrid.
pub fn name(path: &Path) -> Result<Option<String>, FileError> {
    let file = File::open(path).map_err(|source| FileError::Open {
        path: path.to_owned(),
        source,
    })?;
    let read = || {
        let mut metadata = ParquetMetaDataReader::new();
        metadata.try_parse(&file).and_then(|()| metadata.finish())
    };
    // As in `read`.
    let found = catch_unwind(AssertUnwindSafe(read)).map_err(|panic| FileError::Damaged {
        path: path.to_owned(),
        problem: panic_message(panic.as_ref()),
    })?;
    let metadata = found.map_err(|source| FileError::Parquet {
        path: path.to_owned(),
        source,
    })?;
    Ok(entries(&metadata).remove("posegrid.table"))
}

fn panic_message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("no message")
        .to_owned()
}

fn entries(metadata: &ParquetMetaData) -> Entries {
    let pairs = metadata
        .file_metadata()
        .key_value_metadata()
        .into_iter()
        .flatten();
    pairs
        .filter_map(|pair| Some((pair.key.clone(), pair.value.clone()?)))
        .collect()
}

fn key(entries: &Entries) -> Option<RunKey> {
    let part = |name: &str| entries.get(&format!("posegrid.{name}"));
    Some(RunKey::new(part("robot")?, part("session")?, part("run")?))
}

fn check_version(path: &Path, schema: &TableSchema, entries: &Entries) -> Result<(), FileError> {
    let table = entries.get("posegrid.table");
    if table != Some(&schema.table) {
        let no_table = || "no table of posegrid".to_owned();
        return Err(FileError::OtherTable {
            path: path.to_owned(),
            found: table.map_or_else(no_table, |name| format!("table {name:?}")),
            expected: schema.table.clone(),
        });
    }
    let version = entries
        .get("posegrid.schema_version")
        .map_or("none", String::as_str);
    if version != schema.version.to_string() {
        return Err(FileError::OtherVersion {
            path: path.to_owned(),
            table: schema.table.clone(),
            found: version.to_owned(),
            expected: schema.version,
        });
    }
    Ok(())
}

/// The columns of `schema` out of a file's, by name.
fn columns(batch: &RecordBatch, schema: &TableSchema) -> Result<Vec<Option<ArrayRef>>, TableError> {
    let accepted = schema.role == Role::Accepted;
    let fields = batch.schema();
    let extra = fields
        .fields()
        .iter()
        .find(|field| schema.column(field.name()).is_none());
    if let Some(field) = extra.filter(|_| !accepted) {
        return Err(TableError::UnknownColumn {
            table: schema.table.clone(),
            column: field.name().clone(),
        });
    }
    let find = |column: &ColumnSchema| match batch.column_by_name(&column.name) {
        Some(array) if accepted => Some(widened(array, &column.kind.arrow())),
        Some(array) => Some(Arc::clone(array)),
        None if accepted && column.nullable => {
            Some(new_null_array(&column.kind.arrow(), batch.num_rows()))
        }
        None => None,
    };
    Ok(schema.columns.iter().map(find).collect())
}

/// The array as `wanted` where that says the same; otherwise as it is, and the check that follows names its type.
fn widened(array: &ArrayRef, wanted: &DataType) -> ArrayRef {
    // Otherwise what does not fit would become null in silence.
    let strict = CastOptions {
        safe: false,
        ..CastOptions::default()
    };
    let as_wanted =
        widens(array.data_type(), wanted).then(|| cast_with_options(array, wanted, &strict));
    as_wanted
        .and_then(Result::ok)
        .unwrap_or_else(|| Arc::clone(array))
}

fn widens(found: &DataType, wanted: &DataType) -> bool {
    match (found, wanted) {
        (found, DataType::Float64) => found.is_integer() || found.is_floating(),
        (found, DataType::Int64) => found.is_integer(),
        (found, DataType::Utf8) => found.is_string(),
        (DataType::List(found) | DataType::LargeList(found), DataType::List(wanted)) => {
            widens(found.data_type(), wanted.data_type())
        }
        (found, wanted) => found == wanted,
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::FileExt as _;

    use super::*;
    use crate::io::schema;
    use crate::io::table::{Columns, write};

    fn curve(order: [f64; 3]) -> Table {
        Columns::new(schema::find("joint_errors").unwrap(), 3)
            .key(&RunKey::new("ur10", "grid", "00ff"))
            .same("joint", 1_u64)
            .same("joint_name", "shoulder_pan_joint")
            .column("angle_rad", order)
            .column("error_rad", order.map(|angle| angle / 1e3))
            .column("curve_rad", order.map(|angle| angle / 1e3))
            .same("sd_rad", 1e-5)
            .same("gear_lines_rad", 0.0)
            .same("measured", true)
            .finish()
            .unwrap()
    }

    fn saved(bytes: &[u8]) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        file
    }

    #[test]
    fn a_table_comes_back_and_the_order_given_leaves_no_trace_in_the_bytes() {
        let table = curve([-1.0, 0.0, 1.0]);
        let bytes = write(&table, Vec::new()).unwrap();
        assert_eq!(bytes, write(&curve([1.0, -1.0, 0.0]), Vec::new()).unwrap());
        let back = read(saved(&bytes).path(), table.schema()).unwrap();
        assert_eq!(back, table);
    }

    #[test]
    fn another_table_version_or_file_is_refused() {
        let bytes = write(&curve([-1.0, 0.0, 1.0]), Vec::new()).unwrap();
        let refusal =
            |bytes: &[u8], schema| read(saved(bytes).path(), schema).unwrap_err().to_string();
        let other = refusal(&bytes, schema::find("clocks").unwrap());
        assert!(
            other.contains("holds table \"joint_errors\", not table \"clocks\""),
            "{other}"
        );
        let mut next = curve([-1.0, 0.0, 1.0]).schema().clone();
        next.version = 2;
        let older = refusal(&bytes, Box::leak(Box::new(next)));
        assert!(
            older.contains("version 1 of table \"joint_errors\", this program reads version 2"),
            "{older}"
        );
        let schema = schema::find("joint_errors").unwrap();
        assert!(refusal(b"robot,session\n", schema).contains("as a Parquet file"));
        assert!(refusal(b"", schema).contains("as a Parquet file"));
        let missing = read(Path::new("/nowhere/x.parquet"), schema)
            .unwrap_err()
            .to_string();
        assert!(
            missing.starts_with("cannot open /nowhere/x.parquet"),
            "{missing}"
        );
    }

    #[test]
    fn a_damaged_byte_anywhere_never_panics() {
        let table = curve([-1.0, 0.0, 1.0]);
        let schema = table.schema();
        let bytes = write(&table, Vec::new()).unwrap();
        let file = saved(&bytes);
        let writable = File::options().write(true).open(file.path()).unwrap();
        let mut refused = 0;
        for (place, &byte) in bytes.iter().enumerate() {
            for damage in [0x80, 0x01, 0xff] {
                writable
                    .write_all_at(&[byte ^ damage], place as u64)
                    .unwrap();
                let outcome = catch_unwind(|| read(file.path(), schema).is_err());
                refused += usize::from(outcome.unwrap_or_else(|_| panic!("panic at byte {place}")));
            }
            writable.write_all_at(&[byte], place as u64).unwrap();
        }
        // Parquet files carry no checksum: a changed value passes, which is what the digests in `runs` are for.
        assert!(
            refused > bytes.len(),
            "only {refused} of {} damages were refused",
            3 * bytes.len()
        );
        assert_eq!(
            read(file.path(), schema).unwrap(),
            table,
            "undone, the file is whole again"
        );
    }
}
