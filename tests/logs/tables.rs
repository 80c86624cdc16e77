//! `logs` tables that are written while the logs are read: every sample is in them, with the same bytes at any number of
//! threads.

use std::fs;

use arrow::array::{Array as _, AsArray as _};
use arrow::datatypes::Float64Type;
use posegrid::files::table::Table;
use posegrid::ingest::{CommandSamples, Mapping, PoseSamples, TargetReadings, TemperatureSamples};
use posegrid::io::lake::Lake;
use posegrid::io::log::{Limits, SessionLogs, read_session};
use posegrid::io::tables::logs::LogTable;
use posegrid::join::stationary::Stationary;
use posegrid::join::{JoinInput, JoinSettings};
use posegrid::manifest::RunKey;
use posegrid::progress::Quiet;

use crate::build::{Folder, WholeSession, mapping, read_whole, session_log};
use crate::recordings;

fn key() -> RunKey {
    RunKey::new("robot", "session", "00ff")
}

/// Reads a session and publishes its samples: the bytes of the file and the table.
fn published(logs: &SessionLogs, mapping: &Mapping) -> (Vec<u8>, Table) {
    let folder = Folder::new();
    let lake = Lake::new(folder.path());
    let mut run = lake.start(&key()).expect("a lake").expect("a new run");
    let mut table = LogTable::new(&run, "session");
    let (rule, limits) = (JoinSettings::default().arm_rule(), Limits::default());
    let read = read_session(logs, mapping, limits, &rule, &mut table, &Quiet).expect("sound");
    let table = table.finish(&read.input).expect("room on the disk");
    run.keep(table.expect("samples"));
    assert!(run.written().is_empty(), "not in its place yet");
    run.publish_kept().expect("a new run");
    let table = lake.read("logs", &key()).expect("published");
    assert_eq!(run.written()[0].rows, table.rows() as u64);
    let path = lake.place("logs", &key());
    let bytes = fs::read(path.expect("short names").named()).expect("published");
    (bytes, table)
}

/// Columns of single numbers.
const NUMBERS: [&str; 14] = [
    "x_mm",
    "y_mm",
    "z_mm",
    "qx",
    "qy",
    "qz",
    "qw",
    "stated_cov_xx_mm2",
    "stated_cov_xy_mm2",
    "stated_cov_xz_mm2",
    "stated_cov_yy_mm2",
    "stated_cov_yz_mm2",
    "stated_cov_zz_mm2",
    "temperature_c",
];

/// A row of the table.
#[derive(Debug, PartialEq)]
struct Row {
    source: &'static str,
    sample: i64,
    stamp_ns: i64,
    joints_rad: Option<Vec<f64>>,
    numbers: [Option<f64>; 14],
}

/// The rows that a table of these samples has to have.
fn rows(of: &WholeSession) -> impl Iterator<Item = Row> {
    let joints = of.joints.stamps.iter().zip(of.joints.angles.rows());
    let joints = (0..).zip(joints).map(|(sample, (stamp, angles))| Row {
        source: "joints",
        sample,
        stamp_ns: stamp.ns(),
        joints_rad: Some(angles.to_vec()),
        numbers: [None; 14],
    });
    let temperatures = of.temperatures.stamps.iter().zip(&of.temperatures.celsius);
    let temperatures = (0..).zip(temperatures).map(|(sample, (stamp, &celsius))| {
        let mut numbers = [None; 14];
        numbers[13] = Some(celsius);
        Row { source: "temperature", sample, stamp_ns: stamp.ns(), joints_rad: None, numbers }
    });
    joints
        .chain(rows_of_poses("command", &of.commands))
        .chain(rows_of_poses("target", &of.readings))
        .chain(temperatures)
}

fn rows_of_poses<C: Copy>(source: &'static str, of: &PoseSamples<C>) -> impl Iterator<Item = Row> {
    (0..of.stamps.len()).zip(0..).map(move |(row, sample)| {
        let mut numbers = [None; 14];
        numbers[..3].copy_from_slice(&of.positions[row].map(Some));
        if let Some(orientations) = &of.orientations {
            numbers[3..7].copy_from_slice(&orientations[row].map(Some));
        }
        if let Some(covariances) = &of.covariances {
            let position = covariances[row].position;
            numbers[7..13].copy_from_slice(&position.map_or([None; 6], |own| own.map(Some)));
        }
        Row { source, sample, stamp_ns: of.stamps[row].ns(), joints_rad: None, numbers }
    })
}

/// The rows that it has.
fn rows_of(table: &Table) -> impl Iterator<Item = Row> {
    let sources = ["joints", "command", "target", "temperature"];
    let (source, angles) = (table.text("source"), table.list("joints_rad"));
    let (sample, stamp_ns) = (table.i64("sample"), table.i64("stamp_ns"));
    let numbers = NUMBERS.map(|column| table.f64(column));
    (0..table.rows()).map(move |row| {
        let source = sources.iter().find(|name| source.value(row) == **name);
        let joints_rad = angles.is_valid(row).then(|| angles.value(row));
        Row {
            source: source.expect("one of them"),
            sample: sample.value(row),
            stamp_ns: stamp_ns.value(row),
            joints_rad: joints_rad
                .map(|joints| joints.as_primitive::<Float64Type>().values().to_vec()),
            numbers: numbers.map(|column| column.is_valid(row).then(|| column.value(row))),
        }
    })
}

