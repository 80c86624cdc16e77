//! Tables and the lake from outside: a sample of every schema written, read back and left for the independent readers
//! of `tests/readers`; commits that race; a lake that cannot be written.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, Barrier};

use arrow::array::{Array as _, ArrayRef, Float32Array, Float64Array, RecordBatch, StringArray};
use parquet::arrow::ArrowWriter;
use posegrid::files::schema::{self, ColumnSchema, ColumnType, KEY_COLUMNS, Role, TableSchema};
use posegrid::files::store::Listed;
use posegrid::files::table::{self, Columns, ROW_GROUP_ROWS, Table};
use posegrid::geometry::PoseCovariance;
use posegrid::ingest::{CommandSamples, TargetReadings, TemperatureSamples};
use posegrid::io::lake::{
    ASKED, CORRECTIONS, Commit, Correction, ESTIMATES, GRIDS, JOINED, Lake, OpenRun, rows_of,
};
use posegrid::io::log::JointSink as _;
use posegrid::io::rows::Row as _;
use posegrid::io::tables::PublishError;
use posegrid::io::tables::estimates::EstimateRow;
use posegrid::io::tables::grids;
use posegrid::io::tables::joined_sessions::JoinedSessionRow;
use posegrid::io::tables::logs::LogTable;
use posegrid::io::tables::runs::{self, Ending};
use posegrid::io::tables::words::{CorrectedForm, CorrectingTable};
use posegrid::join::JoinInput;
use posegrid::join::stationary::Stationary;
use posegrid::manifest::{RunKey, Work, Written, canonical};
use posegrid::units::{Stamp, WallTime};

/// Names that a log may hold and no reader should trip over.
fn hostile_work() -> Work {
    Work {
        robot: "../ü r=10".to_owned(),
        session: "2020.11 \"grid\"/a".to_owned(),
        pipeline: "sample".to_owned(),
        sessions: Vec::new(),
        test_sessions: Vec::new(),
        inputs: Vec::new(),
        settings: canonical(&()).unwrap(),
    }
}

fn outcome() -> Ending {
    Ending { reason: Some("a sample".to_owned()), ..Ending::default() }
}

/// Three rows (one where a file has one row) of plausible values: row 1 is null wherever the schema allows it.
fn sample(schema: &'static TableSchema, key: &RunKey) -> Table {
    let rows = if schema.order.is_empty() { 1 } else { 3 };
    let columns = Columns::new(schema, rows);
    let (columns, keys) = match schema.role {
        Role::Published => (columns.key(key), KEY_COLUMNS.len()),
        Role::Accepted => (columns, 0),
    };
    let rest = schema.columns.iter().skip(keys);
    let filled = rest.fold(columns, |columns, column| fill(columns, column, rows));
    filled.finish().unwrap()
}

fn fill(columns: Columns, column: &ColumnSchema, rows: usize) -> Columns {
    let name = column.name.as_str();
    let there = |row: &usize| !(column.nullable && *row == 1);
    let cells = |rows: usize| (0..rows).map(|row| Some(row).filter(there));
    let word = |row: usize| match &column.values {
        Some(words) => words[row % words.len()].clone(),
        None => format!("\"{row}\", ü\n"),
    };
    match column.kind {
        ColumnType::Float64 => columns.column(name, cells(rows).map(|r| r.map(|r| r as f64 / 3.0))),
        ColumnType::Int64 => columns.column(name, cells(rows)),
        ColumnType::Bool => columns.column(name, cells(rows).map(|r| r.map(|r| r == 0))),
        ColumnType::Timestamp => columns.column(
            name,
            cells(rows).map(|r| {
                r.map(|r| WallTime::of_us(1_000_000 * i64::try_from(r).expect("few rows")))
            }),
        ),
        ColumnType::String => columns.column(name, cells(rows).map(|r| r.map(word))),
        ColumnType::ListFloat64 => {
            columns.column(name, cells(rows).map(|r| r.map(|r| vec![0.1; r])))
        }
        ColumnType::ListInt64 => {
            columns.column(name, cells(rows).map(|r| r.map(|r| vec![-1_i64; r])))
        }
        ColumnType::ListString => {
            columns.column(name, cells(rows).map(|r| r.map(|r| vec![word(r); r])))
        }
    }
}

