//! Logs: MCAP files → samples in order of time, with a reject for every byte that cannot be used.
//!
//! The reader is our own because default readers panic, abort or silently drop messages on damaged files. It works from the
//! data section alone; a summary is never needed.
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

use std::io;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::at::At;
use crate::ingest::{IngestError, Mapping};
use crate::message::SchemaError;

pub use block::Extent;
pub use packed::{Packed, PackedFault};
pub use peeked::{has_no_end, session_record};
pub use read_summary::ReadSummary;
pub use record::MessageRecord;
pub use registry::{Channel, Schema};
pub use replay::{JointSink, SessionRead, read_session};
pub use scan::{Visitor, ns, scan};
pub use session::{SessionLogs, read_metadata};
pub use streams::{Glance, Layout, Suggestible, Suggestion, json_fields, suggest};
use streams::{Stream, Wanted};
pub use summary::Ending;

/// `[limits]`: the largest sizes that a log may have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// The longest record, bytes; attachments, which are not read, may be longer.
    pub record_bytes: u64,
    /// The largest chunk, bytes as stored and decompressed together.
    pub chunk_bytes: u64,
    /// Bytes worked on at once, as stored and decompressed; a single chunk may be larger.
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

/// The reason why a file cannot be read as a log, and the file's name as given.
pub type FileError = At<FileFault>;

/// The reason why a file cannot be read as a log.
#[derive(Debug, Error)]
pub enum FileFault {
    /// The operating system refuses to read it.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// Not a regular file, but a pipe, a device or a socket: it cannot be read by position.
    #[error(
        "it is {0}, not a file, and a log is read by position; copy what comes out of it into a file first"
    )]
    NotAFile(&'static str),
    /// A folder in the place of a log.
    #[error("it is a folder, and no log in it ends in .mcap or .mcap.zst; give the file of a log")]
    Folder,
    #[error("the file is empty; was the recorder stopped before it wrote anything?")]
    Empty,
    /// Stored in zstd, and larger than the limit of the settings after decompression, bytes.
    #[error(
        "decompressed it is larger than the limit of {0} bytes; if that is right, raise unpacked_bytes in [limits]"
    )]
    TooLarge(u64),
    /// Stored in zstd, and damaged from its start: the reason as text.
    #[error("it is stored in zstd, and no byte of it can be decompressed: {0}")]
    NotUnpacked(String),
    /// Stored in zstd, and there is no folder with room to decompress it.
    #[error(
        "cannot decompress it into {folder}: {source}; let TMPDIR name a folder with room, or decompress the log"
    )]
    NoRoom {
        /// The folder for temporary files.
        folder: String,
        /// The operating system's error.
        source: io::Error,
    },
    /// Not an MCAP log: its first bytes.
    #[error(
        "not an MCAP log: it begins with {start:02x?} instead of 89 4d 43 41 50 30 0d 0a{}",
        foreign::what_it_is(.0),
        start = .0
    )]
    NotMcap(Vec<u8>),
}

/// The reason why the logs of a session cannot be read.
#[derive(Debug, Error)]
pub enum LogError {
    /// A file cannot be read as a log.
    #[error(transparent)]
    File(#[from] FileError),
    /// A topic that the pipeline file names is missing.
    #[error("{file}: no topic {topic:?}; topics in it: {topics}{damage}")]
    UnknownTopic {
        file: String,
        topic: String,
        /// The topics of the file, with types.
        topics: String,
        /// A remark where the log is damaged, or empty.
        damage: String,
    },
    /// Messages of a type that this stream cannot be made from.
    #[error(transparent)]
    Unsuitable(Box<Unsuitable>),
    /// A schema that cannot be read or lacks the fields.
    #[error("{file}: topic {topic:?}: {source}")]
    Schema { file: String, topic: String, source: SchemaError },
    /// One topic is named for two streams.
    #[error("{file}: topic {topic:?} is named for two streams; each needs a topic of its own")]
    NamedTwice { file: String, topic: String },
    /// There is no room to spill poses to disk.
    #[error(
        "cannot spill the commanded poses and readings to disk in {folder}: {source}; let TMPDIR name a folder with room"
    )]
    NoRoom {
        /// The folder for temporary files.
        folder: String,
        /// The operating system's error.
        source: io::Error,
    },
    /// A stream without any usable message.
    #[error(transparent)]
    Ingest(#[from] IngestError),
}

/// A topic whose messages do not suit the stream that it is named for.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "{file}: topic {topic:?} carries {type_name:?} in encoding {encoding:?} with a schema in {schema_encoding:?}; read \
     here are {suitable}, in CDR (with a schema in ros2msg or ros2idl), protobuf or JSON{}",
    by_fields(fields)
)]
pub struct Unsuitable {
    pub file: String,
    pub topic: String,
    /// The type of its messages, empty without a schema.
    pub type_name: String,
    /// Encoding of the messages.
    pub encoding: String,
    /// Language of the schema.
    pub schema_encoding: String,
    /// Message types that suit the stream.
    pub suitable: &'static str,
    /// The fields of the schema, where it can be read.
    pub fields: Vec<String>,
}

/// Advice for messages whose fields are known.
fn by_fields(fields: &[String]) -> String {
    if fields.is_empty() {
        return String::new();
    }
    let fields = fields.join(", ");
    format!(
        "; for any other type name the fields to read, as in fields = {{ x = \"pose.position.x\", … }}; it has {fields}"
    )
}

/// The streams to read from the controller's log and from the tracker's.
fn wanted(mapping: &Mapping) -> (Vec<Wanted>, Vec<Wanted>) {
    let wanted = |stream, topic: &str, time| Wanted { stream, topic: topic.to_owned(), time };
    let (controller, tracker) = (&mapping.controller, &mapping.tracker);
    let mut of_controller = vec![wanted(Stream::Joints, &controller.topic, controller.time)];
    of_controller
        .extend(mapping.commanded.iter().map(|c| wanted(Stream::Commands, &c.topic, c.time)));
    let topics = tracker.topics().into_iter();
    let mut of_tracker: Vec<Wanted> =
        topics.map(|topic| wanted(Stream::Readings, topic, tracker.time)).collect();
    of_tracker
        .extend(tracker.temperature.iter().map(|t| wanted(Stream::Temperatures, t, tracker.time)));
    let lengths = tracker.length_topics().into_iter();
    of_tracker.extend(lengths.map(|topic| wanted(Stream::Lengths, topic, tracker.time)));
    (of_controller, of_tracker)
}

impl Stream {
    /// The name of the stream in counts and tables.
    const fn name(self) -> &'static str {
        match self {
            Self::Joints => "joints",
            Self::Commands => "commands",
            Self::Readings => "readings",
            Self::Temperatures => "temperatures",
            Self::Lengths => "lengths",
        }
    }

    /// Whether it is an error that a session has no usable message of it, where the pipeline file names its topic.
    const fn is_needed(self) -> bool {
        !matches!(self, Self::Temperatures)
    }
}