/// Writes the table of a sound session with several numbers of threads, and holds it against the samples; tells how many
/// rows it has.
pub fn check_table(logs: &SessionLogs, mapping: &Mapping) -> usize {
    let whole = read_whole(logs, mapping, Limits::default(), &Quiet).expect("sound");
    let (alone, table) = with_threads(1, || published(logs, mapping));
    assert!(rows_of(&table).eq(rows(&whole)), "other rows than samples");
    for threads in [2, 4] {
        let (bytes, _) = with_threads(threads, || published(logs, mapping));
        assert!(bytes == alone, "other bytes with {threads} threads");
    }
    table.rows()
}

fn with_threads<T: Send>(threads: usize, run: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.expect("threads").install(run)
}

#[test]
fn tables_of_real_recordings_hold_every_sample() {
    for name in ["ur10-random-a", "ur10-grid"] {
        let Some(folder) = recordings::recording(name) else {
            continue;
        };
        let side = |log| folder.join(log);
        let logs = SessionLogs::of_two(&side("controller.mcap"), &side("tracker.mcap"));
        let mapping = recordings::mapping(posegrid::ingest::TimeSource::Header);
        assert!(check_table(&logs, &mapping) > 10_000);
    }
}

#[test]
fn the_table_of_a_damaged_log_holds_what_is_left() {
    let whole = session_log(Some(mcap::Compression::Zstd), 3000);
    let folder = Folder::new();
    let left = |name: &str, bytes: &[u8]| {
        let path = folder.file(name, bytes);
        check_table(&SessionLogs::of_two(&path, &path), &mapping())
    };
    let rows = left("whole.mcap", &whole);
    assert_eq!(rows, 3600, "3000 joint states, 300 commands, 300 readings");
    for place in [3, 5, 8] {
        let mut flipped = whole.clone();
        flipped[whole.len() * place / 10] ^= 0x10;
        let flipped = left("flipped.mcap", &flipped);
        assert!((3000..3600).contains(&flipped), "a chunk is lost: {flipped}");
        let cut = left("cut.mcap", &whole[..whole.len() * place / 10]);
        assert!((1..3600).contains(&cut), "{cut}");
    }
}

#[test]
fn a_table_that_is_not_finished_leaves_no_file() {
    let folder = Folder::new();
    let log = folder.file("log.mcap", &session_log(None, 3000));
    let logs = SessionLogs::of_two(&log, &log);
    let lake = Lake::new(folder.path().join("lake"));
    let mut run = lake.start(&key()).expect("a lake").expect("a new run");
    let mut table = LogTable::new(&run, "session");
    let (rule, limits) = (JoinSettings::default().arm_rule(), Limits::default());
    let read = read_session(&logs, &mapping(), limits, &rule, &mut table, &Quiet);
    let read = read.expect("a sound log");
    let files = || {
        let path = lake.place("logs", &key());
        let path = path.expect("short names");
        let folder = path.named();
        let folder = folder.parent().expect("it stands in a folder");
        fs::read_dir(folder).map_or(0, Iterator::count)
    };
    assert_eq!(files(), 1, "under a temporary name");
    drop(table);
    assert_eq!(files(), 0);
    // Whole, but the run comes to nothing.
    let table = LogTable::new(&run, "session").finish(&read.input);
    run.keep(table.expect("room on the disk").expect("commands and readings"));
    assert_eq!(files(), 1, "under a temporary name");
    drop(run);
    assert_eq!(files(), 0);
}

#[test]
fn what_breaks_the_contract_is_reported_at_the_end_and_leaves_no_file() {
    use posegrid::io::log::JointSink as _;
    let folder = Folder::new();
    let lake = Lake::new(folder.path());
    let run = lake.start(&key()).expect("a lake").expect("a new run");
    let mut table = LogTable::new(&run, "session");
    table.take(&[1, 2], &[0.0, 1.0]);
    table.take(&[3, 4], &[0.0, f64::NAN]);
    table.take(&[5], &[0.0]);
    let nothing = JoinInput {
        joints: Stationary::default(),
        commands: Box::new(CommandSamples::default()),
        readings: Box::new(TargetReadings::default()),
        others: Vec::new(),
        references: Vec::new(),
        lengths: Vec::new(),
        temperatures: TemperatureSamples::default(),
    };
    let error = table.finish(&nothing);
    let error = error.expect_err("no angle is NaN").to_string();
    assert!(error.contains("\"joints_rad\", row 1: NaN"), "{error}");
    let found: Vec<Table> = lake.read("logs", &key()).into_iter().collect();
    assert!(found.is_empty());
}
