//! Joint states that stream into dwells: what is found and accounted for has to be, bit for bit, what the whole log gives,
//! and the table of samples written meanwhile byte for byte.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use mcap::{Compression, WriteOptions};
use posegrid::ingest::{JointSamples, Recording};
use posegrid::io::log::{Limits, LogError, SessionLogs, SessionRead, read_dwells, read_session};
use posegrid::join::JoinSettings;
use posegrid::join::rest::{Rest, at_rest};
use posegrid::progress::{Progress, Quiet};

use crate::build::{Cdr, Folder, Log, mapping};
use crate::tables;

/// 2 ms apart, 200 s: far more samples than are held back or looked at before the first is judged.
const SAMPLES: usize = 100_000;
/// A rest of 0.6 s and a move of 0.4 s, in samples.
const PERIOD: usize = 500;
const REST: usize = 300;

/// One joint state: stamp, angles.
type State = (i64, [f64; 2]);
/// A command, or a reading with an orientation: stamp, position, quaternion.
type Pose = (i64, [f64; 7]);

fn states() -> Vec<State> {
    let angle = |i: usize| {
        let (station, within) = (i / PERIOD, i % PERIOD);
        let share = within.saturating_sub(REST) as f64 / (PERIOD - REST) as f64;
        let noise = ((i * 7919) % 1009) as f64 * 1e-8;
        (station as f64 + share * share * (3.0 - 2.0 * share)) * 0.02 + noise
    };
    let stamp = |i: usize| 100_000_000_000 + i64::try_from(i).expect("few") * 2_000_000;
    (0..SAMPLES)
        .map(|i| (stamp(i), [angle(i), -0.5 * angle(i)]))
        .collect()
}

/// A log of these joint states, with one command and one reading.
fn log(states: &[State]) -> Vec<u8> {
    let reading = [(states[0].0, [3.0, 0.0, 4.0])];
    log_with(states, &[command(states)], "PointStamped", &reading)
}

fn command(states: &[State]) -> Pose {
    (states[0].0, [0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 1.0])
}

/// The same with these commands and readings: stamps and the numbers behind them, one of each for each joint state as long
/// as there are some.
fn log_with<const N: usize>(
    states: &[State],
    commands: &[Pose],
    reading_type: &str,
    readings: &[(i64, [f64; N])],
) -> Vec<u8> {
    let options = WriteOptions::new()
        .compression(Some(Compression::Zstd))
        .chunk_size(Some(100_000));
    let mut log = Log::with(options);
    let joints = log.channel("/joints", "JointState");
    let command = log.channel("/command", "PoseStamped");
    let reading = log.channel("/reading", reading_type);
    let (mut commands, mut readings) = (commands.iter(), readings.iter());
    for (place, (stamp, angles)) in (0..).zip(states) {
        if let Some((stamp, numbers)) = commands.next() {
            let message = Cdr::stamped(*stamp).numbers(numbers).done();
            log.write(command, place, &message);
        }
        if let Some((stamp, numbers)) = readings.next() {
            let message = Cdr::stamped(*stamp).numbers(numbers).done();
            log.write(reading, place, &message);
        }
        let message = Cdr::stamped(*stamp).joints(&["a", "b"], angles).done();
        log.write(joints, place, &message);
    }
    log.done()
}

/// Counts how often a file is begun.
#[derive(Default)]
struct Begun(AtomicUsize);

impl Progress for Begun {
    fn begin(&self, _: &str, _: u64) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
    fn advance(&self, _: u64) {}
    fn end(&self) {}
}

fn whole(logs: &SessionLogs, limits: Limits) -> Result<(Recording, Rest), LogError> {
    let mut recording = read_session(logs, &mapping(), limits, &Quiet)?;
    let JointSamples { stamps, angles } = std::mem::take(&mut recording.joints);
    let stamps_ns: Vec<i64> = stamps.iter().map(|stamp| stamp.ns()).collect();
    let rest = at_rest(
        &stamps_ns,
        angles.all(),
        angles.joints(),
        &JoinSettings::default().arm_rule(),
    );
    Ok((recording, rest))
}

/// The same with commands and readings in memory.
fn in_memory(read: SessionRead) -> (Recording, Rest) {
    let mut recording = read.recording;
    let readings = read.readings.read(0..read.readings.count());
    recording.readings = readings.expect("put aside before");
    let commands = read.commands.read(0..read.commands.count());
    recording.commands = commands.expect("put aside before");
    (recording, read.joints)
}

/// Reads a session while its samples are let go, and holds that against the whole of it in memory.
pub fn streamed_as_whole(
    logs: &SessionLogs,
    limits: Limits,
    progress: &dyn Progress,
) -> Result<(Recording, Rest), LogError> {
    let rule = JoinSettings::default().arm_rule();
    let streamed = read_dwells(logs, &mapping(), limits, &rule, progress).map(in_memory);
    assert_eq!(
        format!("{streamed:?}"),
        format!("{:?}", whole(logs, limits))
    );
    streamed
}

/// Reads both ways, compares, and tells how many files were begun and how many dwells found.
fn both_ways(parts: &[PathBuf]) -> (usize, usize) {
    let logs = SessionLogs {
        controller: parts.to_vec(),
        tracker: parts.to_vec(),
    };
    let begun = Begun::default();
    let streamed = streamed_as_whole(&logs, Limits::default(), &begun);
    tables::same_both_ways(&logs, &mapping());
    let dwells = streamed.map_or(0, |(_, rest)| rest.stretches.len());
    (begun.0.into_inner(), dwells)
}

