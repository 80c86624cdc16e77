//! Past runs recomputed: what is the same, and what is told when a file, an input, a setting or a value is not.

use std::fs::{self, File};
use std::path::Path;
use std::sync::Arc;

use arrow::array::{
    ArrayRef, AsArray, Float64Array, ListBuilder, RecordBatch, StringArray, StringBuilder,
};
use arrow::datatypes::{Field, Float64Type};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::file::properties::WriterProperties;
use posegrid::manifest::digest;

use super::cell::{Cell, Ended, ended, posegrid, undisturbed};

/// A cell with the sessions, and the lake, of the undisturbed one.
fn copied() -> Cell {
    let cell = Cell::new().with_quickstart("mon").with_quickstart("tue");
    for (name, bytes) in undisturbed().lake() {
        let path = cell.path("lake").join(name);
        fs::create_dir_all(path.parent().expect("in a lake")).expect("writable");
        fs::write(path, bytes).expect("writable");
    }
    cell
}

/// `posegrid verify` of the cell's lake by its pipeline file; temporary folders stand, and have to go, in the cell.
fn verify(cell: &Cell, arguments: &[&str]) -> Ended {
    let temporary = cell.path("temporary");
    fs::create_dir_all(&temporary).expect("writable");
    let before = cell.lake();
    let ended = ended(
        posegrid()
            .env("TMPDIR", &temporary)
            .arg("verify")
            .arg(cell.path("lake"))
            .arg("--pipeline")
            .arg(cell.pipeline())
            .args(arguments),
    );
    assert!(cell.lake() == before, "the lake is only read");
    let left = fs::read_dir(&temporary).expect("there").count();
    assert_eq!(left, 0, "temporary folders are removed");
    ended
}

/// Changes columns of a Parquet file and writes it anew with the same metadata.
fn rewrite(path: &Path, change: impl Fn(&str, &ArrayRef) -> Option<ArrayRef>) {
    let reader = ParquetRecordBatchReaderBuilder::try_new(File::open(path).expect("there"));
    let reader = reader.expect("a Parquet file");
    let metadata = reader.metadata().file_metadata().key_value_metadata();
    let properties = WriterProperties::builder()
        .set_key_value_metadata(metadata.cloned())
        .build();
    let batches: Vec<RecordBatch> = reader
        .build()
        .expect("readable")
        .map(|batch| batch.expect("readable"))
        .collect();
    let schema = batches[0].schema();
    let file = File::create(path).expect("writable");
    let mut writer = ArrowWriter::try_new(file, Arc::clone(&schema), Some(properties)).expect("ok");
    for batch in &batches {
        let fields = schema.fields().iter().zip(batch.columns());
        let columns = fields
            .map(|(field, array)| change(field.name(), array).unwrap_or_else(|| Arc::clone(array)))
            .collect();
        let batch = RecordBatch::try_new(Arc::clone(&schema), columns).expect("same types");
        writer.write(&batch).expect("written");
    }
    writer.close().expect("written");
}

/// Puts the digest of a changed table's file into the session's row of `runs`.
fn claim_digest(cell: &Cell, table: &str, session: &str, before: &str) {
    let (after, _) = digest(File::open(cell.table_file(table, session)).expect("there")).unwrap();
    rewrite(&cell.table_file("runs", session), |column, array| {
        (column == "table_digests").then(|| -> ArrayRef {
            let field = Field::new("element", arrow::datatypes::DataType::Utf8, false);
            let mut list = ListBuilder::new(StringBuilder::new()).with_field(field);
            let texts = array.as_list::<i32>().value(0);
            for text in texts.as_string::<i32>().iter().flatten() {
                let text = if text == before { &after } else { text };
                list.values().append_value(text);
            }
            list.append(true);
            Arc::new(list.finish())
        })
    });
}

fn digest_of(path: &Path) -> String {
    digest(File::open(path).expect("there"))
        .expect("readable")
        .0
}

#[test]
fn the_same_work_is_the_same_byte_for_byte() {
    let ended = verify(undisturbed(), &[]);
    ended.expect(
        0,
        &[
            "kr210-demo/mon run ",
            ": the same\n",
            // Eleven tables and the page; the row of runs is compared by value.
            "12 files computed again, byte for byte the same",
            "2 runs: 2 the same",
        ],
    );
    // A sample is drawn, and what is not drawn is told.
    let sample = verify(undisturbed(), &["--sample", "1", "--seed", "3"]);
    sample.expect(0, &["1 runs: 1 the same; 1 not drawn"]);
}

#[test]
fn a_flipped_byte_of_a_published_table_is_told_by_table_with_both_digests() {
    let cell = copied();
    let path = cell.table_file("residuals", "mon");
    let sound = digest_of(&path);
    let mut bytes = fs::read(&path).expect("there");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&path, bytes).expect("writable");
    let altered = digest_of(&path);
    let ended = verify(&cell, &["mon"]);
    let told = format!(
        "output residuals/mon: digest {altered}, the row says {sound}; computed again it is as the row says"
    );
    ended.expect(3, &["outputs altered", &told, "11 files computed again"]);
}

#[test]
fn a_table_that_is_gone_is_told() {
    let cell = copied();
    fs::remove_file(cell.table_file("compensation", "mon")).expect("there");
    let ended = verify(&cell, &[]);
    ended.expect(
        3,
        &[
            "output compensation/mon: ",
            "No such file",
            "2 runs: 1 outputs altered, 1 the same",
        ],
    );
}

