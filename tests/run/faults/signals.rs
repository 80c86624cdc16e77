//! Asked to end by a signal, at moments that system calls tell; once, and twice.

use crate::faults::strace::{self, Call};
use crate::faults::{Trial, UNDISTURBED, lake};

/// Sends the signal there, and asserts that the run ended cleanly; gives its exit code, or -1 where it had not begun.
fn ended_by(signal: &str, code: i32, call: &Call) -> i32 {
    let trial = Trial::new();
    let ended = strace::run(&trial, call, &format!("signal={signal}"));
    let what = format!("{signal} at {} number {}", call.name, call.number);
    let runs = lake::check(&trial.lake(), &what);
    let Some(found) = ended.code else {
        assert!(
            !trial.lake().exists(),
            "before the lake is opened, a signal has its usual effect: {what}"
        );
        return -1;
    };
    if found == code {
        let line = ["stopped      mon: ", "not-started  mon: "];
        assert!(line.iter().any(|line| ended.told.contains(line)), "{what}: {}", ended.told);
        assert!(ended.told.contains("1 stopped"), "{what}: {}", ended.told);
        assert_eq!(runs, 0, "{what}");
    } else {
        // It came when the result was there and being written: that is finished.
        assert_eq!((found, runs), (UNDISTURBED, 1), "{what}: {}", ended.told);
    }
    assert!(lake::temporaries(&trial.lake()).is_empty(), "{what}: leftovers");
    trial.recovers(&what);
    found
}

/// After the lock is taken, which the handlers were there before.
fn call(name: &str, number: usize) -> Call {
    let name = name.to_owned();
    Call { name, number }
}

#[test]
fn a_run_that_is_asked_to_end_does_so_and_leaves_nothing_half_done() {
    if !strace::is_there() {
        return;
    }
    // As the lake is locked, as samples are written while logs are read, as the session as joined is written and committed, as the
    // estimate is committed, as the first table of the result is written, and as the run is committed.
    assert_eq!(ended_by("INT", 130, &call("flock", 1)), 130);
    assert_eq!(ended_by("TERM", 143, &call("flock", 1)), 143);
    assert_eq!(ended_by("TERM", 143, &call("fsync", 1)), 143);
    assert_eq!(ended_by("TERM", 143, &call("fsync", 2)), 143);
    assert_eq!(ended_by("INT", 130, &call("linkat", 1)), 130);
    assert_eq!(ended_by("INT", 130, &call("linkat", 2)), 130);
    assert_eq!(ended_by("TERM", 143, &call("fsync", 10)), UNDISTURBED);
    assert_eq!(ended_by("INT", 130, &call("linkat", 3)), UNDISTURBED);
    // As files are opened, logs among them, and as the stages take memory.
    let (_, on_the_way) = strace::calls_of_one_thread();
    let opened =
        on_the_way.into_iter().filter(|call| ["openat", "mprotect"].contains(&call.name.as_str()));
    let moments = strace::spread(&opened.collect::<Vec<_>>(), 8);
    let codes: Vec<i32> = moments.iter().map(|call| ended_by("TERM", 143, call)).collect();
    assert!(codes.contains(&143), "{codes:?} at {moments:?}");
}

#[test]
fn a_second_signal_is_the_end() {
    if !strace::is_there() {
        return;
    }
    let trial = Trial::new();
    // As the folder of the first table is brought to the disk, and as the second table is.
    let inject = "inject=fsync:signal=INT:when=2..3";
    let mut command = strace::strace(&["trace=fsync", inject], "/dev/null");
    let ended = strace::posegrid(&mut command, &trial).output().expect("started");
    let ended = strace::Faulted::from(ended);
    assert_eq!((ended.code, ended.signal), (None, Some(2)), "{}", ended.told);
    assert_eq!(lake::temporaries(&trial.lake()).len(), 1, "it was being written");
    trial.recovers("ended at once");
}

#[test]
#[ignore = "minutes: both signals at many calls; see .github/CONTRIBUTING.md"]
fn a_run_that_is_asked_to_end_at_any_call_does_so() {
    if !strace::is_there() {
        return;
    }
    let (writing, on_the_way) = strace::calls_of_one_thread();
    let calls = [strace::spread(&writing, 40), strace::spread(&on_the_way, 60)].concat();
    let mut stopped = 0;
    for (place, call) in calls.iter().enumerate() {
        let (signal, code) = [("INT", 130), ("TERM", 143)][place % 2];
        stopped += usize::from(ended_by(signal, code, call) == code);
    }
    println!("{} signals, {stopped} of them ended the run before its result", calls.len());
}
