//! Parquet files → tables. [`read`] refuses a published table whose content differs from its digest ([`Seal`]),
//! [`open`] returns it with the result.

use std::any::Any;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;

use arrow_array::cast::AsArray as _;
use arrow_array::types::TimestampMicrosecondType;
use arrow_array::{ArrayRef, RecordBatch, new_null_array};
use arrow_schema::{ArrowError, DataType, TimeUnit};
use parquet::arrow::arrow_reader::{ArrowReaderOptions, ParquetRecordBatchReaderBuilder};
use parquet::errors::ParquetError;
use parquet::file::metadata::{ParquetMetaData, ParquetMetaDataReader};

use super::error::{plain, plain_values};
use super::values::widened;
use super::{FileError, FileErrorKind, Table, TableError, check, digest};
use crate::input::{self, Bound};
use crate::manifest::RunKey;
use crate::schema::{ColumnSchema, Role, TableSchema, UTC};
use crate::stated;

type Result<T, E = FileError> = std::result::Result<T, E>;

struct Entries(Vec<(String, String)>);

impl Entries {
    /// The value of a key; of several the last.
    fn get(&self, key: &str) -> Option<&String> {
        let own = self.0.iter().rev().find(|(own, _)| own == key);
        own.map(|(_, value)| value)
    }
}

/// The digest that the file carries; absent where an older version wrote it, or another program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Seal {
    Holds,
    Broken { stated: String, found: String },
    Absent,
}

#[derive(Debug, Clone)]
pub struct Opened {
    pub table: Table,
    pub seal: Seal,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Head {
    /// Name of the table in it; `None` where it is no table of posegrid.
    pub table: Option<String>,
    /// Robot, session and run; `None` where it does not state them.
    pub key: Option<RunKey>,
    /// The program that wrote it; `None` where it does not state it.
    pub created_by: Option<String>,
    pub columns: Vec<String>,
}

/// Reads a Parquet file as a table of `schema`, and checks that it keeps that contract.
///
/// A published table has to state its table and version in its metadata. An accepted one may come from any program:
/// columns that may be null may be missing, other columns may be present, and narrower types are widened.
///
/// ```
/// # use posegrid_base::manifest::RunKey;
/// # use posegrid_files::{schema, table::{self, Columns}};
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("curve.parquet");
/// # let curve = Columns::new(schema::find("joint_errors")?, 1)
/// #     .key(&RunKey::new("ur10", "2020-11-09", "00ff"))
/// #     .same("joint", 1_u64).same("joint_name", "shoulder_pan_joint").same("joint_unit", "rad").same("angle_rad", 0.5)
/// #     .same("error_rad", -1.2e-4).same("curve_rad", -1.2e-4).same("sd_rad", 2.0e-5)
/// #     .same("gear_lines_rad", 0.0).same("measured", true).finish()?;
/// # table::write(&curve, std::fs::File::create(&path)?)?;
/// let table = table::read(&path, schema::find("joint_errors")?)?;
/// assert_eq!(table.text("joint_name").value(0), "shoulder_pan_joint");
/// assert_eq!(table.f64("error_rad").value(0), -1.2e-4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read(path: &Path, schema: &'static TableSchema) -> Result<Table> {
    read_within(path, schema, Bound::TABLE)
}

/// Reads a Parquet file whose size, and that of its values in memory, has another bound.
pub fn read_within(path: &Path, schema: &'static TableSchema, bound: Bound) -> Result<Table> {
    let file = open_file(path, bound)?;
    open_within(file, path, schema, bound.of_values())?.believed(path)
}

fn open_file(path: &Path, bound: Bound) -> Result<File> {
    input::open(path, bound).map_err(|source| FileErrorKind::Open(source).at(path))
}

/// Reads a table from an open file of any size, which errors call `path`.
pub fn read_open(file: File, path: &Path, schema: &'static TableSchema) -> Result<Table> {
    open(file, path, schema)?.believed(path)
}

