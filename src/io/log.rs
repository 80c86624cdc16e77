//! Logs: MCAP files → decoded columns → a [`Recording`], with every byte that cannot be used accounted for.
//!
//! The reader is our own because default readers panic, abort or drop messages in silence on damaged files. It works
//! from the data section alone; a summary is never needed.
//!
//! 1. Frames: where each record lies (`frames`); damage becomes rejects with byte ranges.
//! 2. Blocks: chunks decompressed and checked in parallel, in bounded memory (`scan`, `block`).
//! 3. Streams: the messages of the wanted topics decoded by a plan into columns (`streams`).
//! 4. [`crate::ingest::ingest`] makes the recording.

mod account;
mod block;
mod chunk;
mod frames;
mod record;
mod registry;
mod scan;
mod source;
mod streams;
mod summary;

use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::ingest::{Decoded, IngestError, Mapping, Recording, ingest};
use crate::io::message::SchemaError;
use crate::progress::Progress;

pub use account::Account;
pub use block::Extent;
pub use record::MessageRecord;
pub use registry::{Channel, Schema};
pub use scan::{Visitor, ns, scan};
pub use streams::{Glance, Layout, Suggestion, suggest};
use streams::{Stream, Streams, Wanted};

/// `[limits]`: what a log may ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// The longest record, bytes; attachments, which are not read, may be longer.
    pub record_bytes: u64,
    /// The largest chunk after decompression, bytes.
    pub chunk_bytes: u64,
    /// What is worked on at once, bytes as stored and decompressed; a single chunk may be larger.
    pub batch_bytes: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            record_bytes: 256 << 20,
            chunk_bytes: 256 << 20,
            batch_bytes: 32 << 20,
        }
    }
}

/// Why a file cannot be read as a log.
#[derive(Debug, Error)]
pub enum FileError {
    /// The operating system says no.
    #[error("{file}: {source}")]
    Io {
        /// The file.
        file: String,
        /// Why.
        source: io::Error,
    },
    /// Nothing in it.
    #[error("{file}: the file is empty; was the recorder stopped before it wrote anything?")]
    Empty {
        /// The file.
        file: String,
    },
    /// Something else.
    #[error(
        "{file}: not an MCAP log: it begins with {start:02x?} instead of 89 4d 43 41 50 30 0d 0a{}",
        what_it_is(start)
    )]
    NotMcap {
        /// The file.
        file: String,
        /// Its first bytes.
        start: Vec<u8>,
    },
}

/// Why two logs make no recording.
#[derive(Debug, Error)]
pub enum LogError {
    /// A file cannot be read as a log.
    #[error(transparent)]
    File(FileError),
    /// A topic that the pipeline file names is not there.
    #[error("{file}: no topic {topic:?}; topics in it: {topics}{damage}")]
    UnknownTopic {
        /// The file.
        file: String,
        /// The topic.
        topic: String,
        /// What it has, with types.
        topics: String,
        /// A remark where the log is damaged, or empty.
        damage: String,
    },
    /// Messages of a kind that this stream cannot be made of.
    #[error(transparent)]
    Unsuitable(Box<Unsuitable>),
    /// A schema that cannot be read or does not hold the fields.
    #[error("{file}: topic {topic:?}: {source}")]
    Schema {
        /// The file.
        file: String,
        /// The topic.
        topic: String,
        /// Why.
        source: SchemaError,
    },
    /// A topic with messages of several kinds.
    #[error(
        "{file}: topic {topic:?} carries messages with and without orientation or covariance; name one publisher's topic"
    )]
    Mixed {
        /// The file.
        file: String,
        /// The topic.
        topic: String,
    },
    /// The same topic for two streams.
    #[error("{file}: topic {topic:?} is named for two streams; each needs a topic of its own")]
    NamedTwice {
        /// The file.
        file: String,
        /// The topic.
        topic: String,
    },
    /// What was decoded makes no recording.
    #[error(transparent)]
    Ingest(#[from] IngestError),
}

