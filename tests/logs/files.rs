//! Logs as recorders leave them: chunks that overlap, messages out of order, several channels on one topic, recordings split
//! into files, files in zstd as a whole.

#![expect(clippy::float_cmp, reason = "whole numbers that must come back as they were written")]

use std::path::PathBuf;

use mcap::Compression;
use posegrid::ingest::{Mapping, TimeSource};
use posegrid::io::log::{Limits, LogError, SessionLogs};
use posegrid::progress::Quiet;

use crate::build::{
    Cdr, Folder, Log, WholeSession, mapping, read, read_as, read_file, read_whole, schema, session,
    session_log, stamp,
};
use crate::raw::{self, Packing, op};

fn read_parts(parts: &[PathBuf], mapping: &Mapping) -> Result<WholeSession, LogError> {
    let logs = SessionLogs { controller: parts.to_vec(), tracker: parts.to_vec() };
    read_whole(&logs, mapping, Limits::default(), &Quiet)
}

/// Schemas 1 to 3 and channels 1 to 3 of [`session`], as records.
fn definitions() -> Vec<u8> {
    let topics =
        [("/joints", "JointState"), ("/command", "PoseStamped"), ("/reading", "PointStamped")];
    let records = (1..).zip(topics).flat_map(|(id, (topic, short))| {
        let (name, text) = schema(short);
        [
            raw::schema(id, &name, "ros2msg", text.as_bytes()).record(op::SCHEMA),
            raw::channel(id, id, topic, "cdr", &[]).record(op::CHANNEL),
        ]
    });
    records.collect::<Vec<_>>().concat()
}

/// Joint state `x` on a channel, with its three times in steps of [`stamp`].
fn joints(channel: u16, x: f64, [header, publish, log]: [u32; 3]) -> Vec<u8> {
    let ns = |i| u64::try_from(stamp(i)).expect("positive");
    let payload = Cdr::stamped(stamp(header)).joints(&["a", "b"], &[x, -x]);
    raw::message(channel, 0, ns(log), ns(publish), &payload.done()).record(op::MESSAGE)
}

/// A command and a reading, without which there is no session.
fn others() -> Vec<u8> {
    let ns = u64::try_from(stamp(0)).expect("positive");
    let pose = Cdr::stamped(stamp(0)).numbers(&[0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 1.0]);
    let point = Cdr::stamped(stamp(0)).numbers(&[3.0, 0.0, 4.0]);
    [(2, pose), (3, point)]
        .map(|(channel, cdr)| raw::message(channel, 0, ns, ns, &cdr.done()).record(op::MESSAGE))
        .concat()
}

fn chunk(records: &[Vec<u8>], packing: Packing) -> Vec<u8> {
    raw::chunk((0, u64::MAX), &records.concat(), packing).record(op::CHUNK)
}

#[test]
fn messages_come_out_in_the_order_of_the_time_source_wherever_they_stand() {
    // Two chunks that overlap in every clock, a message between them, and within each the later one first.
    // Times: header, publish, log. By header the numbers are in order.
    let first = [definitions(), others(), joints(1, 4.0, [4, 1, 2]), joints(1, 1.0, [1, 2, 3])];
    let between = joints(1, 2.0, [2, 3, 1]);
    let second = [joints(1, 3.0, [3, 4, 5]), joints(1, 0.0, [0, 5, 4])];
    let log = raw::log(&[chunk(&first, Packing::Zstd), between, chunk(&second, Packing::Lz4)]);
    for (time, expected, backward) in [
        // In the file: 4 1 2 3 0.
        (TimeSource::Header, [0.0, 1.0, 2.0, 3.0, 4.0], 2),
        (TimeSource::Publish, [4.0, 1.0, 2.0, 3.0, 0.0], 0),
        // Log times in the file: 2 3 1 5 4.
        (TimeSource::Log, [2.0, 4.0, 1.0, 0.0, 3.0], 2),
    ] {
        let mut mapping = mapping();
        mapping.controller.time = time;
        let found = read_as(&log, &mapping).expect("sound");
        assert_eq!(found.rejects, []);
        assert_eq!(crate::of_joint(&found.joints.angles, 0), expected, "{time}");
        assert!(found.joints.stamps.is_sorted());
        assert_eq!(found.counts["joints.backward_stamps"], backward, "{time}");
    }
}

