//! What a log's own marks hide: messages behind its end, messages that are cut out or swallowed, records of others.

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use mcap::{Compression, WriteOptions};
use posegrid::ingest::LossKind;
use posegrid::io::inspect::{Inspection, inspect};
use posegrid::io::log::{Ending, Limits};
use posegrid::progress::Quiet;

use crate::build::{Cdr, Folder, Log, WholeSession, read, session, session_log, stamp};
use crate::damage::frames;
use crate::raw::{self, Body, op};

/// Of them 200 are joint states, 20 commands and 20 readings.
const JOINTS: u32 = 200;
const ALL: u64 = 240;

fn chunked() -> Vec<u8> {
    session_log(Some(Compression::Zstd), JOINTS)
}

fn unchunked() -> Vec<u8> {
    let mut log = Log::with(WriteOptions::new().use_chunks(false));
    session(&mut log, JOINTS);
    log.done()
}

/// A log's records of data, with their opcodes, and those of its summary.
fn parts(log: &[u8]) -> [Vec<(u8, Vec<u8>)>; 2] {
    let all = frames(log);
    let end = all.iter().position(|frame| frame.2 == op::DATA_END).expect("written");
    let of = |frames: &[(usize, usize, u8)]| {
        let record =
            |&(start, end, opcode): &(usize, usize, u8)| (opcode, log[start..end].to_vec());
        frames.iter().map(record).collect()
    };
    [of(&all[..end]), of(&all[end + 1..all.len() - 1])]
}

fn bytes(records: &[(u8, Vec<u8>)]) -> Vec<u8> {
    records.iter().flat_map(|(_, bytes)| bytes).copied().collect()
}

/// These records of data, the end of data, and the summary with its checksum.
fn log_of(data: &[(u8, Vec<u8>)], summary: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let end = raw::data_end(0).record(op::DATA_END);
    closed(&[mcap::MAGIC, &bytes(data), &end].concat(), summary)
}

/// These bytes, the summary with its checksum, the footer and the closing mark.
fn closed(before: &[u8], summary: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let start = before.len() as u64;
    let summary = bytes(summary);
    let footer = |crc| raw::footer(start, 0, crc).record(op::FOOTER);
    let crc = crc32fast::hash(&[&summary[..], &footer(0)[..9 + 16]].concat());
    [before, &summary, &footer(crc), mcap::MAGIC].concat()
}

fn inspected(bytes: &[u8]) -> Inspection {
    let path = Folder::new();
    let path = path.file("log.mcap", bytes);
    inspect(&path, Limits::default(), &Quiet).expect("a log")
}

/// Exit code and words of `posegrid inspect`.
fn shown(bytes: &[u8]) -> (Option<i32>, String) {
    let folder = Folder::new();
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_posegrid"))
        .arg("inspect")
        .arg(folder.file("log.mcap", bytes))
        .output()
        .expect("runs");
    let words = String::from_utf8_lossy(&output.stdout).into_owned();
    (output.status.code(), words)
}

/// Every joint state is there as it was written.
fn is_whole(recording: &WholeSession, what: &str) {
    let rows = 0..recording.joints.stamps.len();
    assert_eq!(rows.len(), JOINTS as usize, "{what}: {:?}", recording.rejects);
    for (row, i) in rows.zip(0..) {
        assert_eq!(recording.joints.stamps[row].ns(), stamp(i), "{what}");
        let angle = recording.joints.angles.row(row)[0];
        assert_eq!(angle.to_bits(), f64::from(i).to_bits(), "{what}");
    }
    assert_eq!(recording.readings.stamps.len(), JOINTS as usize / 10, "{what}");
}

