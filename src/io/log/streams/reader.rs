//! One message of a wanted channel → one row of its stream's columns, or the reason why not.

use std::collections::BTreeMap;

use thiserror::Error;

use super::Stream;
use super::layout::Layout;
use crate::ingest::{DecodedJoints, DecodedPoses, DecodedTemperatures, TimeSource};
use crate::io::log::block::Tally;
use crate::io::log::record::MessageRecord;
use crate::io::message::{CdrPlan, MessageFault, Texts, Value};

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
    #[error("the message's time lies after the year 2262: it is damaged")]
    Time,
}

/// How the messages of one channel are read: `None` where nobody wants them.
pub type Decoder = Option<Box<Reader>>;

/// How the messages of one wanted channel are read.
#[derive(Debug)]
pub struct Reader {
    pub(super) stream: Stream,
    pub(super) layout: Layout,
    pub(super) time: TimeSource,
    pub(super) plan: CdrPlan,
}

/// Most values that a layout lends: stamp and pose and covariance.
const MOST_VALUES: usize = 10;

/// What one block gives.
#[derive(Debug, Default)]
pub struct Part {
    pub(super) joints: DecodedJoints,
    order: JointOrder,
    pub(super) commands: DecodedPoses,
    pub(super) readings: DecodedPoses,
    pub(super) temperatures: DecodedTemperatures,
    pub(super) faults: BTreeMap<(Stream, RowFault), Tally>,
    pub(super) messages: BTreeMap<Stream, u64>,
}

/// Where the arm's joints stand in messages with these names.
#[derive(Debug, Default)]
struct JointOrder {
    names: Vec<u8>,
    count: usize,
    places: Vec<usize>,
}

impl Part {
    /// Empties it for the next block, with so many joints.
    pub(super) fn clear(&mut self, joints: usize) {
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
    /// Adds the message's row to the part, or nothing.
    pub(super) fn read(
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
            (TimeSource::Publish, _) => stamp_of(message.publish_time),
            _ => stamp_of(message.log_time),
        }
    }
}

fn stamp_of(time: u64) -> Result<i64, RowFault> {
    i64::try_from(time).map_err(|_| RowFault::Time)
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