#[test]
fn duplicated_and_backward_clocks_are_counted_and_no_message_is_lost() {
    let mut records = vec![definitions(), others()];
    // A clock that is set back by three steps and goes over the same times again.
    for (i, header) in [0, 1, 2, 3, 1, 2, 3, 4].into_iter().enumerate() {
        let log = u32::try_from(i).expect("few");
        records.push(joints(1, f64::from(log), [header, log, log]));
    }
    let found = read(&raw::log(&records)).expect("sound");
    assert_eq!(found.rejects, []);
    // Equal stamps stay in the order of the file.
    assert_eq!(crate::of_joint(&found.joints.angles, 0), [0.0, 1.0, 4.0, 2.0, 5.0, 3.0, 6.0, 7.0]);
    assert_eq!(found.counts["joints.backward_stamps"], 1);
    assert_eq!(found.counts["joints.duplicate_stamps"], 3);
}

#[test]
fn two_channels_of_one_schema_on_one_topic_are_one_stream() {
    let second = raw::channel(9, 1, "/joints", "cdr", &[("publisher", "two")]).record(op::CHANNEL);
    let log = raw::log(&[
        definitions(),
        second,
        others(),
        joints(1, 0.0, [0, 0, 0]),
        joints(9, 1.0, [1, 1, 1]),
        joints(1, 2.0, [2, 2, 2]),
    ]);
    let found = read(&log).expect("sound");
    assert_eq!(crate::of_joint(&found.joints.angles, 0), [0.0, 1.0, 2.0]);
    assert_eq!(found.counts["joints.messages"], 3);
}

#[test]
fn two_schemas_on_one_topic_are_reported() {
    let (name, text) = schema("Temperature");
    let other = [
        raw::schema(9, &name, "ros2msg", text.as_bytes()).record(op::SCHEMA),
        raw::channel(9, 9, "/joints", "cdr", &[]).record(op::CHANNEL),
    ];
    let log = raw::log(&[definitions(), others(), joints(1, 0.0, [0, 0, 0]), other.concat()]);
    let error = read(&log).expect_err("which one is meant?").to_string();
    assert!(
        error.contains("\"/joints\"") && error.contains("sensor_msgs/msg/Temperature"),
        "{error}"
    );
}

#[test]
fn poses_and_points_on_one_topic_are_one_stream_once_orientations_are_left_out() {
    let ns = u64::try_from(stamp(1)).expect("positive");
    let pose = Cdr::stamped(stamp(1)).numbers(&[5.0, 6.0, 7.0, 0.0, 0.0, 0.0, 1.0]);
    let log = raw::log(&[
        definitions(),
        raw::channel(9, 2, "/reading", "cdr", &[]).record(op::CHANNEL),
        others(),
        joints(1, 0.0, [0, 0, 0]),
        raw::message(9, 0, ns, ns, &pose.done()).record(op::MESSAGE),
    ]);
    let error = read(&log).expect_err("a reading has an orientation or has none").to_string();
    assert!(error.contains("ignore_orientation"), "{error}");
    let mut mapping = mapping();
    mapping.tracker.ignore_orientation = true;
    let found = read_as(&log, &mapping).expect("sound");
    assert_eq!(found.readings.positions, [[3.0, 0.0, 4.0], [5.0, 6.0, 7.0]]);
}

