//! How much more than plain decompression ingest costs, on a log of 2.2 million messages.
//!
//! `cargo bench --bench ingest` writes the log (2.0 M joint states of 6 joints with velocities and efforts, 0.2 M points,
//! zstd: 615 MB of records) into a temporary folder, once with joints that always move and once with joints that go from
//! rest to rest. It prints user, system and wall seconds, the ratio of user seconds to those of plain decompression in the
//! same round, and peak memory of each step: medians of five rounds, each step in a process of its own. `-- long` does the
//! same on a log ten times as long, side by side. Messages per CPU second in protobuf and JSON follow; `-- forms` measures
//! them alone. Without `--bench` (as `cargo test` calls it) a small log shows that it works.

mod forms;
#[path = "../common/mapping.rs"]
mod mapping;
#[expect(dead_code, reason = "the tests write more kinds of messages than these")]
#[path = "../logs/encodings/proto.rs"]
mod proto;
mod steps;

use std::fs::{self, File};
use std::io::{BufWriter, Read, Seek, SeekFrom};
use std::path::Path;
use std::thread;
use std::time::Instant;

use mcap::records::{MessageHeader, op};
use mcap::{Compression, WriteOptions, Writer};
use posegrid::ingest::{
    AngleUnit, CommandedSettings, ControllerSettings, JointFields, LengthUnit, Mapping, PoseFields,
    TimeSource,
};

const JOINTS: [&str; 6] = ["joint_1", "joint_2", "joint_3", "joint_4", "joint_5", "joint_6"];
/// Of an encoder, a radian.
const STEPS: f64 = (1_u64 << 41) as f64;
const JOINT_STATE: &str = "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n";
const POSE_STAMPED: &str = "std_msgs/Header header\ngeometry_msgs/Pose pose\n";
const POINT_STAMPED: &str = "std_msgs/Header header\ngeometry_msgs/Point point\n";
const SHARED: &str = "================\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
    ================\nMSG: geometry_msgs/Pose\nPoint position\nQuaternion orientation\n\
    ================\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n\
    ================\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n";

fn main() {
    let args: Vec<String> = std::env::args().collect();
    if let Some(place) = args.iter().position(|arg| arg == steps::FLAG) {
        return steps::run_alone(&args[place + 1..]);
    }
    let has = |flag: &str| args.iter().any(|arg| arg == flag);
    let joint_states = if has("--bench") { 2_000_000 } else { 2_000 };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let lengths = if has("long") { &[1, 10][..] } else { &[1] };
    let lengths: Vec<u64> = lengths.iter().map(|times| times * joint_states).collect();
    if !has("forms") {
        steps::measure_all(folder.path(), &lengths);
    }
    forms::measure_all(folder.path(), joint_states / 4);
}

/// Runs a step, prints its times, returns its user seconds.
fn measure(step: &str, floor: Option<f64>, run: impl FnOnce() -> u64) -> f64 {
    let (start, (user, system)) = (Instant::now(), cpu_seconds());
    let result = run();
    let (wall, (user_after, system_after)) = (start.elapsed().as_secs_f64(), cpu_seconds());
    assert!(result > 0, "{step} did something");
    let (user, system) = (user_after - user, system_after - system);
    let ratio = floor.map_or_else(String::new, |floor| format!("{:.2}", user / floor));
    println!("{step:<44} {user:>8.2} {system:>8.2} {wall:>8.2} {ratio:>8}");
    user
}

/// Of an odd number of rounds.
fn median(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut numbers: Vec<f64> = numbers.collect();
    numbers.sort_by(f64::total_cmp);
    numbers[numbers.len() / 2]
}

/// User and system CPU seconds of this process, all threads.
fn cpu_seconds() -> (f64, f64) {
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // Fields 14 and 15, counted behind the command's closing parenthesis, in hundredths of a second.
    let mut ticks = stat.rsplit(')').next().unwrap_or("").split_whitespace().skip(11);
    let mut next =
        || ticks.next().and_then(|ticks| ticks.parse::<f64>().ok()).unwrap_or(f64::NAN) / 100.0;
    (next(), next())
}

/// Decompresses every chunk, into one buffer a thread; returns how many bytes.
fn decompress(path: &Path, threads: usize) -> u64 {
    let chunks = chunks(path);
    let shares = chunks.chunks(chunks.len().div_ceil(threads));
    thread::scope(|scope| {
        let of_share = |share| scope.spawn(move || decompress_some(path, share));
        let running: Vec<_> = shares.map(of_share).collect();
        let bytes = running.into_iter().map(thread::ScopedJoinHandle::join);
        bytes.map(|bytes| bytes.expect("a sound log")).sum()
    })
}

/// Place and length of each chunk record, without what stands before its content.
fn chunks(path: &Path) -> Vec<(u64, u64)> {
    let mut file = File::open(path).expect("just written");
    let mut at = 8;
    let (mut header, mut found) = ([0; 9], Vec::new());
    while file.seek(SeekFrom::Start(at)).is_ok() && file.read_exact(&mut header).is_ok() {
        let length = u64::from_le_bytes(header[1..].try_into().expect("eight bytes"));
        at += 9;
        if header[0] == op::CHUNK {
            found.push((at, length));
        }
        at += length;
    }
    found
}

