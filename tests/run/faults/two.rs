//! Two batches at once on one lake: with its lock one works, without a lock both do, and the lake is the same.

use std::fs;
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::Duration;

use crate::faults::strace::{self, Faulted};
use crate::faults::{Trial, UNDISTURBED, lake, small, text};

fn started(trial: &Trial, expressions: &[&str]) -> Child {
    let mut command = strace::strace(expressions, "/dev/null");
    let command = strace::posegrid(&mut command, trial);
    let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().expect("started")
}

fn ended(child: Child) -> Faulted {
    Faulted::from(child.wait_with_output().expect("our own child"))
}

#[test]
fn a_second_batch_is_reported_of_the_first_and_may_wait_for_it() {
    if !strace::is_there() {
        return;
    }
    let trial = Trial::new();
    // The first batch takes two seconds over its first table, in microseconds.
    let slow = "inject=fsync:delay_enter=2000000:when=1";
    let first = started(&trial, &["trace=fsync", slow]);
    let lock = trial.lake().join(".lock");
    while fs::read(&lock).unwrap_or_default().is_empty() {
        sleep(Duration::from_millis(5));
    }
    let words = fs::read_to_string(&lock).expect("signed");
    let second = small().run(&["--lake", text(&trial.lake())]);
    second.expect(1, &["another batch works on this lake", &words, "--wait"]);
    assert!(second.results.is_empty(), "{}", second.results);
    let waiting = small().run(&["--lake", text(&trial.lake()), "--wait"]);
    waiting.expect(UNDISTURBED, &["waiting for its end", "done-before  mon"]);
    let first = ended(first);
    assert_eq!(first.code, Some(UNDISTURBED), "{}", first.told);
    trial.is_undisturbed("one after the other");
}

/// Two batches where the file system refuses locks; each waits as long before its N-th call, so they meet there.
fn without_a_lock(at: &str) {
    let trial = Trial::new();
    let refused = "inject=flock:error=ENOLCK";
    let slow = format!("inject={at}:delay_enter=400000:when=1");
    let trace = format!("trace=flock,{at}");
    let both = [(); 2].map(|()| started(&trial, &[&trace, refused, &slow]));
    for one in both.map(ended) {
        assert_eq!(one.code, Some(UNDISTURBED), "{at}: {}", one.told);
        assert!(!one.told.contains("panicked"), "{}", one.told);
    }
    assert_eq!(lake::check(&trial.lake(), at), 1);
    trial.is_undisturbed(at);
}

#[test]
fn without_locks_two_batches_do_the_same_work_and_one_commits() {
    if strace::is_there() {
        without_a_lock("linkat");
    }
}

#[test]
#[ignore = "a minute: twenty races; see .github/CONTRIBUTING.md"]
fn without_locks_two_batches_race_twenty_times() {
    if strace::is_there() {
        for round in 0..20 {
            without_a_lock(["linkat", "rename", "fsync", "mkdir"][round % 4]);
        }
    }
}
