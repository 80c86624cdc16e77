//! Inspect: a log file → what is in it, channel by channel: types, rates, gaps, clocks, damage.
//!
//! 1. Read the log as ingest does ([`super::log`]), so damage is what ingest would lose.
//! 2. Of each message take log time, publish time, sequence and, where its schema has one, the header stamp.
//! 3. Sum up each channel in the order of the file.

use std::collections::BTreeMap;
use std::path::Path;

use crate::ingest::{LogReject, TimeSource};
use crate::io::log::{
    Account, Channel, Extent, FileError, Glance, Layout, Limits, MessageRecord, Schema, Visitor,
    ns, scan,
};
use crate::io::message::{Plan, Row, Value};
use crate::progress::Progress;

/// What is in one log.
#[derive(Debug, Clone, PartialEq)]
pub struct Inspection {
    /// The file: size, header, chunks, metadata, damage.
    pub account: Account,
    /// Its channels, by topic.
    pub channels: Vec<ChannelSummary>,
}

/// What is on one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelSummary {
    /// The topic.
    pub topic: String,
    /// The message type, empty without a schema.
    pub type_name: String,
    /// How messages are serialised.
    pub encoding: String,
    /// The language of the schema.
    pub schema_encoding: String,
    /// What the common streams can be made of, if it is one of these.
    pub layout: Option<Layout>,
    /// Messages.
    pub messages: u64,
    /// Log times.
    pub log: ClockSummary,
    /// Publish times.
    pub publish: ClockSummary,
    /// Header stamps, where messages have them.
    pub header: ClockSummary,
    /// Smallest and largest log time less header stamp, ns.
    pub log_less_header_ns: Option<(i64, i64)>,
    /// Largest sequence number; 0 where the recorder does not count.
    pub last_sequence: u32,
    /// Steps of the sequence number other than one.
    pub sequence_jumps: u64,
    /// Messages whose schema does not fit them.
    pub unreadable: u64,
    /// Joint names of the first message, where they are joint states.
    pub joints: Vec<String>,
}

/// One clock's times on one channel, ns.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ClockSummary {
    /// Times seen.
    pub count: u64,
    /// Earliest.
    pub first: i64,
    /// Latest.
    pub last: i64,
    /// Steps back.
    pub backward: u64,
    /// Steps of zero.
    pub duplicate: u64,
    /// Largest step forward.
    pub largest_gap: i64,
    previous: i64,
}

impl ClockSummary {
    fn add(&mut self, time: i64) {
        if self.count == 0 {
            (self.first, self.last) = (time, time);
        } else {
            let step = time.saturating_sub(self.previous);
            self.backward += u64::from(step < 0);
            self.duplicate += u64::from(step == 0);
            self.largest_gap = self.largest_gap.max(step);
        }
        (self.first, self.last) = (self.first.min(time), self.last.max(time));
        self.previous = time;
        self.count += 1;
    }

    /// From the earliest to the latest, s.
    pub fn span_s(&self) -> f64 {
        self.last.saturating_sub(self.first) as f64 * 1e-9
    }

    /// Times per second, where there are at least two moments.
    pub fn rate_hz(&self) -> Option<f64> {
        let span = self.span_s();
        (span > 0.0).then(|| (self.count - 1) as f64 / span)
    }
}

impl ChannelSummary {
    /// The time source that would suit the channel best.
    pub fn best_time(&self) -> TimeSource {
        let stamped = self.header.count > 0 && self.header.count == self.messages;
        if stamped && (self.header.first, self.header.last) != (0, 0) {
            TimeSource::Header
        } else {
            TimeSource::Log
        }
    }

    fn add(&mut self, sample: &Sample) {
        let jump = self.messages > 0
            && sample.sequence.wrapping_sub(self.last_sequence) != 1
            && sample.sequence != 0;
        self.sequence_jumps += u64::from(jump);
        self.last_sequence = self.last_sequence.max(sample.sequence);
        self.messages += 1;
        self.log.add(sample.log);
        self.publish.add(sample.publish);
        match sample.header {
            Header::Stamp(header) => {
                self.header.add(header);
                let difference = sample.log.saturating_sub(header);
                let (least, most) = self.log_less_header_ns.unwrap_or((difference, difference));
                self.log_less_header_ns = Some((least.min(difference), most.max(difference)));
            }
            Header::None => {}
            Header::Unreadable => self.unreadable += 1,
        }
    }
}