impl Opened {
    /// The table; an error where it is not the one that was written.
    pub fn believed(self, path: &Path) -> Result<Table> {
        match self.seal {
            Seal::Holds | Seal::Absent => Ok(self.table),
            Seal::Broken { stated, found } => {
                Err(FileErrorKind::Altered { found, stated }.at(path))
            }
        }
    }
}

/// Reads an open file of any size, which errors call `path`, and states whether its content is the one that was
/// written.
pub fn open(file: File, path: &Path, schema: &'static TableSchema) -> Result<Opened> {
    let unbounded = Bound { bytes: u64::MAX, ..Bound::TABLE };
    open_within(file, path, schema, unbounded)
}

/// Reads an open file whose values take no more memory than `values` allows.
pub fn open_within(
    file: File,
    path: &Path,
    schema: &'static TableSchema,
    values: Bound,
) -> Result<Opened> {
    // The Parquet reader panics on some damaged pages. It owns only the file, so no other state is left inconsistent.
    let decoded = catch_unwind(AssertUnwindSafe(|| decode(path, file, schema, values)));
    let (entries, batch) = decoded.unwrap_or_else(|panic| {
        Err(FileErrorKind::Damaged(panic_message(panic.as_ref())).at(path))
    })?;
    let content = |source| FileErrorKind::Content(source).at(path);
    let version = version(&entries).unwrap_or(schema.version);
    let columns = columns(&batch, schema, version).map_err(content)?;
    let (table, _) =
        check::table(schema, key(&entries), batch.num_rows(), columns, None).map_err(content)?;
    let table = Table { version, ..table };
    let is_sealed = schema.role == Role::Published;
    let seal = if is_sealed { seal(&table, &entries) } else { Seal::Absent };
    Ok(Opened { table, seal })
}

fn seal(table: &Table, entries: &Entries) -> Seal {
    let Some(stated) = entries.get(digest::ENTRY) else { return Seal::Absent };
    let found = digest::of_file(table, &entries.0);
    if found == *stated { Seal::Holds } else { Seal::Broken { stated: stated.clone(), found } }
}

/// The file's metadata entries and its rows, unchanged.
fn decode(
    path: &Path,
    file: File,
    schema: &TableSchema,
    bound: Bound,
) -> Result<(Entries, RecordBatch)> {
    check_form(&file).map_err(|kind| kind.at(path))?;
    let parquet = |source: ParquetError| FileErrorKind::Damaged(plain(&source)).at(path);
    let values = |source: ArrowError| FileErrorKind::Damaged(plain_values(&source)).at(path);
    let (limit, advice) = (bound.bytes, bound.advice);
    let too_large = || FileErrorKind::TooLarge { limit, advice }.at(path);
    if limit < u64::MAX {
        let again = file.try_clone().map_err(|source| FileErrorKind::Open(source).at(path))?;
        if stated::decoded_bytes(&file, again, limit).map_err(parquet)? > limit {
            return Err(too_large());
        }
    }
    let options = ArrowReaderOptions::new().with_skip_arrow_metadata(true);
    let reader =
        ParquetRecordBatchReaderBuilder::try_new_with_options(file, options).map_err(parquet)?;
    let entries = entries(reader.metadata());
    if schema.role == Role::Published {
        check_version(path, schema, &entries)?;
    }
    let found = Arc::clone(reader.schema());
    let rows = reader.build().map_err(parquet)?;
    let batch = stated::batch_within(&found, rows, limit).map_err(values)?;
    Ok((entries, batch.ok_or_else(too_large)?))
}

pub fn head(path: &Path) -> Result<Head> {
    let file = open_file(path, Bound::TABLE)?;
    head_of(&file, path)
}

