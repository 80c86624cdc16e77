//! Streams: the messages of the topics that the pipeline file names → decoded columns.
//!
//! The common message types need no field paths: which fields are read follows from the type.

use std::collections::{BTreeMap, BTreeSet};

use thiserror::Error;

use super::block::{Extent, Tally};
use super::record::MessageRecord;
use super::registry::{Channel, Schema};
use super::scan::{Visitor, ns};
use super::{FileError, LogError, Unsuitable};
use crate::ingest::{
    DecodedJoints, DecodedPoses, DecodedTemperatures, LogReject, Mapping, Origin, Origins,
    TimeSource,
};
use crate::io::message::{CdrPlan, MessageFault, Texts, Value, ros2msg};

/// A stream of the recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stream {
    Joints,
    Commands,
    Readings,
    Temperatures,
}

/// A stream and where it comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Wanted {
    pub stream: Stream,
    pub topic: String,
    pub time: TimeSource,
}

/// What a type of message is decoded as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// `sensor_msgs/JointState`.
    Joints,
    /// `geometry_msgs/PoseStamped`.
    Pose,
    /// `geometry_msgs/PointStamped`.
    Point,
    /// `geometry_msgs/PoseWithCovarianceStamped`.
    PoseWithCovariance,
    /// `sensor_msgs/Temperature`.
    Temperature,
}

impl Layout {
    /// The layout of a common type, named `pkg/msg/T` or `pkg/T`.
    pub fn of_type(name: &str) -> Option<Self> {
        Some(match ros2msg::short_name(name).as_str() {
            "sensor_msgs/JointState" => Self::Joints,
            "geometry_msgs/PoseStamped" => Self::Pose,
            "geometry_msgs/PointStamped" => Self::Point,
            "geometry_msgs/PoseWithCovarianceStamped" => Self::PoseWithCovariance,
            "sensor_msgs/Temperature" => Self::Temperature,
            _ => return None,
        })
    }

    /// Whether a stream can be made of it.
    pub const fn suits(self, stream: Stream) -> bool {
        match stream {
            Stream::Joints => matches!(self, Self::Joints),
            Stream::Commands | Stream::Readings => {
                matches!(self, Self::Pose | Self::Point | Self::PoseWithCovariance)
            }
            Stream::Temperatures => matches!(self, Self::Temperature),
        }
    }

    const fn fields(self) -> &'static [&'static str] {
        match self {
            Self::Joints => &["name", "position"],
            Self::Pose => &[
                "pose.position.x",
                "pose.position.y",
                "pose.position.z",
                "pose.orientation.x",
                "pose.orientation.y",
                "pose.orientation.z",
                "pose.orientation.w",
            ],
            Self::Point => &["point.x", "point.y", "point.z"],
            Self::PoseWithCovariance => &[
                "pose.pose.position.x",
                "pose.pose.position.y",
                "pose.pose.position.z",
                "pose.pose.orientation.x",
                "pose.pose.orientation.y",
                "pose.pose.orientation.z",
                "pose.pose.orientation.w",
                "pose.covariance",
            ],
            Self::Temperature => &["temperature"],
        }
    }
}

/// What a stream's message types are called, for an error.
const fn suitable_types(stream: Stream) -> &'static str {
    match stream {
        Stream::Joints => "sensor_msgs/msg/JointState",
        Stream::Commands | Stream::Readings => {
            "geometry_msgs/msg/PoseStamped, PointStamped and PoseWithCovarianceStamped"
        }
        Stream::Temperatures => "sensor_msgs/msg/Temperature",
    }
}

