//! Damaged logs: a clear error or a reject with the byte range, and never a message lost in silence.

use std::collections::BTreeMap;

use mcap::{Compression, WriteOptions};
use posegrid::io::log::{Limits, LogError};

use crate::build::{Folder, Log, WholeSession, read, read_file, session, session_log, stamp};

const MESSAGES: u32 = 200;

/// Every way a log of [`session`] is stored.
fn storages() -> Vec<(&'static str, Vec<u8>)> {
    let unchunked = || {
        let mut log = Log::with(WriteOptions::new().use_chunks(false));
        session(&mut log, MESSAGES);
        log.done()
    };
    vec![
        ("zstd", session_log(Some(Compression::Zstd), MESSAGES)),
        ("lz4", session_log(Some(Compression::Lz4), MESSAGES)),
        ("uncompressed", session_log(None, MESSAGES)),
        ("unchunked", unchunked()),
    ]
}

/// Top-level frames: first byte, one past the last byte, opcode.
pub fn frames(log: &[u8]) -> Vec<(usize, usize, u8)> {
    let mut found = Vec::new();
    let mut at = 8;
    while at + 9 <= log.len() {
        let length = u64::from_le_bytes(log[at + 1..at + 9].try_into().expect("eight"));
        let end = at + 9 + usize::try_from(length).expect("a sound log");
        found.push((at, end, log[at]));
        if log[at] == mcap::records::op::FOOTER {
            break;
        }
        at = end;
    }
    found
}

/// The frame that each joint state of a sound log lies in, by number.
fn homes(log: &[u8]) -> BTreeMap<u32, (usize, usize)> {
    use mcap::records::Record;
    let mut homes = BTreeMap::new();
    let mut note = |record: &Record<'_>, home| {
        if let Record::Message { header, .. } = record
            && header.channel_id == 1
        {
            let ns = i64::try_from(header.log_time).expect("small") - 1_000_000_000;
            homes.insert(u32::try_from((ns - stamp(0)) / 10_000_000).expect("small"), home);
        }
    };
    for (start, end, opcode) in frames(log) {
        let record = mcap::parse_record(opcode, &log[start + 9..end]).expect("a sound log");
        match record {
            Record::Chunk { header, data } => {
                let records = mcap::read::ChunkReader::new(header, &data).expect("a sound chunk");
                records.for_each(|record| note(&record.expect("a sound record"), (start, end)));
            }
            record => note(&record, (start, end)),
        }
    }
    homes
}

/// Numbers of the joint states that were decoded; each must be what was written.
fn decoded(recording: &WholeSession) -> Vec<u32> {
    let joints = &recording.joints;
    let trusted =
        !recording.rejects.iter().any(|reject| reject.reason.contains("checksum of all records"));
    let numbers = joints
        .stamps
        .iter()
        .map(|at| u32::try_from((at.ns() - stamp(0)) / 10_000_000).unwrap_or(u32::MAX));
    let numbers: Vec<_> = numbers.collect();
    for (row, &i) in numbers.iter().enumerate().filter(|_| trusted) {
        assert_eq!(joints.angles.row(row)[0].to_bits(), f64::from(i).to_bits(), "row {row}");
        assert_eq!(joints.angles.row(row)[1].to_bits(), (-f64::from(i)).to_bits(), "row {row}");
    }
    numbers
}

/// Each joint state was decoded or lies in bytes that are reported lost.
fn all_accounted(log: &[u8], homes: &BTreeMap<u32, (usize, usize)>, length: usize, case: &str) {
    let recording = match read(log) {
        Ok(recording) => recording,
        // Nothing is decoded, and the error says so.
        Err(
            LogError::File(_)
            | LogError::UnknownTopic { .. }
            | LogError::Ingest(_)
            | LogError::Schema { .. }
            | LogError::Unsuitable(_),
        ) => return,
        Err(error) => panic!("{case}: {error}"),
    };
    let decoded = decoded(&recording);
    let checksum =
        recording.rejects.iter().any(|reject| reject.reason.contains("checksum of all records"));
    for (i, &(start, end)) in homes {
        let lost = recording.rejects.iter().any(|reject| {
            let reaches_end = reject.byte_end == length as u64 && start >= length;
            (reject.byte_start < end as u64 && reject.byte_end > start as u64) || reaches_end
        });
        assert!(
            checksum || lost || decoded.contains(i),
            "{case}: message {i} is lost in silence: {:?}",
            recording.rejects
        );
    }
    let counts = &recording.counts;
    assert_eq!(
        counts["joints.messages"],
        counts["joints.kept"] + counts["joints.rejected"],
        "{case}"
    );
}

