//! Sessions that are read while their logs are decoded: samples, dwells, counts and the table written meanwhile have to be
//! those of what was written into the logs, whatever the order in which it stands there.

use std::convert::Infallible;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

use mcap::{Compression, WriteOptions};
use posegrid::ingest::PoseSamples;
use posegrid::io::log::{Limits, LogError, SessionLogs};
use posegrid::join::JoinSettings;
use posegrid::join::stationary::stationary_of;
use posegrid::progress::Progress;

use crate::build::{Cdr, Folder, Log, WholeSession, mapping, read_whole};
use crate::tables;

/// 2 ms apart, 200 s: far more samples than are buffered or looked at before the first is judged.
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
    (0..SAMPLES).map(|i| (stamp(i), [angle(i), -0.5 * angle(i)])).collect()
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
    let options =
        WriteOptions::new().compression(Some(Compression::Zstd)).chunk_size(Some(100_000));
    let mut log = Log::with(options);
    let joints = log.channel("/joints", "JointState");
    let command = log.channel("/command", "PoseStamped");
    let reading = log.channel("/reading", reading_type);
    let (mut commands, mut readings) = (commands.iter(), readings.iter());
    for (place, (stamp, angles)) in (0..).zip(states) {
        let recorded = 100_000_000_000 + place * 2_000_000;
        if let Some((stamp, numbers)) = commands.next() {
            let message = Cdr::stamped(*stamp).numbers(numbers).done();
            log.write(command, recorded, &message);
        }
        if let Some((stamp, numbers)) = readings.next() {
            let message = Cdr::stamped(*stamp).numbers(numbers).done();
            log.write(reading, recorded, &message);
        }
        let message = Cdr::stamped(*stamp).joints(&["a", "b"], angles).done();
        log.write(joints, recorded, &message);
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

/// Reads a session and checks what holds of any: messages are kept or rejected, each sample that is kept is there, in order
/// of time, and dwells are those of the detector when it sees all joint samples at once.
pub fn consistent(
    logs: &SessionLogs,
    limits: Limits,
    progress: &dyn Progress,
) -> Result<WholeSession, LogError> {
    let found = read_whole(logs, &mapping(), limits, progress)?;
    let stamps_ns: Vec<i64> = found.joints.stamps.iter().map(|stamp| stamp.ns()).collect();
    let angles = &found.joints.angles;
    let rule = JoinSettings::default().arm_rule();
    let dwells = stationary_of(angles.joints(), &rule, |finder| {
        finder.push(&stamps_ns, angles.all());
        Ok::<_, Infallible>(())
    });
    assert_eq!(found.dwells, dwells.expect("no error").0);
    assert_eq!(angles.len(), stamps_ns.len());
    check_counts(&found, "joints", &stamps_ns);
    check_counts(&found, "commands", &stamps_of(&found.commands));
    check_counts(&found, "readings", &stamps_of(&found.readings));
    Ok(found)
}

fn stamps_of<C: Copy>(poses: &PoseSamples<C>) -> Vec<i64> {
    poses.stamps.iter().map(|stamp| stamp.ns()).collect()
}

fn check_counts(found: &WholeSession, stream: &str, stamps_ns: &[i64]) {
    let count = |name: &str| found.counts.get(&format!("{stream}.{name}")).copied();
    let [messages, kept, rejected, repeated, held, equal_stamps] =
        ["messages", "kept", "rejected", "repeated", "held", "duplicate_stamps"]
            .map(|name| count(name).unwrap_or(0));
    assert_eq!(messages, kept + rejected + repeated + held, "{stream}");
    assert_eq!(kept, stamps_ns.len() as u64, "{stream}");
    assert!(stamps_ns.is_sorted(), "{stream}");
    let equal = stamps_ns.windows(2).filter(|pair| pair[0] == pair[1]);
    assert_eq!(equal_stamps, equal.count() as u64, "{stream}");
}

/// Reads the files, and writes the table of their samples; what was found, and how many files were begun.
fn read(parts: &[PathBuf]) -> (Result<WholeSession, LogError>, usize) {
    let logs = SessionLogs { controller: parts.to_vec(), tracker: parts.to_vec() };
    let begun = Begun::default();
    let found = consistent(&logs, Limits::default(), &begun);
    if found.is_ok() {
        tables::check_table(&logs, &mapping());
    }
    (found, begun.0.into_inner())
}

/// Joint states of files, one behind the other, as they have to come out: those that are numbers, by stamp; equal stamps
/// stay as they are, and what is there twice counts once. With them how often a stamp is before the one before it.
fn by_time(files: &[&[State]]) -> (Vec<State>, u64) {
    let all: Vec<State> = files.concat();
    let backward = all.windows(2).filter(|pair| pair[1].0 < pair[0].0).count();
    let numbers = all.into_iter().filter(|state| state.1.iter().all(|x| x.is_finite()));
    let mut kept: Vec<State> = numbers.collect();
    kept.sort_by_key(|state| state.0);
    kept.dedup();
    (kept, backward as u64)
}

/// Reads files with these joint states, the earliest file first; how many files were begun and how many dwells found.
fn check_joints(parts: &[PathBuf], states: &[&[State]]) -> (usize, usize) {
    let (found, begun) = read(parts);
    let found = found.expect("sound");
    let (expected, backward) = by_time(states);
    let joints = found.joints.stamps.iter().zip(found.joints.angles.rows());
    let joints: Vec<State> = joints.map(|(stamp, row)| (stamp.ns(), [row[0], row[1]])).collect();
    let apart = joints.iter().zip(&expected).position(|(own, other)| own != other);
    assert!(joints == expected, "{} of {}, from row {apart:?}", joints.len(), expected.len());
    assert_eq!(found.counts["joints.backward_stamps"], backward);
    (begun, found.dwells.stretches.len())
}

fn one_file(states: &[State]) -> (usize, usize) {
    let folder = Folder::new();
    check_joints(&[folder.file("log.mcap", &log(states))], &[states])
}

/// Why a file with these joint states cannot be used, and how often it was begun.
fn refused(states: &[State]) -> (String, usize) {
    let folder = Folder::new();
    let (found, begun) = read(&[folder.file("log.mcap", &log(states))]);
    (found.expect_err("of no use").to_string(), begun)
}

const DWELLS: usize = SAMPLES / PERIOD;

#[test]
fn a_sound_log_is_read_once() {
    assert_eq!(one_file(&states()), (1, DWELLS));
}

#[test]
fn disorder_within_reach_repeats_and_angles_that_are_none_change_nothing() {
    let mut states = states();
    // Blocks of 97 backwards, a stretch of 1500 samples 3000 places late, stamps twice, angles that are no numbers.
    states[10_000..30_000].chunks_mut(97).for_each(<[State]>::reverse);
    states[40_000..44_500].rotate_left(1500);
    for place in (55_000..60_000).step_by(10) {
        states[place].0 = states[place - 1].0;
    }
    for place in [7, 20_000, 99_999] {
        states[place].1[1] = f64::NAN;
    }
    assert_eq!(one_file(&states), (1, DWELLS));
}

#[test]
fn a_clock_that_goes_back_far_is_read_again() {
    let mut states = states();
    // 80 s back, over what was rest and motion.
    for state in &mut states[70_000..] {
        state.0 -= 80_000_000_000;
    }
    let folder = Folder::new();
    let (found, begun) = read(&[folder.file("log.mcap", &log(&states))]);
    let found = found.expect("sound");
    assert_eq!((begun, found.dwells.stretches.len()), (2, DWELLS));
    // The step is taken out: one sample's time is all that no stamp tells.
    for (own, (stamp, angles)) in found.joints.stamps.iter().zip(self::states()) {
        assert!((own.ns() - stamp).abs() <= 2_000_000, "{own:?}, {stamp} ns, {angles:?}");
    }
}

#[test]
fn readings_of_an_instrument_slower_than_its_stream_are_read_once() {
    let states = states();
    let held = |messages: usize| -> Vec<(i64, [f64; 3])> {
        let reading = |(place, (stamp, _)): (usize, &State)| {
            let first = place / messages * messages;
            let [a, b] = states[first].1;
            let noise = (first * first % 100_003 * 7919 % 1009) as f64 * 1e-4;
            (*stamp, [1000.0 * a + noise, 1000.0 * b, 500.0])
        };
        states.iter().enumerate().map(reading).collect()
    };
    for messages in [1, 2, 4, 5] {
        let readings = held(messages);
        let folder = Folder::new();
        let log = log_with(&states, &[command(&states)], "PointStamped", &readings);
        let (found, begun) = read(&[folder.file("log.mcap", &log)]);
        let found = found.expect("sound");
        assert_eq!(begun, if messages == 1 { 1 } else { 2 });
        let first: Vec<i64> = readings.iter().step_by(messages).map(|own| own.0).collect();
        assert_eq!(stamps_of(&found.readings), first, "{messages}");
        let left_out = readings.len() - first.len();
        assert_eq!(found.counts["readings.held"], left_out as u64);
        let told = found.rejects.iter().filter(|own| own.reason.contains("slower than its stream"));
        assert_eq!(told.count(), usize::from(messages > 1));
    }
}

#[test]
fn breaks_dropped_samples_and_a_changing_rate_change_nothing() {
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
    let (error, begun) = refused(&unset);
    assert!(error.contains("header stamp 0"), "{error}");
    assert_eq!(begun, 1);
    let mut none = states()[..50].to_vec();
    for state in &mut none {
        state.1[0] = f64::INFINITY;
    }
    let (error, begun) = refused(&none);
    assert!(
        error.contains("50 decoded, all rejected: a joint angle is not a finite number"),
        "{error}"
    );
    assert_eq!(begun, 1);
}

#[test]
fn a_split_recording_is_read_once_if_its_parts_are_given_in_order() {
    let states = states();
    let folder = Folder::new();
    // Cut within a dwell; the parts overlap by 40 samples.
    let (first, second) = (&states[..50_120], &states[50_080..]);
    let mut parts = [folder.file("0.mcap", &log(first)), folder.file("1.mcap", &log(second))];
    assert_eq!(check_joints(&parts, &[first, second]), (2, DWELLS));
    parts.reverse();
    assert_eq!(check_joints(&parts, &[first, second]), (4, DWELLS));
    // Parts that fit into the buffer are put in order there.
    let (first, second) = (&states[..7000], &states[7000..14_000]);
    let parts = [folder.file("3.mcap", &log(second)), folder.file("2.mcap", &log(first))];
    assert_eq!(check_joints(&parts, &[first, second]), (2, 28));
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

/// Poses as they have to come out: those that are numbers and have a rotation, or none because the reflector is missing, which some
/// instruments log as positions that are no numbers; by stamp, in mm, with unit quaternions. With them how many of these were none.
fn poses_by_time(poses: &[Pose], to_mm: f64) -> (Vec<Pose>, u64) {
    let missing = |numbers: &[f64; 7]| numbers.iter().all(|&x| x == 0.0);
    let mut poses = poses.to_vec();
    let are_readings = to_mm < 2.0;
    for (_, numbers) in poses.iter_mut().filter(|pose| are_readings && pose.1[2].is_nan()) {
        *numbers = [0.0; 7];
    }
    let usable = |(_, numbers): &&Pose| {
        let rotation = numbers[3..].iter().any(|&x| x != 0.0);
        numbers.iter().all(|x| x.is_finite()) && (rotation || missing(numbers))
    };
    let (mut kept, mut not_unit) = (Vec::new(), 0);
    for &(stamp, mut numbers) in poses.iter().filter(usable) {
        let norm = numbers[3..].iter().map(|x| x * x).sum::<f64>().sqrt();
        numbers[..3].iter_mut().for_each(|x| *x *= to_mm);
        if missing(&numbers) {
            numbers[6] = 1.0;
        } else {
            not_unit += u64::from((norm - 1.0).abs() > 1e-3);
            numbers[3..].iter_mut().for_each(|x| *x /= norm);
        }
        kept.push((stamp, numbers));
    }
    kept.sort_by_key(|pose| pose.0);
    (kept, not_unit)
}

fn check_poses<C: Copy>(found: &PoseSamples<C>, expected: &[Pose]) {
    let orientations = found.orientations.as_ref().expect("poses");
    assert_eq!(found.stamps.len(), expected.len());
    for (row, (stamp, numbers)) in expected.iter().enumerate() {
        assert_eq!(found.stamps[row].ns(), *stamp);
        let mut position = found.positions[row].iter().zip(&numbers[..3]);
        let same = |(found, expected): (&f64, &f64)| found.to_bits() == expected.to_bits();
        assert!(position.all(same), "row {row}");
        // The norm is rounded: of numbers below 1 by less than a few of the last place.
        let apart = orientations[row].iter().zip(&numbers[3..]);
        let apart = apart.map(|(found, expected)| (found - expected).abs());
        assert!(apart.fold(0.0, f64::max) < 1e-15, "row {row}");
    }
}

/// Reads a log with these poses as commands or as readings, and 100 000 joint states.
fn read_poses(commands: &[Pose], readings: &[Pose]) -> (Result<WholeSession, LogError>, usize) {
    let folder = Folder::new();
    let log = log_with(&states(), commands, "PoseStamped", readings);
    read(&[folder.file("log.mcap", &log)])
}

/// How many files were begun to read these poses, as readings (mm) and as commands (m).
fn check_as_both(poses: &[Pose]) -> [usize; 2] {
    let one = [command(&states())];
    let (found, begun_for_readings) = read_poses(&one, poses);
    let found = found.expect("sound");
    let (expected, not_unit) = poses_by_time(poses, 1.0);
    check_poses(&found.readings, &expected);
    assert_eq!(found.counts["readings.quaternions_not_unit"], not_unit);
    assert_eq!(found.dwells.stretches.len(), DWELLS);
    let (found, begun_for_commands) = read_poses(poses, &one);
    let found = found.expect("sound");
    let (expected, not_unit) = poses_by_time(poses, 1000.0);
    check_poses(&found.commands, &expected);
    assert_eq!(found.counts["commands.quaternions_not_unit"], not_unit);
    assert_eq!(found.dwells.stretches.len(), DWELLS);
    [begun_for_readings, begun_for_commands]
}

#[test]
fn poses_are_spilled_in_order_whatever_is_wrong_with_some() {
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
    assert_eq!(check_as_both(&poses), [1, 1]);
}

#[test]
fn poses_far_out_of_order_are_read_again() {
    let mut late = poses();
    late.rotate_left(2_000);
    assert_eq!(check_as_both(&late), [2, 2]);
}

#[test]
fn poses_of_which_none_can_be_used_are_refused() {
    let mut none = poses();
    none.truncate(100);
    for pose in &mut none {
        pose.1[0] = f64::INFINITY;
    }
    let one = [command(&states())];
    for (topic, (found, begun)) in
        [("/reading", read_poses(&one, &none)), ("/command", read_poses(&none, &one))]
    {
        let error = found.expect_err("of no use").to_string();
        let expected =
            format!("topic \"{topic}\" has no usable message: 100 decoded, all rejected");
        assert!(error.contains(&expected), "{error}");
        assert_eq!(begun, 1);
    }
}
