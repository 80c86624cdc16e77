//! stdout or stderr that refuses one of its writes, or that and all after it: each write in turn, with each of the answers
//! that a full disk, a reader that has gone away and a broken device give.
//!
//! Whatever stderr refuses, the command does what it always does. What stdout refuses is exit code 1, or 0 (`verify`: 141) where the reader
//! has gone; of `run` the work is done all the same.

use std::fs::{self, File};

use crate::cell::{Cell, in_time};
use crate::faults::{Trial, UNDISTURBED, new, small, strace, text};

/// What `write` answers.
const ERRORS: [&str; 3] = ["ENOSPC", "EPIPE", "EIO"];
/// How a command other than `run` ends whose reader has gone away.
const READER_GONE: i32 = 141;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stream {
    Results,
    Messages,
}

/// How a command ended, and what reached the files that its streams are.
#[derive(Debug)]
struct Told {
    code: Option<i32>,
    results: String,
    messages: String,
}

/// A fault at writes to a stream.
#[derive(Debug, Clone)]
struct Fault {
    stream: Stream,
    error: &'static str,
    /// Which writes, counted from 1: `2` or, with all after it, `2+`.
    when: String,
}

impl Trial {
    /// Runs a command with its streams as files here. Of its system calls `strace` sees only the writes to one of them, and does
    /// with those what the expressions say.
    fn told(&self, arguments: &[&str], stream: Stream, expressions: &[&str]) -> Told {
        let streams = ["results", "messages"].map(|name| self.folder.path().join(name));
        let [results, messages] =
            streams.each_ref().map(|path| File::create(path).expect("writable"));
        let calls = self.folder.path().join("calls");
        let mut command = strace::strace(&[&["trace=write"], expressions].concat(), text(&calls));
        command.args(["-P", text(&streams[stream as usize])]);
        command.arg(env!("CARGO_BIN_EXE_posegrid")).args(arguments);
        command.env("RAYON_NUM_THREADS", "1").env_remove("RUST_LOG");
        let started = command.stdout(results).stderr(messages).spawn();
        let code = in_time(started.expect("started")).status.code();
        let [results, messages] = streams.map(|path| fs::read_to_string(path).expect("UTF-8"));
        Told { code, results, messages }
    }

    /// How often a command writes to a stream.
    fn writes(&self, arguments: &[&str], stream: Stream) -> usize {
        self.told(arguments, stream, &[]);
        let calls = fs::read_to_string(self.folder.path().join("calls"));
        // A call that another thread interrupts stands on two lines, of which the second says `resumed`.
        let calls = calls.expect("a trace");
        calls.lines().filter(|line| line.contains("write(")).count()
    }
}

/// Asserts what has to hold of a command when a write is refused, against how it ends undisturbed.
fn refused(trial: &Trial, arguments: &[&str], usual: &Told, fault: &Fault) {
    let Fault { stream, error, when } = fault;
    let inject = format!("inject=write:error={error}:when={when}");
    let found = trial.told(arguments, *stream, &[&inject]);
    let what = format!("{fault:?} {arguments:?}: {found:?}");
    let is_run = arguments[0] == "run";
    assert!(!found.messages.contains("panicked"), "{what}");
    if *stream == Stream::Messages {
        assert_eq!(found.code, usual.code, "{what}");
        // A run says where its lake is.
        assert!(is_run || found.results == usual.results, "{what}");
        return;
    }
    let code = match (*error, is_run) {
        ("EPIPE", true) => usual.code,
        ("EPIPE", false) if arguments[0] == "verify" => Some(READER_GONE),
        ("EPIPE", false) => Some(0),
        _ => Some(1),
    };
    let is_told = found.messages.contains("cannot write the results to stdout");
    assert_eq!((found.code, is_told), (code, *error != "EPIPE"), "{what}");
}

/// Every fault at a number of writes to either stream.
fn faults(writes: impl Fn(Stream) -> usize) -> Vec<Fault> {
    let mut faults = Vec::new();
    for stream in [Stream::Results, Stream::Messages] {
        for number in 1..=writes(stream) {
            for when in [number.to_string(), format!("{number}+")] {
                faults.extend(ERRORS.map(|error| Fault { stream, error, when: when.clone() }));
            }
        }
    }
    faults
}

