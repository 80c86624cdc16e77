//! Work that was done before is known without its logs: a second run opens none of them, until one changes or the index is gone.

use std::fs;
use std::io::{Seek as _, SeekFrom, Write as _};
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

use crate::cell::{Cell, posegrid};
use crate::faults::{UNDISTURBED, new, strace, text};

/// Longer than a file that changed is taken to change again at a time that is stated alike.
const SETTLED: Duration = Duration::from_millis(2200);

/// Runs the cell's pipeline; gives what it told, and how often it opened a log.
fn run(cell: &Cell) -> (String, usize) {
    run_with(cell, &[])
}

fn run_with(cell: &Cell, arguments: &[&str]) -> (String, usize) {
    let trace = cell.path("trace");
    let mut command = strace::strace(&["trace=openat"], text(&trace));
    let output = command
        .arg(env!("CARGO_BIN_EXE_posegrid"))
        .arg("run")
        .arg(cell.pipeline())
        .args(arguments)
        .output()
        .expect("started");
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    let trace = fs::read_to_string(trace).expect("a trace");
    assert_eq!(output.status.code(), Some(UNDISTURBED), "{told}");
    let opened = trace.lines().filter(|line| line.contains(".mcap\""));
    (told, opened.count())
}

/// Changes one byte of a file where it stands, and sets its time back.
fn change(path: &Path) {
    let modified = path.metadata().and_then(|own| own.modified());
    let file = fs::File::options().write(true).open(path);
    let mut file = file.expect("a log");
    // The last byte of the magic at the end: the log is damaged from now on, which is another input.
    file.seek(SeekFrom::End(-1)).expect("within the file");
    file.write_all(b"x").expect("writable");
    file.set_modified(modified.expect("known")).expect("writable");
}

#[test]
fn a_second_run_opens_no_log_until_one_changes() {
    if !strace::is_there() {
        return;
    }
    // Logs of an hour ago: of later ones the end is looked at, as they may still be written.
    let cell = new().with_log("mon", "controller.mcap", |bytes| bytes).with_log(
        "mon",
        "tracker.mcap",
        |bytes| bytes,
    );
    sleep(SETTLED);
    let index = cell.path("lake/.index/runs.jsonl.zst");
    let (first, opened) = run(&cell);
    assert!(first.contains("1 done, 0 done before") && opened > 0, "{first}");
    assert!(index.exists());
    let (second, opened) = run(&cell);
    assert!(second.contains("0 done, 1 done before"), "{second}");
    assert_eq!(opened, 0, "{second}");
    fs::remove_file(&index).expect("there");
    let (digested, opened) = run(&cell);
    assert_eq!(digested, second, "the index says what the lake says");
    assert!(opened > 0);
    assert_eq!(run(&cell), (second.clone(), 0), "it is made again");
    fs::write(&index, "{}\n").expect("writable");
    assert_eq!(run(&cell).0, second, "a damaged one is not used");
    let lake = cell.path("lake").to_string_lossy().into_owned();
    let verified = posegrid().args(["verify", &lake]).output();
    let verified = verified.expect("started");
    let told = String::from_utf8_lossy(&verified.stdout).into_owned();
    assert!(told.contains("7 the lake's own"), "{told}");
    assert!(run_with(&cell, &["--fresh"]).1 > 0, "as it was asked to");
    change(&cell.session("mon").join("tracker.mcap"));
    sleep(SETTLED);
    let (changed, opened) = run(&cell);
    assert!(changed.contains("1 done, 0 done before") && opened > 0, "{changed}");
}
