//! stdout or stderr that refuses what is written: without messages work goes on, and results that reach nobody are told by the
//! exit code. Each call of `write` in turn is refused in `tests/run/faults/unwritable.rs`.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use super::cell::{Cell, alone, in_time, undisturbed};
use super::planned::planning;

/// How a command ends that SIGPIPE would have ended.
const READER_GONE: i32 = 141;
/// What is told of results that cannot be written.
const REFUSED: &str = "cannot write the results to stdout: ";

/// Where a stream of a command leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stream {
    /// To us.
    Read,
    /// To a disk without room.
    Full,
    /// To a reader that has gone away.
    Gone,
    /// To a file that is not open for writing.
    ReadOnly,
}

impl Stream {
    fn open(self) -> Stdio {
        match self {
            Self::Read => Stdio::piped(),
            Self::Full => {
                Stdio::from(File::options().write(true).open("/dev/full").expect("Linux"))
            }
            Self::Gone => Stdio::from(io::pipe().expect("a pipe").1),
            Self::ReadOnly => Stdio::from(File::open("/dev/null").expect("Linux")),
        }
    }
}

/// How a command ended, and what could be read of it.
#[derive(Debug, PartialEq, Eq)]
struct Told {
    code: Option<i32>,
    results: String,
    messages: String,
}

impl From<Output> for Told {
    fn from(output: Output) -> Self {
        let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
        Self {
            code: output.status.code(),
            results: text(output.stdout),
            messages: text(output.stderr),
        }
    }
}

fn posegrid(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_posegrid"));
    command.args(arguments).env_remove("RUST_LOG");
    command
}

/// Runs a command to its end with its streams leading there.
fn told(command: &mut Command, results: Stream, messages: Stream) -> Told {
    let command = command.stdin(Stdio::null());
    let started = command.stdout(results.open()).stderr(messages.open()).spawn();
    Told::from(in_time(started.expect("started")))
}

/// Asserts what has to hold of a command that changes nothing, whatever its streams refuse. One that tells results is to
/// tell some.
fn holds(arguments: &[&str], has_results: bool) {
    use Stream::{Full, Gone, Read, ReadOnly};
    let usual = told(&mut posegrid(arguments), Read, Read);
    assert_eq!(usual.results.is_empty(), !has_results, "{arguments:?}: {usual:?}");
    for messages in [Full, Gone, ReadOnly] {
        for format in ["text", "json"] {
            let mut command = posegrid(arguments);
            let found = told(command.args(["--log-format", format]), Read, messages);
            let what = format!("{arguments:?}, {format} to {messages:?}");
            assert_eq!(found.code, usual.code, "{what}");
            assert_eq!(found.results, usual.results, "{what}");
        }
    }
    if !has_results {
        return;
    }
    let of_run = arguments[0] == "run" && !arguments.contains(&"--dry-run");
    for (results, words) in [(Full, "No space left"), (ReadOnly, "Bad file descriptor")] {
        let refused = told(&mut posegrid(arguments), results, Read);
        assert_eq!(refused.code, Some(1), "{arguments:?}: {refused:?}");
        for text in [REFUSED, words] {
            assert!(refused.messages.contains(text), "{arguments:?}: {refused:?}");
        }
        assert_eq!(refused.messages.matches(REFUSED).count(), 1, "{refused:?}");
        assert!(!refused.messages.contains("panicked"), "{refused:?}");
        let both = told(&mut posegrid(arguments), results, Full);
        assert_eq!(both.code, Some(1), "{arguments:?}");
    }
    let left = told(&mut posegrid(arguments), Gone, Read);
    let code = match arguments[0] {
        _ if of_run => usual.code,
        "verify" => Some(READER_GONE),
        _ => Some(0),
    };
    assert_eq!(left.code, code, "{arguments:?}: {left:?}");
    // What it said before there were results it says still, and not a word more.
    assert!(usual.messages.starts_with(&left.messages), "{left:?}");
    assert_eq!(told(&mut posegrid(arguments), Gone, Gone).code, code);
}

fn text(path: &Path) -> String {
    path.to_str().expect("UTF-8").to_owned()
}