/// The statements about itself of an open file, which errors call `path`.
pub fn head_of(file: &File, path: &Path) -> Result<Head> {
    check_form(file).map_err(|kind| kind.at(path))?;
    let read = || {
        let mut metadata = ParquetMetaDataReader::new();
        metadata.try_parse(file).and_then(|()| metadata.finish())
    };
    // The reader may panic, as in `open`.
    let found = catch_unwind(AssertUnwindSafe(read))
        .map_err(|panic| FileErrorKind::Damaged(panic_message(panic.as_ref())).at(path))?;
    let metadata = found.map_err(|source| FileErrorKind::Damaged(plain(&source)).at(path))?;
    let entries = entries(&metadata);
    let columns = metadata.file_metadata().schema().get_fields();
    Ok(Head {
        columns: columns.iter().map(|own| own.name().to_owned()).collect(),
        table: entries.get("posegrid.table").cloned(),
        key: key(&entries),
        created_by: metadata.file_metadata().created_by().map(str::to_owned),
    })
}

const MAGIC: &[u8] = b"PAR1";

fn check_form(file: &File) -> Result<(), FileErrorKind> {
    let (start, end) = ends(file).map_err(FileErrorKind::Open)?;
    if !start.starts_with(MAGIC) {
        return Err(FileErrorKind::NoParquet(looks_like(&start)));
    }
    if end != MAGIC || start.len() < 3 * MAGIC.len() {
        return Err(FileErrorKind::CutOff);
    }
    stated::check_levels(file).map_err(|source| FileErrorKind::Damaged(plain(&source)))
}

/// The first bytes of a file, some hundred where it has them, and its last four.
fn ends(mut file: &File) -> io::Result<(Vec<u8>, Vec<u8>)> {
    let (mut start, mut end) = (Vec::new(), Vec::new());
    file.seek(SeekFrom::Start(0))?;
    file.take(512).read_to_end(&mut start)?;
    let length = file.metadata()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(MAGIC.len() as u64)))?;
    file.take(MAGIC.len() as u64).read_to_end(&mut end)?;
    Ok((start, end))
}

fn looks_like(start: &[u8]) -> &'static str {
    // A letter may be cut off at the end.
    let is_utf8 =
        |bytes: &[u8]| str::from_utf8(bytes).map_or_else(|e| e.error_len().is_none(), |_| true);
    let is_text = |bytes: &[u8]| !bytes.contains(&0) && is_utf8(bytes);
    match start {
        [] => "empty",
        [0x89, b'M', b'C', b'A', b'P', ..] => "a log (MCAP)",
        text if text.starts_with(input::POINTER) => "a pointer of Git LFS (`git lfs pull`)",
        [b'P', b'K', 3, 4, ..] => "an archive or a spreadsheet (ZIP)",
        text if is_text(text) => "a text, such as CSV or JSON",
        _ => "something else",
    }
}

pub(crate) fn panic_message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message").to_owned()
}

fn entries(metadata: &ParquetMetaData) -> Entries {
    let pairs = metadata.file_metadata().key_value_metadata().into_iter().flatten();
    Entries(pairs.filter_map(|pair| Some((pair.key.clone(), pair.value.clone()?))).collect())
}

fn key(entries: &Entries) -> Option<RunKey> {
    let part = |name: &str| entries.get(&format!("posegrid.{name}"));
    Some(RunKey::new(part("robot")?, part("session")?, part("run")?))
}

fn version(entries: &Entries) -> Option<u32> {
    entries.get("posegrid.schema_version")?.parse().ok()
}

/// What a file holds, by the name of its table; `None` where it is none of posegrid.
pub fn in_words(table: Option<&str>) -> String {
    table.map_or_else(|| "no table of posegrid".to_owned(), |name| format!("table {name:?}"))
}