/// The tables that a run writes before its row.
fn published() -> impl Iterator<Item = &'static TableSchema> {
    schema::all()
        .iter()
        .filter(|schema| schema.role == Role::Published)
        .filter(|schema| !["runs", ASKED, CORRECTIONS].contains(&schema.table.as_str()))
        .filter(|schema| rows_of(&schema.table) == "runs")
}

/// Writes a sample of a session as joined.
fn write_joined(lake: &Lake, key: &RunKey) {
    let open = lake.start_in(JOINED.rows, key).unwrap();
    let mut open = open.expect("the lake is new");
    let readings = schema::find("readings").unwrap();
    open.publish(&sample(readings, key)).unwrap();
    let [file] = open.written() else { panic!("one file") };
    let row = JoinedSessionRow {
        made: (&hostile_work()).into(),
        joined: "{}".to_owned(),
        files: [file.clone()][..].into(),
        ..JoinedSessionRow::default()
    };
    let row = JoinedSessionRow::table(vec![row], key).unwrap();
    assert_eq!(open.commit(&row.table).unwrap(), Commit::Done);
}

/// Writes a sample of an estimate.
fn write_estimate(lake: &Lake, key: &RunKey) {
    let open = lake.start_in(ESTIMATES.rows, key).unwrap();
    let mut open = open.expect("the lake is new");
    let residuals = schema::find("estimate_residuals").unwrap();
    open.publish(&sample(residuals, key)).unwrap();
    let written = open.written();
    let row = EstimateRow {
        made: (&hostile_work()).into(),
        session_names: vec![key.session.clone()],
        session_runs: vec!["00".to_owned()],
        robot_digest: "00".to_owned(),
        models: "{}".to_owned(),
        fold_models: Vec::new(),
        left_out: "[]".to_owned(),
        table_names: Some(written.iter().map(Written::name).collect()),
        table_rows: Some(written.iter().map(|file| file.rows).collect()),
        table_digests: Some(written.iter().map(|file| file.digest.clone()).collect()),
        row_digest: None,
    };
    let row = EstimateRow::table(vec![row], key).unwrap();
    assert_eq!(open.commit(&row.table).unwrap(), Commit::Done);
}

/// Writes a sample of grids.
fn write_grids(lake: &Lake, key: &RunKey) {
    let open = lake.start_in(GRIDS.rows, key).unwrap();
    let mut open = open.expect("the lake is new");
    let errors = schema::find("grid_errors").unwrap();
    open.publish(&sample(errors, key)).unwrap();
    let row = grids::table(&[], &hostile_work(), open.written()).unwrap();
    assert_eq!(open.commit(&row).unwrap(), Commit::Done);
}

/// What was corrected with a table of that run; records are no part of it.
fn correction() -> Correction {
    Correction {
        key: hostile_work().key(),
        corrected_by: CorrectingTable::Compensation,
        form: CorrectedForm::Csv,
        version: "0.1.0".to_owned(),
        targets_digest: "00".to_owned(),
        file_digest: "ff".to_owned(),
        targets: 3,
        corrected: 2,
        positions: vec![[1.0, -2.5, 3.0], [4.0, 5.0, 6.0]],
        joints: vec![vec![0.5; 6]; 2],
    }
}

/// Files of the sample lake beside the tables of its run: the run's row, the record of a correction, a session as joined
/// (two files), an estimate (two files), grids (two files).
const OTHER_FILES: usize = 8;

/// Writes a sample of every published table as one committed run.
fn write_sample_lake(root: &Path) -> Lake {
    let lake = Lake::new(root);
    let key = hostile_work().key();
    let mut run = lake.start(&key).unwrap().expect("the lake is new");
    for schema in published() {
        run.publish(&sample(schema, &key)).unwrap();
    }
    let runs = runs::table(&hostile_work(), &[], run.written(), &outcome()).unwrap();
    assert_eq!(run.commit(&runs).unwrap(), Commit::Done);
    assert_eq!(lake.ask(&key).unwrap().number, 1);
    assert!(lake.record(&correction()).unwrap());
    write_joined(&lake, &key);
    write_estimate(&lake, &key);
    write_grids(&lake, &key);
    lake
}