/// Joint states from number `first` on and a reading for every tenth; channels come in another order than in a session.
fn later_part(first: u32, last: u32, compression: Option<Compression>) -> Vec<u8> {
    let mut log = Log::new(compression);
    let reading = log.channel("/reading", "PointStamped");
    let command = log.channel("/command", "PoseStamped");
    let joints = log.channel("/joints", "JointState");
    for i in first..last {
        let (ns, x) = (stamp(i), f64::from(i));
        let log_time = u64::try_from(ns).expect("positive") + 1_000_000_000;
        let state = Cdr::stamped(ns).joints(&["a", "b"], &[x, -x]);
        log.write(joints, log_time, &state.done());
        if i % 10 == 0 {
            let pose = Cdr::stamped(ns).numbers(&[x, 1.0, 2.0, 0.0, 0.0, 0.0, 2.0]);
            log.write(command, log_time, &pose.done());
            let point = Cdr::stamped(ns).numbers(&[3.0, x, 4.0]);
            log.write(reading, log_time, &point.done());
        }
    }
    log.done()
}

#[test]
fn logs_one_behind_another_are_all_read_each_with_its_own_ids() {
    for compression in [None, Some(Compression::Zstd)] {
        let (one, two) = (session_log(compression, 100), later_part(100, 200, compression));
        let both = [&one[..], &two].concat();
        let recording = read(&both).expect("two sound logs");
        is_whole(&recording, "two logs");
        let found = inspected(&both);
        assert_eq!((found.read_summary.logs, found.read_summary.messages), (2, ALL));
        assert_eq!(found.read_summary.ending, Ending::Sound);
        assert_eq!(found.read_summary.bytes_lost(), 0);
        let [reject] = &found.read_summary.rejects[..] else {
            panic!("{:?}", found.read_summary.rejects)
        };
        assert_eq!((reject.byte_start, reject.loss), (one.len() as u64, LossKind::Nothing));
        let (code, words) = shown(&both);
        assert_eq!(code, Some(3), "{words}");
        assert!(words.contains("2 logs in one file"), "{words}");
        // Without the closing mark of the first, or without its end.
        for cut in [8, 12, 100] {
            let both = [&one[..one.len() - cut], &two].concat();
            is_whole(&read(&both).expect("read"), &format!("{cut} bytes less"));
            assert!(!inspected(&both).read_summary.rejects.is_empty());
        }
        let three = [&one[..], &two, &later_part(200, 210, compression)].concat();
        assert_eq!(read(&three).expect("read").joints.stamps.len(), 210);
        let packed = zstd::stream::encode_all(&both[..], 1).expect("memory");
        is_whole(&read(&packed).expect("read"), "two logs in zstd");
    }
}

#[test]
fn a_log_cut_anywhere_before_another_costs_its_own_messages_only() {
    let (one, two) = (chunked(), later_part(200, 300, Some(Compression::Zstd)));
    for tenth in 1..10 {
        let both = [&one[..one.len() * tenth / 10], &two].concat();
        let recording = read(&both).expect("the second is sound");
        let later = recording.joints.stamps.iter().filter(|at| at.ns() >= stamp(200));
        assert_eq!(later.count(), 100, "{tenth}: {:?}", recording.rejects);
        assert!(!recording.rejects.is_empty(), "{tenth}");
    }
}

#[test]
fn an_end_before_the_last_records_is_reported_and_they_are_read() {
    for log in [chunked(), unchunked()] {
        let [data, summary] = parts(&log);
        let end = (op::DATA_END, raw::data_end(0).record(op::DATA_END));
        let is_content = |(opcode, _): &&(u8, Vec<u8>)| matches!(*opcode, op::CHUNK | op::MESSAGE);
        let contents = data.iter().filter(is_content).count();
        let cut = |before: usize| {
            let mut left = before;
            let is_cut = |(opcode, _): &(u8, Vec<u8>)| {
                let content = matches!(*opcode, op::CHUNK | op::MESSAGE);
                left -= usize::from(content && left > 0);
                content && left == 0
            };
            data.iter().position(is_cut).expect("there")
        };
        for before in [2, contents / 2, contents] {
            let (one, two) = data.split_at(cut(before));
            let moved = [one, std::slice::from_ref(&end), two].concat();
            let before_end = [mcap::MAGIC, &bytes(&moved)].concat();
            let twice = log_of(&moved, &summary);
            let summary_first = [one, std::slice::from_ref(&end), &summary, two].concat();
            let cases = [
                ("moved", closed(&before_end, &summary)),
                ("twice", twice),
                ("behind a summary", log_of(&summary_first, &summary)),
                ("after the closing mark", [&log_of(one, &summary)[..], &bytes(two)].concat()),
            ];
            for (what, bytes) in cases {
                let recording = read(&bytes).expect("a log");
                is_whole(&recording, what);
                let told =
                    recording.rejects.iter().any(|r| r.reason.contains("its data ends at byte"));
                assert!(told, "{what}: {:?}", recording.rejects);
                assert_eq!(inspected(&bytes).read_summary.messages, ALL, "{what}");
                assert_eq!(shown(&bytes).0, Some(3), "{what}");
            }
        }
    }
}

