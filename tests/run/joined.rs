//! Sessions as joined: published by themselves, and what later runs start from.

use std::fs;

use super::cell::{Cell, ended, posegrid, published, undisturbed};
use super::same_work::assert_same;

/// Asserts that ingest and join first, then the estimate, its grids, and the rest from all of them without any of the sessions' files, give the same bytes as all at once; `code` is the
/// exit code of both.
pub fn assert_two_steps_as_one(cell: &Cell, code: i32) {
    let at_once = cell.path("at-once").to_string_lossy().into_owned();
    let stepwise = cell.path("stepwise").to_string_lossy().into_owned();
    cell.run(&["--lake", &at_once]).expect(code, &[]);
    let first = cell.run(&["--lake", &stepwise, "--until", "session"]);
    first.expect(0, &[" sessions as joined: "]);
    fs::rename(cell.path("sessions"), cell.path("archived")).expect("writable");
    let estimated = cell.run(&["--lake", &stepwise, "--from", "estimate", "--until", "estimate"]);
    estimated.expect(0, &[" estimates: "]);
    let gridded = cell.run(&["--lake", &stepwise, "--from", "table", "--until", "table"]);
    gridded.expect(0, &[" grids: "]);
    let then = cell.run(&["--lake", &stepwise, "--from", "report"]);
    fs::rename(cell.path("archived"), cell.path("sessions")).expect("writable");
    then.expect(code, &[]);
    let (once, steps) = (published(at_once.as_ref()), published(stepwise.as_ref()));
    assert!(once.keys().any(|path| path.starts_with("runs/")));
    assert_same(&steps, &once);
}

#[test]
fn a_run_from_sessions_as_joined_has_the_bytes_of_one_from_logs() {
    let cell = Cell::new().with_quickstart("mon");
    let joined = cell.run(&["--until", "session"]);
    joined.expect(0, &["joined       mon: ", "1 of 1 sessions as joined: 1 now, 0 before"]);
    let files: Vec<String> = cell.lake().into_keys().collect();
    assert_eq!(files.len(), 2, "{files:?}");
    cell.run(&["--until", "session"]).expect(0, &["done-before  mon: ", "0 now, 1 before"]);
    // Without any log.
    fs::remove_dir_all(cell.path("sessions")).expect("writable");
    cell.run(&["--from", "estimate"]).expect(0, &["1 of 1 within 0.5 mm"]);
    let mut expected = undisturbed().lake();
    expected.retain(|path, _| path.contains("/mon/"));
    assert_same(&cell.lake(), &expected);
    // What comes after the join may change; what comes before may not.
    let cell = cell.with("mm = 0.5", "mm = 0.4");
    cell.run(&["--from", "estimate"]).expect(0, &["1 of 1 within 0.4 mm"]);
    let cell = cell.with("[tolerance]", "[join]\nmin_readings = 4\n\n[tolerance]");
    cell.run(&["--from", "estimate"])
        .expect(2, &["mon", "of other settings of ingest and join", "run it from its files"]);
}

#[test]
fn the_whole_is_not_left_to_what_is_there_as_joined() {
    let cell = Cell::new().with_quickstart("mon");
    cell.run(&["--from", "estimate"]).expect(2, &["no session to learn from", "joined_sessions"]);
    cell.run(&["--until", "session"]).expect(0, &[]);
    cell.run(&["tue", "--from", "estimate"])
        .expect(2, &["tue", "the lake does not have it as joined"]);
    let cell = cell.with("lake = \"lake\"", "lake = \"lake\"\nlogs = true");
    cell.run(&["--from", "estimate"]).expect(2, &["[output] logs", "reads none"]);
}

#[test]
fn readings_that_were_changed_are_read_from_the_logs_again_or_refused() {
    let cell = Cell::new().with_quickstart("mon");
    cell.run(&["--until", "session"]).expect(0, &[]);
    let readings = cell.table_file("readings", "mon");
    let mut bytes = fs::read(&readings).expect("written");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&readings, &bytes).expect("writable");
    let lake = cell.path("lake").to_string_lossy().into_owned();
    ended(posegrid().args(["verify", &lake])).expect(3, &["mon session as joined", "1 changed"]);
    cell.run(&["--from", "estimate"])
        .expect(1, &["mon", "the session as joined", "cannot be used"]);
    cell.run(&[]).expect(0, &["1 of 1 within 0.5 mm", "it is made again"]);
}

#[test]
fn sessions_as_joined_are_verified_by_themselves() {
    let cell = undisturbed();
    let lake = cell.path("lake").to_string_lossy().into_owned();
    ended(posegrid().args(["verify", &lake, "mon"])).expect(
        0,
        &["sessions as joined: 1 in the lake, 1 as written, 0 changed; 0 joined anew and the same"],
    );
    let pipeline = cell.pipeline().to_string_lossy().into_owned();
    ended(posegrid().args(["verify", &lake, "mon", "--pipeline", &pipeline])).expect(
        0,
        &["sessions as joined: 1 in the lake, 1 as written, 0 changed; 1 joined anew and the same"],
    );
}

#[test]
fn a_session_whose_name_begins_anothers_path_has_one_result_in_a_pool_and_alone() {
    let flags = ["--random", "40"];
    let cell = Cell::new()
        .with(
            "# sessions",
            "sessions_by = \"metadata\"\ncontroller = \"*controller.mcap\"\ntracker = \"*tracker.mcap\"\npool = \"all\"",
        )
        .with_simulated("a", &flags)
        .with_simulated("a/b", &flags);
    for side in ["controller.mcap", "tracker.mcap"] {
        for (session, to) in [("a/b", "second"), ("a", "first")] {
            let from = cell.session(session).join(side);
            let to = cell.path(&format!("sessions/{to}_{side}"));
            fs::rename(from, to).expect("writable");
        }
    }
    let first = cell.run(&[]);
    first.expect(first.code, &["done", "pooled"]);
    cell.run(&["--until", "session"])
        .expect(0, &["done-before  a: ", "done-before  a/b: ", "0 now, 2 before"]);
    // The pool from what the lake has of them is the same work.
    fs::remove_dir_all(cell.path("sessions")).expect("writable");
    let before = cell.lake();
    cell.run(&["--from", "table"]).expect(first.code, &["done-before  pooled"]);
    assert_same(&cell.lake(), &before);
}