fn check_version(path: &Path, schema: &TableSchema, entries: &Entries) -> Result<()> {
    let table = entries.get("posegrid.table");
    if table != Some(&schema.table) {
        let (found, expected) = (in_words(table.map(String::as_str)), schema.table.clone());
        return Err(FileErrorKind::OtherTable { found, expected }.at(path));
    }
    if !version(entries).is_some_and(|version| schema.reads(version)) {
        let found = entries.get("posegrid.schema_version");
        let other = FileErrorKind::OtherVersion {
            table: schema.table.clone(),
            found: found.map_or("none", String::as_str).to_owned(),
            expected: schema.version,
        };
        return Err(other.at(path));
    }
    Ok(())
}

/// Whether a file of `version` may have the column.
fn is_known(name: &str, schema: &TableSchema, version: u32) -> bool {
    let is_removed = version < schema.version && schema.removed.iter().any(|own| own == name);
    is_removed || schema.column(name).is_some_and(|(_, column)| column.is_in(version))
}

/// The columns of `schema` from a file's, by name; those added after its `version` are null, those removed since are
/// passed over.
fn columns(
    batch: &RecordBatch,
    schema: &TableSchema,
    version: u32,
) -> Result<Vec<Option<ArrayRef>>, TableError> {
    let accepted = schema.role == Role::Accepted;
    let fields = batch.schema();
    names_are_clear(fields.fields().iter().map(|field| field.name().as_str()), schema)?;
    let extra = fields.fields().iter().find(|field| !is_known(field.name(), schema, version));
    if let Some(field) = extra.filter(|_| !accepted) {
        return Err(TableError::unknown_column(schema, field.name()));
    }
    let nothing = |column: &ColumnSchema| new_null_array(&column.kind.arrow(), batch.num_rows());
    let find = |column: &ColumnSchema| match batch.column_by_name(&column.name) {
        Some(array) if accepted => Some(widened(array, &column.kind.arrow())),
        Some(array) => Some(in_utc(array)),
        None if column.nullable && (accepted || !column.is_in(version)) => Some(nothing(column)),
        None => None,
    };
    Ok(schema.columns.iter().map(find).collect())
}

/// Checks that no name of a column is given twice, and none is one of the schema's in another case.
fn names_are_clear<'n>(
    names: impl Iterator<Item = &'n str>,
    schema: &TableSchema,
) -> Result<(), TableError> {
    let mut seen: BTreeMap<String, &str> = BTreeMap::new();
    for name in names {
        let folded = name.trim().to_lowercase();
        let alike = |other: &str| {
            let problem =
                "the names differ at most in upper and lower case; which is meant is not clear";
            TableError::at(schema, format_args!(": columns {name:?} and {other:?}"), problem)
        };
        if folded != name && schema.column(&folded).is_some() {
            return Err(alike(&folded));
        }
        if let Some(other) = seen.insert(folded, name) {
            return Err(alike(other));
        }
    }
    Ok(())
}