/// Every file below a folder with its content, sorted by path, but for those of `asked`, which has a clock.
fn contents(root: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            if path.is_dir() {
                folders.extend((!path.ends_with(ASKED)).then_some(path));
            } else {
                found.push((path.strip_prefix(root).unwrap().to_owned(), fs::read(&path).unwrap()));
            }
        }
    }
    found.sort();
    found
}

#[test]
fn every_table_is_written_and_read_back_and_left_for_other_readers() {
    // The place is fixed, so that the independent readers find it after the tests.
    let root = Path::new(env!("CARGO_TARGET_TMPDIR")).join("sample-lake");
    if root.exists() {
        fs::remove_dir_all(&root).unwrap();
    }
    let lake = write_sample_lake(&root);
    let key = hostile_work().key();
    for schema in published() {
        assert_eq!(
            lake.read(&schema.table, &key).unwrap(),
            sample(schema, &key),
            "{}",
            schema.table
        );
    }
    let readings = schema::find("readings").unwrap();
    assert_eq!(lake.read("readings", &key).unwrap(), sample(readings, &key));
    let runs = lake.read("runs", &key).unwrap();
    assert_eq!(
        runs.list("table_digests").value_length(0),
        i32::try_from(published().count()).unwrap()
    );
}

#[test]
fn two_lakes_of_the_same_work_are_the_same_files_with_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    write_sample_lake(&folder.path().join("one"));
    write_sample_lake(&folder.path().join("two"));
    let one = contents(&folder.path().join("one"));
    assert_eq!(
        one.len(),
        published().count() + OTHER_FILES,
        "a file a table, the row, the record of a correction, a session as joined, an estimate, its grids, no temporaries"
    );
    assert!(one == contents(&folder.path().join("two")));
}

/// A file of targets as somebody else may write it.
fn foreign_targets(x_mm: ArrayRef, more: Vec<(&str, ArrayRef)>) -> Result<Table, String> {
    let names: ArrayRef = Arc::new(StringArray::from(vec!["rivet 1", "rivet 2"]));
    let zero: ArrayRef = Arc::new(Float64Array::from(vec![0.0, 0.0]));
    let mut columns =
        vec![("z_mm", zero.clone()), ("y_mm", zero), ("x_mm", x_mm), ("target", names)];
    columns.extend(more);
    let batch = RecordBatch::try_from_iter(columns).unwrap();
    let file = tempfile::NamedTempFile::new().unwrap();
    let mut writer = ArrowWriter::try_new(file.reopen().unwrap(), batch.schema(), None).unwrap();
    writer.write(&batch).unwrap();
    writer.close().unwrap();
    table::read(file.path(), schema::find("targets").unwrap()).map_err(|error| error.to_string())
}

#[test]
fn accepted_targets_may_come_from_other_writers() {
    // Another order of columns, a narrower type, a column of their own, none of those that may be null.
    let x: ArrayRef = Arc::new(Float32Array::from(vec![1.5, -2.0]));
    let note: ArrayRef = Arc::new(StringArray::from(vec!["left wing", "right wing"]));
    let targets = foreign_targets(x, vec![("note", note)]).unwrap();
    assert_eq!(targets.f64("x_mm").values(), &[1.5, -2.0]);
    assert_eq!(targets.text("configuration").null_count(), 2);

    let unit: ArrayRef = Arc::new(StringArray::from(vec!["1.5 mm", "2 mm"]));
    let error = foreign_targets(unit.clone(), vec![]).unwrap_err();
    assert!(error.contains("\"x_mm\": found Utf8, the schema states float64"), "{error}");
    // A column that may be null is no place for text to vanish into.
    let number: ArrayRef = Arc::new(Float64Array::from(vec![1.0, 2.0]));
    let error = foreign_targets(number, vec![("qw", unit.clone())]).unwrap_err();
    assert!(error.contains("\"qw\": found Utf8"), "{error}");
    let hole: ArrayRef = Arc::new(Float64Array::from(vec![Some(1.0), None]));
    let targets = foreign_targets(hole, vec![]).unwrap();
    assert_eq!(targets.f64("x_mm").null_count(), 1, "joint angles may stand instead");
    let nan: ArrayRef = Arc::new(Float64Array::from(vec![f64::NAN, 0.0]));
    let error = foreign_targets(nan, vec![]).unwrap_err();
    assert!(error.contains("row 0: NaN is not a finite number"), "{error}");
}

