//! Logs: MCAP files → samples in order of time, with every byte that cannot be used accounted for.
//!
//! The reader is our own because default readers panic, abort or drop messages in silence on damaged files. It works
//! from the data section alone; a summary is never needed.
//!
//! 1. Frames: where each record lies (`frames`); damage becomes rejects with byte ranges.
//! 2. Blocks: chunks decompressed and checked in parallel, in bounded memory (`scan`, `block`).
//! 3. Streams: the messages of the wanted topics decoded by a reader into columns (`streams`).
//! 4. Sides: the files of a split recording are read one behind the other (`session`).
//! 5. Order: the samples of each stream come out in order of time (`ordered`, [`crate::ingest`]).
//! 6. Replay: they go into the detector of dwells or to disk, for [`crate::join::join`] ([`read_session`]).

mod block;
mod chunk;
mod foreign;
mod frames;
mod ordered;
mod packed;
mod peeked;
mod read_summary;
mod record;
mod registry;
mod replay;
mod scan;
mod session;
mod source;
mod spilled;
mod streams;
mod summary;
mod unnamed;

use std::io;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::ingest::{IngestError, Mapping};
use crate::io::message::SchemaError;

pub use block::Extent;
pub use packed::{Packed, PackedFault};
pub use peeked::{has_no_end, session_record};
pub use read_summary::ReadSummary;
pub use record::MessageRecord;
pub use registry::{Channel, Schema};
pub use replay::{JointSink, SessionRead, read_session};
pub use scan::{Visitor, ns, scan};
pub use session::{SessionLogs, read_metadata};
pub use streams::{Glance, Layout, Suggestible, Suggestion, suggest};
use streams::{Stream, Wanted};
pub use summary::Ending;

/// `[limits]`: what a log may ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// The longest record, bytes; attachments, which are not read, may be longer.
    pub record_bytes: u64,
    /// The largest chunk, bytes as stored and decompressed together.
    pub chunk_bytes: u64,
    /// What is worked on at once, bytes as stored and decompressed; a single chunk may be larger.
    pub batch_bytes: u64,
    /// The largest log that is stored in zstd as a whole, bytes after decompression.
    pub unpacked_bytes: u64,
    /// The largest file of a session that is no log, bytes: corrected targets. Of Parquet the values take sixteen times as
    /// much in memory at most.
    pub file_bytes: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            record_bytes: 256 << 20,
            chunk_bytes: 256 << 20,
            batch_bytes: 32 << 20,
            unpacked_bytes: 64 << 30,
            file_bytes: 64 << 20,
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
    /// Something that cannot be read by position.
    #[error(
        "{file}: it is {what}, not a file, and a log is read by position; copy what comes out of it into a file first"
    )]
    NotAFile {
        /// The file, as it was named.
        file: String,
        /// A pipe, a device, a directory.
        what: &'static str,
    },
    /// Nothing in it.
    #[error("{file}: the file is empty; was the recorder stopped before it wrote anything?")]
    Empty {
        /// The file.
        file: String,
    },
    /// Stored in zstd, and larger than the limit.
    #[error(
        "{file}: decompressed it is larger than the limit of {limit} bytes; if that is right, raise unpacked_bytes in \
         [limits]"
    )]
    TooLarge {
        /// The file.
        file: String,
        /// By the settings.
        limit: u64,
    },
    /// Stored in zstd, and damaged from its start.
    #[error("{file}: it is stored in zstd, and nothing of it can be decompressed: {why}")]
    NotUnpacked {
        /// The file.
        file: String,
        /// Why, in words.
        why: String,
    },
    /// Stored in zstd, and nowhere to decompress it to.
    #[error(
        "{file}: cannot decompress it into {folder}: {source}; let TMPDIR name a folder with room, or decompress the log"
    )]
    NoRoom {
        /// The file.
        file: String,
        /// The folder for temporary files.
        folder: String,
        /// Why.
        source: io::Error,
    },
    /// Something else.
    #[error(
        "{file}: not an MCAP log: it begins with {start:02x?} instead of 89 4d 43 41 50 30 0d 0a{}",
        foreign::what_it_is(start)
    )]
    NotMcap {
        /// The file.
        file: String,
        /// Its first bytes.
        start: Vec<u8>,
    },
}

/// Why the logs of a session cannot be read.
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
    /// The same topic for two streams.
    #[error("{file}: topic {topic:?} is named for two streams; each needs a topic of its own")]
    NamedTwice {
        /// The file.
        file: String,
        /// The topic.
        topic: String,
    },
    /// Nowhere to spill poses to.
    #[error(
        "cannot spill the commanded poses and readings to disk in {folder}: {source}; let TMPDIR name a folder with room"
    )]
    NoRoom {
        /// The folder for temporary files.
        folder: String,
        /// Why.
        source: io::Error,
    },
    /// A stream of which nothing can be used.
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

impl Stream {
    /// As counts and tables call it.
    const fn name(self) -> &'static str {
        match self {
            Self::Joints => "joints",
            Self::Commands => "commands",
            Self::Readings => "readings",
            Self::Temperatures => "temperatures",
        }
    }

    /// Whether a session without a usable message of it is an error, where the pipeline file names its topic.
    const fn is_needed(self) -> bool {
        !matches!(self, Self::Temperatures)
    }
}