fn decompress_some(path: &Path, chunks: &[(u64, u64)]) -> u64 {
    let mut file = File::open(path).expect("just written");
    let mut zstd = zstd::bulk::Decompressor::new().expect("memory");
    let (mut stored, mut records, mut total) = (Vec::new(), Vec::new(), 0);
    for &(at, length) in chunks {
        file.seek(SeekFrom::Start(at)).expect("a file");
        stored.clear();
        (&mut file).take(length).read_to_end(&mut stored).expect("a sound log");
        let Ok(mcap::records::Record::Chunk { header, data }) =
            mcap::parse_record(op::CHUNK, &stored)
        else {
            panic!("a sound chunk")
        };
        records.clear();
        records.reserve(usize::try_from(header.uncompressed_size).expect("small"));
        zstd.decompress_to_buffer(&data[..], &mut records).expect("a sound chunk");
        total += records.len() as u64;
    }
    total
}

fn mapping() -> Mapping {
    let time = TimeSource::Header;
    let (controller, commanded, tracker) = ("/joint_states", "/commanded", "/point");
    Mapping {
        controller: ControllerSettings {
            topic: controller.to_owned(),
            time,
            unit: AngleUnit::Rad,
            length_unit: None,
            fields: JointFields::default(),
        },
        commanded: Some(CommandedSettings {
            topic: commanded.to_owned(),
            time,
            unit: LengthUnit::M,
            fields: PoseFields::default(),
            frame: None,
        }),
        tracker: mapping::tracker(tracker, time, LengthUnit::M),
        slides: Vec::new(),
        joints: JOINTS.map(str::to_owned).to_vec(),
    }
}

/// `motion` tells how far the joints have come at each joint state, rad.
fn write_log(path: &Path, joint_states: u64, motion: impl Fn(u64) -> f64) {
    let file = BufWriter::new(File::create(path).expect("a temporary file"));
    let options = WriteOptions::new()
        .compression(Some(Compression::Zstd))
        .compression_level(1)
        .chunk_size(Some(1 << 20));
    let mut log = options.create(file).expect("a temporary file");
    let joints = channel(&mut log, "/joint_states", "sensor_msgs/msg/JointState", JOINT_STATE);
    let point = channel(&mut log, "/point", "geometry_msgs/msg/PointStamped", POINT_STAMPED);
    let commanded = channel(&mut log, "/commanded", "geometry_msgs/msg/PoseStamped", POSE_STAMPED);
    let mut noise = 1_u64;
    for i in 0..joint_states {
        let ns = 1_600_000_000_000_000_000 + i * 2_000_000;
        write(&mut log, joints, ns, &joint_state(ns, motion(i), &mut noise));
        if i % 10 == 0 {
            let reading = stamped(3, ns, motion(i), &mut noise);
            write(&mut log, point, ns, &reading);
        }
        if i % 100_000 == 0 {
            let pose = stamped(7, ns, i as f64, &mut noise);
            write(&mut log, commanded, ns, &pose);
        }
    }
    log.finish().expect("room in the temporary folder");
}

fn channel(log: &mut Writer<BufWriter<File>>, topic: &str, name: &str, text: &str) -> u16 {
    let schema =
        log.add_schema(name, "ros2msg", format!("{text}{SHARED}").as_bytes()).expect("few schemas");
    log.add_channel(schema, topic, "cdr", &std::collections::BTreeMap::new()).expect("few channels")
}

fn write(log: &mut Writer<BufWriter<File>>, channel_id: u16, log_time: u64, message: &[u8]) {
    let header = MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
    log.write_to_known_channel(&header, message).expect("room in the temporary folder");
}

/// Readings of a real encoder: a slow motion with noise in the last digits.
fn number(message: &mut Vec<u8>, slow: f64, noise: &mut u64) {
    *noise = noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    let noisy = slow.sin() + (*noise >> 40) as f64 * 1e-12;
    let number = (noisy * STEPS).round() / STEPS;
    message.extend(number.to_le_bytes());
}

fn text(message: &mut Vec<u8>, text: &str) {
    message.resize(message.len().next_multiple_of(4), 0);
    message.extend(u32::try_from(text.len() + 1).expect("short").to_le_bytes());
    message.extend(text.as_bytes());
    message.push(0);
}

fn header(ns: u64) -> Vec<u8> {
    let mut message = vec![0, 1, 0, 0];
    message.extend(u32::try_from(ns / 1_000_000_000).expect("before 2106").to_le_bytes());
    message.extend(u32::try_from(ns % 1_000_000_000).expect("below a second").to_le_bytes());
    text(&mut message, "base_link");
    message
}

fn joint_state(ns: u64, slow: f64, noise: &mut u64) -> Vec<u8> {
    let mut message = header(ns);
    message.resize(message.len().next_multiple_of(4), 0);
    message.extend(6_u32.to_le_bytes());
    for name in JOINTS {
        text(&mut message, name);
    }
    // Positions, velocities, efforts.
    for _ in 0..3 {
        message.resize(message.len().next_multiple_of(4), 0);
        message.extend(6_u32.to_le_bytes());
        message.resize((message.len() - 4).next_multiple_of(8) + 4, 0);
        for joint in 0..6 {
            number(&mut message, slow + f64::from(joint), noise);
        }
    }
    message
}

/// A point or a pose: so many numbers behind the header.
fn stamped(numbers: u32, ns: u64, slow: f64, noise: &mut u64) -> Vec<u8> {
    let mut message = header(ns);
    message.resize((message.len() - 4).next_multiple_of(8) + 4, 0);
    for coordinate in 0..numbers {
        number(&mut message, slow + f64::from(coordinate), noise);
    }
    message
}
