//! Inspect: a log file → a summary of each channel: types, rates, gaps, clocks, damage. The log is read like ingest
//! does ([`super::log`]), so damage is what ingest would lose; no message is kept.

mod clock;
mod sizes;
pub mod table;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use crate::ingest::{LogReject, TimeSource};
use crate::log::{
    Channel, Extent, FileError, Glance, Limits, MessageRecord, ReadSummary, Schema, Suggestible,
    Suggestion, Visitor, json_fields, ns, scan,
};
use crate::message::{FieldReader, Row, Value};
use crate::progress::Progress;

pub use clock::{ClockSummary, Differences};
pub use sizes::Sizes;

/// Most joint names of a message that are kept, and most letters of each: as many as an arm can have.
const MOST_JOINTS: usize = 64;
const LONGEST_SAMPLE: usize = 64 * 1024;
const MOST_GUESSES: usize = 4 * 1024 * 1024;
const SHORTEST_MESSAGE: u64 = 31;

#[derive(Debug, Clone, PartialEq)]
pub struct Inspection {
    pub read_summary: ReadSummary,
    pub channels: Vec<ChannelSummary>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct ChannelSummary {
    pub topic: String,
    pub encoding: String,
    /// The message type and its definition, shared by the channels that have it; `None` without a schema.
    pub schema: Option<Arc<Schema>>,
    /// A suggestion of how to read it; `None` where nothing fits.
    pub suggestion: Option<Suggestion>,
    /// The fields of its first message with their values, where it is JSON without a schema and nothing is suggested.
    pub fields: Vec<String>,
    pub traffic: Box<Traffic>,
}

#[derive(Debug, Clone, Default, PartialEq)]
pub struct Traffic {
    pub messages: u64,
    pub bytes: u64,
    pub log: ClockSummary,
    pub publish: ClockSummary,
    pub header: ClockSummary,
    pub log_less_header: Differences,
    pub log_less_publish: Differences,
    /// Largest sequence number; 0 where the recorder does not count.
    pub last_sequence: u32,
    pub sequence_jumps: u64,
    /// Number of messages that do not fit their schema.
    pub unreadable: u64,
    pub sizes: Sizes,
    /// The most joint names that one of the first messages has; empty unless they are joint states.
    pub joints: Vec<String>,
    /// The first and the last sequence number, in the order of the file.
    sequences: Option<(u32, u32)>,
    /// The first message, where only a message can show the fields; otherwise `None`.
    sample: Option<Vec<u8>>,
}

impl ChannelSummary {
    /// The message type, empty without a schema.
    pub fn type_name(&self) -> &str {
        self.schema.as_ref().map_or("", |schema| &schema.name)
    }

    /// The language of the schema, empty without one.
    pub fn schema_encoding(&self) -> &str {
        self.schema.as_ref().map_or("", |schema| &schema.encoding)
    }

    /// The unit of its angles or positions, guessed from their size; `None` where they were not read.
    pub fn unit(&self) -> Option<&'static str> {
        self.traffic.sizes.unit(self.suggestion.as_ref()?.layout)
    }

    pub fn best_time(&self) -> TimeSource {
        let Traffic { header, messages, .. } = &*self.traffic;
        let suggestion = self.suggestion.as_ref();
        // For a common type the place of the stamp is known, and that the stamp is not there.
        let suggested = suggestion.is_some_and(|found| found.stamped && found.fields.is_some());
        let stamped = header.count == *messages || (header.count == 0 && suggested);
        let unset = header.count > 0 && (header.first, header.last) == (0, 0);
        if stamped && !unset { TimeSource::Header } else { TimeSource::Log }
    }
}

