//! Streams: the messages of the named topics → decoded columns, a block at a time. The fields of common types follow
//! from the type; for any other the pipeline file names them.

mod common;
mod elements;
mod layout;
mod reader;
mod suggest;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::block::Extent;
use super::ordered::SessionStreams;
use super::record::MessageRecord;
use super::registry::{Channel, Schema};
use super::scan::{Visitor, ns};
use super::{LogError, Unsuitable};
use crate::ingest::{LogReject, LossKind, Mapping, SpanClock, TimeSource};
use crate::message::{FieldPath, MessageSchema};

pub use common::Layout;
use common::suitable_types;
pub use layout::Glance;
use layout::Recipe;
pub use reader::Part;
use reader::{Decoder, Reader, RowFault, Wished};
pub use suggest::{Suggestible, Suggestion, json_fields};

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stream {
    Joints,
    Commands,
    Readings,
    Temperatures,
    Lengths,
}

impl Stream {
    /// All streams in the order of their numbers.
    pub const ALL: [Self; 5] =
        [Self::Joints, Self::Commands, Self::Readings, Self::Temperatures, Self::Lengths];
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Wanted {
    pub stream: Stream,
    pub topic: String,
    pub time: TimeSource,
}

type SharedReader = (Option<Arc<Schema>>, Arc<Reader>);

pub struct Streams<'m, 's> {
    file: String,
    pub wanted: Vec<Wanted>,
    mapping: &'m Mapping,
    met: BTreeSet<String>,
    /// Readers of messages, by topic, schema and encoding: channels that share these share the reader.
    readers: BTreeMap<(String, u16, String), SharedReader>,
    /// The fields that are read of each wanted topic.
    paths: BTreeMap<usize, Vec<FieldPath>>,
    /// Receiver of the rows. It works on them while the next blocks are opened, on another thread.
    session: &'m Mutex<SessionStreams<'s>>,
    pub messages: BTreeMap<Stream, u64>,
    pub undecoded: BTreeMap<Stream, u64>,
    /// Messages of the joints' topic that are not of the arm: they are no rejects.
    pub not_of_arm: u64,
}

impl<'m, 's> Streams<'m, 's> {
    pub fn new(
        file: &str,
        wanted: Vec<Wanted>,
        mapping: &'m Mapping,
        session: &'m Mutex<SessionStreams<'s>>,
    ) -> Self {
        Self {
            file: file.to_owned(),
            wanted,
            mapping,
            met: BTreeSet::new(),
            readers: BTreeMap::new(),
            paths: BTreeMap::new(),
            session,
            messages: BTreeMap::new(),
            undecoded: BTreeMap::new(),
            not_of_arm: 0,
        }
    }

    fn session(&self) -> MutexGuard<'m, SessionStreams<'s>> {
        self.session.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn has(&self, topic: &str) -> bool {
        self.met.contains(topic)
    }

    /// The reader of a wanted channel's messages; a schema is parsed once, however many channels share it.
    fn reader(
        &mut self,
        place: usize,
        wanted: &Wanted,
        channel: &Channel,
        schema: Option<&Arc<Schema>>,
    ) -> Result<Arc<Reader>, LogError> {
        let key = (channel.topic.clone(), channel.schema_id, channel.encoding.clone());
        // The id may mean another schema in the next log of the file.
        if let Some((of, reader)) = self.readers.get(&key)
            && of.as_ref().map(Arc::as_ptr) == schema.map(Arc::as_ptr)
        {
            return Ok(Arc::clone(reader));
        }
        let schema = schema.cloned();
        let reader = Arc::new(self.new_reader(place, wanted, channel, schema.as_deref())?);
        self.readers.insert(key, (schema, Arc::clone(&reader)));
        Ok(reader)
    }

    fn new_reader(
        &self,
        place: usize,
        wanted: &Wanted,
        channel: &Channel,
        schema: Option<&Schema>,
    ) -> Result<Reader, LogError> {
        let (file, topic) = (&self.file, &channel.topic);
        let at = |source| LogError::Schema { file: file.clone(), topic: topic.clone(), source };
        let (name, language) = schema.map_or(("", ""), |s| (&s.name, &s.encoding));
        let unsuitable = |fields: Vec<String>| {
            LogError::Unsuitable(Box::new(Unsuitable {
                file: self.file.clone(),
                topic: channel.topic.clone(),
                type_name: name.to_owned(),
                encoding: channel.encoding.clone(),
                schema_encoding: language.to_owned(),
                suitable: suitable_types(wanted.stream),
                fields,
            }))
        };
        let definition = schema.map_or(&[][..], |s| &s.definition);
        let schema = MessageSchema::read(&channel.encoding, name, language, definition)
            .ok_or_else(|| unsuitable(Vec::new()))?
            .map_err(at)?;
        let recipe = Recipe::resolve(wanted, self.mapping, name, &schema)
            .map_err(at)?
            .ok_or_else(|| unsuitable(schema.leaves()))?;
        Ok(Reader {
            wanted: place,
            stream: wanted.stream,
            time: wanted.time,
            targets: match wanted.stream {
                Stream::Readings => self.targets_of(&channel.topic),
                _ => Vec::new(),
            },
            lengths: match wanted.stream {
                Stream::Lengths => self.mapping.tracker.lengths_on(&channel.topic),
                _ => Vec::new(),
            },
            recipe,
        })
    }

    fn targets_of(&self, topic: &str) -> Vec<Wished> {
        let seen = self.mapping.tracker.seen().into_iter().enumerate();
        let own = seen.filter(|(_, own)| own.topic == topic);
        own.map(|(place, own)| Wished { place, is: own.is.cloned() }).collect()
    }

    fn describe(&self, wanted: usize, fault: RowFault) -> String {
        let joint = |place: usize| self.mapping.joints.get(place).map_or("", String::as_str);
        let path = |place: usize| {
            let paths = self.paths.get(&wanted).map_or(&[][..], Vec::as_slice);
            paths.get(place).map_or_else(String::new, FieldPath::to_string)
        };
        match fault {
            RowFault::JointMissing(place) => {
                format!("joint {:?} is missing from the message", joint(place))
            }
            RowFault::JointTwice(place) => {
                format!("joint {:?} is twice in the message", joint(place))
            }
            RowFault::NoValue(place) => format!("the message has no value at {:?}", path(place)),
            RowFault::NoNumber(place) => {
                format!("the message's value at {:?} is no number", path(place))
            }
            RowFault::NoArray(place) => {
                format!("the message has no array of values at {:?}", path(place))
            }
            RowFault::TargetTwice(place) => {
                let seen = self.mapping.tracker.seen();
                let name = seen.get(place).map_or("", |own| own.name);
                format!("the target {name:?} is twice in the message")
            }
            RowFault::OtherFrame => format!(
                "the message is in another frame than {:?}",
                self.wanted.get(wanted).map_or("", |own| self.frame(own.stream))
            ),
            other => other.to_string(),
        }
    }
    fn frame(&self, stream: Stream) -> &str {
        let commanded = self.mapping.commanded.as_ref();
        let frame = match stream {
            Stream::Commands => commanded.and_then(|commanded| commanded.frame.as_deref()),
            _ => self.mapping.tracker.frame.as_deref(),
        };
        frame.unwrap_or("")
    }
}

impl Visitor for Streams<'_, '_> {
    type Decoder = Decoder;
    type Part = Part;
    type Error = LogError;

