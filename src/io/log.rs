//! Logs: MCAP files → samples in order of time, with a reject for every byte that cannot be used. The reader is our own
//! because default readers panic, abort or silently drop messages on damaged files; it never needs a summary.
//!
//! 1. Frames: where each record lies; damage becomes rejects with byte ranges.
//! 2. Blocks: chunks decompressed and checked in parallel, in bounded memory (`scan`, `block`).
//! 3. Streams: the messages of the wanted topics decoded into columns.
//! 4. Sides: the files of a split recording are read one behind the other (`session`).
//! 5. Order: the samples of each stream in order of time (`ordered`, [`crate::ingest`]).
//! 6. Replay: into the detector of dwells or to disk, for [`crate::join::join`] ([`read_session`]).

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

use thiserror::Error;

use crate::at::At;
use crate::ingest::{IngestError, Mapping};
use crate::message::SchemaError;

pub use crate::input::Limits;
pub use block::Extent;
pub use packed::{Packed, PackedFault};
pub use peeked::{has_no_end, session_record};
pub use read_summary::ReadSummary;
pub use record::MessageRecord;
pub use registry::{Channel, Schema};
pub use replay::{JointSink, SessionRead, read_session};
pub use scan::{Visitor, ns, scan};
pub use session::{SessionLogs, read_metadata};
pub use streams::{Glance, Layout, Suggestible, Suggestion, json_fields};
use streams::{Stream, Wanted};
pub use summary::Ending;

pub type FileError = At<FileFault>;

#[derive(Debug, Error)]
pub enum FileFault {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error(
        "it is {0}, not a file, and a log is read by position; copy what comes out of it into a file first"
    )]
    NotAFile(&'static str),
    #[error("it is a folder, and no log in it ends in .mcap or .mcap.zst; give the file of a log")]
    Folder,
    #[error("the file is empty; was the recorder stopped before it wrote anything?")]
    Empty,
    #[error(
        "decompressed it is larger than the limit of {0} bytes; if that is right, raise unpacked_bytes in [limits]"
    )]
    TooLarge(u64),
    #[error("it is stored in zstd, and no byte of it can be decompressed: {0}")]
    NotUnpacked(String),
    #[error(
        "cannot decompress it into {folder}: {source}; let TMPDIR name a folder with room, or decompress the log"
    )]
    NoRoom { folder: String, source: io::Error },
    #[error(
        "not an MCAP log: it begins with {start:02x?} instead of 89 4d 43 41 50 30 0d 0a{}",
        foreign::what_it_is(.0),
        start = .0
    )]
    NotMcap(Vec<u8>),
}

#[derive(Debug, Error)]
pub enum LogError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{file}: no topic {topic:?}; topics in it: {topics}{damage}")]
    UnknownTopic { file: String, topic: String, topics: String, damage: String },
    #[error(transparent)]
    Unsuitable(Box<Unsuitable>),
    #[error("{file}: topic {topic:?}: {source}")]
    Schema { file: String, topic: String, source: SchemaError },
    #[error("{file}: topic {topic:?} is named for two streams; each needs a topic of its own")]
    NamedTwice { file: String, topic: String },
    #[error(
        "cannot spill the commanded poses and readings to disk in {folder}: {source}; let TMPDIR name a folder with room"
    )]
    NoRoom { folder: String, source: io::Error },
    #[error(transparent)]
    Ingest(#[from] IngestError),
}

/// A topic whose messages do not suit the stream that it is named for.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "{file}: topic {topic:?} carries {type_name:?} in encoding {encoding:?} with a schema in {schema_encoding:?}; read \
     here are {suitable}, in CDR (with a schema in ros2msg or ros2idl), ROS 1 (ros1msg), protobuf or JSON{}",
    by_fields(fields)
)]
pub struct Unsuitable {
    pub file: String,
    pub topic: String,
    pub type_name: String,
    pub encoding: String,
    pub schema_encoding: String,
    pub suitable: &'static str,
    /// The fields of the schema, where it can be read.
    pub fields: Vec<String>,
}

fn by_fields(fields: &[String]) -> String {
    if fields.is_empty() {
        return String::new();
    }
    let fields = fields.join(", ");
    format!(
        "; for any other type name the fields to read, as in fields = {{ x = \"pose.position.x\", … }}; it has {fields}"
    )
}

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