impl Traffic {
    fn add(&mut self, message: &MessageRecord<'_>, kind: &Kind, row: &mut Row) {
        let (log, publish) = (ns(message.log_time), ns(message.publish_time));
        self.count_sequence(message.sequence, message.sequence);
        self.last_sequence = self.last_sequence.max(message.sequence);
        self.bytes += message.payload.len() as u64;
        self.log.add(log);
        self.publish.add(publish);
        self.log_less_publish.add(log.saturating_sub(publish));
        let stamp = kind.glance.stamp.as_ref();
        match stamp.map_or(Header::None, |reader| header(reader, message.payload, row)) {
            Header::Stamp(header) => {
                self.header.add(header);
                self.log_less_header.add(log.saturating_sub(header));
            }
            Header::Unreadable => self.unreadable += 1,
            Header::None => {}
        }
        if let Some(reader) = &kind.glance.values {
            self.sizes.add(self.messages, reader, message.payload, row);
        }
        // A gripper may publish on the topic of the arm, and before it.
        if self.messages < NAMED_IN
            && let Some(reader) = &kind.glance.joint_names
        {
            let names = joint_names(reader, message.payload, row);
            self.take_longer(names);
        }
        if self.messages == 0 {
            // JSON may come without a schema.
            let sample = matches!(kind.suggestible, Suggestible::Json(_))
                && message.payload.len() <= LONGEST_SAMPLE;
            self.sample = sample.then(|| message.payload.to_vec());
        }
        self.messages += 1;
    }

    fn take_longer(&mut self, joints: Vec<String>) {
        if joints.len() > self.joints.len() {
            self.joints = joints;
        }
    }

    fn append(&mut self, later: Self) {
        if let Some((first, last)) = later.sequences {
            self.count_sequence(first, last);
        }
        self.take_longer(later.joints);
        self.messages += later.messages;
        self.bytes += later.bytes;
        self.log.append(&later.log);
        self.publish.append(&later.publish);
        self.header.append(&later.header);
        self.log_less_header.append(later.log_less_header);
        self.log_less_publish.append(later.log_less_publish);
        self.last_sequence = self.last_sequence.max(later.last_sequence);
        self.sequence_jumps += later.sequence_jumps;
        self.unreadable += later.unreadable;
        self.sizes.append(later.sizes);
    }

    fn count_sequence(&mut self, first: u32, last: u32) {
        let begin = match self.sequences {
            None => first,
            Some((begin, previous)) => {
                let jump = first != 0 && first.wrapping_sub(previous) != 1;
                self.sequence_jumps += u64::from(jump);
                begin
            }
        };
        self.sequences = Some((begin, last));
    }
}

pub fn inspect(
    path: &Path,
    limits: Limits,
    progress: &dyn Progress,
) -> Result<Inspection, FileError> {
    let mut survey = Survey::default();
    let name = path.display().to_string();
    let read_summary = scan(path, &name, limits, &mut survey, progress)?;
    let mut channels = survey.channels;
    channels.sort_by(|a, b| a.topic.cmp(&b.topic));
    Ok(Inspection { read_summary, channels })
}

/// The kind of messages with one schema and encoding: examined once, however many channels share them.
struct Kind {
    schema: Option<Arc<Schema>>,
    glance: Glance,
    suggestible: Suggestible,
}

impl Kind {
    fn of(encoding: &str, schema: Option<&Arc<Schema>>) -> Self {
        let definition = schema.map_or(&[][..], |schema| &schema.definition);
        let (name, language) = schema.map_or(("", ""), |s| (&s.name, &s.encoding));
        Self {
            schema: schema.cloned(),
            glance: Glance::of(encoding, name, language, definition),
            suggestible: Suggestible::of(encoding, name, language, definition),
        }
    }
}

#[derive(Default)]
struct Part {
    row: Row,
    /// Summaries by the channel's place.
    traffic: BTreeMap<usize, Box<Traffic>>,
}

#[derive(Default)]
struct Survey {
    channels: Vec<ChannelSummary>,
    /// The kind of each channel.
    of_channels: Vec<Arc<Kind>>,
    kinds: BTreeMap<(u16, String), Arc<Kind>>,
    guesses: usize,
}

impl Survey {
    fn kind(&mut self, channel: &Channel, schema: Option<&Arc<Schema>>) -> Arc<Kind> {
        let key = (channel.schema_id, channel.encoding.clone());
        let is_of = |kind: &Kind| kind.schema.as_ref().map(Arc::as_ptr) == schema.map(Arc::as_ptr);
        match self.kinds.get(&key) {
            Some(kind) if is_of(kind) => Arc::clone(kind),
            _ => {
                let kind = Arc::new(Kind::of(&channel.encoding, schema));
                self.kinds.insert(key, Arc::clone(&kind));
                kind
            }
        }
    }

    /// Whether `bytes` more are within the limit; if so they are counted.
    const fn has_room(&mut self, bytes: usize) -> bool {
        let has_room = self.guesses + bytes <= MOST_GUESSES;
        if has_room {
            self.guesses += bytes;
        }
        has_room
    }