/// The messages of [`session`] numbered `range`, with channels defined in an order of their own; `latched` decides
/// whether commands are in it.
fn part(range: std::ops::Range<u32>, reversed: bool, latched: bool) -> Vec<u8> {
    let mut log = Log::new(Some(Compression::Lz4));
    let mut topics = vec![("/joints", "JointState"), ("/reading", "PointStamped")];
    if latched {
        topics.push(("/command", "PoseStamped"));
    }
    if reversed {
        topics.reverse();
    }
    let ids: std::collections::BTreeMap<_, _> =
        topics.into_iter().map(|(topic, short)| (topic, log.channel(topic, short))).collect();
    for i in range {
        let (ns, x) = (stamp(i), f64::from(i));
        let at = u64::try_from(ns).expect("positive");
        let joints = Cdr::stamped(ns).joints(&["a", "b"], &[x, -x]);
        log.write(ids["/joints"], at, &joints.done());
        let reading = Cdr::stamped(ns).numbers(&[3.0, x, 4.0]);
        log.write(ids["/reading"], at, &reading.done());
        if let Some(&command) = ids.get("/command") {
            let pose = Cdr::stamped(ns).numbers(&[x, 1.0, 2.0, 0.0, 0.0, 0.0, 1.0]);
            log.write(command, at, &pose.done());
        }
    }
    log.done()
}

#[test]
fn a_split_recording_is_one_whatever_its_files_are_called() {
    let folder = Folder::new();
    let whole = [folder.file("whole.mcap", &part(0..300, false, true))];
    // The earliest part has the last name, and in each the ids mean something else.
    let parts = [
        folder.file("a.mcap", &part(200..300, true, false)),
        folder.file("b.mcap", &part(100..200, false, false)),
        folder.file("c.mcap", &part(0..100, true, true)),
    ];
    let whole = read_parts(&whole, &mapping()).expect("sound");
    let found = read_parts(&parts, &mapping()).expect("sound");
    assert_eq!(found.rejects, []);
    assert_eq!((&found.joints, &found.readings), (&whole.joints, &whole.readings));
    // Put in order by what is in them, no clock went back.
    assert_eq!(found.counts["joints.backward_stamps"], 0);
    assert_eq!(found.counts["log.files"], 3);
    assert_eq!(found.counts["joints.messages"], 300);
    // Commands stand in one file only, as a latched topic does.
    assert_eq!(found.commands.stamps.len(), 100);
    let error = read_parts(&parts[..2], &mapping()).expect_err("no commands").to_string();
    for text in ["a.mcap", "b.mcap", "\"/command\"", "\"/reading\", \"/joints\""] {
        assert!(error.contains(text), "{error}");
    }
}

#[test]
fn a_damaged_part_is_named_and_the_others_are_read() {
    let folder = Folder::new();
    let second = part(100..200, true, false);
    let cut = second.len() / 2;
    let parts = [
        folder.file("one.mcap", &part(0..100, false, true)),
        folder.file("two.mcap", &second[..cut]),
        folder.file("three.mcap", &part(200..300, true, false)),
    ];
    let found = read_parts(&parts, &mapping()).expect("the rest is sound");
    let kept = found.joints.stamps.len();
    assert!((220..280).contains(&kept), "{kept}");
    let [lost] = &found.rejects[..] else { panic!("one loss: {:?}", found.rejects) };
    assert!(lost.file.ends_with("two.mcap") && lost.byte_end == cut as u64, "{lost:?}");
}

#[test]
fn a_row_that_is_rejected_is_placed_in_its_own_file() {
    let folder = Folder::new();
    let bad = |at: u32| {
        raw::log(&[
            definitions(),
            others(),
            joints(1, 1.0, [at, at, at]),
            joints(1, f64::NAN, [at + 1, at + 1, at + 1]),
        ])
    };
    let parts = [folder.file("late.mcap", &bad(50)), folder.file("early.mcap", &bad(10))];
    let found = read_parts(&parts, &mapping()).expect("half of it is sound");
    let places: Vec<_> = found
        .rejects
        .iter()
        .map(|reject| {
            let name = PathBuf::from(&reject.file);
            let name = name.file_name().expect("a name").to_string_lossy().into_owned();
            (name, reject.messages, reject.time_span_ns.map(|span| span.0))
        })
        .collect();
    let place = |name: &str, at| (name.to_owned(), Some(1), Some(stamp(at)));
    assert_eq!(places, [place("early.mcap", 11), place("late.mcap", 51)]);
}

fn packed(bytes: &[u8]) -> Vec<u8> {
    zstd::stream::encode_all(bytes, 1).expect("memory")
}