/// Moments with UTC in their type: earlier versions wrote theirs without a time zone.
fn in_utc(array: &ArrayRef) -> ArrayRef {
    match array.data_type() {
        DataType::Timestamp(TimeUnit::Microsecond, None) => {
            let moments = array.as_primitive::<TimestampMicrosecondType>();
            Arc::new(moments.clone().with_timezone(UTC))
        }
        _ => Arc::clone(array),
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::FileExt as _;

    use super::*;
    use crate::schema;
    use crate::table::{Columns, write};

    fn curve(order: [f64; 3]) -> Table {
        Columns::new(schema::find("joint_errors").unwrap(), 3)
            .key(&RunKey::new("ur10", "grid", "00ff"))
            .same("joint", 1_u64)
            .same("joint_name", "shoulder_pan_joint")
            .same("joint_unit", "rad")
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
        assert!(other.contains("holds table \"joint_errors\", not table \"clocks\""), "{other}");
        let mut next = curve([-1.0, 0.0, 1.0]).schema().clone();
        next.version = 3;
        next.reads_from = None;
        let older = refusal(&bytes, Box::leak(Box::new(next)));
        assert!(
            older.contains("version 2 of table \"joint_errors\", this program reads version 3"),
            "{older}"
        );
        let schema = schema::find("joint_errors").unwrap();
        for (bytes, looks) in [
            (&b"robot,session\n"[..], "it is a text, such as CSV or JSON"),
            (b"", "it is empty"),
            (b"PK\x03\x04 and more", "it is an archive or a spreadsheet"),
            (b"\x89MCAP0\r\n", "it is a log (MCAP)"),
            (b"\xff\xfe\x00\x01", "it is something else"),
            (b"PAR1", "its end is missing"),
            (
                &bytes[..bytes.len() / 2],
                "its end is missing, as after a copy that was interrupted; get it anew",
            ),
        ] {
            let told = refusal(bytes, schema);
            assert!(told.contains("as a Parquet file") && told.contains(looks), "{told}");
        }
        let mut footer = bytes.clone();
        let length = footer.len();
        footer[length - 8..length - 4].copy_from_slice(&u32::MAX.to_le_bytes());
        let told = refusal(&footer, schema);
        assert!(told.contains("it is damaged: ") && told.contains("get it anew"), "{told}");
        assert!(!told.contains("Parquet error"), "{told}");
        let missing = read(Path::new("/nowhere/x.parquet"), schema).unwrap_err().to_string();
        assert!(missing.starts_with("cannot open /nowhere/x.parquet"), "{missing}");
    }

    #[test]
    fn a_table_says_whether_it_is_as_it_was_written() {
        let table = curve([-1.0, 0.0, 1.0]);
        let opened = |bytes: &[u8]| {
            let file = saved(bytes);
            open(file.reopen().unwrap(), file.path(), table.schema()).unwrap()
        };
        let bytes = write(&table, Vec::new()).unwrap();
        assert_eq!(opened(&bytes).seal, Seal::Holds);
        // A letter of the digest itself.
        let key =
            bytes.windows(digest::ENTRY.len()).position(|own| own == digest::ENTRY.as_bytes());
        let letter = key.unwrap() + digest::ENTRY.len() + 20;
        let mut other = bytes.clone();
        other[letter] ^= 1;
        let found = opened(&other);
        assert!(matches!(found.seal, Seal::Broken { .. }), "{:?}", found.seal);
        let error = read(saved(&other).path(), table.schema()).unwrap_err().to_string();
        assert!(error.contains("is not as it was written: its content has the digest"), "{error}");
        // As a version without digests wrote it: the entry is renamed.
        let mut none = bytes.clone();
        none[key.unwrap()] ^= 1;
        assert_eq!(opened(&none).seal, Seal::Absent);
        assert_eq!(read(saved(&none).path(), table.schema()).unwrap(), table);
    }

    #[test]
    fn a_damaged_byte_anywhere_is_refused_or_changes_nothing() {
        let table = curve([-1.0, 0.0, 1.0]);
        let schema = table.schema();
        let bytes = write(&table, Vec::new()).unwrap();
        let file = saved(&bytes);
        let writable = File::options().write(true).open(file.path()).unwrap();
        let mut refused = 0;
        for (place, &byte) in bytes.iter().enumerate() {
            for damage in [0x80, 0x01, 0xff] {
                writable.write_all_at(&[byte ^ damage], place as u64).unwrap();
                let outcome = catch_unwind(|| read(file.path(), schema));
                let outcome = outcome.unwrap_or_else(|_| panic!("panic at byte {place}"));
                // Statistics, sizes and names that this reader does not use may change; no value may.
                assert!(
                    outcome.as_ref().is_err() || outcome.as_ref().is_ok_and(|read| *read == table),
                    "byte {place}"
                );
                refused += usize::from(outcome.is_err());
            }
            writable.write_all_at(&[byte], place as u64).unwrap();
        }
        assert!(
            refused > bytes.len(),
            "only {refused} of {} damages were refused",
            3 * bytes.len()
        );
        assert_eq!(read(file.path(), schema).unwrap(), table, "undone, the file is whole again");
    }
}
