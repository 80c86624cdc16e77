//! Tables that were changed, with as many of their digests changed along as whoever did it thought of.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{ArrayRef, AsArray, ListBuilder, RecordBatch, StringArray, StringBuilder};
use arrow::datatypes::{Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use posegrid::files::schema;
use posegrid::files::table::{self, Opened, Seal};
use posegrid::io::tables::runs::row_digest;
use posegrid::manifest::digest;

use super::cell::Cell;

/// The entry of a file's metadata that has the digest of its content.
const DIGEST: &str = "posegrid.content_digest";

/// A Parquet file that is written anew by another writer.
pub struct Anew {
    path: PathBuf,
    entries: Vec<KeyValue>,
    created_by: Option<String>,
    batch: RecordBatch,
}

impl Anew {
    /// The file as it is.
    pub fn of(path: &Path) -> Self {
        let reader = ParquetRecordBatchReaderBuilder::try_new(File::open(path).expect("there"));
        let reader = reader.expect("a Parquet file");
        let file = reader.metadata().file_metadata();
        let (entries, created_by) = (file.key_value_metadata(), file.created_by());
        let (entries, created_by) = (entries.cloned(), created_by.map(str::to_owned));
        let schema = Arc::clone(reader.schema());
        let batches: Vec<RecordBatch> =
            reader.build().expect("readable").map(|batch| batch.expect("readable")).collect();
        let mut entries = entries.unwrap_or_default();
        // The writer adds its own.
        entries.retain(|entry| entry.key != "ARROW:schema");
        Self {
            path: path.to_owned(),
            entries,
            created_by,
            batch: arrow::compute::concat_batches(&schema, &batches).expect("one schema"),
        }
    }

    /// With this entry in its metadata.
    pub fn entry(mut self, key: &str, value: &str) -> Self {
        self.entries.retain(|entry| entry.key != key);
        let entry = KeyValue::new(key.to_owned(), value.to_owned());
        self.entries.push(entry);
        self
    }

    /// Without this entry in its metadata.
    pub fn without_entry(mut self, key: &str) -> Self {
        self.entries.retain(|entry| entry.key != key);
        self
    }

    /// Without these columns.
    pub fn without(mut self, columns: &[&str]) -> Self {
        let schema = self.batch.schema();
        let kept = |place: &usize| !columns.contains(&schema.field(*place).name().as_str());
        let kept: Vec<usize> = (0..schema.fields().len()).filter(kept).collect();
        self.batch = self.batch.project(&kept).expect("its columns");
        self
    }

    /// As if this program had written it.
    pub fn created_by(mut self, program: &str) -> Self {
        self.created_by = Some(program.to_owned());
        self
    }

    /// Writes it with some columns changed.
    pub fn write(self, change: impl Fn(&str, &ArrayRef) -> Option<ArrayRef>) {
        let properties = WriterProperties::builder().set_key_value_metadata(Some(self.entries));
        let properties = match self.created_by {
            Some(program) => properties.set_created_by(program),
            None => properties,
        };
        let schema = self.batch.schema();
        let fields = schema.fields().iter().zip(self.batch.columns());
        let columns = fields
            .map(|(field, array)| change(field.name(), array).unwrap_or_else(|| Arc::clone(array)))
            .collect();
        let plain = Arc::new(Schema::new(schema.fields().clone()));
        let batch = RecordBatch::try_new(Arc::clone(&plain), columns).expect("same types");
        let file = File::create(&self.path).expect("writable");
        let writer = ArrowWriter::try_new(file, plain, Some(properties.build()));
        let mut writer = writer.expect("a schema");
        writer.write(&batch).expect("written");
        writer.close().expect("written");
    }
}

/// Changes columns of a Parquet file and writes it anew with the same metadata.
pub fn rewrite(path: &Path, change: impl Fn(&str, &ArrayRef) -> Option<ArrayRef>) {
    Anew::of(path).write(change);
}

fn opened(path: &Path, name: &str) -> Opened {
    let schema = schema::find(name).expect("a table");
    table::open(File::open(path).expect("there"), path, schema).expect("a table")
}

/// Gives a changed table the digest of what it holds now.
pub fn seal(path: &Path, name: &str) {
    if let Seal::Broken { found, .. } = opened(path, name).seal {
        Anew::of(path).entry(DIGEST, &found).write(|_, _| None);
    }
    assert_ne!(opened(path, name).seal, Seal::Absent);
}

/// Gives a changed row of `runs` the digests of what it says now; one of this version as this version writes it.
pub fn seal_row(path: &Path) {
    let digest = row_digest(&opened(path, "runs").table);
    rewrite(path, |column, _| (column == "row_digest").then(|| same_text(&digest, 1)));
    seal(path, "runs");
    let row = opened(path, "runs").table;
    if row.text("version").value(0) == posegrid::manifest::VERSION {
        fs::write(path, table::write(&row, Vec::new()).expect("in memory")).expect("writable");
    }
}

/// A file as a version wrote it that gave tables no digest of their content.
pub fn unsealed(path: &Path) {
    Anew::of(path).without_entry(DIGEST).write(|_, _| None);
}

/// A row of `runs` as the first version of that table had it.
pub fn of_first_version(path: &Path) {
    Anew::of(path)
        .without(&[
            "row_digest",
            "replaced_row_digest",
            "verdict_of",
            "statement",
            "warnings",
            "bound_mm",
            "held_out",
            "visits",
            "stations_covered_share",
            "session_started",
            "made_of",
            "estimate",
            "grids",
            "first_session_started",
            "mean_before_mm",
            "mean_after_mm",
            "means_of",
            "means_by_poses_mm",
        ])
        .without_entry(DIGEST)
        .entry("posegrid.schema_version", "1")
        .write(|_, _| None);
}

/// Puts the digest of a changed table's file into the session's row of `runs`, and changes that row's digests with it.
pub fn claim_digest(cell: &Cell, table: &str, session: &str, before: &str) {
    let after = digest_of(&cell.table_file(table, session));
    let row = cell.table_file("runs", session);
    rewrite(&row, |column, array| {
        let changed = |text: &str| if text == before { &*after } else { text }.to_owned();
        (column == "table_digests").then(|| texts(array, changed))
    });
    seal_row(&row);
}

/// BLAKE3 of a file.
pub fn digest_of(path: &Path) -> String {
    digest(File::open(path).expect("there")).expect("readable").0
}

/// A column of one list of texts, each changed.
pub fn texts(array: &ArrayRef, change: impl Fn(&str) -> String) -> ArrayRef {
    let field = Field::new("element", arrow::datatypes::DataType::Utf8, false);
    let mut list = ListBuilder::new(StringBuilder::new()).with_field(field);
    let texts = array.as_list::<i32>().value(0);
    for text in texts.as_string::<i32>().iter().flatten() {
        list.values().append_value(change(text));
    }
    list.append(true);
    Arc::new(list.finish())
}

/// A column with the same text in each row.
pub fn same_text(text: &str, rows: usize) -> ArrayRef {
    Arc::new(StringArray::from(vec![text; rows]))
}