/// Why one message of a wanted topic is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Error)]
pub enum RowFault {
    #[error(transparent)]
    Message(#[from] MessageFault),
    /// The index is the joint's place in the arm.
    #[error("joint")]
    JointMissing(usize),
    #[error("joint")]
    JointTwice(usize),
    #[error("the message has another number of positions than of joint names")]
    UnequalArrays,
    #[error("the header stamp's nanoseconds are a second or more")]
    Stamp,
}

/// How the messages of one channel are read: `None` where nobody wants them.
pub type Decoder = Option<Box<Reader>>;

/// How the messages of one wanted channel are read.
#[derive(Debug)]
pub struct Reader {
    stream: Stream,
    layout: Layout,
    time: TimeSource,
    plan: CdrPlan,
}

/// Most values that a layout lends: stamp and pose and covariance.
const MOST_VALUES: usize = 10;

/// What one block gives.
#[derive(Debug, Default)]
pub struct Part {
    joints: DecodedJoints,
    order: JointOrder,
    commands: DecodedPoses,
    readings: DecodedPoses,
    temperatures: DecodedTemperatures,
    faults: BTreeMap<(Stream, RowFault), Tally>,
    messages: BTreeMap<Stream, u64>,
}

/// Where the arm's joints stand in messages with these names.
#[derive(Debug, Default)]
struct JointOrder {
    names: Vec<u8>,
    count: usize,
    places: Vec<usize>,
}

/// The wanted streams of one file, being filled.
#[derive(Debug)]
pub struct Streams<'m> {
    file: String,
    wanted: Vec<Wanted>,
    joint_names: &'m [String],
    met: BTreeSet<Stream>,
    pub joints: DecodedJoints,
    pub commands: DecodedPoses,
    pub readings: DecodedPoses,
    pub temperatures: DecodedTemperatures,
    pub messages: BTreeMap<Stream, u64>,
    pub undecoded: BTreeMap<Stream, u64>,
}

impl<'m> Streams<'m> {
    /// Nothing read yet.
    pub fn new(file: &str, wanted: Vec<Wanted>, mapping: &'m Mapping) -> Self {
        let origins = |stream| Origins {
            file: file.to_owned(),
            topic: wanted
                .iter()
                .find(|w| w.stream == stream)
                .map(|w| w.topic.clone())
                .unwrap_or_default(),
            blocks: Vec::new(),
        };
        let poses = |stream| DecodedPoses {
            origins: origins(stream),
            ..DecodedPoses::default()
        };
        Self {
            file: file.to_owned(),
            joint_names: &mapping.joints,
            met: BTreeSet::new(),
            joints: DecodedJoints {
                origins: origins(Stream::Joints),
                angles: vec![Vec::new(); mapping.joints.len()],
                ..DecodedJoints::default()
            },
            commands: poses(Stream::Commands),
            readings: poses(Stream::Readings),
            temperatures: DecodedTemperatures {
                origins: origins(Stream::Temperatures),
                ..DecodedTemperatures::default()
            },
            messages: BTreeMap::new(),
            undecoded: BTreeMap::new(),
            wanted,
        }
    }

    /// The first wanted topic that the file does not have.
    pub fn missing_topic(&self) -> Option<&Wanted> {
        self.wanted
            .iter()
            .find(|wanted| !self.met.contains(&wanted.stream))
    }

    fn reader(
        &self,
        wanted: &Wanted,
        channel: &Channel,
        schema: Option<&Schema>,
    ) -> Result<Reader, LogError> {
        let at = |source| LogError::Schema {
            file: self.file.clone(),
            topic: channel.topic.clone(),
            source,
        };
        let unsuitable = |type_name: &str, schema_encoding: &str| {
            LogError::Unsuitable(Box::new(Unsuitable {
                file: self.file.clone(),
                topic: channel.topic.clone(),
                type_name: type_name.to_owned(),
                encoding: channel.encoding.clone(),
                schema_encoding: schema_encoding.to_owned(),
                suitable: suitable_types(wanted.stream),
            }))
        };
        let schema = schema.ok_or_else(|| unsuitable("", ""))?;
        let refused = || unsuitable(&schema.name, &schema.encoding);
        let layout = Layout::of_type(&schema.name)
            .filter(|layout| layout.suits(wanted.stream))
            .ok_or_else(refused)?;
        if channel.encoding != "cdr" || schema.encoding != "ros2msg" {
            return Err(refused());
        }
        let text = String::from_utf8_lossy(&schema.definition);
        let definition = ros2msg::parse(&schema.name, &text).map_err(at)?;
        let stamp: &[&str] = match wanted.time {
            TimeSource::Header => &["header.stamp.sec", "header.stamp.nanosec"],
            TimeSource::Publish | TimeSource::Log => &[],
        };
        let plan = CdrPlan::resolve(&definition, &[stamp, layout.fields()].concat()).map_err(at)?;
        Ok(Reader {
            stream: wanted.stream,
            layout,
            time: wanted.time,
            plan,
        })
    }