    fn suggested(&mut self, suggestion: Option<Suggestion>) -> Option<Suggestion> {
        let bytes = |found: &Suggestion| found.fields.as_ref().map_or(0, String::len);
        suggestion.filter(|found| self.has_room(bytes(found)))
    }
}

impl Visitor for Survey {
    type Decoder = (usize, Arc<Kind>);
    type Part = Part;
    type Error = FileError;

    fn channel(
        &mut self,
        channel: &Channel,
        schema: Option<&Arc<Schema>>,
    ) -> Result<Self::Decoder, FileError> {
        let place = self.channels.len();
        let kind = self.kind(channel, schema);
        let suggestion = self.suggested(kind.suggestible.suggestion(None));
        self.channels.push(ChannelSummary {
            topic: channel.topic.clone(),
            encoding: channel.encoding.clone(),
            schema: kind.schema.clone(),
            suggestion,
            fields: Vec::new(),
            traffic: Box::default(),
        });
        self.of_channels.push(Arc::clone(&kind));
        Ok((place, kind))
    }

    /// Each message of a block may be of another channel.
    fn part_bytes(&self, block: u64) -> u64 {
        let channels = (block / SHORTEST_MESSAGE).min(self.channels.len() as u64);
        // The map needs a few words more for each.
        channels * (64 + size_of::<Traffic>() as u64)
    }

    fn message(&self, (place, kind): &Self::Decoder, message: &MessageRecord<'_>, part: &mut Part) {
        part.traffic.entry(*place).or_default().add(message, kind, &mut part.row);
    }

    fn clear(&self, part: &mut Part) {
        part.traffic.clear();
    }

    fn merge(&mut self, _: &Extent, part: &mut Part, _: &mut Vec<LogReject>) {
        for (place, mut later) in std::mem::take(&mut part.traffic) {
            let is_first = self.channels[place].traffic.messages == 0;
            if let Some(sample) = later.sample.take().filter(|_| is_first) {
                let kind = Arc::clone(&self.of_channels[place]);
                let suggestion = self.suggested(kind.suggestible.suggestion(Some(&sample)));
                if suggestion.is_none() && kind.schema.is_none() {
                    let fields = json_fields(&sample);
                    let bytes = fields.iter().map(String::len).sum();
                    self.channels[place].fields =
                        if self.has_room(bytes) { fields } else { Vec::new() };
                }
                self.channels[place].suggestion = suggestion;
            }
            let known = self.channels[place].traffic.joints.len() >= later.joints.len();
            let bytes = |name: &String| name.len() + size_of::<String>();
            if known || !self.has_room(later.joints.iter().map(bytes).sum()) {
                later.joints = Vec::new();
            }
            self.channels[place].traffic.append(*later);
        }
    }
}

#[derive(Debug, Clone, Copy)]
enum Header {
    None,
    /// The stamp, ns since 1970.
    Stamp(i64),
    Unreadable,
}

fn header(reader: &FieldReader, payload: &[u8], row: &mut Row) -> Header {
    let read = reader.read(payload, row);
    let value = |slot| row.value(payload, slot);
    match (read, value(0).integer(), value(1).integer()) {
        (Ok(()), Some(sec), Some(nanosec)) => {
            Header::Stamp(sec.saturating_mul(1_000_000_000).saturating_add(nanosec))
        }
        (Ok(()), ..) if let Value::Text(text) = value(2) => {
            text.date_time_ns().map_or(Header::Unreadable, Header::Stamp)
        }
        // JSON may leave the stamp out.
        (Ok(()), ..) if value(0) == Value::Absent => Header::None,
        _ => Header::Unreadable,
    }
}

/// Messages of each part of a log whose joint names are read.
const NAMED_IN: u64 = 100;

fn joint_names(reader: &FieldReader, payload: &[u8], row: &mut Row) -> Vec<String> {
    let short = |name: String| name.chars().take(MOST_JOINTS).collect();
    match (reader.read(payload, row), row.value(payload, 0).texts()) {
        (Ok(()), Some(names)) => {
            names.iter().flatten().take(MOST_JOINTS).map(|name| short(name.to_text())).collect()
        }
        _ => Vec::new(),
    }
}
