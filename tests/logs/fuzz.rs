//! Logs, messages, pipeline files and robot files, changed at random (`tests/common/fuzz.rs`).
//!
//! `POSEGRID_FUZZ_SECONDS=600 cargo test --release --test logs fuzz::` takes ten minutes for each target; targets and
//! tables that somebody gives are fuzzed in `tests/run/compensate`.
//!
//! Long runs so far, all clean (on two busy cores; seconds, thousands of inputs): `log_file` 420, 691; `log_file_in_zstd`
//! 420, 782; `schema_and_message` 300, 970; `pipeline_file` 450, 85; `robot_file` 450, 43.

#[path = "../common/fuzz.rs"]
mod harness;

use std::fs;
use std::path::Path;

use mcap::Compression;
use posegrid::files::message::{FieldPath, MessageSchema, Row};
use posegrid::io::inspect::inspect;
use posegrid::io::log::{Limits, SessionLogs, Suggestible};
use posegrid::pipeline::configuration::{Configuration, Overrides};
use posegrid::progress::Quiet;

use crate::build::{Folder, session_log};
use crate::dwells::consistent;
use crate::encodings::sample::Noise;
use crate::encodings::worded::{Seen, compare};
use crate::mutator::log::Log;
use crate::raw::{self, Body, op};
use crate::{conformance, encodings};
use harness::{Chance, LONGEST, NUMBERS, change, change_text, fuzz};

const LIMITS: Limits = Limits {
    record_bytes: 4 << 20,
    chunk_bytes: 4 << 20,
    batch_bytes: 4 << 20,
    unpacked_bytes: 16 << 20,
    file_bytes: 1 << 20,
};

/// Places of records in a log, as far as their lengths lead from one to the next, and one past the last.
fn record_places(bytes: &[u8]) -> Vec<usize> {
    let mut places = vec![8.min(bytes.len())];
    while let Some(&at) = places.last()
        && let Some(length) = bytes.get(at + 1..at + 9).and_then(|b| b.first_chunk())
        && let Ok(length) = usize::try_from(u64::from_le_bytes(*length))
        && let Some(end) = at.checked_add(9).and_then(|body| body.checked_add(length))
        && end <= bytes.len()
    {
        places.push(end);
    }
    places
}

/// Changes a log by whole records: cuts some out, puts others in, another log behind it, an end where there is none, counts
/// that are wrong.
fn change_log(bytes: &mut Vec<u8>, others: &[Vec<u8>], chance: &mut Chance) {
    let places = record_places(bytes);
    let at = *chance.of(&places);
    let next = places.iter().find(|&&place| place > at);
    let next = next.copied().unwrap_or(at);
    match chance.below(16) {
        0 => drop(bytes.drain(at..next)),
        1 => {
            let end = raw::data_end(0).record(op::DATA_END);
            drop(bytes.splice(at..at, end));
        }
        2 => {
            let opcode = 0x80 | chance.next().to_le_bytes()[0];
            let body = Body(vec![chance.next().to_le_bytes()[0]; chance.below(100)]);
            drop(bytes.splice(at..at, body.record(opcode)));
        }
        3 => {
            let other = chance.of(others).clone();
            drop(bytes.splice(at..at, other));
        }
        4 => bytes.extend(chance.of(others)),
        5 => {
            let other = chance.of(others);
            let from = record_places(other);
            let (one, two) = (*chance.of(&from), *chance.of(&from));
            let records = other[one.min(two)..one.max(two)].to_vec();
            drop(bytes.splice(at..at, records));
        }
        6 => set_statistics(bytes, chance),
        7 if next > at => {
            // A record that takes in the ones behind it.
            let to = *chance.of(&places);
            if let Some(length) = to.checked_sub(at + 9) {
                bytes[at + 1..at + 9].copy_from_slice(&(length as u64).to_le_bytes());
            }
        }
        _ => return change(bytes, others, chance),
    }
    bytes.truncate(LONGEST);
}

