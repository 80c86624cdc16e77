//! Inspect: a log file → what is in it, channel by channel: types, rates, gaps, clocks, damage.
//!
//! 1. Read the log as ingest does ([`super::log`]), so damage is what ingest would lose.
//! 2. Of each message take log time, publish time, sequence and, where its schema has one, the header stamp.
//! 3. Sum up each channel block by block, in the order of the file; nothing is kept of a message.

mod clock;

use std::collections::BTreeMap;
use std::path::Path;

use crate::ingest::{LogReject, TimeSource};
use crate::io::log::{
    Account, Channel, Extent, FileError, Layout, Limits, MessageRecord, Schema, Visitor, ns, scan,
};
use crate::io::message::{CdrPlan, Value, ros2msg};
use crate::progress::Progress;

pub use clock::{ClockSummary, Differences};

/// Joint names of a message that are kept, and letters of each: as many as an arm can have.
const MOST_JOINTS: usize = 64;

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
    /// Its messages.
    pub traffic: Traffic,
}

/// The messages of one channel, or of a part of it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Traffic {
    /// Messages.
    pub messages: u64,
    /// Bytes of them.
    pub bytes: u64,
    /// Log times.
    pub log: ClockSummary,
    /// Publish times.
    pub publish: ClockSummary,
    /// Header stamps, where messages have them.
    pub header: ClockSummary,
    /// Log time less header stamp.
    pub log_less_header: Differences,
    /// Log time less publish time.
    pub log_less_publish: Differences,
    /// Largest sequence number; 0 where the recorder does not count.
    pub last_sequence: u32,
    /// Steps of the sequence number other than one.
    pub sequence_jumps: u64,
    /// Messages whose schema does not fit them.
    pub unreadable: u64,
    /// Joint names of the first message, where they are joint states.
    pub joints: Vec<String>,
    /// The first and the last sequence number, in the order of the file.
    sequences: Option<(u32, u32)>,
}

impl ChannelSummary {
    /// The time source that would suit the channel best.
    pub fn best_time(&self) -> TimeSource {
        let Traffic {
            header, messages, ..
        } = &self.traffic;
        let stamped = header.count > 0 && header.count == *messages;
        if stamped && (header.first, header.last) != (0, 0) {
            TimeSource::Header
        } else {
            TimeSource::Log
        }
    }
}

impl Traffic {
    fn add(&mut self, message: &MessageRecord<'_>, plans: &Plans) {
        let (log, publish) = (ns(message.log_time), ns(message.publish_time));
        self.count_sequence(message.sequence, message.sequence);
        self.last_sequence = self.last_sequence.max(message.sequence);
        self.bytes += message.payload.len() as u64;
        self.log.add(log);
        self.publish.add(publish);
        self.log_less_publish.add(log.saturating_sub(publish));
        match plans
            .stamp
            .as_ref()
            .map(|plan| stamp(plan, message.payload))
        {
            Some(Some(header)) => {
                self.header.add(header);
                self.log_less_header.add(log.saturating_sub(header));
            }
            Some(None) => self.unreadable += 1,
            None => {}
        }
        if let (Some(plan), 0) = (&plans.names, self.messages) {
            self.joints = names(plan, message.payload);
        }
        self.messages += 1;
    }

    /// Takes in what follows in the file.
    fn append(&mut self, later: Self) {
        if let Some((first, last)) = later.sequences {
            self.count_sequence(first, last);
        }
        if self.joints.is_empty() {
            self.joints = later.joints;
        }
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

/// Reads a log and sums it up.
pub fn inspect(
    path: &Path,
    limits: Limits,
    progress: &dyn Progress,
) -> Result<Inspection, FileError> {
    let mut survey = Survey::default();
    let name = path.display().to_string();
    let account = scan(path, &name, limits, &mut survey, progress)?;
    let mut channels: Vec<_> = survey.channels.into_values().collect();
    channels.sort_by(|a, b| a.topic.cmp(&b.topic));
    Ok(Inspection { account, channels })
}

/// How to take the header stamp, and the joint names, of a channel's messages.
struct Plans {
    stamp: Option<CdrPlan>,
    names: Option<CdrPlan>,
}

#[derive(Default)]
struct Survey {
    channels: BTreeMap<u16, ChannelSummary>,
}

impl Visitor for Survey {
    type Decoder = Plans;
    type Part = BTreeMap<u16, Traffic>;
    type Error = FileError;

    fn channel(&mut self, channel: &Channel, schema: Option<&Schema>) -> Result<Plans, FileError> {
        self.channels.insert(channel.id, summary(channel, schema));
        let readable =
            schema.filter(|schema| schema.encoding == "ros2msg" && channel.encoding == "cdr");
        let definition = readable.and_then(|schema| {
            ros2msg::parse(&schema.name, &String::from_utf8_lossy(&schema.definition)).ok()
        });
        let plan = |paths: &[&str]| {
            definition
                .as_ref()
                .and_then(|d| CdrPlan::resolve(d, paths).ok())
        };
        let is_joints =
            schema.and_then(|schema| Layout::of_type(&schema.name)) == Some(Layout::Joints);
        Ok(Plans {
            stamp: plan(&["header.stamp.sec", "header.stamp.nanosec"]),
            names: plan(&["name"]).filter(|_| is_joints),
        })
    }

    fn message(&self, plans: &Plans, message: &MessageRecord<'_>, part: &mut Self::Part) {
        let traffic = part.entry(message.channel_id).or_default();
        traffic.add(message, plans);
    }

    fn clear(&self, part: &mut Self::Part) {
        part.clear();
    }

    fn merge(&mut self, _: &Extent, part: &mut Self::Part, _: &mut Vec<LogReject>) {
        for (id, traffic) in std::mem::take(part) {
            let channel = self.channels.get_mut(&id).expect("met before its messages");
            channel.traffic.append(traffic);
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
        traffic: Traffic::default(),
    }
}

/// The header stamp of a message, ns; `None` where its schema does not fit it.
fn stamp(plan: &CdrPlan, payload: &[u8]) -> Option<i64> {
    let mut values = [Value::Unread; 2];
    plan.read(payload, &mut values).ok()?;
    let (sec, nanosec) = (values[0].integer()?, values[1].integer()?);
    Some(sec.saturating_mul(1_000_000_000).saturating_add(nanosec))
}

fn names(plan: &CdrPlan, payload: &[u8]) -> Vec<String> {
    let mut values = [Value::Unread; 1];
    match (plan.read(payload, &mut values), values[0]) {
        (Ok(()), Value::Texts(names)) => names
            .iter()
            .take(MOST_JOINTS)
            .map(|name| String::from_utf8_lossy(&name[..name.len().min(MOST_JOINTS)]).into_owned())
            .collect(),
        _ => Vec::new(),
    }
}