#[test]
fn missing_empty_and_foreign_files_are_named() {
    let folder = Folder::new();
    let cases: [(&str, &[u8], &str); 4] = [
        ("empty.mcap", b"", "empty"),
        ("text.mcap", b"time,x,y,z\n", "not an MCAP log"),
        ("short.mcap", b"\x89MCA", "not an MCAP log"),
        ("packed.mcap", b"\x28\xb5\x2f\xfdxxxx", "zstd"),
    ];
    let read = |path: &std::path::Path| read_file(path, Limits::default());
    for (name, bytes, expected) in cases {
        let error = read(&folder.file(name, bytes)).expect_err("refused").to_string();
        assert!(error.contains(name) && error.contains(expected), "{error}");
    }
    let error = read(&folder.path().join("absent.mcap")).expect_err("refused").to_string();
    assert!(error.contains("absent.mcap"), "{error}");
    let error = read(folder.path()).expect_err("refused").to_string();
    assert!(
        error.contains("it is a folder") && error.contains("give the file of a log"),
        "{error}"
    );
}

#[test]
fn magic_alone_is_a_log_without_topics() {
    let error = read(mcap::MAGIC).expect_err("refused").to_string();
    assert!(
        error.contains("/joints") && error.contains("none") && error.contains("damaged"),
        "{error}"
    );
}

#[test]
fn a_log_cut_at_ten_places_is_read_up_to_there() {
    for (storage, log) in storages() {
        let homes = homes(&log);
        let data_end =
            frames(&log).iter().find(|f| f.2 == mcap::records::op::DATA_END).expect("written").0;
        for tenth in 1..=10 {
            let length = data_end * tenth / 10;
            let cut = &log[..length];
            let case = format!("{storage} cut to {length} of {}", log.len());
            all_accounted(cut, &homes, length, &case);
            let Ok(recording) = read(cut) else {
                assert!(tenth < 4, "{case}: definitions and first messages are there");
                continue;
            };
            let lost = recording.rejects.last().expect("the cut is told");
            assert_eq!(lost.byte_end, length as u64, "{case}");
            let whole = homes.values().filter(|home| home.1 <= length).count();
            assert_eq!(recording.joints.stamps.len(), whole, "{case}: all that is whole is read");
        }
    }
}

#[test]
fn a_flipped_byte_costs_its_chunk_and_nothing_else() {
    for (storage, log) in storages().into_iter().take(3) {
        let homes = homes(&log);
        let chunks: Vec<_> =
            frames(&log).into_iter().filter(|f| f.2 == mcap::records::op::CHUNK).collect();
        assert!(chunks.len() > 5, "{storage}: {} chunks", chunks.len());
        let (start, end, _) = chunks[3];
        let mut damaged = log.clone();
        damaged[usize::midpoint(start, end)] ^= 0x10;
        let recording = read(&damaged).expect("the rest is sound");
        let [reject] = &recording.rejects[..] else {
            panic!("{storage}: one chunk is lost: {:?}", recording.rejects)
        };
        assert_eq!((reject.byte_start, reject.byte_end), (start as u64, end as u64));
        let lost: Vec<_> =
            homes.iter().filter(|(_, home)| home.0 == start).map(|(i, _)| *i).collect();
        let span = reject.time_span_ns.expect("the chunk's header tells");
        let log_time = |i: u32| stamp(i) + 1_000_000_000;
        assert_eq!(span, (log_time(lost[0]), log_time(lost[lost.len() - 1])));
        // Its message indexes count joint states, commands and readings.
        assert!(reject.messages.expect("indexed") >= lost.len() as u64);
        assert_eq!(recording.joints.stamps.len(), homes.len() - lost.len());
        all_accounted(&damaged, &homes, damaged.len(), storage);
    }
}

#[test]
fn a_flipped_byte_outside_chunks_is_noticed_by_the_checksum_of_all() {
    let (_, log) = storages().remove(3);
    let (start, _, _) = frames(&log)[50];
    let mut damaged = log;
    // The first byte of a number or stamp: the message still decodes.
    damaged[start + 9 + 22 + 4] ^= 1;
    let recording = read(&damaged).expect("still decodes");
    assert!(
        recording.rejects[0].reason.contains("checksum of all records"),
        "{:?}",
        recording.rejects
    );
}

#[test]
fn a_message_that_cannot_be_used_does_not_hide_another_that_is_damaged() {
    let (_, log) = storages().remove(3);
    let messages: Vec<_> =
        frames(&log).into_iter().filter(|f| f.2 == mcap::records::op::MESSAGE).collect();
    let mut damaged = log;
    // One message whose encapsulation is none, and one whose stamp is another: 22 bytes of header stand before them.
    for (place, offset) in [(40, 1), (50, 4)] {
        damaged[messages[place].0 + 9 + 22 + offset] ^= 0x40;
    }
    let recording = read(&damaged).expect("still decodes");
    let told = |text: &str| recording.rejects.iter().any(|reject| reject.reason.contains(text));
    assert!(told("encapsulation") && told("checksum of all records"), "{:?}", recording.rejects);
}