/// Reads a log and sums it up.
pub fn inspect(
    path: &Path,
    limits: Limits,
    progress: &dyn Progress,
) -> Result<Inspection, FileError> {
    let mut survey = Survey::default();
    let account = scan(
        path,
        &path.display().to_string(),
        limits,
        &mut survey,
        progress,
    )?;
    let mut channels: Vec<_> = survey.channels.into_values().collect();
    channels.sort_by(|a, b| a.topic.cmp(&b.topic));
    Ok(Inspection { account, channels })
}

/// What is taken of one message.
#[derive(Debug)]
struct Sample {
    channel: u16,
    sequence: u32,
    log: i64,
    publish: i64,
    header: Header,
}

#[derive(Debug, Clone, Copy)]
enum Header {
    None,
    Stamp(i64),
    Unreadable,
}

#[derive(Debug, Default)]
struct Samples {
    row: Row,
    taken: Vec<Sample>,
    joints: BTreeMap<u16, Vec<String>>,
}

#[derive(Default)]
struct Survey {
    channels: BTreeMap<u16, ChannelSummary>,
}

impl Visitor for Survey {
    type Decoder = Glance;
    type Part = Samples;
    type Error = FileError;

    fn channel(&mut self, channel: &Channel, schema: Option<&Schema>) -> Result<Glance, FileError> {
        self.channels.insert(channel.id, summary(channel, schema));
        let (name, language) = schema.map_or(("", ""), |s| (&s.name, &s.encoding));
        let definition = schema.map_or(&[][..], |s| &s.definition);
        Ok(Glance::of(&channel.encoding, name, language, definition))
    }

    fn message(&self, glance: &Glance, message: &MessageRecord<'_>, part: &mut Samples) {
        if let Some(plan) = &glance.joint_names {
            part.joints
                .entry(message.channel_id)
                .or_insert_with(|| names(plan, message.payload));
        }
        let stamp = glance.stamp.as_ref();
        let header = stamp.map_or(Header::None, |plan| {
            header(plan, message.payload, &mut part.row)
        });
        part.taken.push(Sample {
            channel: message.channel_id,
            sequence: message.sequence,
            log: ns(message.log_time),
            publish: ns(message.publish_time),
            header,
        });
    }

    fn clear(&self, part: &mut Samples) {
        part.taken.clear();
        part.joints.clear();
    }

    fn merge(&mut self, _: &Extent, part: &mut Samples, _: &mut Vec<LogReject>) {
        for sample in part.taken.drain(..) {
            self.channels
                .get_mut(&sample.channel)
                .expect("met before its messages")
                .add(&sample);
        }
        for (id, names) in std::mem::take(&mut part.joints) {
            let channel = self.channels.get_mut(&id).expect("met before its messages");
            if channel.joints.is_empty() {
                channel.joints = names;
            }
        }
    }
}

fn summary(channel: &Channel, schema: Option<&Schema>) -> ChannelSummary {
    ChannelSummary {
        topic: channel.topic.clone(),
        type_name: schema.map(|schema| schema.name.clone()).unwrap_or_default(),
        encoding: channel.encoding.clone(),
        schema_encoding: schema
            .map(|schema| schema.encoding.clone())
            .unwrap_or_default(),
        layout: schema.and_then(|schema| Layout::of_type(&schema.name)),
        messages: 0,
        log: ClockSummary::default(),
        publish: ClockSummary::default(),
        header: ClockSummary::default(),
        log_less_header_ns: None,
        last_sequence: 0,
        sequence_jumps: 0,
        unreadable: 0,
        joints: Vec::new(),
    }
}

fn header(plan: &Plan, payload: &[u8], row: &mut Row) -> Header {
    let read = plan.read(payload, row);
    let value = |slot| row.value(payload, slot);
    match (read, value(0).integer(), value(1).integer()) {
        (Ok(()), Some(sec), Some(nanosec)) => {
            Header::Stamp(sec.saturating_mul(1_000_000_000).saturating_add(nanosec))
        }
        // JSON may leave it out.
        (Ok(()), ..) if value(0) == Value::Absent => Header::None,
        _ => Header::Unreadable,
    }
}

fn names(plan: &Plan, payload: &[u8]) -> Vec<String> {
    let mut row = Row::default();
    match (plan.read(payload, &mut row), row.value(payload, 0).texts()) {
        (Ok(()), Some(names)) => names.iter().flatten().map(|name| name.to_text()).collect(),
        _ => Vec::new(),
    }
}