/// A topic whose messages the stream it is named for cannot be made of.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "{file}: topic {topic:?} carries {type_name:?} in encoding {encoding:?} with a schema in {schema_encoding:?}; read \
     here are {suitable}, in CDR (with a schema in ros2msg or ros2idl), protobuf or JSON{}",
    by_fields(fields)
)]
pub struct Unsuitable {
    /// The file.
    pub file: String,
    /// The topic.
    pub topic: String,
    /// The type of its messages, empty without a schema.
    pub type_name: String,
    /// How messages are serialised.
    pub encoding: String,
    /// The language of the schema.
    pub schema_encoding: String,
    /// What could be read.
    pub suitable: &'static str,
    /// The fields that the schema has, where it can be read.
    pub fields: Vec<String>,
}

/// What else can be done with messages whose fields are known.
fn by_fields(fields: &[String]) -> String {
    if fields.is_empty() {
        return String::new();
    }
    let fields = fields.join(", ");
    format!(
        "; of any other type name what to read, as in fields = {{ x = \"pose.position.x\", … }}; it has {fields}"
    )
}

/// Guesses what a file is that is no MCAP log.
fn what_it_is(start: &[u8]) -> &'static str {
    match start {
        [0x28, 0xb5, 0x2f, 0xfd, ..] => " (a zstd file: decompress it first)",
        [b'#', b'R', b'O', b'S', b'B', b'A', b'G', ..] => {
            " (a ROS 1 bag: convert it with `mcap convert`)"
        }
        [b'S', b'Q', b'L', b'i', b't', b'e', ..] => {
            " (a rosbag2 SQLite file: convert it with `ros2 bag convert`)"
        }
        _ => "",
    }
}

/// Reads the two logs of a session; both may be the same file.
///
/// Damage does not fail it: what is lost is in the rejects, for the pipeline's limit to judge.
pub fn read_recording(
    controller: &Path,
    tracker: &Path,
    mapping: &Mapping,
    limits: Limits,
    progress: &dyn Progress,
) -> Result<Recording, LogError> {
    let decoded = decode(controller, tracker, mapping, limits, progress)?;
    Ok(ingest(decoded, mapping)?)
}

/// Decodes the two logs of a session into columns in the logs' own units.
pub fn decode(
    controller: &Path,
    tracker: &Path,
    mapping: &Mapping,
    limits: Limits,
    progress: &dyn Progress,
) -> Result<Decoded, LogError> {
    let (of_controller, of_tracker) = wanted(mapping);
    let mut decoded = Decoded::default();
    if same_file(controller, tracker) {
        let all = [of_controller, of_tracker].concat();
        read_file(
            controller,
            "log",
            all,
            mapping,
            limits,
            progress,
            &mut decoded,
        )?;
    } else {
        read_file(
            controller,
            "controller",
            of_controller,
            mapping,
            limits,
            progress,
            &mut decoded,
        )?;
        read_file(
            tracker,
            "tracker",
            of_tracker,
            mapping,
            limits,
            progress,
            &mut decoded,
        )?;
    }
    Ok(decoded)
}

fn same_file(one: &Path, other: &Path) -> bool {
    let real = |path: &Path| path.canonicalize().ok();
    one == other || real(one).is_some_and(|one| real(other) == Some(one))
}

/// The streams wanted of the controller's log and of the tracker's.
fn wanted(mapping: &Mapping) -> (Vec<Wanted>, Vec<Wanted>) {
    let wanted = |stream, topic: &str, time| Wanted {
        stream,
        topic: topic.to_owned(),
        time,
    };
    let (controller, tracker) = (&mapping.controller, &mapping.tracker);
    let mut of_controller = vec![wanted(Stream::Joints, &controller.topic, controller.time)];
    of_controller.extend(
        mapping
            .commanded
            .iter()
            .map(|c| wanted(Stream::Commands, &c.topic, c.time)),
    );
    let mut of_tracker = vec![wanted(Stream::Readings, &tracker.topic, tracker.time)];
    of_tracker.extend(
        tracker
            .temperature
            .iter()
            .map(|t| wanted(Stream::Temperatures, t, tracker.time)),
    );
    (of_controller, of_tracker)
}

