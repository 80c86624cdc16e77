//! Every night: sessions found in each way, those that are not ready wait, bad ones stop no other, and only new work is done.

use std::fs;
use std::path::{Path, PathBuf};

use arrow::array::AsArray as _;

use super::cell::{Cell, Ended};

/// A cell with sessions of 12 random poses, all alike but for their names.
fn with_sessions(names: &[&str]) -> Cell {
    let cell = Cell::new().with("harmonics = 12", "enabled = false");
    names.iter().fold(cell, |cell, name| cell.with_simulated(name, &["--random", "12"]))
}

/// Cuts a log in the middle, now: as a recorder leaves it while it writes.
fn cut(log: &Path) {
    let bytes = fs::read(log).expect("a log");
    fs::write(log, &bytes[..bytes.len() / 2]).expect("writable");
}

/// The lines of the sessions, without what comes behind the name.
fn states(ended: &Ended) -> Vec<String> {
    let lines = ended.results.lines().take_while(|line| !line.is_empty());
    let state = |line: &str| {
        let (state, _) = line.split_once(": ").expect("STATE NAME: WORDS");
        state.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    lines.map(state).collect()
}

#[test]
fn a_session_that_is_still_written_waits_and_is_done_once_it_is_whole() {
    let cell = with_sessions(&["mon", "tue"]);
    let log = cell.session("mon").join("tracker.mcap");
    let whole = fs::read(&log).expect("a log");
    cut(&log);
    let first = cell.run(&[]);
    first.expect(3, &["waits        mon: tracker.mcap has no end and changed ", "1 waiting"]);
    assert_eq!(states(&first), ["waits mon", "done tue"]);
    fs::write(&log, whole).expect("writable");
    let second = cell.run(&[]);
    assert_eq!(states(&second), ["done mon", "done-before tue"]);
    assert_eq!(states(&cell.run(&[])), ["done-before mon", "done-before tue"]);
}

#[test]
fn a_log_that_stays_without_an_end_is_a_damaged_one() {
    let cell = with_sessions(&["mon"]).with("# sessions", "settle_s = 0");
    cut(&cell.session("mon").join("tracker.mcap"));
    let ended = cell.run(&[]);
    assert_eq!(states(&ended), ["failed mon"], "its only chunk is cut");
    ended.expect(1, &["the log is damaged in 1 places"]);
}

#[test]
fn nothing_but_waiting_is_no_failure() {
    let cell = with_sessions(&["mon"]);
    fs::remove_file(cell.session("mon").join("controller.mcap")).expect("was there");
    let ended = cell.run(&[]);
    ended.expect(0, &["waits        mon: it has no controller.mcap yet", "0 of 0 within"]);
    assert!(cell.lake().is_empty(), "{:?}", cell.lake().keys());
}

#[test]
fn a_pool_learns_without_a_session_that_waits_and_again_when_it_is_there() {
    let cell = with_sessions(&["mon", "tue", "wed"]).with("# sessions", "pool = \"until\"");
    let log = cell.session("tue").join("controller.mcap");
    let whole = fs::read(&log).expect("a log");
    cut(&log);
    let dry = cell.run(&["--dry-run"]);
    let learns = ["mon: learns from mon", "wed: learns from mon, wed"];
    dry.expect(0, &learns);
    dry.expect(0, &["waits        tue: ", "the pool learns without it"]);
    fs::write(&log, whole).expect("writable");
    cell.run(&["--dry-run"])
        .expect(0, &["tue: learns from mon, tue", "wed: learns from mon, tue, wed"]);
}

#[test]
fn a_pool_goes_on_without_a_bad_session_and_that_is_no_success() {
    for (pool, expected) in [
        ("all", ["failed tue", "done pooled"].as_slice()),
        ("until", &["done mon", "failed tue", "done wed"]),
    ] {
        let cell = with_sessions(&["mon", "tue", "wed"])
            .with("# sessions", &format!("pool = \"{pool}\""))
            .with_log("tue", "tracker.mcap", |_| b"time,x,y,z\n".to_vec());
        let ended = cell.run(&[]);
        assert_eq!(states(&ended), expected, "{}", ended.results);
        ended.expect(1, &["not an MCAP log", "going on without tue"]);
        let last = ["pooled", "wed"][usize::from(pool == "until")];
        let runs = cell.table("runs", last);
        let learnt = runs.list("sessions").value(0);
        assert_eq!(
            format!("{:?}", learnt.as_string::<i32>().iter().flatten().collect::<Vec<_>>()),
            "[\"mon\", \"wed\"]"
        );
    }
}

#[test]
fn those_that_a_waiting_session_judges_wait_too() {
    let cell = with_sessions(&["mon", "tue"]);
    cut(&cell.session("tue").join("controller.mcap"));
    let ended = cell.run(&["--test", "tue"]);
    ended.expect(0, &["waits        mon: tue judges it: controller.mcap has no end"]);
    cell.run(&["--test", "wed"])
        .expect(1, &["failed       mon: no result: wed judges it: there is no such folder"]);
}

#[test]
fn bad_sessions_of_every_kind_stop_no_other() {
    let cell = with_sessions(&["mon", "pooled", "sun"])
        .with_log("mon", "tracker.mcap", |_| b"time,x,y,z\n".to_vec())
        .with("# sessions", "sessions = [\"mon\", \"sat\", \"pooled\", \"sun\"]");
    let ended = cell.run(&["--jobs", "2"]);
    assert_eq!(states(&ended), ["failed mon", "failed sat", "failed pooled", "done sun"]);
    let reasons = ["not an MCAP log", "there is no such folder", "rename the session"];
    ended.expect(1, &reasons);
    ended.expect(
        1,
        &["0 of 4 within 0.5 mm, 3 without a result: 1 done, 0 done before, 1 not met, 3 failed"],
    );
}

/// Moves the logs of the sessions into one folder, under these names.
fn in_one_folder(cell: &Cell, names: &[(&str, &str, &str)]) -> PathBuf {
    let folder = cell.path("sessions");
    for (session, controller, tracker) in names {
        for (log, name) in [("controller.mcap", controller), ("tracker.mcap", tracker)] {
            fs::rename(cell.session(session).join(log), folder.join(name)).expect("moved");
        }
        fs::remove_dir_all(cell.session(session)).expect("writable");
    }
    folder
}

#[test]
fn sessions_are_found_by_the_names_of_their_files() {
    let by = "sessions_by = \"file_name\"\ncontroller = \"{session}_arm.mcap\"\ntracker = \"{session}_laser.mcap\"";
    let cell = with_sessions(&["mon", "tue"]).with("# sessions", by);
    let names =
        [("mon", "mon_arm.mcap", "mon_laser.mcap"), ("tue", "tue_arm.mcap", "tue_laser.mcap")];
    let folder = in_one_folder(&cell, &names);
    fs::rename(folder.join("tue_laser.mcap"), folder.join("wed_laser.mcap")).expect("moved");
    let ended = cell.run(&[]);
    assert_eq!(states(&ended), ["done mon", "waits tue", "waits wed"]);
    ended.expect(3, &["tue: there is no tue_laser.mcap yet", "wed: there is no wed_arm.mcap yet"]);
    cell.run(&["thu"]).expect(2, &["\"thu\"", "no file names it", "mon, tue, wed"]);
}

#[test]
fn sessions_are_found_by_what_their_logs_say() {
    let by = "sessions_by = \"metadata\"\ncontroller = \"a*.mcap\"\ntracker = \"l*.mcap\"";
    let cell = with_sessions(&["mon", "tue", "wed"]).with("# sessions", by);
    let names = [
        ("mon", "a1.mcap", "l9.mcap"),
        ("tue", "a2.mcap", "l3.mcap"),
        ("wed", "a3.mcap", "l1.mcap"),
    ];
    let folder = in_one_folder(&cell, &names);
    fs::copy(folder.join("a2.mcap"), folder.join("a4.mcap")).expect("copied");
    fs::write(folder.join("l2.mcap"), [mcap::MAGIC, mcap::MAGIC].concat()).expect("writable");
    let ended = cell.run(&[]);
    // Two files say that they are tue's; one says nothing.
    assert_eq!(states(&ended), ["done mon", "failed tue", "done wed"]);
    ended.expect(
        1,
        &["a2.mcap, a4.mcap all state", "l2.mcap is no session: it has no metadata record"],
    );
    let rows = cell.table("stations", "wed").rows();
    assert_eq!(rows, 12);
}