#[test]
fn channels_defined_in_a_lost_chunk_are_known_from_the_summary() {
    let log = session_log(Some(Compression::Zstd), MESSAGES);
    let (start, end, _) =
        *frames(&log).iter().find(|f| f.2 == mcap::records::op::CHUNK).expect("chunked");
    let mut damaged = log.clone();
    damaged[usize::midpoint(start, end)] ^= 1;
    let recording = read(&damaged).expect("the summary repeats what the first chunk defines");
    assert_eq!(recording.rejects.len(), 1);
    let lost = homes(&log).values().filter(|home| home.0 == start).count();
    assert_eq!(recording.joints.stamps.len(), MESSAGES as usize - lost);
    // With a summary that is damaged as well, the channels stay unknown.
    let summary = damaged.len() - 200;
    damaged[summary] ^= 1;
    let error = read(&damaged).expect_err("no channel is known").to_string();
    assert!(error.contains("damaged in"), "{error}");
}

/// A fixed sequence of numbers that look random (splitmix64).
struct Chance(u64);

impl Chance {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        usize::try_from((z ^ (z >> 31)) % limit as u64).expect("below a usize")
    }
}

#[test]
fn no_single_flipped_bit_loses_a_message_in_silence() {
    let mut chance = Chance(1);
    for (storage, log) in storages() {
        let homes = homes(&log);
        for _ in 0..150 {
            let (byte, bit) = (chance.below(log.len()), chance.below(8));
            let mut damaged = log.clone();
            damaged[byte] ^= 1 << bit;
            all_accounted(
                &damaged,
                &homes,
                log.len(),
                &format!("{storage}, byte {byte}, bit {bit}"),
            );
        }
    }
}

#[test]
fn no_damaged_frame_loses_a_message_in_silence() {
    for (storage, log) in storages() {
        let homes = homes(&log);
        let places = frames(&log);
        for &(start, _, _) in places.iter().step_by(places.len() / 12) {
            for (offset, bytes) in [
                (0, &[0x07_u8][..]),
                (0, &[0x00]),
                (0, &[0x84]),
                (1, &[0xff; 8]),
                (1, &[0; 8]),
                (1, &[0, 0, 0, 0, 0, 1]),
                (3, &[0x40]),
                (0, &[0xee; 40]),
            ] {
                let mut damaged = log.clone();
                let end = (start + offset + bytes.len()).min(log.len());
                damaged[start + offset..end].copy_from_slice(&bytes[..end - start - offset]);
                all_accounted(
                    &damaged,
                    &homes,
                    log.len(),
                    &format!("{storage}, frame {start}, {offset} {bytes:?}"),
                );
            }
        }
    }
}

#[test]
fn a_definition_does_not_swallow_what_follows() {
    use mcap::records::op;
    for (storage, log) in storages() {
        let homes = homes(&log);
        let definitions = frames(&log)
            .into_iter()
            .filter(|f| matches!(f.2, op::HEADER | op::SCHEMA | op::CHANNEL));
        for (start, _, _) in definitions {
            // The length, 512 or 4096 or 16384 more.
            for bit in [1, 4, 6] {
                let mut damaged = log.clone();
                damaged[start + 2] ^= 1 << bit;
                all_accounted(
                    &damaged,
                    &homes,
                    log.len(),
                    &format!("{storage}, frame {start}, bit {bit}"),
                );
            }
        }
    }
}

#[test]
fn every_cut_is_accounted_for() {
    let mut chance = Chance(2);
    for (storage, log) in storages() {
        let homes = homes(&log);
        for _ in 0..60 {
            let length = chance.below(log.len());
            all_accounted(&log[..length], &homes, length, &format!("{storage} cut to {length}"));
        }
    }
}

#[test]
fn sizes_that_a_log_states_are_not_believed() {
    let log = session_log(Some(Compression::Zstd), MESSAGES);
    let (start, end, _) =
        *frames(&log).iter().find(|f| f.2 == mcap::records::op::CHUNK).expect("chunked");
    // uncompressed_size stands 16 bytes into the body.
    let field = start + 9 + 16;
    for stated in [u64::MAX, 1 << 40, 200 << 20, 1, 0] {
        let mut damaged = log.clone();
        damaged[field..field + 8].copy_from_slice(&stated.to_le_bytes());
        let error = read(&damaged).err();
        // The first chunk defines the channels, so losing it may leave nothing known.
        if let Some(error) = error {
            assert!(error.to_string().contains("damaged in"), "{error}");
        }
        all_accounted(
            &damaged,
            &homes(&log),
            log.len(),
            &format!("{stated} bytes in chunk {start}..{end}"),
        );
    }
}