#[test]
fn of_many_that_commit_the_same_run_one_wins() {
    let folder = tempfile::tempdir().unwrap();
    let lake = Lake::new(folder.path());
    let key = hostile_work().key();
    let together = Barrier::new(8);
    let commit = || {
        let mut run = lake.start(&key).unwrap().expect("nobody has committed yet");
        run.publish(&sample(schema::find("clocks").unwrap(), &key)).unwrap();
        let runs = runs::table(&hostile_work(), &[], run.written(), &outcome()).unwrap();
        together.wait();
        run.commit(&runs).unwrap()
    };
    let commits: Vec<Commit> = std::thread::scope(|scope| {
        let racers: Vec<_> = (0..8).map(|_| scope.spawn(commit)).collect();
        racers.into_iter().map(|racer| racer.join().unwrap()).collect()
    });
    assert_eq!(commits.iter().filter(|&&commit| commit == Commit::Done).count(), 1);
    assert!(lake.start(&key).unwrap().is_none(), "the run exists");
    assert_eq!(contents(folder.path()).len(), 2, "the table and its row, no temporaries");
}

/// Commits a run of the hostile session that has a setting, after the run that is current then.
fn committed(lake: &Lake, setting: u32) -> RunKey {
    let work = Work { settings: canonical(&setting).unwrap(), ..hostile_work() };
    let key = work.key();
    let run = lake.start(&key).unwrap().expect("a new setting");
    let ending = outcome().replacing(lake.current(&key).unwrap());
    let row = runs::table(&work, &[], run.written(), &ending).unwrap();
    assert_eq!(run.commit(&row).unwrap(), Commit::Done);
    key
}

/// The requests of a lake's only session in order: the run, and the one before.
fn requests(lake: &Lake) -> Vec<(String, Option<String>)> {
    let files = lake.requests(ASKED).unwrap().into_iter().zip(1..);
    let row = |(file, number): (Listed, u64)| {
        let (key, row) = lake.request(&file.key).unwrap();
        assert_eq!(row.number, number, "without gaps");
        (key.run, row.replaced)
    };
    files.map(row).collect()
}

#[test]
fn the_run_asked_for_last_is_current_whoever_asks_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let lake = Lake::new(folder.path());
    let current = |key: &RunKey| lake.current(key).unwrap().map(|own| own.run);
    // Of a lake that an earlier version wrote the run is current that no other replaces.
    let [first, second] = [1, 2].map(|setting| committed(&lake, setting));
    assert_eq!(current(&first).as_ref(), Some(&second.run));
    assert!(requests(&lake).is_empty());
    // One that comes back is current again, once, and says what it replaced.
    let asked = lake.ask(&first).unwrap();
    assert_eq!((asked.number, asked.replaced.as_ref()), (1, Some(&second.run)));
    assert_eq!(current(&first).as_ref(), Some(&first.run));
    let again = lake.ask(&first).unwrap();
    assert_eq!((again.number, again.replaced), (1, None));
    // A run that was stopped before its request is not current, and is when it is asked for again.
    let third = committed(&lake, 3);
    assert_eq!(current(&first).as_ref(), Some(&first.run));
    assert_eq!(lake.ask(&third).unwrap().number, 2);
    // Of several at once each request has a number of its own, and replaces the run of the one before.
    let together = Barrier::new(6);
    std::thread::scope(|scope| {
        for key in [&first, &second, &third, &first, &second, &third] {
            let (lake, together) = (&lake, &together);
            scope.spawn(move || {
                together.wait();
                (0..5).for_each(|_| drop(lake.ask(key).unwrap()));
            });
        }
    });
    let all = requests(&lake);
    for pair in all.windows(2) {
        assert_eq!(pair[1].1.as_ref(), Some(&pair[0].0));
        assert_ne!(pair[1].0, pair[0].0, "a request that changes nothing is no row");
    }
    assert!(all.len() >= 4, "each of three runs was asked for");
    assert_eq!(current(&first), all.last().map(|own| own.0.clone()));
    // A file that holds the row of another request is refused, whoever is asked.
    let files = lake.requests(ASKED).unwrap();
    let [file, last] = [&files[0], files.last().unwrap()].map(|file| folder.path().join(&file.key));
    fs::copy(file, last).unwrap();
    let error = lake.current(&first).unwrap_err().to_string();
    assert!(error.contains("does not hold the request"), "{error}");
}