/// The undisturbed cell: its pipeline file, its lake, and one of its logs.
fn places() -> [String; 3] {
    let cell = undisturbed();
    let log = cell.session("mon").join("controller.mcap");
    [cell.pipeline(), cell.path("lake"), log].map(|path| text(&path))
}

#[test]
fn what_reads_logs_and_pipeline_files_goes_on_without_messages_and_tells_lost_results() {
    let [pipeline, _, log] = places();
    holds(&["schema"], true);
    holds(&["schema", "stations", "--format", "json"], true);
    holds(&["check", &pipeline], true);
    holds(&["inspect", &log], true);
    holds(&["inspect", &log, "no-such.mcap", &log], true);
    holds(&["run", &pipeline, "--dry-run"], true);
    holds(&["run", &pipeline], true);
    holds(&["run", "no-such.toml"], false);
}

#[test]
fn what_reads_a_lake_goes_on_without_messages_and_tells_lost_results() {
    let [_, lake, _] = places();
    holds(&["verify", &lake], true);
    holds(&["verify", "no-such-lake"], false);
    holds(&["history", &lake], true);
    let nodes = text(&alone("compensation"));
    let arm = text(&alone("calibrations"));
    holds(&["export", &nodes, "--format", "csv"], true);
    // Its last line is not ended.
    holds(&["export", &arm, "--format", "urdf"], true);
    let targets = text(&undisturbed().path("a-target.csv"));
    fs::write(&targets, "target,x_mm,y_mm,z_mm\na,1500,0,1000\n").expect("writable");
    holds(&["compensate", &nodes, &targets], true);
}

#[test]
fn a_plan_is_there_whether_or_not_it_can_be_told() {
    let cell = planning().with("# of the past", "session = \"mon\"");
    let cell = cell.with("poses = [12]", "poses = [5]");
    let pipeline = text(&cell.pipeline());
    let made = told(&mut posegrid(&["plan", &pipeline]), Stream::Full, Stream::Gone);
    assert_eq!(made.code, Some(1));
    let again = told(&mut posegrid(&["plan", &pipeline]), Stream::Read, Stream::Read);
    assert!(again.results.contains("the lake has this plan already"), "{again:?}");
    holds(&["plan", &pipeline], true);
}

#[test]
fn help_and_version_are_results_and_an_error_of_usage_is_a_message() {
    for arguments in [&["--help"][..], &["--version"], &["run", "--help"]] {
        let mut command = posegrid(arguments);
        assert_eq!(told(&mut command, Stream::Read, Stream::Full).code, Some(0));
        let refused = told(&mut command, Stream::Full, Stream::Read);
        assert_eq!(refused.code, Some(1), "{arguments:?}: {refused:?}");
        assert!(refused.messages.contains(REFUSED), "{refused:?}");
        let left = told(&mut command, Stream::Gone, Stream::Read);
        assert_eq!((left.code, left.messages.as_str()), (Some(0), ""));
    }
    for refusing in [Stream::Full, Stream::Gone] {
        assert_eq!(told(&mut posegrid(&["nonsense"]), refusing, refusing).code, Some(2));
    }
}

#[test]
fn a_choice_of_messages_that_cannot_be_read_is_reported_where_that_is_possible() {
    let mut command = posegrid(&["schema"]);
    command.env("RUST_LOG", "posegrid=loudly");
    let read = told(&mut command, Stream::Read, Stream::Read);
    assert_eq!(read.code, Some(0));
    assert!(read.messages.contains("RUST_LOG=\"posegrid=loudly\" has no effect"), "{read:?}");
    assert_eq!(told(&mut command, Stream::Read, Stream::Full).results, read.results);
}

/// The undisturbed lake without its second session.
fn of_monday() -> BTreeMap<String, Vec<u8>> {
    let mut lake = undisturbed().lake();
    lake.retain(|path, _| path.contains("/mon/"));
    lake
}