/// Without the chunk of this number and its message indexes.
fn without_chunk(data: &[(u8, Vec<u8>)], number: usize) -> Vec<(u8, Vec<u8>)> {
    let mut chunk = 0;
    let kept = data.iter().filter(|(opcode, _)| {
        chunk += usize::from(*opcode == op::CHUNK);
        chunk != number || !matches!(*opcode, op::CHUNK | op::MESSAGE_INDEX)
    });
    kept.cloned().collect()
}

/// With a message whose length takes in so many behind it.
fn swallowing(data: &[(u8, Vec<u8>)], number: usize, count: usize) -> Vec<(u8, Vec<u8>)> {
    let messages = data.iter().enumerate().filter(|(_, (opcode, _))| *opcode == op::MESSAGE);
    let first = messages.map(|(place, _)| place).nth(number).expect("there");
    let mut data = data.to_vec();
    let swallowed: Vec<_> = data.drain(first + 1..=first + count).collect();
    data[first].1.extend(bytes(&swallowed));
    let length = (data[first].1.len() - 9) as u64;
    data[first].1[1..9].copy_from_slice(&length.to_le_bytes());
    data
}

#[test]
fn messages_that_a_sound_summary_counts_and_that_are_not_there_are_lost() {
    let [chunks, of_chunks] = parts(&chunked());
    let [messages, of_messages] = parts(&unchunked());
    let cases = [
        ("a chunk cut out", log_of(&without_chunk(&chunks, 4), &of_chunks)),
        ("a message swallows", log_of(&swallowing(&messages, 100, 39), &of_messages)),
    ];
    for (what, bytes) in cases {
        let found = inspected(&bytes);
        let recording = read(&bytes).expect("the rest is sound");
        let lost = ALL - found.read_summary.messages;
        assert!(lost >= 10, "{what}: {lost}");
        assert_eq!(found.read_summary.messages_lost, lost, "{what}");
        let topics = ["/joints", "/command", "/reading"];
        let read_of = [
            recording.counts["joints.messages"],
            recording.counts["commands.messages"],
            recording.counts["readings.messages"],
        ];
        for ((topic, all), read) in topics.into_iter().zip([200, 20, 20]).zip(read_of) {
            let missing = recording.rejects.iter().filter(|reject| {
                reject.loss == LossKind::Missing && reject.topic.as_deref() == Some(topic)
            });
            let told: u64 = missing.filter_map(|reject| reject.messages).sum();
            assert_eq!(told, all - read, "{what}: {topic}");
            let lost_of = found.read_summary.lost_of.get(topic).copied().unwrap_or(0);
            assert_eq!(lost_of, told, "{what}: {topic}");
        }
        assert_eq!(recording.counts["log.messages_lost"], lost, "{what}");
        assert_eq!(recording.counts["joints.messages_lost"], 200 - read_of[0], "{what}");
        let (code, words) = shown(&bytes);
        assert_eq!(code, Some(3), "{what}: {words}");
        assert!(words.contains(&format!("{lost} of {ALL} messages lost")), "{what}: {words}");
    }
}