#[test]
fn what_never_committed_is_no_run_and_is_written_anew() {
    let folder = tempfile::tempdir().unwrap();
    let lake = Lake::new(folder.path());
    let key = hostile_work().key();
    let clocks = sample(schema::find("clocks").unwrap(), &key);
    let mut interrupted = lake.start(&key).unwrap().unwrap();
    interrupted.publish(&clocks).unwrap();
    drop(interrupted);
    assert!(!lake.exists(&key).unwrap());
    // What stands there is a leftover, whatever it holds.
    let path = lake.place("clocks", &key).unwrap().named();
    fs::write(&path, "torn").unwrap();
    let mut again = lake.start(&key).unwrap().expect("the run does not exist");
    again.publish(&clocks).unwrap();
    assert_eq!(lake.read("clocks", &key).unwrap(), clocks);
    // A table that changes between writing and committing keeps the run from existing.
    fs::write(&path, "torn").unwrap();
    let runs = runs::table(&hostile_work(), &[], again.written(), &outcome()).unwrap();
    let error = again.commit(&runs).unwrap_err().to_string();
    assert!(error.contains("changed while its run was being written"), "{error}");
    assert!(!lake.exists(&key).unwrap());
}

#[test]
fn nothing_published_is_rewritten() {
    let folder = tempfile::tempdir().unwrap();
    let lake = Lake::new(folder.path());
    let key = hostile_work().key();
    let slower = lake.start(&key).unwrap();
    write_sample_lake(folder.path());
    let before = contents(folder.path());
    // A second process that began before the first committed: the same bytes are fine, others are refused.
    let mut slower = slower.expect("the run did not exist yet");
    let schema = schema::find("joint_errors").unwrap();
    slower.publish(&sample(schema, &key)).unwrap();
    let other = Columns::new(schema, 0).key(&key);
    let rest = schema.columns.iter().skip(KEY_COLUMNS.len());
    let other = rest.fold(other, |columns, column| fill(columns, column, 0)).finish().unwrap();
    let error = slower.publish(&other).unwrap_err().to_string();
    assert!(error.contains("is published, and recomputing it gave other bytes"), "{error}");
    let foreign = RunKey::new(&key.robot, &key.session, "00ff");
    let error = slower.publish(&sample(schema, &foreign)).unwrap_err().to_string();
    assert!(error.contains("its rows belong to 00ff"), "{error}");
    let runs = runs::table(&hostile_work(), &[], slower.written(), &outcome()).unwrap();
    assert_eq!(slower.commit(&runs).unwrap(), Commit::AlreadyThere);
    assert!(before == contents(folder.path()));
}

/// Set for the copy of this test that runs inside a mount of its own: the lake's folder.
const MOUNTED: &str = "POSEGRID_TEST_MOUNTED_LAKE";

/// The tests may run as root, who can write anything: only a mount is truly full or read-only.
fn run_in_mount(test: &str, prepare: &str) {
    let folder = tempfile::tempdir().unwrap();
    let script = format!(
        "mount -t tmpfs -o size=64k tmpfs \"$1\" && {prepare} && exec \"$2\" --exact tables::{test} --nocapture"
    );
    let output = Command::new("unshare")
        .args(["-rm", "sh", "-c", &script, "sh"])
        .arg(folder.path())
        .arg(std::env::current_exe().unwrap())
        .env(MOUNTED, folder.path())
        .output();
    let may_mount =
        Command::new("unshare").args(["-rm", "true"]).status().is_ok_and(|status| status.success());
    if !may_mount {
        assert!(std::env::var_os("CI").is_none(), "`unshare -rm` is not permitted, and CI is set");
        eprintln!(
            "SKIPPED {test}: `unshare -rm` is not permitted here, so no full or read-only folder can be made"
        );
        return;
    }
    let output = output.unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    let ran = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && ran.contains("1 passed"), "{ran}{said}");
}

