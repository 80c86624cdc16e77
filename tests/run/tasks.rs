//! Tasks: listed without a log, done in any order and more than once, with the bytes of a batch.

use std::fs;
use std::thread::{self, sleep};
use std::time::Duration;

use serde_json::Value;

use super::cell::{Cell, Ended, ended, ended_with, posegrid, undisturbed};
use super::same_work::assert_same;

/// Longer than a file that changed is taken to change again at a time that is stated alike.
const SETTLED: Duration = Duration::from_millis(2200);

/// The tasks that are listed.
fn listed(cell: &Cell) -> Vec<String> {
    let listed = ended(posegrid().arg("tasks").arg(cell.pipeline()));
    listed.expect(0, &[]);
    listed.results.lines().map(str::to_owned).collect()
}

/// Does a task that comes on standard input.
fn done(cell: &Cell, task: &str) -> Ended {
    ended_with(posegrid().arg("task").arg(cell.pipeline()), &(task.to_owned() + "\n"))
}

fn value(line: &str) -> Value {
    serde_json::from_str(line).expect("a line of JSON")
}

#[test]
fn tasks_in_any_order_and_twice_at_once_give_the_lake_of_a_batch() {
    let cell = Cell::new().with_quickstart("mon").with_quickstart("tue");
    sleep(SETTLED);
    let tasks = listed(&cell);
    let [mon, tue] = &tasks[..] else {
        panic!("{tasks:?}");
    };
    assert_eq!(value(mon)["session"], "mon");
    assert_eq!(value(tue)["learns_from"][0], "tue");
    assert!(value(mon)["bytes"].as_u64() > Some(100_000), "{mon}");
    let twice = thread::scope(|scope| {
        let both = [tue, tue].map(|task| scope.spawn(|| done(&cell, task)));
        both.map(|own| own.join().expect("it ends"))
    });
    for ended in &twice {
        ended.expect(0, &["\"met\":true", "\"session\":\"tue\""]);
    }
    // What it is expected to take follows from the runs in the lake by then.
    let left: Vec<Value> = listed(&cell).iter().map(|own| value(own)["id"].clone()).collect();
    assert_eq!(left, [value(mon)["id"].clone()], "one is left");
    done(&cell, mon).expect(0, &["\"ended\":\"done\""]);
    done(&cell, mon).expect(0, &["\"ended\":\"done-before\""]);
    assert!(listed(&cell).is_empty());
    let mut found = cell.lake();
    found.retain(|path, _| !path.starts_with(".index/"));
    assert_same(&found, &undisturbed().lake());
    // A batch takes it from there.
    cell.run(&[]).expect(0, &["0 done, 2 done before"]);
}

#[test]
fn a_task_that_cannot_be_done_says_whether_to_do_it_again() {
    let cell = Cell::new().with_quickstart("mon");
    let log = cell.session("mon").join("tracker.mcap");
    fs::copy(cell.session("mon").join("controller.mcap"), &log).expect("writable");
    sleep(SETTLED);
    let task = listed(&cell).remove(0);
    done(&cell, &task).expect(1, &["\"ended\":\"failed\"", "\"session\":\"mon\""]);
    // Inputs that changed are another task.
    fs::copy("tests/recordings/quickstart/tracker.mcap", &log).expect("writable");
    sleep(SETTLED);
    done(&cell, &task).expect(1, &["there is no such work: files or settings changed"]);
    let task = listed(&cell).remove(0);
    // The lake's place is a file: nothing is wrong with the data.
    fs::write(cell.path("no-lake"), "").expect("writable");
    let id = value(&task)["id"].as_str().expect("a text").to_owned();
    let lake = cell.path("no-lake").to_string_lossy().into_owned();
    let to = ["--id", &id, "--lake", &lake];
    ended(posegrid().arg("task").arg(cell.pipeline()).args(to)).expect(75, &[]);
    for wrong in ["", "{}", "mon"] {
        done(&cell, wrong).expect(2, &["standard input has no task"]);
    }
    let robot = ["--id", &id, "--robot", "kr210-demo"];
    ended(posegrid().arg("task").arg(cell.pipeline()).args(robot))
        .expect(0, &["\"ended\":\"done\""]);
}

#[test]
fn a_session_that_changed_just_now_is_a_task_and_says_what_the_next_may_take() {
    let cell = Cell::new().with_quickstart("mon");
    let first = listed(&cell).remove(0);
    assert_eq!((value(&first)["expected_mb"].as_f64(), listed(&cell).len()), (Some(600.0), 1));
    done(&cell, &first).expect(0, &["\"ended\":\"done\""]);
    let cell = cell.with_quickstart("tue");
    let [second] = &listed(&cell)[..] else {
        panic!("mon is done, and tue is not");
    };
    assert!(value(second)["expected_s"].as_f64() < value(&first)["expected_s"].as_f64());
}
