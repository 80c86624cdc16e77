//! `logs` tables that are written while the logs are read: byte for byte what the whole recording in memory gives, at any
//! number of threads.

use std::fs;

use posegrid::ingest::Mapping;
use posegrid::io::lake::Lake;
use posegrid::io::log::{Limits, LogError, SessionLogs, read_dwells_beside, read_session};
use posegrid::io::schema;
use posegrid::io::table::Table;
use posegrid::io::tables::logs::{LogTable, logs as rows, parts};
use posegrid::join::JoinSettings;
use posegrid::manifest::RunKey;
use posegrid::progress::Quiet;

use crate::build::{Folder, mapping, session_log};
use crate::recordings;

fn key() -> RunKey {
    RunKey::new("robot", "session", "00ff")
}

/// The table's file and how many rows it is said to have, or why there is no recording.
type Published = Result<(Vec<u8>, u64), String>;

fn published(
    write: impl FnOnce(&mut posegrid::io::lake::OpenRun<'_>) -> Result<(), LogError>,
) -> Published {
    let folder = Folder::new();
    let lake = Lake::new(folder.path());
    let mut run = lake.start(&key()).expect("a lake").expect("a new run");
    write(&mut run).map_err(|error| error.to_string())?;
    let path = lake.path(schema::find("logs").expect("a table"), &key());
    let bytes = fs::read(path.expect("short names").named()).expect("published");
    Ok((bytes, run.written()[0].rows))
}

fn while_read(logs: &SessionLogs, mapping: &Mapping) -> Published {
    published(|run| {
        let mut table = LogTable::new(run, "session");
        let (rule, limits) = (JoinSettings::default().arm_rule(), Limits::default());
        let read = read_dwells_beside(logs, mapping, limits, &rule, &mut table, &Quiet)?;
        let table = table.finish((&read).into());
        let table = table.expect("room on the disk");
        run.keep(table.expect("samples"));
        assert!(run.written().is_empty(), "not in its place yet");
        run.publish_kept().expect("a new run");
        Ok(())
    })
}

fn at_the_end(logs: &SessionLogs, mapping: &Mapping) -> Published {
    published(|run| {
        let recording = read_session(logs, mapping, Limits::default(), &Quiet)?;
        let table = |part| rows((&recording).into(), part, &key());
        run.publish_parts(parts((&recording).into()), table)
            .expect("room on the disk");
        Ok(())
    })
}

/// Writes the table both ways, and the new one with several numbers of threads; tells how many rows it has.
pub fn same_both_ways(logs: &SessionLogs, mapping: &Mapping) -> u64 {
    let expected = at_the_end(logs, mapping);
    for threads in [1, 2, 4] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let found = pool.expect("threads").install(|| while_read(logs, mapping));
        assert!(
            found == expected,
            "{threads} threads: {:?}",
            found.map(|(_, rows)| rows)
        );
    }
    expected.map_or(0, |(_, rows)| rows)
}

#[test]
fn real_recordings_give_the_same_table_both_ways() {
    for name in ["ur10-random-a", "ur10-grid"] {
        let Some(folder) = recordings::recording(name) else {
            continue;
        };
        let side = |log| folder.join(log);
        let logs = SessionLogs::of_two(&side("controller.mcap"), &side("tracker.mcap"));
        let mapping = recordings::mapping(posegrid::ingest::TimeSource::Header);
        assert!(same_both_ways(&logs, &mapping) > 10_000);
    }
}

#[test]
fn a_damaged_log_gives_the_same_table_both_ways() {
    let whole = session_log(Some(mcap::Compression::Zstd), 3000);
    let folder = Folder::new();
    let both = |name: &str, bytes: &[u8]| {
        let path = folder.file(name, bytes);
        same_both_ways(&SessionLogs::of_two(&path, &path), &mapping())
    };
    let rows = both("whole.mcap", &whole);
    assert_eq!(rows, 3600, "3000 joint states, 300 commands, 300 readings");
    for place in [3, 5, 8] {
        let mut flipped = whole.clone();
        flipped[whole.len() * place / 10] ^= 0x10;
        let left = both("flipped.mcap", &flipped);
        assert!((3000..3600).contains(&left), "a chunk is lost: {left}");
        let cut = both("cut.mcap", &whole[..whole.len() * place / 10]);
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
    let read = read_dwells_beside(&logs, &mapping(), limits, &rule, &mut table, &Quiet);
    let read = read.expect("a sound log");
    let files = || {
        let path = lake.path(schema::find("logs").expect("a table"), &key());
        let path = path.expect("short names");
        let folder = path.named();
        let folder = folder.parent().expect("it stands in a folder");
        fs::read_dir(folder).map_or(0, Iterator::count)
    };
    assert_eq!(files(), 1, "under a temporary name");
    drop(table);
    assert_eq!(files(), 0);
    // Whole, but the run comes to nothing.
    let table = LogTable::new(&run, "session").finish((&read).into());
    run.keep(
        table
            .expect("room on the disk")
            .expect("commands and readings"),
    );
    assert_eq!(files(), 1, "under a temporary name");
    drop(run);
    assert_eq!(files(), 0);
}

#[test]
fn what_breaks_the_contract_is_told_at_the_end_and_leaves_no_file() {
    use posegrid::io::log::JointSink as _;
    let folder = Folder::new();
    let lake = Lake::new(folder.path());
    let run = lake.start(&key()).expect("a lake").expect("a new run");
    let mut table = LogTable::new(&run, "session");
    table.take(&[1, 2], &[0.0, 1.0]);
    table.take(&[3, 4], &[0.0, f64::NAN]);
    table.take(&[5], &[0.0]);
    let nothing = posegrid::ingest::Recording::default();
    let error = table.finish((&nothing).into());
    let error = error.expect_err("no angle is NaN").to_string();
    assert!(error.contains("\"joints_rad\", row 1: NaN"), "{error}");
    let found: Vec<Table> = lake.read("logs", &key()).into_iter().collect();
    assert!(found.is_empty());
}