fn one_file(states: &[State]) -> (usize, usize) {
    let folder = Folder::new();
    both_ways(&[folder.file("log.mcap", &log(states))])
}

const DWELLS: usize = SAMPLES / PERIOD;

#[test]
fn a_sound_log_is_read_once() {
    assert_eq!(one_file(&states()), (1, DWELLS));
}

#[test]
fn disorder_within_reach_repeats_and_angles_that_are_none_change_nothing() {
    let mut states = states();
    // Blocks of 97 backwards, a stretch of 3000 samples 5000 places late, stamps twice, angles that are no numbers.
    states[10_000..30_000]
        .chunks_mut(97)
        .for_each(<[State]>::reverse);
    states[40_000..48_000].rotate_left(3000);
    for place in (55_000..60_000).step_by(10) {
        states[place].0 = states[place - 1].0;
    }
    for place in [7, 20_000, 99_999] {
        states[place].1[1] = f64::NAN;
    }
    assert_eq!(one_file(&states), (1, DWELLS));
}

#[test]
fn a_clock_that_goes_back_far_is_read_as_a_whole() {
    let mut states = states();
    // 80 s back, over what was rest and motion.
    for state in &mut states[70_000..] {
        state.0 -= 80_000_000_000;
    }
    let (begun, dwells) = one_file(&states);
    assert_eq!(begun, 2);
    assert!(dwells > 0);
}

#[test]
fn breaks_dropped_samples_and_a_changing_rate_are_the_same_both_ways() {
    let mut states = states();
    for state in &mut states[33_333..] {
        state.0 += 5_000_000_000;
    }
    let mut place = 0;
    states.retain(|_| {
        place += 1;
        place % 7 != 0 && (place < 80_000 || place % 10 == 0)
    });
    let (begun, dwells) = one_file(&states);
    assert_eq!(begun, 1);
    assert!(dwells > DWELLS / 2, "{dwells}");
}

#[test]
fn few_samples_and_none_that_can_be_used() {
    for count in [1, 2, 3, 40, 700] {
        assert_eq!(one_file(&states()[..count]).0, 1, "{count}");
    }
    let mut unset = states()[..50].to_vec();
    for state in &mut unset {
        state.0 = 0;
    }
    assert_eq!(one_file(&unset), (2, 0)); // read again, for the error
    let mut none = states()[..50].to_vec();
    for state in &mut none {
        state.1[0] = f64::INFINITY;
    }
    assert_eq!(one_file(&none), (2, 0));
}

#[test]
fn a_split_recording_streams_if_its_parts_are_given_in_order() {
    let states = states();
    let folder = Folder::new();
    // Cut within a dwell; the parts overlap by 40 samples.
    let (first, second) = (&states[..50_120], &states[50_080..]);
    let parts = [
        folder.file("0.mcap", &log(first)),
        folder.file("1.mcap", &log(second)),
    ];
    assert_eq!(both_ways(&parts), (2, DWELLS));
    let backwards = parts.map(|path| Path::new(&path).to_owned());
    let backwards: Vec<_> = backwards.into_iter().rev().collect();
    assert_eq!(both_ways(&backwards), (4, DWELLS));
}

/// 5 ms apart.
fn poses() -> Vec<Pose> {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let reading = |i: i32| {
        let stamp = 7_000_000_000 + i64::from(i) * 5_000_000;
        let x = f64::from(i) / 3.0;
        (stamp, [x, -x, 4.0, half, 0.0, 0.0, half])
    };
    (0..60_000).map(reading).collect()
}

fn with_readings(readings: &[Pose]) -> (usize, usize) {
    let folder = Folder::new();
    let states = states();
    let log = log_with(&states, &[command(&states)], "PoseStamped", readings);
    both_ways(&[folder.file("log.mcap", &log)])
}

fn with_commands(commands: &[Pose]) -> (usize, usize) {
    let folder = Folder::new();
    let states = states();
    let log = log_with(&states, commands, "PoseStamped", &[command(&states)]);
    both_ways(&[folder.file("log.mcap", &log)])
}

#[test]
fn poses_are_put_aside_in_order_whatever_is_wrong_with_some() {
    let mut poses = poses();
    poses[5_000..20_000].chunks_mut(89).for_each(<[_]>::reverse);
    poses[30_000..38_000].rotate_left(2000);
    for place in (40_000..45_000).step_by(10) {
        poses[place].0 = poses[place - 1].0;
    }
    poses[9].1[2] = f64::NAN;
    poses[10].1[5] = f64::INFINITY;
    poses[11].1[3..].fill(0.0); // a zero quaternion
    poses[12].1.fill(0.0); // a missing reflector
    poses[50_000].1[6] = 2.0; // not of unit length
    assert_eq!(with_readings(&poses), (1, DWELLS));
    assert_eq!(with_commands(&poses), (1, DWELLS));
}

#[test]
fn poses_far_out_of_order_and_none_that_can_be_used_are_read_as_a_whole() {
    let mut late = poses();
    late.rotate_left(20_000);
    assert_eq!(with_readings(&late), (2, DWELLS));
    assert_eq!(with_commands(&late), (2, DWELLS));
    let mut none = poses();
    none.truncate(100);
    for pose in &mut none {
        pose.1[0] = f64::NAN;
    }
    assert_eq!(with_readings(&none), (2, 0)); // read again, for the error
    assert_eq!(with_commands(&none), (2, 0));
}