#[test]
fn messages_of_a_damaged_chunk_are_counted_once() {
    let log = chunked();
    let chunks: Vec<_> = frames(&log).into_iter().filter(|f| f.2 == op::CHUNK).collect();
    let mut damaged = log.clone();
    damaged[usize::midpoint(chunks[3].0, chunks[3].1)] ^= 0x10;
    let read_summary = inspected(&damaged).read_summary;
    let [reject] = &read_summary.rejects[..] else { panic!("{:?}", read_summary.rejects) };
    assert_eq!(reject.messages, Some(ALL - read_summary.messages));
    assert_eq!(read_summary.messages_lost, ALL - read_summary.messages);
    // Beside it a chunk that is cut out: only its messages are told as missing.
    let [mut data, summary] = parts(&log);
    data = without_chunk(&data, 6);
    let places: Vec<usize> = (0..data.len()).filter(|&i| data[i].0 == op::CHUNK).collect();
    let middle = data[places[3]].1.len() / 2;
    data[places[3]].1[middle] ^= 0x10;
    let read_summary = inspected(&log_of(&data, &summary)).read_summary;
    let sum = |loss| {
        let of = read_summary.rejects.iter().filter(move |reject| reject.loss == loss);
        of.filter_map(|reject| reject.messages).sum::<u64>()
    };
    let lost = ALL - read_summary.messages;
    assert_eq!(read_summary.messages_lost, lost);
    assert_eq!(sum(LossKind::Bytes), reject.messages.expect("indexed"));
    assert_eq!(sum(LossKind::Missing) + sum(LossKind::Bytes), lost);
}

fn statistics(messages: u64, of_channels: &[(u16, u64)]) -> Vec<u8> {
    let counts =
        of_channels.iter().fold(Body::default(), |body, (id, count)| body.u16(*id).u64(*count));
    let body = Body::default().u64(messages).u16(3).u32(3).u32(0).u32(0).u32(0);
    body.u64(0).u64(0).bytes(&counts.0).record(op::STATISTICS)
}

#[test]
fn statistics_that_say_nothing_of_a_loss_raise_no_alarm() {
    let [data, summary] = parts(&chunked());
    let max = u64::MAX;
    let sound = [(1, 200), (2, 20), (3, 20)];
    let cases: [(&str, Option<Vec<u8>>); 9] = [
        ("none", None),
        ("right", Some(statistics(ALL, &sound))),
        ("of no channel", Some(statistics(ALL, &[]))),
        ("of one channel", Some(statistics(ALL, &[(1, 200)]))),
        ("zeros", Some(statistics(0, &[(1, 0), (2, 0), (3, 0)]))),
        ("zeros of channels", Some(statistics(ALL, &[(1, 0), (2, 0), (3, 0)]))),
        ("fewer", Some(statistics(100, &[(1, 90), (2, 10)]))),
        ("the most", Some(statistics(max, &[(1, max), (2, max), (9, max)]))),
        ("too long", Some(Body::default().u64(ALL).raw(&[0; 20]).record(op::STATISTICS))),
    ];
    for (what, record) in cases {
        let others = summary.iter().filter(|(opcode, _)| *opcode != op::STATISTICS).cloned();
        let record = record.map(|bytes| (op::STATISTICS, bytes));
        let summary: Vec<_> = others.chain(record).collect();
        let bytes = log_of(&data, &summary);
        let read_summary = inspected(&bytes).read_summary;
        assert_eq!(read_summary.rejects, [], "{what}");
        assert_eq!((read_summary.messages, read_summary.messages_lost), (ALL, 0), "{what}");
        let (code, words) = shown(&bytes);
        assert_eq!(code, Some(0), "{what}: {words}");
        let noted = words.contains("its writer counted wrongly");
        assert_eq!(noted, ["zeros", "fewer"].contains(&what), "{what}: {words}");
        is_whole(&read(&bytes).expect("sound"), what);
    }
    // A count that is too large, yet not beyond belief, is one of lost messages, and the share stays below one.
    for (stated, lost) in [(ALL + 10, 10), (1 << 48, (1 << 48) - ALL)] {
        let summary = [(op::STATISTICS, statistics(stated, &[]))];
        let read_summary = inspected(&log_of(&data, &summary)).read_summary;
        assert_eq!(read_summary.messages_lost, lost);
        assert_eq!(read_summary.bytes_lost(), 0);
    }
    // A damaged summary proves nothing.
    let mut damaged = log_of(&data, &[(op::STATISTICS, statistics(1000, &[]))]);
    let at = damaged.len() - 60;
    damaged[at] ^= 1;
    assert_eq!(inspected(&damaged).read_summary.messages_lost, 0);
}

