//! Killed (SIGKILL) as a system call begins.

use std::collections::BTreeMap;

use crate::faults::strace::{self, Call};
use crate::faults::{Trial, lake};

/// Kills a run there and asserts what has to hold afterwards; gives whether it came to that.
fn killed(call: &Call) -> bool {
    let trial = Trial::new();
    let ended = strace::run(&trial, call, "signal=KILL");
    let what = format!("killed at {} number {}", call.name, call.number);
    let killed = ended.signal == Some(9);
    assert!(killed || ended.code == Some(crate::faults::UNDISTURBED), "{what}: {ended:?}");
    lake::check(&trial.lake(), &what);
    trial.recovers(&what);
    killed
}

#[test]
fn a_run_killed_at_any_of_a_few_calls_is_finished_by_the_next_one() {
    if !strace::is_there() {
        return;
    }
    let (writing, on_the_way) = strace::calls();
    let few = [strace::spread(&writing, 8), strace::spread(&on_the_way, 2)].concat();
    let link = writing.iter().filter(|call| call.name == "linkat").cloned();
    let few: Vec<Call> = few.into_iter().chain(link).collect();
    assert!(few.iter().filter(|call| killed(call)).count() >= 10);
}

#[test]
#[ignore = "minutes: every write of a run; see .github/CONTRIBUTING.md"]
fn a_run_killed_at_any_call_is_finished_by_the_next_one() {
    if !strace::is_there() {
        return;
    }
    let (writing, on_the_way) = strace::calls();
    let all = [writing, strace::spread(&on_the_way, 200)].concat();
    let mut tried: BTreeMap<&str, usize> = BTreeMap::new();
    for call in &all {
        *tried.entry(&call.name).or_default() += usize::from(killed(call));
    }
    let count: usize = tried.values().sum();
    println!("{count} kill points of {} calls: {tried:?}", all.len());
    assert!(count >= 200, "{tried:?}");
}
