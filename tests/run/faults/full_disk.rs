//! No space left: as the answer to one write, and on a disk that is really full.

use std::path::Path;
use std::process::Command;

use crate::faults::strace::{self, Call};
use crate::faults::{Trial, UNDISTURBED, cell::Ended, lake, small, text};

/// What a full disk can refuse.
const NEEDING_ROOM: [&str; 5] = ["write", "fsync", "rename", "linkat", "mkdir"];

/// Refuses a call, and asserts what has to hold afterwards.
fn refused(call: &Call) {
    let trial = Trial::new();
    let ended = strace::run(&trial, call, "error=ENOSPC");
    let what = format!("no space at {} number {}", call.name, call.number);
    assert!(!ended.told.contains("panicked"), "{what}: {}", ended.told);
    let runs = lake::check(&trial.lake(), &what);
    match ended.code {
        // The row in `runs` is there: nothing that was refused mattered.
        Some(UNDISTURBED) => assert_eq!(runs, 1, "{what}: {}", ended.told),
        Some(1) => {
            assert!(ended.told.contains("No space left on device"), "{what}: {}", ended.told);
        }
        code => panic!("{what}: exit code {code:?}: {}", ended.told),
    }
    assert!(lake::temporaries(&trial.lake()).is_empty(), "{what}: leftovers");
    trial.recovers(&what);
}

fn calls() -> Vec<Call> {
    let (writing, _) = strace::calls();
    let room = |call: &Call| NEEDING_ROOM.contains(&call.name.as_str());
    writing.into_iter().filter(room).collect()
}

#[test]
fn a_few_writes_that_find_no_space_are_reported_and_harm_nothing() {
    if strace::is_there() {
        strace::spread(&calls(), 5).iter().for_each(refused);
    }
}

#[test]
#[ignore = "minutes: every write of a run; see .github/CONTRIBUTING.md"]
fn any_write_that_finds_no_space_is_reported_and_harms_nothing() {
    if strace::is_there() {
        let calls = calls();
        calls.iter().for_each(refused);
        println!("{} writes refused", calls.len());
    }
}

/// Runs into a file system of so many KiB, then with room; what the lake is then goes to the trial's folder.
const SCRIPT: &str = "mount -t tmpfs -o size=\"$1\"k none \"$2\"; \"$3\" run \"$4\" --lake \"$2/lake\"; code=$?; \
    find \"$2/lake\" -name '.*.tmp-*' | grep . && exit 99; mount -o remount,size=64m \"$2\"; \
    \"$3\" run \"$4\" --lake \"$2/lake\" >\"$5/again\" 2>&1; again=$?; cp -r \"$2/lake\" \"$5\"; \
    echo \"full: $code, then: $again\"";

fn on_a_disk_of(kib: usize) {
    let trial = Trial::new();
    let disk = trial.folder.path().join("disk");
    std::fs::create_dir(&disk).expect("writable");
    let size = kib.to_string();
    let output = Command::new("unshare")
        .args(["-rm", "sh", "-c", SCRIPT, "sh", &size, text(&disk)])
        .arg(Path::new(env!("CARGO_BIN_EXE_posegrid")))
        .args([&small().pipeline(), &trial.folder.path().to_owned()])
        .output();
    let ended = Ended::from(output.expect("started"));
    let what = format!("a disk of {kib} KiB");
    // Too small for the lake: it fails, says so, and leaves nothing; with room it is what it always is.
    ended.expect(0, &["full: 1, then: 3", "No space left on device", "make room there"]);
    trial.is_undisturbed(&what);
}

fn mounting_is_allowed() -> bool {
    let probe = Command::new("unshare").args(["-rm", "true"]).output();
    let allowed = probe.is_ok_and(|probe| probe.status.success());
    assert!(
        allowed || std::env::var_os("CI").is_none(),
        "unshare -rm is refused: CI must allow it"
    );
    if !allowed {
        eprintln!("SKIPPED: unshare -rm is refused, so this test has shown nothing");
    }
    allowed
}

#[test]
fn a_run_on_a_full_disk_is_finished_when_there_is_room() {
    if mounting_is_allowed() {
        on_a_disk_of(100);
    }
}

#[test]
#[ignore = "a minute: full disks of many sizes; see .github/CONTRIBUTING.md"]
fn a_run_on_full_disks_of_many_sizes_is_finished_when_there_is_room() {
    if mounting_is_allowed() {
        // The lake takes some 600 KiB with its folders.
        (1..=24).for_each(|step| on_a_disk_of(20 * step));
    }
}
