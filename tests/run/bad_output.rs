//! Lakes that cannot be written to: told with the path and what to try, and nothing half done is taken for a run.
//!
//! Tests may run as root, whom no permission stops: a mount in a name space of its own makes the folder.

use std::path::Path;
use std::process::Command;

use super::cell::{Cell, Ended};

/// Whether this machine lets us mount; said loudly where it does not, and a failure where `CI` is set.
fn mounting_is_allowed() -> bool {
    let probe = Command::new("unshare").args(["-rm", "true"]).output();
    if probe.is_ok_and(|probe| probe.status.success()) {
        return true;
    }
    assert!(std::env::var_os("CI").is_none(), "unshare -rm is refused: CI must allow it");
    eprintln!("SKIPPED: unshare -rm is refused, so this test has shown nothing");
    false
}

/// Runs the cell's pipeline with a small file system, of these options, as its lake; lists what it left there.
fn run_on(cell: &Cell, options: &str) -> Ended {
    let lake = cell.path("lake");
    std::fs::create_dir(&lake).expect("writable");
    let script = "mount -t tmpfs -o \"$1\" none \"$2\" && \"$3\" run \"$4\"; code=$?; find \"$2\" -type f; exit $code";
    let output = Command::new("unshare")
        .args(["-rm", "sh", "-c", script, "sh", options])
        .args([lake.as_path(), Path::new(env!("CARGO_BIN_EXE_posegrid"))])
        .arg(cell.pipeline())
        .output();
    Ended::from(output.expect("started"))
}

fn small() -> Cell {
    Cell::new().with_simulated("mon", &["--random", "12"])
}

#[test]
fn a_read_only_lake_is_reported() {
    if !mounting_is_allowed() {
        return;
    }
    let cell = small();
    let ended = run_on(&cell, "ro,size=1m");
    let lake = cell.path("lake").display().to_string();
    ended.expect(1, &["mon: no result", &lake, "Read-only file system"]);
}

#[test]
fn a_full_lake_is_reported_and_holds_no_run() {
    if !mounting_is_allowed() {
        return;
    }
    let cell = small();
    // Some tables fit and some do not.
    let ended = run_on(&cell, "size=64k");
    let lake = cell.path("lake").display().to_string();
    ended.expect(1, &["mon: no result", &lake, "No space left on device"]);
    assert!(!ended.results.contains("lake/runs/"), "{}", ended.results);
    assert!(!ended.results.contains(".tmp-"), "{}", ended.results);
}