#[test]
fn a_log_in_zstd_as_a_whole_is_read_as_the_log_itself() {
    let folder = Folder::new();
    for log in [session_log(Some(Compression::Zstd), 200), session_log(None, 200)] {
        let (plain, stored) =
            (folder.file("log.mcap", &log), folder.file("log.mcap.zst", &packed(&log)));
        let expected = read_parts(&[plain], &mapping()).expect("sound");
        let found = read_parts(&[stored], &mapping()).expect("sound");
        assert_eq!(found.rejects, []);
        assert_eq!((found.joints, found.readings), (expected.joints, expected.readings));
    }
}

#[test]
fn a_cut_zstd_file_gives_what_is_sound_and_a_count_of_what_is_not() {
    let folder = Folder::new();
    // Chunks that are compressed already, so that half of the file is half of the log.
    let mut log = Log::new(Some(Compression::Zstd));
    session(&mut log, 20_000);
    let log = log.done();
    let stored = packed(&log);
    let half = stored.len() / 2;
    let found = read_parts(&[folder.file("cut.mcap.zst", &stored[..half])], &mapping())
        .expect("the first half is sound");
    let kept = found.joints.stamps.len();
    assert!((5_000..15_000).contains(&kept), "{kept}");
    assert!(found.joints.angles.rows().zip(0_u32..).all(|(row, i)| row[0] == f64::from(i)));
    let told = |text: &str| found.rejects.iter().any(|reject| reject.reason.contains(text));
    assert!(told("zstd file is unsound at its byte"), "{:?}", found.rejects);
    // Damage in its middle: what follows cannot be decompressed, and as many bytes are lost at least.
    let mut wrong = stored.clone();
    wrong[half..half + 64].fill(0xff);
    let found = read_parts(&[folder.file("wrong.mcap.zst", &wrong)], &mapping())
        .expect("the first part is sound");
    let lost: u64 = found
        .rejects
        .iter()
        .filter(|reject| reject.reason.contains("cannot be decompressed"))
        .map(|reject| reject.byte_end - reject.byte_start)
        .sum();
    assert!(lost > stored.len() as u64 / 3, "{lost} of {}: {:?}", stored.len(), found.rejects);
}

#[test]
fn a_log_in_zstd_beyond_the_limit_is_refused() {
    let path = Folder::new();
    let path = path.file("log.mcap.zst", &packed(&session_log(None, 200)));
    let limits = Limits { unpacked_bytes: 10_000, ..Limits::default() };
    let error = read_file(&path, limits).expect_err("too large");
    assert!(error.to_string().contains("the limit of 10000 bytes"), "{error}");
}

#[test]
fn a_log_cut_behind_its_data_loses_no_message_and_says_so() {
    let log = session_log(Some(Compression::Zstd), 100);
    for missing in [1, 8, 9, 60] {
        let found = read(&log[..log.len() - missing]).expect("all data is there");
        assert_eq!(found.joints.stamps.len(), 100);
        let [note] = &found.rejects[..] else { panic!("{:?}", found.rejects) };
        assert!(note.messages == Some(0) && note.reason.contains("after its data"), "{note:?}");
    }
    let mut wrong = log.clone();
    // In the statistics: only the summary's own checksum can tell.
    wrong[log.len() - 60] ^= 1;
    let found = read(&wrong).expect("all data is there");
    assert!(
        found.rejects[0].reason.contains("summary at the end is damaged"),
        "{:?}",
        found.rejects
    );
}

#[test]
fn more_metadata_than_anyone_reads_takes_no_memory() {
    // A name of a megabyte with a hundred thousand empty pairs: a hundred gigabytes if the name is kept with each.
    let name = "n".repeat(1 << 20);
    let pairs = vec![("", ""); 100_000];
    let metadata = raw::Body::default().text(&name).map(&pairs).record(op::METADATA);
    let log = raw::log(&[definitions(), others(), metadata, joints(1, 0.0, [0, 0, 0])]);
    let found = read(&log).expect("sound but for its metadata");
    assert_eq!(found.joints.stamps.len(), 1);
    assert!(found.metadata.is_empty());
    assert!(found.rejects[0].reason.contains("1 MiB of metadata"), "{:?}", found.rejects);
}