/// Makes the summary count otherwise, and its checksum fit.
fn set_statistics(bytes: &mut [u8], chance: &mut Chance) {
    let places = record_places(bytes);
    let of = |opcode| places.iter().find(|&&at| bytes.get(at) == Some(&opcode)).copied();
    let (Some(counts), Some(footer)) = (of(op::STATISTICS), of(op::FOOTER)) else {
        return;
    };
    let number = chance.of(&NUMBERS).to_le_bytes();
    // Of all messages, or of a channel: behind lengths and other counts.
    let field = counts + 9 + *chance.of(&[0, 48, 58]);
    let Some(place) = bytes.get_mut(field..field + 8) else {
        return;
    };
    place.copy_from_slice(&number);
    let start = bytes.get(footer + 9..footer + 17).and_then(|b| b.first_chunk());
    let start = start.map_or(0, |start| u64::from_le_bytes(*start));
    let covered = usize::try_from(start).ok().and_then(|start| bytes.get(start..footer + 25));
    if let Some(crc) = covered.map(crc32fast::hash)
        && let Some(place) = bytes.get_mut(footer + 25..footer + 29)
    {
        place.copy_from_slice(&crc.to_le_bytes());
    }
}

/// Reads a log in all ways; what goes in comes out or is counted.
fn read_log(path: &Path) -> String {
    let (mut outcome, mut summaries) = (String::new(), None);
    match inspect(path, LIMITS, &Quiet) {
        Err(error) => outcome += &error.to_string(),
        Ok(found) => {
            let counted: u64 = found.channels.iter().map(|channel| channel.traffic.messages).sum();
            assert!(counted <= found.read_summary.messages);
            summaries = Some(found.read_summary.clone());
            for reject in &found.read_summary.rejects {
                assert!(reject.byte_start <= reject.byte_end, "{reject:?}");
                outcome += &reject.reason;
            }
        }
    }
    match consistent(&SessionLogs::of_two(path, path), LIMITS, &Quiet) {
        Err(error) => outcome += &error.to_string(),
        Ok(found) => {
            // Both ways of reading see the same log, and lose the same of it.
            let read_summary = summaries.expect("what can be read can be inspected");
            let counts = [
                ("log.messages", read_summary.messages),
                ("log.messages_lost", read_summary.messages_lost),
                ("log.bytes_lost", read_summary.bytes_lost()),
            ];
            for (name, count) in counts {
                assert_eq!(found.counts[name], count, "{name}");
            }
        }
    }
    outcome
}

fn logs() -> Vec<Vec<u8>> {
    let mut seeds = vec![Log::new(true).bytes, Log::new(false).bytes];
    seeds.extend(
        [None, Some(Compression::Zstd), Some(Compression::Lz4)].map(|c| session_log(c, 30)),
    );
    seeds.extend(conformance::samples());
    let private = Body(vec![7; 40]).record(0x91);
    seeds.push(raw::log(&[private.clone(), raw::data_end(0).record(op::DATA_END), private]));
    let both = [session_log(None, 10), session_log(Some(Compression::Zstd), 20)];
    seeds.push(both.concat());
    seeds
}

#[test]
fn log_file() {
    let folder = Folder::new();
    fuzz("log_file", logs(), change_log, |bytes| read_log(&folder.file("log.mcap", bytes)));
}

#[test]
fn log_file_in_zstd() {
    let folder = Folder::new();
    let packed = |log: Vec<u8>| zstd::stream::encode_all(&log[..], 1).expect("memory");
    let seeds = logs().into_iter().map(packed).collect();
    fuzz("log_file_in_zstd", seeds, change, |bytes| read_log(&folder.file("log.mcap.zst", bytes)));
}

/// Encodings of messages with the languages of their schemas.
const FORMS: [(&str, &str); 5] = [
    ("cdr", "ros2msg"),
    ("cdr", "ros2idl"),
    ("protobuf", "protobuf"),
    ("json", "jsonschema"),
    ("ros1", "ros1msg"),
];

/// Which form, length of the type's name, length of the schema; then name, schema and message.
fn packed_form(form: u8, name: &str, schema: &[u8], message: &[u8]) -> Vec<u8> {
    let name_length = u8::try_from(name.len()).expect("short");
    let length = u16::try_from(schema.len()).expect("short").to_le_bytes();
    let head = [form, name_length, length[0], length[1]];
    [&head[..], name.as_bytes(), schema, message].concat()
}

/// Fields of the messages in JSON, whose schemas tell none.
const JSON_PATHS: [&str; 7] = [
    "header.stamp.sec",
    "name",
    "position[1]",
    "joints[].name",
    "joints[].position",
    "timestamp.nsec",
    "point.y",
];

