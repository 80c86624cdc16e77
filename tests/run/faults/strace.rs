//! `posegrid run` under `strace`, which puts a fault into a system call that it counts; the program knows nothing of it.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::process::ExitStatusExt as _;
use std::process::{Command, Output};

use crate::faults::{Trial, small, text};

/// System calls that change what is on the disk.
const WRITING: [&str; 13] = [
    "write",
    "pwrite64",
    "fsync",
    "fdatasync",
    "rename",
    "linkat",
    "unlink",
    "mkdir",
    "flock",
    "renameat",
    "renameat2",
    "unlinkat",
    "mkdirat",
];
/// System calls on the way there: while files are opened, read and left, and while the stages take memory.
const ON_THE_WAY: [&str; 7] = ["openat", "read", "pread64", "close", "statx", "lseek", "mprotect"];

/// A system call, counted from 1 in the thread that makes most of them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Call {
    /// Its name.
    pub name: String,
    /// Its number.
    pub number: usize,
}

/// How a run under a fault ended.
#[derive(Debug)]
pub struct Faulted {
    /// Its exit code, if it was not ended by a signal.
    pub code: Option<i32>,
    /// The signal that ended it.
    pub signal: Option<i32>,
    /// Its results and messages.
    pub told: String,
}

/// Whether `strace` can be used here; said loudly where it cannot, and a failure where `CI` is set.
pub fn is_there() -> bool {
    let probe = Command::new("strace").args(["-f", "-o", "/dev/null", "true"]).output();
    if probe.is_ok_and(|probe| probe.status.success()) {
        return true;
    }
    assert!(std::env::var_os("CI").is_none(), "strace is absent or may not trace: CI must have it");
    eprintln!(
        "SKIPPED: strace is absent or may not trace, so this test has shown nothing (apt-get install strace)"
    );
    false
}

impl Call {
    /// The fault as `strace` takes it.
    fn inject(&self, fault: &str) -> String {
        format!("inject={}:{fault}:when={}", self.name, self.number)
    }
}

/// A run into the trial's lake, with a fault (`signal=KILL`, `error=ENOSPC`) at a system call.
pub fn run(trial: &Trial, call: &Call, fault: &str) -> Faulted {
    let mut command = strace(&[&format!("trace={}", call.name), &call.inject(fault)], "/dev/null");
    Faulted::from(posegrid(&mut command, trial).output().expect("started"))
}

/// `strace` with these expressions, to which a command is to be added. Its own words go to a file.
pub fn strace(expressions: &[&str], to: &str) -> Command {
    let mut command = Command::new("strace");
    command.args(["-f", "-y", "-qq", "-o", to]);
    for expression in expressions {
        command.args(["-e", expression]);
    }
    command
}

/// Adds a run into the trial's lake, on one thread so that calls have the same numbers each time.
pub fn posegrid<'c>(command: &'c mut Command, trial: &Trial) -> &'c mut Command {
    command
        .arg(env!("CARGO_BIN_EXE_posegrid"))
        .arg("run")
        .arg(small().pipeline())
        .args(["--lake", text(&trial.lake())])
        .env("RAYON_NUM_THREADS", "1")
        .env("RUST_LOG", "error")
}

impl From<Output> for Faulted {
    fn from(output: Output) -> Self {
        let told = [output.stdout, output.stderr].concat();
        Self {
            code: output.status.code(),
            signal: output.status.signal(),
            told: String::from_utf8_lossy(&told).into_owned(),
        }
    }
}

/// The calls of an undisturbed run that write, and a number of those on the way.
pub fn calls() -> (Vec<Call>, Vec<Call>) {
    numbered(|_| 1)
}

/// Those that one thread alone makes. A call of which two threads make so many is met by the fault twice, and a second signal
/// is another thing than a first.
pub fn calls_of_one_thread() -> (Vec<Call>, Vec<Call>) {
    numbered(|made| made.by_next + 1)
}

/// The calls that write and those on the way, of each name from a number on.
fn numbered(from: impl Fn(&Made) -> usize) -> (Vec<Call>, Vec<Call>) {
    let counts = counted();
    let of = |names: &[&str]| {
        let counted = names.iter().filter_map(|name| counts.get_key_value(*name));
        let numbered = |(name, made): (&String, &Made)| {
            let name = name.clone();
            (from(made)..=made.by_most).map(move |number| Call { name: name.clone(), number })
        };
        counted.flat_map(numbered).collect()
    };
    (of(&WRITING), of(&ON_THE_WAY))
}

/// How often a system call is made by the thread that makes most of it, and by the next.
#[derive(Debug, Clone, Copy, Default)]
struct Made {
    by_most: usize,
    by_next: usize,
}

/// How often each system call is made.
fn counted() -> BTreeMap<String, Made> {
    let trial = Trial::new();
    let trace = trial.folder.path().join("trace");
    let names = [&WRITING[..], &ON_THE_WAY[..]].concat().join(",?");
    let mut command = strace(&[&format!("trace=?{names}")], text(&trace));
    let output = posegrid(&mut command, &trial).output().expect("started");
    assert_eq!(output.status.code(), Some(crate::faults::UNDISTURBED));
    let mut by_thread: BTreeMap<(String, String), usize> = BTreeMap::new();
    for line in fs::read_to_string(&trace).expect("a trace").lines() {
        let called = line.split_once(' ').and_then(|(thread, rest)| {
            let (name, _) = rest.trim_start().split_once('(')?;
            Some((name.to_owned(), thread.to_owned()))
        });
        // A call that another thread interrupted is told twice, the second time as `<... NAME resumed>`.
        if let Some(called) = called.filter(|(name, _)| !name.starts_with('<')) {
            *by_thread.entry(called).or_default() += 1;
        }
    }
    let mut counts: BTreeMap<String, Made> = BTreeMap::new();
    for ((name, _), count) in by_thread {
        let made = counts.entry(name).or_default();
        let next = count.min(made.by_most).max(made.by_next);
        *made = Made { by_most: count.max(made.by_most), by_next: next };
    }
    counts
}

/// `count` of the calls, evenly spread over them.
pub fn spread(calls: &[Call], count: usize) -> Vec<Call> {
    let count = count.min(calls.len());
    (0..count).map(|i| calls[i * calls.len() / count].clone()).collect()
}
