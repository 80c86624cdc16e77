//! A log with every kind of record, in which every field in turn holds what it should not: no panic, no hang, no memory by a
//! number from the file, and no message lost in silence.

pub mod log;

use std::fs;
use std::ops::Range;
use std::process::Command;

use posegrid::io::inspect::inspect;
use posegrid::io::log::{Limits, LogError, SessionLogs, read_session};
use posegrid::join::JoinSettings;
use posegrid::progress::Quiet;

use crate::build::{Folder, mapping, read_file, stamp};
use crate::raw::{Packing, op};
use log::{Field, Log, fields};

/// Small limits, so that a number from a file that is believed shows.
const LIMITS: Limits = Limits {
    record_bytes: 8 << 20,
    chunk_bytes: 8 << 20,
    batch_bytes: 8 << 20,
    unpacked_bytes: 32 << 20,
    file_bytes: 1 << 20,
};

/// A log with one thing wrong.
struct Mutant {
    what: String,
    bytes: Vec<u8>,
    /// Bytes of the sound log that were changed; everything from its start for a length, which moves what follows.
    changed: Range<usize>,
    /// Bytes of the sound log whose messages may come out otherwise, since nothing in the file could tell.
    excused: Range<usize>,
}

impl Mutant {
    /// Where something of the sound log lies now: what stands behind a chunk of another length has moved.
    fn place(&self, log: &Log, home: &Range<usize>) -> Range<usize> {
        let cut = self.changed.end == log.bytes.len();
        if cut || home.start < self.changed.end {
            return home.clone();
        }
        let moved = |at: usize| at + self.bytes.len() - log.bytes.len();
        moved(home.start)..moved(home.end)
    }
}

const NOTHING: Range<usize> = 0..0;

/// What each field is set to.
fn wrong_values(field: &Field, sound: u64, length: usize) -> Vec<u64> {
    let bits = 8 * u32::try_from(field.width).expect("at most eight");
    let max = u64::MAX >> (64 - bits);
    let mut values = vec![
        0,
        1,
        max,
        max >> 1,
        sound.wrapping_add(1) & max,
        sound.wrapping_sub(1) & max,
        sound ^ (1 << (bits - 1)),
    ];
    if field.width == 8 {
        values.extend([1 << 40, length as u64, (length as u64).wrapping_neg()]);
    }
    if field.name.ends_with("opcode") {
        values.extend(0..=16);
    }
    values.retain(|value| *value != sound);
    values.sort_unstable();
    values.dedup();
    values
}

/// Every field of the file with every wrong value.
fn mutants(log: &Log) -> Vec<Mutant> {
    let bytes = &log.bytes;
    let mut found = Vec::new();
    for field in fields(bytes, 8..bytes.len() - 8) {
        let changed = field.at..field.at + field.width;
        let frames = field.name.ends_with("opcode") || field.name.ends_with("record length");
        let in_chunk = log.chunks.iter().any(|chunk| chunk.place.contains(&field.at));
        let told = log.has_data_crc || frames || in_chunk;
        for value in wrong_values(&field, field.value(bytes), bytes.len()) {
            found.push(Mutant {
                what: format!("{} at {} = {value:#x}", field.name, field.at),
                bytes: field.set(bytes, value),
                changed: changed.clone(),
                excused: if told { NOTHING } else { changed.clone() },
            });
        }
    }
    found
}

/// The same for the records in its chunks.
fn mutants_in_chunks(log: &Log) -> Vec<Mutant> {
    let mut found = Vec::new();
    for chunk in &log.chunks {
        for field in fields(&chunk.records, 0..chunk.records.len()) {
            for value in wrong_values(&field, field.value(&chunk.records), log.bytes.len()) {
                let records = field.set(&chunk.records, value);
                for (keep_crc, checksum) in [(true, "kept"), (false, "made to fit")] {
                    found.push(Mutant {
                        what: format!(
                            "in a {:?} chunk, its checksum {checksum}: {} = {value:#x}",
                            chunk.packing, field.name
                        ),
                        bytes: log.with_chunk(chunk, &records, keep_crc),
                        changed: chunk.place.clone(),
                        excused: if keep_crc { NOTHING } else { chunk.place.clone() },
                    });
                }
            }
        }
    }
    found
}