fn read_file(
    path: &Path,
    role: &str,
    wanted: Vec<Wanted>,
    mapping: &Mapping,
    limits: Limits,
    progress: &dyn Progress,
    decoded: &mut Decoded,
) -> Result<(), LogError> {
    let file = path.display().to_string();
    let twice = wanted
        .iter()
        .enumerate()
        .find(|(i, w)| wanted[..*i].iter().any(|other| other.topic == w.topic));
    if let Some((_, twice)) = twice {
        let topic = twice.topic.clone();
        return Err(LogError::NamedTwice { file, topic });
    }
    let mut streams = Streams::new(&file, wanted.clone(), mapping);
    let account = scan(path, &file, limits, &mut streams, progress)?;
    if let Some(missing) = streams.missing_topic() {
        return Err(unknown_topic(&account, &missing.topic));
    }
    take_counts(role, &account, &streams, decoded);
    for (name, key, value) in account.metadata {
        remember(&mut decoded.metadata, format!("{name}.{key}"), value, role);
    }
    decoded.rejects.extend(account.rejects);
    for wanted in wanted {
        take(&wanted, &mut streams, decoded)?;
    }
    Ok(())
}

/// The same key with another value in the second log gets that log's name behind it.
fn remember(
    metadata: &mut std::collections::BTreeMap<String, String>,
    key: String,
    value: String,
    role: &str,
) {
    match metadata.get(&key) {
        Some(known) if *known == value => {}
        Some(_) => {
            metadata.insert(format!("{key} ({role})"), value);
        }
        None => {
            metadata.insert(key, value);
        }
    }
}

fn unknown_topic(account: &Account, topic: &str) -> LogError {
    let topics: Vec<_> = account
        .channels
        .iter()
        .map(|channel| format!("{:?}", channel.topic))
        .collect();
    let damage = match account.rejects.len() {
        0 => String::new(),
        n => format!(
            " (the log is damaged in {n} places, so topics may be missing; see `posegrid inspect`)"
        ),
    };
    LogError::UnknownTopic {
        file: account.file.clone(),
        topic: topic.to_owned(),
        topics: if topics.is_empty() {
            "none".to_owned()
        } else {
            topics.join(", ")
        },
        damage,
    }
}

fn take_counts(role: &str, account: &Account, streams: &Streams<'_>, decoded: &mut Decoded) {
    let mut count = |name: String, count: u64| {
        *decoded.counts.entry(name).or_default() += count;
    };
    count(format!("{role}.bytes"), account.bytes);
    count(format!("{role}.chunks"), account.chunks.values().sum());
    count(format!("{role}.chunks_unchecked"), account.chunks_unchecked);
    count(format!("{role}.messages"), account.messages);
    count(
        format!("{role}.messages_outside_chunks"),
        account.messages_outside_chunks,
    );
    for (stream, messages) in &streams.messages {
        count(format!("{}.messages", stream.name()), *messages);
        let undecoded = streams.undecoded.get(stream).copied().unwrap_or(0);
        count(format!("{}.rejected", stream.name()), undecoded);
    }
}

fn take(wanted: &Wanted, streams: &mut Streams<'_>, decoded: &mut Decoded) -> Result<(), LogError> {
    let poses = match wanted.stream {
        Stream::Joints => {
            decoded.joints = std::mem::take(&mut streams.joints);
            return Ok(());
        }
        Stream::Temperatures => {
            decoded.temperatures = Some(std::mem::take(&mut streams.temperatures));
            return Ok(());
        }
        Stream::Commands => decoded
            .commands
            .insert(std::mem::take(&mut streams.commands)),
        Stream::Readings => {
            decoded.readings = std::mem::take(&mut streams.readings);
            &mut decoded.readings
        }
    };
    let whole = |rows: Option<usize>| rows.is_none_or(|rows| rows == poses.stamps.len());
    if whole(poses.orientations.as_ref().map(Vec::len))
        && whole(poses.covariances.as_ref().map(Vec::len))
    {
        return Ok(());
    }
    Err(LogError::Mixed {
        file: poses.origins.file.clone(),
        topic: poses.origins.topic.clone(),
    })
}

impl Stream {
    const fn name(self) -> &'static str {
        match self {
            Self::Joints => "joints",
            Self::Commands => "commands",
            Self::Readings => "readings",
            Self::Temperatures => "temperatures",
        }
    }
}
