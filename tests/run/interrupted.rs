//! Runs killed at any moment: the next one finishes the work, with the bytes of an undisturbed lake.

use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::cell::{Cell, undisturbed};
use super::same_work::assert_same;

#[test]
fn a_killed_run_is_finished_by_the_next_one_with_the_same_bytes() {
    let cell = Cell::new().with_quickstart("mon");
    // In the middle of the stages, then as soon as tables appear in the lake: three moments, one after the other.
    killed(&cell, |age, _| age > Duration::from_millis(300));
    // What the session is as joined may be there; the stages behind the join write nothing.
    let lake: Vec<String> = cell.lake().into_keys().collect();
    assert!(lake.iter().all(|path| is_as_joined(path)), "{lake:?}");
    // Files are counted under their last names: a listing may show a file that is just renamed under both.
    let whole = || {
        let files = cell.lake().into_keys();
        files.filter(|path| !path.contains(".tmp-")).count()
    };
    for tables in [3, 8] {
        killed(&cell, |_, _| whole() >= tables);
        assert!(whole() >= tables, "{:?}", cell.lake().keys());
    }
    cell.run(&[]).expect(0, &["1 of 1 within"]);
    // Nothing more either: what the killed runs left under temporary names is gone.
    let mut expected = undisturbed().lake();
    expected.retain(|path, _| path.contains("/mon/"));
    assert_same(&cell.lake(), &expected);
}

#[test]
fn samples_stand_under_a_temporary_name_until_their_run_has_a_result() {
    let samples = "lake = \"lake\"\nlogs = true";
    let cell = Cell::new().with("lake = \"lake\"", samples).with_quickstart("mon");
    // While the logs are read, or right behind it: long before the first table.
    killed(&cell, |_, files| files >= 1);
    let left: Vec<String> = cell.lake().into_keys().collect();
    assert!(left.iter().all(|path| path.contains(".tmp-")), "{left:?}");
    cell.run(&[]).expect(0, &["1 of 1 within"]);
    let samples = cell.table("logs", "mon");
    assert!(samples.rows() > 10_000, "{}", samples.rows());
    let left: Vec<String> = cell.lake().into_keys().collect();
    assert!(!left.iter().any(|path| path.contains(".tmp-")), "{left:?}");
}

#[test]
fn a_session_without_a_result_leaves_no_samples() {
    let cell = Cell::new()
        .with("lake = \"lake\"", "lake = \"lake\"\nlogs = true")
        .with("# sessions", "max_lost_share = 0.001")
        .with_quickstart("mon")
        .with_log("mon", "controller.mcap", |bytes| bytes[..bytes.len() / 2].to_vec());
    cell.run(&[]).expect(1, &["max_lost_share = 0.001"]);
    assert!(cell.lake().is_empty());
}

/// Whether a file is of a session as joined, of an estimate or of grids.
fn is_as_joined(path: &str) -> bool {
    ["joined_sessions/", "readings/", "estimates/", "grids/"]
        .iter()
        .any(|folder| path.starts_with(folder))
}

/// Starts the run and kills it as soon as `now` says so of its age and the number of files in the lake.
fn killed(cell: &Cell, now: impl Fn(Duration, usize) -> bool) {
    let mut child = started(cell);
    let start = Instant::now();
    loop {
        let ended = child.try_wait().expect("our own child").is_some();
        if ended || now(start.elapsed(), cell.lake().len()) {
            break;
        }
        sleep(Duration::from_micros(200));
    }
    // Where the run was faster than we look, it is whole: then the next has nothing to do, and the bytes still have to
    // be the same.
    child.kill().expect("killed, or gone");
    child.wait().expect("our own child");
}

fn started(cell: &Cell) -> Child {
    Command::new(env!("CARGO_BIN_EXE_posegrid"))
        .arg("run")
        .arg(cell.pipeline())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("started")
}