/// What is wrong with more than a field: places where the file ends, and compressed bytes that lie about themselves.
fn hostile(log: &Log) -> Vec<Mutant> {
    let bytes = &log.bytes;
    let mut found: Vec<Mutant> = (0..bytes.len())
        .step_by(97)
        .map(|length| Mutant {
            what: format!("cut to {length}"),
            bytes: bytes[..length].to_vec(),
            changed: length..bytes.len(),
            excused: NOTHING,
        })
        .collect();
    for chunk in log.chunks.iter().filter(|chunk| chunk.packing != Packing::None) {
        // The frame's own header: its window and its content size.
        for at in 0..16 {
            for value in [0x00, 0x7f, 0x80, 0xff] {
                let mut wrong = bytes.clone();
                let at = chunk.packed.start + at;
                wrong[at] = value;
                found.push(Mutant {
                    what: format!("byte {at} of {:?} = {value:#x}", chunk.packing),
                    bytes: wrong,
                    changed: chunk.place.clone(),
                    excused: NOTHING,
                });
            }
        }
        for (name, bomb) in bombs(chunk.packing) {
            for stated in [1000, bomb.1, u64::MAX] {
                found.push(Mutant {
                    what: format!("{name} in {:?} that states {stated} bytes", chunk.packing),
                    bytes: log.with_packed(chunk, &bomb.0, stated),
                    changed: chunk.place.clone(),
                    excused: NOTHING,
                });
            }
        }
    }
    found
}

/// Few bytes that become many: zeros, and messages of a channel that is not defined.
fn bombs(packing: Packing) -> [(&'static str, (Vec<u8>, u64)); 2] {
    let zeros = vec![0; 64 << 20];
    let message = crate::raw::message(999, 0, 0, 0, &[]).record(op::MESSAGE);
    let messages = message.repeat((64 << 20) / message.len());
    [("zeros", zeros), ("messages", messages)]
        .map(|(name, unpacked)| (name, (packing.pack(&unpacked), unpacked.len() as u64)))
}

/// Whether each joint state was decoded as it was written, or lies in bytes that are reported, or is
/// excused.
fn check(log: &Log, mutant: &Mutant, folder: &Folder) -> Result<(), LogError> {
    let path = folder.file("mutant.mcap", &mutant.bytes);
    let what = &mutant.what;
    let seen = inspect(&path, LIMITS, &Quiet);
    let recording = read_file(&path, LIMITS)?;
    let seen = seen.unwrap_or_else(|error| panic!("{what}: {error}"));
    let counted: u64 = seen.channels.iter().map(|channel| channel.traffic.messages).sum();
    let unknown: u64 = seen
        .read_summary
        .rejects
        .iter()
        .filter(|reject| reject.reason.contains("which no record before them"))
        .filter_map(|reject| reject.messages)
        .sum();
    assert_eq!(counted + unknown, seen.read_summary.messages, "{what}: {seen:#?}");
    for stream in ["joints", "commands", "readings"] {
        let count = |name: &str| recording.counts.get(&format!("{stream}.{name}")).copied();
        let [messages, kept, rejected, repeated] =
            ["messages", "kept", "rejected", "repeated"].map(|name| count(name).unwrap_or(0));
        assert_eq!(messages, kept + rejected + repeated, "{what}: {stream}");
    }
    for (i, sound) in &log.homes {
        let home = mutant.place(log, sound);
        let row = recording.joints.stamps.iter().position(|at| at.ns() == stamp(*i));
        let whole = row.is_some_and(|row| {
            recording.joints.angles.row(row)[0].to_bits() == f64::from(*i).to_bits()
        });
        let reported = recording.rejects.iter().any(|reject| {
            let beyond =
                reject.byte_end == mutant.bytes.len() as u64 && home.end > mutant.bytes.len();
            beyond || (reject.byte_start < home.end as u64 && reject.byte_end > home.start as u64)
        });
        let excused = mutant.excused.start < sound.end && mutant.excused.end > sound.start;
        assert!(
            whole || reported || excused,
            "{what}: message {i} at {home:?} is lost in silence: {:#?}",
            recording.rejects
        );
    }
    Ok(())
}

/// Reads all mutants; how many there were, and of how many the rest could be read.
fn check_all(log: &Log, mutants: &[Mutant]) -> (usize, usize) {
    let folder = Folder::new();
    let read = mutants.iter().filter(|mutant| check(log, mutant, &folder).is_ok());
    let read = read.count();
    println!("{} mutants, {read} of them could be read", mutants.len());
    (mutants.len(), read)
}

#[test]
fn the_log_itself_is_sound() {
    for has_data_crc in [true, false] {
        let log = Log::new(has_data_crc);
        let recording = crate::build::read(&log.bytes).expect("sound");
        assert_eq!(recording.rejects, []);
        assert_eq!(recording.joints.stamps.len(), log.homes.len());
        assert_eq!(recording.commands.stamps.len(), 2);
    }
}

#[test]
fn every_field_of_a_log_with_checksums_can_lie() {
    let log = Log::new(true);
    let mut mutants = mutants(&log);
    mutants.extend(mutants_in_chunks(&log));
    let (all, read) = check_all(&log, &mutants);
    assert!(all > 3000, "{all} mutants");
    // Where a definition is what is wrong, there is an error that says so; most damage leaves the rest readable.
    assert!(read * 10 > all * 7, "{read} of {all} mutants could be read");
}

#[test]
fn every_field_of_a_log_without_checksums_can_lie() {
    let log = Log::new(false);
    let (all, read) = check_all(&log, &mutants(&log));
    assert!(all > 1500, "{all} mutants");
    assert!(read * 10 > all * 7, "{read} of {all} mutants could be read");
}

#[test]
fn cuts_and_compressed_lies_lose_nothing_in_silence() {
    let log = Log::new(true);
    let (all, read) = check_all(&log, &hostile(&log));
    assert!(all > 150 && read * 10 > all * 7, "{read} of {all} mutants could be read");
}

/// The largest memory that this process ever held, bytes; where the system tells.
fn peak() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kb| kb * 1024)
}