#[test]
fn records_of_an_application_are_stepped_over_and_counted() {
    let private = |opcode: u8, length: usize| (opcode, Body(vec![7; length]).record(opcode));
    for log in [chunked(), unchunked()] {
        let [mut data, mut summary] = parts(&log);
        for (place, record) in [
            (1, private(0x80, 0)),
            (3, private(0xff, 1000)),
            (7, private(0x85, 300_000)),
            (7, private(0x86, 100)),
        ] {
            data.insert(place, record);
        }
        data.push(private(0x80, 5));
        summary.insert(1, private(0x90, 5));
        let bytes = log_of(&data, &summary);
        let read_summary = inspected(&bytes).read_summary;
        assert_eq!(read_summary.rejects, []);
        let counted: Vec<_> = read_summary.private_records.into_iter().collect();
        assert_eq!(counted, [(0x80, 2), (0x85, 1), (0x86, 1), (0xff, 1)]);
        is_whole(&read(&bytes).expect("sound"), "private records");
        let (code, words) = shown(&bytes);
        assert_eq!(code, Some(0), "{words}");
        assert!(words.contains("2 with opcode 0x80"), "{words}");
    }
    // In a chunk as well.
    let at = u64::try_from(stamp(0)).expect("positive");
    let state = Cdr::stamped(stamp(0)).joints(&["a", "b"], &[0.0, 0.0]).done();
    let (name, text) = crate::build::schema("JointState");
    let records = [
        raw::schema(1, &name, "ros2msg", text.as_bytes()).record(op::SCHEMA),
        private(0xc0, 10).1,
        raw::channel(1, 1, "/joints", "cdr", &[]).record(op::CHANNEL),
        raw::message(1, 0, at, at, &state).record(op::MESSAGE),
        private(0xc0, 0).1,
    ];
    let chunk = raw::chunk((at, at), &records.concat(), raw::Packing::Zstd).record(op::CHUNK);
    let read_summary = inspected(&raw::log(&[chunk])).read_summary;
    assert_eq!(read_summary.rejects, []);
    assert_eq!(read_summary.messages, 1);
    assert_eq!(read_summary.private_records.into_iter().collect::<Vec<_>>(), [(0xc0, 2)]);
}

#[test]
fn a_record_that_one_bit_makes_an_applications_is_not_lost_in_silence() {
    for log in [chunked(), unchunked()] {
        let contents = frames(&log).into_iter().filter(|f| matches!(f.2, op::CHUNK | op::MESSAGE));
        for (start, _, _) in contents.step_by(5) {
            let mut damaged = log.clone();
            damaged[start] |= 0x80;
            let recording = read(&damaged).map(|recording| recording.rejects);
            assert!(recording.is_err() || recording.is_ok_and(|rejects| !rejects.is_empty()));
        }
    }
}

#[test]
fn a_pipe_or_a_device_is_reported_at_once() {
    let folder = Folder::new();
    let pipe = folder.path().join("pipe.mcap");
    let made = Command::new("mkfifo").arg(&pipe).status();
    assert!(made.is_ok_and(|status| status.success()), "mkfifo");
    for (path, what) in [
        (pipe.as_path(), "a pipe (FIFO), not a file"),
        ("/dev/zero".as_ref(), "a device, not a file"),
    ] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_posegrid"))
            .arg("inspect")
            .arg(path)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("started");
        let begun = Instant::now();
        while child.try_wait().expect("a child").is_none() {
            if begun.elapsed() > Duration::from_mins(1) {
                child.kill().expect("a child");
                panic!("{}: no end", path.display());
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        let output = child.wait_with_output().expect("ended");
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{told}");
        assert!(told.contains(what), "{told}");
    }
}