    fn channel(
        &mut self,
        channel: &Channel,
        schema: Option<&Arc<Schema>>,
    ) -> Result<Decoder, LogError> {
        let of_topic = |wanted: &Wanted| wanted.topic == channel.topic;
        let Some(place) = self.wanted.iter().position(of_topic) else { return Ok(None) };
        let wanted = self.wanted[place].clone();
        let reader = self.reader(place, &wanted, channel, schema)?;
        let stream = wanted.stream;
        self.met.insert(wanted.topic.clone());
        self.session().begin_file(stream, &self.file);
        self.paths.entry(place).or_insert_with(|| reader.recipe.paths.clone());
        Ok(Some(reader))
    }

    fn message(&self, decoder: &Decoder, message: &MessageRecord<'_>, part: &mut Part) {
        let Some(reader) = decoder else { return };
        // A message with an array of poses counts once for each target, as its rows do.
        let rows = reader.rows();
        if let Err(fault) = reader.read(message, &self.mapping.joints, part) {
            let tally = part.faults.entry((reader.wanted, fault)).or_default();
            (0..rows).for_each(|_| tally.add(message.log_time));
        }
        part.messages[reader.stream as usize] += rows as u64;
    }

    fn clear(&self, part: &mut Part) {
        let tracker = &self.mapping.tracker;
        part.clear(self.mapping.joints.len(), tracker.seen().len(), tracker.lengths.len());
    }

    fn meanwhile(&self) {
        self.session().work();
    }

    fn merge(&mut self, extent: &Extent, part: &mut Part, rejects: &mut Vec<LogReject>) {
        self.session().take(part, extent);
        for (stream, &count) in Stream::ALL.iter().zip(&part.messages) {
            if count > 0 {
                *self.messages.entry(*stream).or_default() += count;
            }
        }
        for ((place, fault), tally) in std::mem::take(&mut part.faults) {
            let wanted = self.wanted.get(place);
            let is_of_arm = fault != RowFault::NotOfArm;
            if !is_of_arm {
                self.not_of_arm += tally.messages.unwrap_or(0);
            } else if let Some(wanted) = wanted {
                *self.undecoded.entry(wanted.stream).or_default() += tally.messages.unwrap_or(0);
            }
            rejects.push(LogReject {
                file: self.file.clone(),
                topic: wanted.map(|wanted| wanted.topic.clone()),
                byte_start: extent.start,
                byte_end: extent.end,
                time_span_ns: tally.times.map(|(first, last)| (ns(first), ns(last))),
                clock: SpanClock::Log,
                messages: tally.messages,
                loss: if is_of_arm { LossKind::Unusable } else { LossKind::Nothing },
                reason: self.describe(place, fault),
            });
        }
    }
}