#[test]
fn a_changed_input_is_told_by_name_and_a_missing_one_too() {
    let cell = copied();
    let sound = digest_of(&cell.session("mon").join("tracker.mcap"));
    let cell = cell.with_log("mon", "tracker.mcap", |mut bytes| {
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        bytes
    });
    let altered = digest_of(&cell.session("mon").join("tracker.mcap"));
    let ended = verify(&cell, &["mon"]);
    let inputs = ended.results.matches("\n  input ").count();
    assert_eq!(inputs, 1, "no other input: {}", ended.results);
    ended.expect(
        3,
        &["inputs altered", "input mon/tracker: ", &sound, &altered],
    );
    fs::remove_file(cell.session("mon").join("tracker.mcap")).expect("there");
    let ended = verify(&cell, &["mon"]);
    ended.expect(
        1,
        &[
            "not recomputed, inputs missing",
            "it has no tracker.mcap",
            &sound,
        ],
    );
}

#[test]
fn a_changed_setting_is_told_by_key_with_both_values() {
    let cell = copied().with("mm = 0.5", "mm = 0.4");
    let ended = verify(&cell, &["mon"]);
    ended.expect(
        3,
        &[
            "settings differ",
            "setting tolerance.mm: 0.4, the row says 0.5",
        ],
    );
    let settings = ended.results.matches("\n  setting ").count();
    assert_eq!(settings, 1, "no other setting: {}", ended.results);
}

#[test]
fn a_changed_value_is_told_by_column_even_when_its_digest_was_changed_with_it() {
    let cell = copied();
    let path = cell.table_file("parameters", "mon");
    let before = digest_of(&path);
    let offset = cell.table("parameters", "mon").f64("offset").value(4);
    // A thousandth more in one row.
    rewrite(&path, |column, array| {
        (column == "offset").then(|| -> ArrayRef {
            let numbers = array.as_primitive::<Float64Type>().iter().enumerate();
            let more = |row| if row == 4 { 1.001 } else { 1.0 };
            let changed = numbers.map(|(row, x)| x.map(|x| x * more(row)));
            Arc::new(changed.collect::<Float64Array>())
        })
    });
    claim_digest(&cell, "parameters", "mon", &before);
    let ended = verify(&cell, &["mon"]);
    // 0.001 of the larger number, which is the published one: 0.001 / 1.001.
    let published = offset * 1.001;
    ended.expect(
        3,
        &[
            ": differs\n",
            "parameters/mon: column offset: 1 of ",
            &format!("by at most {:.3e}", (published - offset).abs()),
            "(relative 9.990e-4",
            &format!("{published} published, {offset} computed"),
        ],
    );
    let columns = ended.results.matches(": column ").count();
    assert_eq!(columns, 1, "no other column: {}", ended.results);
}

#[test]
fn a_file_written_anew_with_the_same_values_is_told_as_such() {
    let cell = copied();
    let path = cell.table_file("parameters", "mon");
    let before = digest_of(&path);
    rewrite(&path, |_, _| None);
    assert_ne!(digest_of(&path), before, "another writer, other bytes");
    claim_digest(&cell, "parameters", "mon", &before);
    let ended = verify(&cell, &["mon"]);
    ended.expect(
        0,
        &[
            ": the same values in other bytes, largest relative difference 0.0e0",
            "parameters/mon: the same values in other bytes",
            "11 files computed again, byte for byte the same",
        ],
    );
}

#[test]
fn a_row_that_says_something_else_than_was_computed_is_told() {
    let cell = copied();
    let text = |to: &'static str| -> ArrayRef { Arc::new(StringArray::from(vec![to])) };
    rewrite(&cell.table_file("runs", "mon"), |column, _| {
        (column == "verdict").then(|| text("not_met"))
    });
    rewrite(&cell.table_file("runs", "tue"), |column, _| {
        (column == "settings").then(|| text("{}"))
    });
    let ended = verify(&cell, &[]);
    ended.expect(
        3,
        &[
            "runs/mon: column verdict: 1 of 1 cells differ, first \"not_met\" published, \"met\" computed",
            "from its inputs, settings and version follows",
            "its settings have the digest",
            "2 runs: 1 differs, 1 row of runs altered",
        ],
    );
}

#[test]
fn what_cannot_be_verified_is_told() {
    let cell = copied();
    verify(&cell, &["wed"]).expect(2, &["\"wed\" is neither a run nor a session", "mon, tue"]);
    let lake = cell.path("lake");
    let by = |pipeline: &Path, arguments: &[&str]| {
        let mut command = posegrid();
        command
            .arg("verify")
            .arg(&lake)
            .arg("--pipeline")
            .arg(pipeline);
        ended(command.args(arguments))
    };
    by(&cell.path("no.toml"), &[]).expect(2, &["no.toml"]);
    let other = cell.path("other.toml");
    fs::copy(cell.pipeline(), &other).expect("copied");
    by(&other, &[]).expect(2, &["has no run by other", "its runs are by pipeline"]);
    by(&other, &["mon"]).expect(1, &["it is by the pipeline file \"pipeline\""]);
    let bare = |lake: &Path| ended(posegrid().arg("verify").arg(lake));
    bare(&lake).expect(1, &["2 runs: 2 not recomputed"]);
    bare(&cell.path("nowhere")).expect(2, &["there is no lake in", "no such folder"]);
    bare(&cell.path("sessions")).expect(2, &["it has no row in runs"]);
}
