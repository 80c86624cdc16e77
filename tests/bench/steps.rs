//! The steps of ingest, each in a process of its own: fresh memory, and a peak that is nobody else's.

use std::fs;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread;
use std::time::Instant;

use posegrid::files::memory::keep_what_is_freed;
use posegrid::io::inspect::inspect;
use posegrid::io::lake::Lake;
use posegrid::io::log::{JointSink, Limits, SessionLogs, SessionRead, read_session};
use posegrid::io::tables::logs::LogTable;
use posegrid::join::JoinSettings;
use posegrid::manifest::RunKey;
use posegrid::progress::Quiet;

use super::{cpu_seconds, decompress, mapping, median, write_log};

/// Before the name of a step, the log and a folder: run only that.
pub const FLAG: &str = "--step";
/// How often the steps are run on the shortest log; medians are printed, of the ratios too.
const ROUNDS: usize = 5;
/// Joint states between two arrivals, and those of them in motion: a move of 0.8 s, then 1.2 s of rest.
const PERIOD: u64 = 1000;
const MOVE: u64 = 400;

/// Its name, and what it does with a log and a folder: how many messages or rows it went through.
type Step = (&'static str, fn(&Path, &Path) -> u64);
/// The first is the floor. The second tells what the machine makes of the same work where all cores are busy, as they are in
/// the steps behind it.
const STEPS: [Step; 5] = [
    ("zstd decompression alone", |log, _| decompress(log, 1)),
    ("the same on all cores", |log, _| {
        let cores = thread::available_parallelism().map_or(1, NonZero::get);
        decompress(log, cores)
    }),
    ("streaming into dwells and readings", |log, _| dwells(log)),
    ("the whole path to Parquet log tables", tables),
    ("inspect", |log, _| {
        inspect(log, Limits::default(), &Quiet).expect("a sound log").read_summary.messages
    }),
];

/// What one step took.
#[derive(Debug, Clone, Copy)]
struct Taken {
    user_s: f64,
    system_s: f64,
    wall_s: f64,
    peak_mb: f64,
}

/// Measures all steps on logs of so many joint states.
pub fn measure_all(folder: &Path, lengths: &[u64]) {
    let always_moving = |i: u64| i as f64 * 1e-4;
    measure_on("always moving", always_moving, folder, &lengths[..1]);
    measure_on("from rest to rest", rest_to_rest, folder, lengths);
}

fn measure_on(name: &str, motion: fn(u64) -> f64, folder: &Path, lengths: &[u64]) {
    let logs = lengths.iter().map(|&joint_states| {
        let path = folder.join(format!("{joint_states}.mcap"));
        write_log(&path, joint_states, motion);
        let stored = fs::metadata(&path).expect("just written").len() as f64 / 1e6;
        let messages = joint_states + joint_states / 10;
        println!("{name}: {messages} messages, {stored:.1} MB stored");
        path
    });
    let logs: Vec<PathBuf> = logs.collect();
    let title = "    user   system  wall s   ratio peak MB";
    println!("{:<38}{}", "", title.repeat(logs.len()));
    // Round after round over all steps: the machine's own pace changes from minute to minute.
    let of = |step, log| in_own_process(step, log, folder);
    let rounds: Vec<Vec<_>> = logs
        .iter()
        .enumerate()
        .map(|(place, log)| {
            let rounds = 0..if place == 0 { ROUNDS } else { 1 };
            rounds.map(|_| STEPS.map(|(step, _)| of(step, log))).collect()
        })
        .collect();
    for (index, (step, _)) in STEPS.iter().enumerate() {
        print!("{step:<38}");
        for rounds in &rounds {
            let of = |number: fn(&Taken) -> f64| median(rounds.iter().map(|r| number(&r[index])));
            let ratio = median(rounds.iter().map(|r| r[index].user_s / r[0].user_s));
            let user = of(|taken| taken.user_s);
            let system = of(|taken| taken.system_s);
            let wall = of(|taken| taken.wall_s);
            let peak = of(|taken| taken.peak_mb);
            print!("{user:>8.2} {system:>8.2} {wall:>7.2} {ratio:>7.2} {peak:>7.0}");
        }
        println!();
    }
}

/// Minimum jerk from station to station, 0.1 rad apart.
fn rest_to_rest(i: u64) -> f64 {
    let (station, within) = (i / PERIOD, i % PERIOD);
    let share = within.min(MOVE) as f64 / MOVE as f64;
    let moved = share.powi(3) * (10.0 - 15.0 * share + 6.0 * share * share);
    (station as f64 + moved) * 0.1
}

fn in_own_process(step: &str, log: &Path, folder: &Path) -> Taken {
    let program = std::env::current_exe().expect("this program");
    let output = Command::new(program)
        .args([FLAG, step])
        .args([log, folder])
        .output()
        .expect("this program again");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let numbers: Vec<f64> = said.split_whitespace().flat_map(str::parse).collect();
    let [user_s, system_s, wall_s, peak_mb] = numbers[..] else {
        panic!("{step}: {}", String::from_utf8_lossy(&output.stderr));
    };
    Taken { user_s, system_s, wall_s, peak_mb }
}

/// Runs one step and prints what it took.
pub fn run_alone(args: &[String]) {
    let [name, log, folder] = args else {
        panic!("a step, a log and a folder, not {args:?}");
    };
    let known = STEPS.iter().find(|(step, _)| step == name);
    let (_, step) = known.expect("the name of a step");
    keep_what_is_freed();
    let (start, (user, system)) = (Instant::now(), cpu_seconds());
    let result = step(Path::new(log), Path::new(folder));
    let (wall, after) = (start.elapsed().as_secs_f64(), cpu_seconds());
    assert!(result > 0, "{name} did something");
    println!("{} {} {wall} {}", after.0 - user, after.1 - system, peak_memory_mb());
}

/// Reads a log that holds both sides; its joint samples go to `sink` too.
fn read(log: &Path, sink: &mut dyn JointSink) -> SessionRead {
    let logs = SessionLogs::of_two(log, log);
    let (rule, limits) = (JoinSettings::default().arm_rule(), Limits::default());
    let read = read_session(&logs, &mapping(), limits, &rule, sink, &Quiet);
    read.expect("a sound log")
}

fn dwells(log: &Path) -> u64 {
    let read = read(log, &mut ());
    let samples = read.input.joints.samples as u64;
    assert_eq!(read.counts["joints.kept"], samples);
    samples
}

/// From the log to the Parquet table of its samples on disk, and to dwells, as `posegrid run` does it.
fn tables(log: &Path, folder: &Path) -> u64 {
    let lake = new_lake(folder);
    let key = RunKey::new("robot", "session", "0123456789abcdef0123456789abcdef");
    let mut run = lake.start(&key).expect("a lake").expect("a new run");
    let mut table = LogTable::new(&run, "session");
    let read = read(log, &mut table);
    let table = table.finish(&read.input).expect("space on disk");
    run.keep(table.expect("many samples"));
    run.publish_kept().expect("a new run");
    let kept = ["joints.kept", "commands.kept", "readings.kept"].map(|kept| read.counts[kept]);
    let rows = run.written()[0].rows;
    assert_eq!(rows, kept.iter().sum::<u64>(), "every sample is a row");
    rows
}

/// It is removed with the folder, when nothing is timed any more.
fn new_lake(folder: &Path) -> Lake {
    let lake = tempfile::tempdir_in(folder).expect("a temporary folder");
    Lake::new(lake.keep())
}

fn peak_memory_mb() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    peak.and_then(|peak| peak.split_whitespace().next()?.parse::<u64>().ok()).unwrap_or(0) / 1024
}