    fn describe(&self, fault: RowFault) -> String {
        let joint = |place: usize| self.joint_names.get(place).map_or("", String::as_str);
        match fault {
            RowFault::JointMissing(place) => {
                format!("joint {:?} is missing from the message", joint(place))
            }
            RowFault::JointTwice(place) => {
                format!("joint {:?} stands twice in the message", joint(place))
            }
            other => other.to_string(),
        }
    }
}

impl Visitor for Streams<'_> {
    type Decoder = Decoder;
    type Part = Part;
    type Error = LogError;

    fn channel(&mut self, channel: &Channel, schema: Option<&Schema>) -> Result<Decoder, LogError> {
        let Some(wanted) = self
            .wanted
            .iter()
            .find(|wanted| wanted.topic == channel.topic)
        else {
            return Ok(None);
        };
        let reader = self.reader(wanted, channel, schema)?;
        self.met.insert(wanted.stream);
        Ok(Some(Box::new(reader)))
    }

    fn message(&self, decoder: &Decoder, message: &MessageRecord<'_>, part: &mut Part) {
        let Some(reader) = decoder else { return };
        *part.messages.entry(reader.stream).or_default() += 1;
        if let Err(fault) = reader.read(message, self.joint_names, part) {
            part.faults
                .entry((reader.stream, fault))
                .or_default()
                .add(message.log_time);
        }
    }

    fn clear(&self, part: &mut Part) {
        part.clear(self.joint_names.len());
    }

    fn merge(&mut self, extent: &Extent, part: &mut Part, rejects: &mut Vec<LogReject>) {
        append_joints(&mut self.joints, &mut part.joints, extent);
        append_poses(&mut self.commands, &mut part.commands, extent);
        append_poses(&mut self.readings, &mut part.readings, extent);
        self.temperatures
            .celsius
            .append(&mut part.temperatures.celsius);
        self.temperatures
            .stamps
            .append(&mut part.temperatures.stamps);
        note(
            &mut self.temperatures.origins,
            self.temperatures.stamps.len(),
            extent,
        );
        for (stream, count) in &part.messages {
            *self.messages.entry(*stream).or_default() += count;
        }
        for ((stream, fault), tally) in std::mem::take(&mut part.faults) {
            *self.undecoded.entry(stream).or_default() += tally.messages.unwrap_or(0);
            let topic = self.wanted.iter().find(|wanted| wanted.stream == stream);
            rejects.push(LogReject {
                file: self.file.clone(),
                topic: topic.map(|wanted| wanted.topic.clone()),
                byte_start: extent.start,
                byte_end: extent.end,
                time_span_ns: tally.times.map(|(first, last)| (ns(first), ns(last))),
                messages: tally.messages,
                reason: self.describe(fault),
            });
        }
    }
}

impl Part {
    fn clear(&mut self, joints: usize) {
        self.joints.stamps.clear();
        self.joints.angles.resize_with(joints, Vec::new);
        self.joints.angles.iter_mut().for_each(Vec::clear);
        for poses in [&mut self.commands, &mut self.readings] {
            poses.stamps.clear();
            poses.positions.clear();
            poses.orientations = None;
            poses.covariances = None;
        }
        self.temperatures.stamps.clear();
        self.temperatures.celsius.clear();
        self.faults.clear();
        self.messages.clear();
    }
}

impl Reader {
    fn read(
        &self,
        message: &MessageRecord<'_>,
        joint_names: &[String],
        part: &mut Part,
    ) -> Result<(), RowFault> {
        let stamp_fields = if self.time == TimeSource::Header {
            2
        } else {
            0
        };
        let mut values = [Value::Unread; MOST_VALUES];
        let values = &mut values[..stamp_fields + self.layout.fields().len()];
        self.plan.read(message.payload, values)?;
        let (stamp, fields) = values.split_at(stamp_fields);
        let stamp = self.stamp(message, stamp)?;
        match (self.layout, self.stream) {
            (Layout::Joints, _) => {
                part.order
                    .read(fields, joint_names, &mut part.joints.angles)?;
                part.joints.stamps.push(stamp);
            }
            (Layout::Temperature, _) => {
                part.temperatures.celsius.push(double(&fields[0]));
                part.temperatures.stamps.push(stamp);
            }
            (layout, Stream::Commands) => push_pose(&mut part.commands, layout, stamp, fields),
            (layout, _) => push_pose(&mut part.readings, layout, stamp, fields),
        }
        Ok(())
    }