/// Reads every value of a message that its schema knows of; a row that read such messages before reads them as a new one.
fn read_message(bytes: &[u8]) -> String {
    let Some((&[form, name_length, low, high], rest)) = bytes.split_first_chunk() else {
        return "short".to_owned();
    };
    let (encoding, language) = FORMS[usize::from(form) % FORMS.len()];
    let (name, rest) = rest.split_at(usize::from(name_length).min(rest.len()));
    let length = usize::from(u16::from_le_bytes([low, high]));
    let (definition, message) = rest.split_at(length.min(rest.len()));
    let name = String::from_utf8_lossy(name);
    let suggestible = Suggestible::of(encoding, &name, language, definition);
    let suggested = suggestible.suggestion(Some(message));
    let schema = match MessageSchema::read(encoding, &name, language, definition) {
        None => return "no such encoding".to_owned(),
        Some(Err(error)) => return error.to_string(),
        Some(Ok(schema)) => schema,
    };
    let known = JSON_PATHS.map(str::to_owned).into_iter();
    let paths = schema.leaves().into_iter().take(20);
    let paths: Vec<_> = paths
        .chain(known.filter(|_| encoding == "json"))
        .filter_map(|path| FieldPath::parse(&path).ok())
        .collect();
    let reader = match schema.reader(&paths) {
        Err(error) => return error.to_string(),
        Ok(reader) => reader,
    };
    let mut row = Row::default();
    let read = reader.read(message, &mut row);
    let values: Vec<_> = match read {
        Ok(()) => {
            (0..paths.len()).map(|slot| row.value(message, slot).integer().is_some()).collect()
        }
        Err(_) => Vec::new(),
    };
    let mut noise = Noise(message.iter().map(|&byte| u64::from(byte)).sum());
    let wanted = (&reader, paths.len());
    compare(wanted, (message, 20), &mut noise, &mut Seen::default());
    format!("{encoding} {language} {read:?} {values:?} {}", suggested.is_some())
}

#[test]
fn schema_and_message() {
    let seed = |sample: encodings::Sample| {
        let form = FORMS.iter().position(|form| *form == sample.form)?;
        let form = u8::try_from(form).ok()?;
        Some(packed_form(form, sample.type_name, &sample.definition, &sample.message))
    };
    let seeds: Vec<_> = encodings::samples().into_iter().filter_map(seed).collect();
    assert!(seeds.len() >= 4, "{} of the forms", seeds.len());
    fuzz("schema_and_message", seeds, change, read_message);
}

/// A folder with a pipeline file, its robot file and a session.
fn cell() -> Folder {
    let folder = Folder::new();
    let session = folder.path().join("sessions/mon");
    fs::create_dir_all(&session).expect("writable");
    for log in ["controller.mcap", "tracker.mcap"] {
        fs::write(session.join(log), b"").expect("writable");
    }
    folder.file("robot.toml", &toml_file("pipelines/robots/kr210-r2700-extra.toml"));
    folder
}

fn toml_file(path: &str) -> Vec<u8> {
    fs::read(path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

fn pipeline_text() -> String {
    let text = String::from_utf8(toml_file("pipelines/quickstart.toml")).expect("text");
    text.replace("../tests/recordings", "sessions")
        .replace("sessions = [\"quickstart\"]", "sessions = [\"mon\"]")
        .replace("robots/kr210-r2700-extra.toml", "robot.toml")
}

fn planned(path: &Path) -> String {
    match Configuration::load(path, &Overrides::default()) {
        Err(error) => error.to_string(),
        Ok(configuration) => {
            assert!(!configuration.pieces.is_empty() || !configuration.set_aside.is_empty());
            configuration.remarks.join("; ")
        }
    }
}

#[test]
fn pipeline_file() {
    let folder = cell();
    let whole = pipeline_text();
    let path = folder.file("pipeline.toml", whole.as_bytes());
    assert!(Configuration::load(&path, &Overrides::default()).is_ok(), "{}", planned(&path));
    fuzz("pipeline_file", vec![whole.into_bytes()], change_text, |bytes| {
        planned(&folder.file("pipeline.toml", bytes))
    });
}

#[test]
fn robot_file() {
    let folder = cell();
    let path = folder.file("pipeline.toml", pipeline_text().as_bytes());
    let robot = toml_file("pipelines/robots/kr210-r2700-extra.toml");
    fuzz("robot_file", vec![robot], change_text, |bytes| {
        folder.file("robot.toml", bytes);
        planned(&path)
    });
}