/// Refuses every write of a command that changes nothing; gives how many that were.
fn every_write_refused(arguments: &[&str]) -> usize {
    let trial = Trial::new();
    let usual = trial.told(arguments, Stream::Results, &[]);
    let faults = faults(|stream| trial.writes(arguments, stream));
    for fault in &faults {
        refused(&trial, arguments, &usual, fault);
    }
    assert!(!faults.is_empty(), "{arguments:?} tells nothing");
    faults.len()
}

/// The small cell with what a run has something to say of: folders that are no session.
fn talkative() -> Cell {
    let cell = new();
    for name in ["notes", "old"] {
        let folder = cell.session(name);
        fs::create_dir(&folder).expect("writable");
        fs::write(folder.join("readme.txt"), "nothing to measure").expect("writable");
    }
    cell
}

/// Refuses a write of a run into a lake of its own, which has to be what it always is.
fn run_refused(cell: &Cell, usual: &Told, fault: &Fault) {
    let trial = Trial::new();
    let (pipeline, lake) = (cell.pipeline(), trial.lake());
    let arguments = ["run", text(&pipeline), "--lake", text(&lake)];
    refused(&trial, &arguments, usual, fault);
    trial.is_undisturbed(&format!("{fault:?}"));
}

/// How the run ends undisturbed, and every fault that its writes can meet.
fn of_run(cell: &Cell) -> (Told, Vec<Fault>) {
    let writes = |stream| {
        let trial = Trial::new();
        let (pipeline, lake) = (cell.pipeline(), trial.lake());
        trial.writes(&["run", text(&pipeline), "--lake", text(&lake)], stream)
    };
    let trial = Trial::new();
    let (pipeline, lake) = (cell.pipeline(), trial.lake());
    let arguments = ["run", text(&pipeline), "--lake", text(&lake)];
    let usual = trial.told(&arguments, Stream::Results, &[]);
    assert_eq!(usual.code, Some(UNDISTURBED), "{usual:?}");
    (usual, faults(writes))
}

#[test]
fn every_write_of_what_a_reader_of_logs_and_lakes_tells_may_be_refused() {
    if !strace::is_there() {
        return;
    }
    // One of its own, as history keeps in it what it judged.
    let trial = Trial::new();
    let (lake, session) = (trial.lake(), small().session("mon"));
    let made = small().run(&["--lake", text(&lake)]);
    made.expect(UNDISTURBED, &[]);
    every_write_refused(&["verify", text(&lake)]);
    every_write_refused(&["inspect", text(&session), "no-such.mcap"]);
    every_write_refused(&["history", text(&lake)]);
}

#[test]
fn a_run_of_which_no_word_can_be_written_publishes_what_it_always_does() {
    if !strace::is_there() {
        return;
    }
    let cell = talkative();
    let (usual, faults) = of_run(&cell);
    assert!(faults.len() > 12, "it is to have something to say: {usual:?}");
    let first = |stream, error| {
        let mut found = faults.iter();
        found.find(|fault| (fault.stream, fault.error) == (stream, error) && fault.when == "1+")
    };
    for (stream, error) in [
        (Stream::Messages, "ENOSPC"),
        (Stream::Messages, "EPIPE"),
        (Stream::Results, "EIO"),
        (Stream::Results, "EPIPE"),
    ] {
        run_refused(&cell, &usual, first(stream, error).expect("among all"));
    }
}

#[test]
#[ignore = "minutes: every write of a run, a plain one and a recomputing one; see .github/CONTRIBUTING.md"]
fn every_write_of_what_a_run_tells_may_be_refused() {
    if !strace::is_there() {
        return;
    }
    let cell = talkative();
    let (usual, faults) = of_run(&cell);
    for fault in &faults {
        run_refused(&cell, &usual, fault);
    }
    let (lake, pipeline) = (small().path("lake"), small().pipeline());
    let verify = ["verify", text(&lake), "--pipeline", text(&pipeline)];
    let count = faults.len() + every_write_refused(&verify);
    println!("{count} writes refused");
}