    fn stamp(&self, message: &MessageRecord<'_>, header: &[Value<'_>]) -> Result<i64, RowFault> {
        match (self.time, header) {
            (TimeSource::Header, [sec, nanosec]) => {
                let (Some(sec), Some(nanosec)) = (sec.integer(), nanosec.integer()) else {
                    return Err(RowFault::Stamp);
                };
                if !(0..1_000_000_000).contains(&nanosec) {
                    return Err(RowFault::Stamp);
                }
                Ok(sec.saturating_mul(1_000_000_000).saturating_add(nanosec))
            }
            (TimeSource::Publish, _) => Ok(ns(message.publish_time)),
            _ => Ok(ns(message.log_time)),
        }
    }
}

/// A number that the plan lent; a schema that stores a text there is met as not finite.
fn double(value: &Value<'_>) -> f64 {
    value.number().unwrap_or(f64::NAN)
}

impl JointOrder {
    fn read(
        &mut self,
        fields: &[Value<'_>],
        joints: &[String],
        angles: &mut [Vec<f64>],
    ) -> Result<(), RowFault> {
        let [Value::Texts(names), Value::Numbers(positions)] = fields else {
            return Err(RowFault::UnequalArrays);
        };
        if names.len() != positions.len() {
            return Err(RowFault::UnequalArrays);
        }
        // The order hardly ever changes, so the names are looked at only when their bytes do.
        if self.count != names.len()
            || self.names != names.as_stored()
            || self.places.len() != joints.len()
        {
            self.find(names, joints)?;
        }
        for (column, &place) in angles.iter_mut().zip(&self.places) {
            column.push(positions.get(place).expect("as many positions as names"));
        }
        Ok(())
    }

    fn find(&mut self, names: &Texts<'_>, joints: &[String]) -> Result<(), RowFault> {
        self.places.clear();
        for (place, joint) in joints.iter().enumerate() {
            let mut found = names
                .iter()
                .enumerate()
                .filter(|(_, name)| *name == joint.as_bytes());
            match (found.next(), found.next()) {
                (Some((index, _)), None) => self.places.push(index),
                (None, _) => return Err(RowFault::JointMissing(place)),
                (Some(_), Some(_)) => return Err(RowFault::JointTwice(place)),
            }
        }
        self.count = names.len();
        self.names.clear();
        self.names.extend_from_slice(names.as_stored());
        Ok(())
    }
}

fn push_pose(poses: &mut DecodedPoses, layout: Layout, stamp: i64, fields: &[Value<'_>]) {
    poses.stamps.push(stamp);
    poses.positions.push([0, 1, 2].map(|i| double(&fields[i])));
    if layout != Layout::Point {
        let orientation = [3, 4, 5, 6].map(|i| double(&fields[i]));
        poses.orientations.get_or_insert_default().push(orientation);
    }
    if let (Layout::PoseWithCovariance, Value::Numbers(covariance)) =
        (layout, fields[fields.len() - 1])
    {
        // Rows of six: x y z and three rotations.
        let upper = [0, 1, 2, 7, 8, 14].map(|i| covariance.get(i).unwrap_or(f64::NAN));
        poses.covariances.get_or_insert_default().push(upper);
    }
}

fn append_joints(to: &mut DecodedJoints, from: &mut DecodedJoints, extent: &Extent) {
    to.stamps.append(&mut from.stamps);
    for (to, from) in to.angles.iter_mut().zip(&mut from.angles) {
        to.append(from);
    }
    note(&mut to.origins, to.stamps.len(), extent);
}

fn append_poses(to: &mut DecodedPoses, from: &mut DecodedPoses, extent: &Extent) {
    to.stamps.append(&mut from.stamps);
    to.positions.append(&mut from.positions);
    if let Some(from) = &mut from.orientations {
        to.orientations.get_or_insert_default().append(from);
    }
    if let Some(from) = &mut from.covariances {
        to.covariances.get_or_insert_default().append(from);
    }
    note(&mut to.origins, to.stamps.len(), extent);
}

fn note(origins: &mut Origins, rows: usize, extent: &Extent) {
    if origins.blocks.last().map_or(0, |origin| origin.rows_end) < rows {
        origins.blocks.push(Origin {
            rows_end: rows,
            byte_start: extent.start,
            byte_end: extent.end,
        });
    }
}

impl From<FileError> for LogError {
    fn from(error: FileError) -> Self {
        Self::File(error)
    }
}