fn publish_error(root: &Path) -> String {
    let lake = Lake::new(root);
    let key = hostile_work().key();
    let mut run = lake.start(&key).unwrap().unwrap();
    run.publish(&sample(schema::find("joint_errors").unwrap(), &key)).unwrap_err().to_string()
}

#[test]
fn a_full_disk_is_reported_and_leaves_nothing_behind() {
    let Some(mount) = std::env::var_os(MOUNTED) else {
        let fill = "head -c 40960 /dev/zero > \"$1/ballast\" && mkdir -p \"$1/lake\" && { cat /dev/zero > \"$1/rest\" 2>/dev/null || true; }";
        return run_in_mount("a_full_disk_is_reported_and_leaves_nothing_behind", fill);
    };
    let lake = Path::new(&mount).join("lake");
    let error = publish_error(&lake);
    assert!(
        error.contains("No space left on device") && error.contains("make room there"),
        "{error}"
    );
    assert_eq!(contents(&lake), [], "no half-written file stays");
}

#[test]
fn a_read_only_folder_is_reported() {
    let Some(mount) = std::env::var_os(MOUNTED) else {
        return run_in_mount("a_read_only_folder_is_reported", "mount -o remount,ro \"$1\"");
    };
    let error = publish_error(Path::new(&mount));
    assert!(
        error.contains("Read-only file system") && error.contains("make the folder writable"),
        "{error}"
    );
}

#[test]
fn a_file_in_the_place_of_the_lake_is_reported() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let lake = Lake::new(file.path());
    let key = hostile_work().key();
    let error = lake.start(&key).unwrap_err().to_string();
    assert!(
        error.contains("Not a directory")
            && error.contains("there is a file where a folder is needed"),
        "{error}"
    );
}

/// More joint samples than a part holds: stamps, and angles of six joints row behind row.
fn joint_samples() -> (Vec<i64>, Vec<f64>) {
    let samples = ROW_GROUP_ROWS + 500;
    let angle = |row: usize, joint: usize| (row * (joint + 1)) as f64 * 1e-5;
    let angles = (0..samples).flat_map(|row| (0..6).map(move |joint| angle(row, joint)));
    let stamps_ns = (0..).step_by(10).take(samples);
    (stamps_ns.collect(), angles.collect())
}

/// Samples of all other sources.
fn other_samples() -> JoinInput {
    JoinInput {
        joints: Stationary::default(),
        commands: Box::new(CommandSamples {
            stamps: vec![Stamp::from_ns(7)],
            positions: vec![[1.0, 2.0, 3.0]],
            ..CommandSamples::default()
        }),
        readings: Box::new(TargetReadings {
            stamps: vec![Stamp::from_ns(5), Stamp::from_ns(5)],
            positions: vec![[0.5; 3]; 2],
            orientations: Some(vec![[0.0, 0.0, 0.0, 1.0]; 2]),
            covariances: Some(vec![PoseCovariance { position: Some([1e-4; 6]), turn: None }; 2]),
        }),
        others: Vec::new(),
        references: Vec::new(),
        lengths: Vec::new(),
        temperatures: TemperatureSamples { stamps: vec![Stamp::from_ns(6)], celsius: vec![20.5] },
    }
}

/// Publishes samples as they come while logs are read.
fn publish_samples(
    run: &mut OpenRun<'_>,
    stamps_ns: &[i64],
    angles: &[f64],
) -> Result<(), PublishError> {
    let session = run.key.session.clone();
    let mut table = LogTable::new(run, &session);
    let pieces = angles.chunks(6 * ROW_GROUP_ROWS);
    for (stamps_ns, angles) in stamps_ns.chunks(ROW_GROUP_ROWS).zip(pieces) {
        table.take(stamps_ns, angles);
    }
    let table = table.finish(&other_samples())?;
    run.keep(table.expect("samples"));
    Ok(run.publish_kept()?)
}