/// Not a test of its own: reads what the test below wrote, in a process of its own whose memory it tells.
#[test]
#[ignore = "started by hostile_logs_stay_within_the_memory_that_is_configured"]
fn child() {
    let Ok(folder) = std::env::var("POSEGRID_MUTANTS") else {
        return;
    };
    for entry in fs::read_dir(folder).expect("the parent made it") {
        let path = entry.expect("readable").path();
        // Either may refuse the file; it is the memory that counts.
        let _ = inspect(&path, LIMITS, &Quiet);
        let logs = SessionLogs::of_two(&path, &path);
        let rule = JoinSettings::default().arm_rule();
        let _ = read_session(&logs, &mapping(), LIMITS, &rule, &mut (), &Quiet);
    }
    println!("peak {}", peak().unwrap_or(0));
}

#[test]
fn hostile_logs_stay_within_the_memory_that_is_configured() {
    let folder = Folder::new();
    let log = Log::new(false);
    let in_chunks = mutants_in_chunks(&log).into_iter();
    let all = mutants(&log).into_iter().chain(in_chunks).chain(hostile(&log));
    let long = all.filter(|mutant| {
        let values = ["0xff", "0x7f", "0x80", "0x100000", "states"];
        values.iter().any(|value| mutant.what.contains(value))
    });
    let mut count = 0;
    for mutant in long {
        folder.file(&format!("{count}.mcap"), &mutant.bytes);
        count += 1;
    }
    for (name, bytes) in log::large(&log) {
        folder.file(&format!("{name}.mcap"), &bytes);
    }
    assert!(count > 500, "{count}");
    let output = Command::new(std::env::current_exe().expect("this test"))
        .args(["--ignored", "--exact", "mutator::child", "--nocapture", "--test-threads", "1"])
        .env("POSEGRID_MUTANTS", folder.path())
        .output()
        .expect("started");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{text}{}", String::from_utf8_lossy(&output.stderr));
    let told = text.lines().find_map(|line| line.split_once("peak ")).expect("told");
    let peak: u64 = told.1.trim().parse().expect("a number");
    if peak == 0 {
        eprintln!("NOT TESTED: this system does not tell a process's peak memory");
        return;
    }
    // What is told of each channel is not in the limits: half a kilobyte for each of the 65,535 that a log may have.
    let channels = 65_535 * 512;
    let limit = LIMITS.chunk_bytes + LIMITS.batch_bytes + (64 << 20) + channels;
    println!("{count} mutants: {peak} bytes at the most, {limit} are allowed");
    assert!(peak < limit, "{peak} bytes at the most, {limit} are allowed");
}