#[test]
fn a_night_without_messages_and_results_is_published_all_the_same() {
    let ends = [
        (Stream::Read, Stream::Full, 0),
        (Stream::Gone, Stream::Gone, 0),
        (Stream::Full, Stream::Full, 1),
    ];
    for (place, (results, messages, code)) in ends.into_iter().enumerate() {
        let cell = Cell::new().with_quickstart("mon");
        let format = ["text", "json"][place % 2];
        let pipeline = text(&cell.pipeline());
        let mut command = posegrid(&["--log-format", format, "run", &pipeline]);
        let ended = told(&mut command, results, messages);
        assert_eq!(ended.code, Some(code), "{results:?}, {messages:?}: {ended:?}");
        assert!(cell.lake() == of_monday(), "{results:?}, {messages:?}");
    }
}

#[test]
fn a_night_whose_words_found_no_room_says_that_its_work_stands() {
    let cell = Cell::new().with_quickstart("mon");
    let pipeline = text(&cell.pipeline());
    let full = told(&mut posegrid(&["run", &pipeline]), Stream::Full, Stream::Read);
    assert_eq!(full.code, Some(1), "{full:?}");
    assert!(full.messages.contains("the published files are complete"), "{full:?}");
    assert!(cell.lake() == of_monday());
    cell.run(&[]).expect(0, &["done-before  mon"]);
}

#[test]
fn closed_streams_change_nothing() {
    let [pipeline, lake, _] = places();
    for arguments in [["run", &pipeline], ["check", &pipeline], ["verify", &lake]] {
        let usual = told(&mut posegrid(&arguments), Stream::Read, Stream::Read);
        let mut closed = Command::new("sh");
        closed.args(["-c", "exec \"$@\" 2>&-", "sh"]);
        closed.arg(env!("CARGO_BIN_EXE_posegrid")).args(arguments);
        let found = told(&mut closed, Stream::Read, Stream::Read);
        assert_eq!((found.code, found.results), (usual.code, usual.results));
    }
}

#[test]
fn a_file_that_may_not_grow_refuses_and_does_not_kill() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("results");
    let mut limited = Command::new("sh");
    limited.args(["-c", "ulimit -f 0; exec \"$@\"", "sh"]);
    limited.arg(env!("CARGO_BIN_EXE_posegrid")).arg("schema");
    let child =
        limited.stdout(File::create(&file).expect("writable")).stderr(Stdio::piped()).spawn();
    let found = Told::from(in_time(child.expect("started")));
    assert_eq!(found.code, Some(1), "{found:?}");
    assert!(found.messages.contains("File too large"), "{found:?}");
    // The same for messages: what is told is told.
    let mut limited = Command::new("sh");
    limited.args(["-c", "ulimit -f 0; exec \"$@\"", "sh"]);
    limited.arg(env!("CARGO_BIN_EXE_posegrid")).arg("schema");
    let child = limited
        .env("RUST_LOG", "posegrid=loudly")
        .stdout(Stdio::piped())
        .stderr(File::create(&file).expect("writable"))
        .spawn();
    let found = Told::from(in_time(child.expect("started")));
    assert_eq!(found.code, Some(0), "{found:?}");
    assert!(found.results.contains("stations"), "{found:?}");
}

#[test]
fn made_files_are_there_whether_or_not_that_can_be_told() {
    let lake = text(&undisturbed().path("lake"));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let trend = text(&folder.path().join("trend"));
    let history = ["history", &lake, "--output", &trend];
    assert_eq!(told(&mut posegrid(&history), Stream::Full, Stream::Full).code, Some(1));
    let names = ["history.parquet", "drift.parquet", "kr210-demo.html"];
    assert!(names.iter().all(|name| Path::new(&trend).join(name).exists()));
    let session = text(&folder.path().join("session"));
    let simulate = ["simulate", "pipelines/robots/kr210-r2700-extra.toml", "--out", &session];
    let poses = ["--home", "0,-75,100,25,55,-15", "--random", "3"];
    let mut command = posegrid(&[&simulate[..], &poses[..]].concat());
    assert_eq!(told(&mut command, Stream::Full, Stream::Full).code, Some(1));
    assert!(Path::new(&session).join("truth.json").exists());
}