#[test]
fn a_table_in_parts_has_the_same_bytes_at_any_number_of_threads() {
    let (stamps_ns, angles) = joint_samples();
    let key = hostile_work().key();
    let digest = |threads: usize| {
        let folder = tempfile::tempdir().unwrap();
        let lake = Lake::new(folder.path());
        let mut run = lake.start(&key).unwrap().unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| publish_samples(&mut run, &stamps_ns, &angles)).unwrap();
        let written = run.written()[0].clone();
        let table = lake.read("logs", &key).unwrap();
        assert_eq!((written.rows, table.rows()), (66_040, 66_040), "65 536 + 500, 1, 2 and 1");
        // In the schema's order: joints, command, target, temperature.
        let sources: Vec<_> = [0, 66_036, 66_037, 66_039]
            .map(|row| table.text("source").value(row).to_owned())
            .into();
        assert_eq!(sources, ["joints", "command", "target", "temperature"]);
        let last = angles[6 * 66_035..].to_vec();
        let lists = table.list("joints_rad");
        assert_eq!(
            lists.value(66_035).as_ref(),
            &Float64Array::from(last) as &dyn arrow::array::Array
        );
        assert!(lists.is_null(66_036), "a command has no angles");
        let numbers = [("x_mm", 66_036), ("stated_cov_zz_mm2", 66_038), ("temperature_c", 66_039)];
        let found = numbers.map(|(column, row)| Some(table.f64(column).value(row)));
        assert_eq!(found, [Some(1.0), Some(1e-4), Some(20.5)]);
        written.digest
    };
    let alone = digest(1);
    assert_eq!([digest(2), digest(7)], [alone.clone(), alone]);
}

#[test]
fn a_part_that_breaks_the_contract_leaves_no_file() {
    let (stamps_ns, mut angles) = joint_samples();
    angles[6 * (ROW_GROUP_ROWS + 7) + 3] = f64::NAN;
    let folder = tempfile::tempdir().unwrap();
    let lake = Lake::new(folder.path());
    let key = hostile_work().key();
    let mut run = lake.start(&key).unwrap().unwrap();
    let published = publish_samples(&mut run, &stamps_ns, &angles);
    let error = published.unwrap_err().to_string();
    assert!(error.contains("\"joints_rad\", row 7: NaN is not a finite number"), "{error}");
    assert!(run.written().is_empty());
    assert_eq!(contents(folder.path()), []);
}

#[test]
fn cleaning_a_lake_leaves_its_tables() {
    let folder = tempfile::tempdir().unwrap();
    let lake = write_sample_lake(folder.path());
    assert_eq!(lake.clean().unwrap(), Vec::<PathBuf>::new());
    assert_eq!(contents(folder.path()).len(), published().count() + OTHER_FILES);
    assert_eq!(Lake::new(folder.path().join("none")).clean().unwrap(), Vec::<PathBuf>::new());
}

#[test]
fn two_columns_of_one_name_or_in_letters_of_another_size_are_reported() {
    let x: ArrayRef = Arc::new(Float64Array::from(vec![1.0, 2.0]));
    let texts: ArrayRef = Arc::new(StringArray::from(vec![None, Some("t-1")]));
    for (name, told) in [
        ("x_mm", "columns \"x_mm\" and \"x_mm\""),
        ("X_mm", "columns \"X_mm\" and \"x_mm\""),
        ("Qx", "columns \"Qx\" and \"qx\""),
    ] {
        let more = vec![(name, x.clone())];
        let error = foreign_targets(x.clone(), more).unwrap_err();
        assert!(error.contains(told), "{error}");
    }
    let error = foreign_targets(x.clone(), vec![("Table_ID", texts.clone())]).unwrap_err();
    assert!(error.contains("columns \"Table_ID\" and \"table_id\""), "{error}");
    let found = foreign_targets(x, vec![("note", texts)]).unwrap();
    assert_eq!(found.rows(), 2, "a column of the caller's own");
}
