//! One message of a wanted channel → one row of its stream's columns, or the reason why it gives none.

use std::collections::BTreeMap;
use std::sync::Arc;

use thiserror::Error;

use super::Stream;
use super::elements::{Element, ElementColumns, Names, is_named};
use super::layout::{Meaning, PoseParts, Recipe, StampValues};
use crate::ingest::{
    DecodedJoints, DecodedPoses, DecodedTemperatures, LoggedCovariance, TargetName, TimeSource,
    TimeUnit,
};
use crate::log::block::Tally;
use crate::log::record::MessageRecord;
use crate::message::{MessageFault, Row, Text, Texts, Value};

type Result<T, E = RowFault> = std::result::Result<T, E>;

/// Numbers are places: of a joint in the arm, or of a wanted path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Error)]
pub enum RowFault {
    #[error(transparent)]
    Message(#[from] MessageFault),
    #[error("joint")]
    JointMissing(usize),
    #[error("joint")]
    JointTwice(usize),
    #[error(
        "the message states no position of the arm's joints: another device's, or velocities alone"
    )]
    NotOfArm,
    #[error("the message has another number of positions than of joint names")]
    UnequalArrays,
    #[error("field")]
    NoValue(usize),
    #[error("field")]
    NoNumber(usize),
    #[error("field")]
    NoArray(usize),
    #[error("the covariance is no array of 9 or 36 numbers")]
    Covariance,
    #[error("frame")]
    OtherFrame,
    #[error("the message is of a target that none of [tracker] targets is")]
    OtherTarget,
    #[error("target")]
    TargetTwice(usize),
    #[error("the arrays of the message's targets and of their poses differ in length")]
    UnequalPoses,
    #[error(
        "the message's stamp is no time: nanoseconds of a second or more, no number, a text that is no date-time with its \
         zone (2026-11-22T08:30:00.25Z), or after the year 2262"
    )]
    Stamp,
    #[error("the message's time lies after the year 2262: it is damaged")]
    Time,
}

/// The reader of one channel's messages: `None` for a channel that is not wanted.
pub type Decoder = Option<Arc<Reader>>;

#[derive(Debug)]
pub struct Reader {
    /// Place of its topic among those that are wanted of the file.
    pub(super) wanted: usize,
    pub(super) stream: Stream,
    pub(super) time: TimeSource,
    pub(super) targets: Vec<Wished>,
    /// The instruments of one length whose readings its messages have, in the order of the recipe's values.
    pub(super) lengths: Vec<usize>,
    pub(super) recipe: Recipe,
}

#[derive(Debug, Clone)]
pub(super) struct Wished {
    pub(super) place: usize,
    /// Its name or number in messages; `None` where every message is of it.
    pub(super) is: Option<TargetName>,
}

#[derive(Debug, Default)]
pub struct Part {
    pub joints: DecodedJoints,
    /// A row for each stream: its messages are alike.
    rows: [Row; 5],
    order: JointOrder,
    pub commands: DecodedPoses,
    /// Those of each target.
    pub readings: Vec<DecodedPoses>,
    pub temperatures: DecodedTemperatures,
    /// Those of each instrument of one length: the length as x, without y and z.
    pub lengths: Vec<DecodedPoses>,
    /// By the place of the topic among those that are wanted of the file.
    pub(super) faults: BTreeMap<(usize, RowFault), Tally>,
    pub(super) messages: [u64; 5],
}

/// The places of the arm's joints in messages with these names.
#[derive(Debug, Default)]
struct JointOrder {
    names: Vec<u8>,
    /// The place of each joint of the arm; fewer where some were not found.
    places: Vec<usize>,
    of: usize,
    /// The filling of the row that had these names.
    seen_in: Option<u64>,
}

/// Stamp and recorder's time of a message, ns.
type Times = (i64, i64);

#[derive(Clone, Copy)]
pub(super) struct Values<'m> {
    row: &'m Row,
    payload: &'m [u8],
}

impl Part {
    /// Empties it for the next block, for this number of joints, targets and instruments of one length.
    pub(super) fn clear(&mut self, joints: usize, targets: usize, lengths: usize) {
        self.readings.resize_with(targets, DecodedPoses::default);
        self.lengths.resize_with(lengths, DecodedPoses::default);
        self.joints.stamps.clear();
        self.joints.logged.clear();
        self.joints.angles.clear(joints);
        let lengths = self.lengths.iter_mut();
        let poses = self.readings.iter_mut().chain(lengths);
        for poses in poses.chain([&mut self.commands]) {
            poses.stamps.clear();
            poses.logged.clear();
            poses.positions.clear();
            poses.orientations = None;
            poses.covariances = None;
        }
        self.temperatures.stamps.clear();
        self.temperatures.logged.clear();
        self.temperatures.celsius.clear();
        self.faults.clear();
        self.messages = [0; 5];
    }
}

impl Reader {
    /// Adds the message's rows to the part; on a fault it adds nothing.
    pub(super) fn read(
        &self,
        message: &MessageRecord<'_>,
        joint_names: &[String],
        part: &mut Part,
    ) -> Result<()> {
        let recipe = &self.recipe;
        let row = &mut part.rows[self.stream as usize];
        recipe.reader.read(message.payload, row)?;
        let values = Values { row, payload: message.payload };
        let (stamp, mut first) = self.stamp(message, values)?;
        let times = (stamp, i64::try_from(message.log_time).unwrap_or(i64::MAX));
        if let Some(frame) = &recipe.frame {
            values.check_frame(first, frame)?;
            first += 1;
        }
        let target = first;
        if recipe.has_target {
            first += 1;
        }
        match (recipe.meaning, self.stream) {
            (meaning @ (Meaning::NamedAngles | Meaning::Angles), _) => {
                if meaning == Meaning::NamedAngles {
                    part.order.read(values, first, joint_names, &mut part.joints)?;
                } else {
                    let angles = &mut part.joints.angles;
                    let places = first..first + angles.joints();
                    angles.try_push(places.map(|place| values.number(place)))?;
                }
                part.joints.stamps.push(times.0);
                part.joints.logged.push(times.1);
            }
            (Meaning::Temperature, _) => {
                part.temperatures.celsius.push(values.number(first)?);
                part.temperatures.stamps.push(times.0);
                part.temperatures.logged.push(times.1);
            }
            (Meaning::Lengths, _) => self.push_lengths(values, first, times, &mut part.lengths)?,
            (Meaning::Pose(parts), stream) => {
                let poses = if stream == Stream::Commands {
                    &mut part.commands
                } else {
                    let place = self.target(values, target)?;
                    part.readings.get_mut(place).ok_or(RowFault::OtherTarget)?
                };
                push_pose(poses, times, values, first, parts)?;
            }
            (Meaning::Poses(parts), _) => {
                let columns = ElementColumns { values, first, parts };
                self.push_elements(&columns, target, times, &mut part.readings)?;
            }
        }
        Ok(())
    }

    pub(super) const fn rows(&self) -> usize {
        match self.recipe.meaning {
            Meaning::Poses(_) => self.targets.len(),
            Meaning::Lengths => self.lengths.len(),
            Meaning::NamedAngles | Meaning::Angles | Meaning::Pose(_) | Meaning::Temperature => 1,
        }
    }

    /// Adds the length of each instrument of the message. On a fault it adds nothing.
    fn push_lengths(
        &self,
        values: Values<'_>,
        first: usize,
        times: Times,
        lengths: &mut [DecodedPoses],
    ) -> Result<()> {
        let read = (first..).take(self.lengths.len());
        let read = read.map(|slot| values.number(slot));
        let read = read.collect::<Result<Vec<f64>>>()?;
        for (place, length) in self.lengths.iter().zip(read) {
            let own = lengths.get_mut(*place).ok_or(RowFault::OtherTarget)?;
            push_row(own, times, ([length, 0.0, 0.0], None, None));
        }
        Ok(())
    }

    /// The target that a message is of, by the name or number in the slot `slot`.
    fn target(&self, values: Values<'_>, slot: usize) -> Result<usize> {
        if !self.recipe.has_target {
            return match &self.targets[..] {
                [only] => Ok(only.place),
                _ => Err(RowFault::OtherTarget),
            };
        }
        let found = values.get(slot);
        if found == Value::Absent {
            return Err(RowFault::NoValue(slot));
        }
        let is_it = |own: &&Wished| own.is.as_ref().is_some_and(|is| is_named(found, is));
        let own = self.targets.iter().find(is_it);
        own.map(|own| own.place).ok_or(RowFault::OtherTarget)
    }

    /// Zeros, which count as a missing reading, of a target that the message does not have. On a fault it adds nothing.
    fn push_elements(
        &self,
        columns: &ElementColumns<'_>,
        slot: usize,
        times: Times,
        readings: &mut [DecodedPoses],
    ) -> Result<()> {
        let names = Names::of(columns.values.get(slot)).ok_or(RowFault::NoArray(slot))?;
        columns.check_length(names.len())?;
        let mut rows = Vec::with_capacity(self.targets.len());
        for own in &self.targets {
            let is_it = |index: &usize| own.is.as_ref().is_some_and(|is| names.is(*index, is));
            let mut found = (0..names.len()).filter(is_it);
            let row = match (found.next(), found.next()) {
                (None, _) => columns.missing(),
                (Some(index), None) => columns.element(index)?,
                (Some(_), Some(_)) => return Err(RowFault::TargetTwice(own.place)),
            };
            rows.push((own.place, row));
        }
        for (place, row) in rows {
            let poses = readings.get_mut(place).ok_or(RowFault::OtherTarget)?;
            push_row(poses, times, row);
        }
        Ok(())
    }

    /// The message's time, and the place of the value after it.
    fn stamp(&self, message: &MessageRecord<'_>, values: Values<'_>) -> Result<(i64, usize)> {
        Ok(match self.recipe.stamp {
            StampValues::Time => (values.time()?, 2),
            StampValues::TimeOrText => (values.time_or_text()?, 3),
            StampValues::Number(unit) => (values.stamp(unit)?, 1),
            StampValues::Record if self.time == TimeSource::Publish => {
                (stamp_of(message.publish_time)?, 0)
            }
            StampValues::Record => (stamp_of(message.log_time)?, 0),
        })
    }
}

fn stamp_of(time: u64) -> Result<i64> {
    i64::try_from(time).map_err(|_| RowFault::Time)
}

impl<'m> Values<'m> {
    pub(super) fn get(self, slot: usize) -> Value<'m> {
        self.row.value(self.payload, slot)
    }

    fn number(self, slot: usize) -> Result<f64> {
        let fault = || match self.get(slot) {
            Value::Absent => RowFault::NoValue(slot),
            _ => RowFault::NoNumber(slot),
        };
        self.row.number(slot).ok_or_else(fault)
    }

    /// Seconds and nanoseconds in the first two places.
    fn time(self) -> Result<i64> {
        let integer = |slot| {
            let fault = || match self.get(slot) {
                Value::Absent => RowFault::NoValue(slot),
                _ => RowFault::Stamp,
            };
            self.row.integer(slot).ok_or_else(fault)
        };
        let (sec, nanosec) = (integer(0)?, integer(1)?);
        if !(0..1_000_000_000).contains(&nanosec) {
            return Err(RowFault::Stamp);
        }
        let ns = sec.checked_mul(1_000_000_000);
        ns.and_then(|ns| ns.checked_add(nanosec)).ok_or(RowFault::Stamp)
    }

    /// Seconds and nanoseconds, or a date-time as text in the third place.
    fn time_or_text(self) -> Result<i64> {
        match self.get(2) {
            Value::Text(text) => text.date_time_ns().ok_or(RowFault::Stamp),
            _ => self.time(),
        }
    }

    /// The number is in the first place. A floating-point number has the resolution of its digits: 0.24 µs for seconds
    /// since 1970.
    fn stamp(self, unit: TimeUnit) -> Result<i64> {
        match self.get(0) {
            Value::Absent => Err(RowFault::NoValue(0)),
            Value::Integer(whole) => whole.checked_mul(unit.to_ns()).ok_or(RowFault::Stamp),
            Value::Number(number) => {
                let ns = (number * unit.to_ns() as f64).round();
                if ns.abs() < 9.2e18 {
                    #[expect(clippy::cast_possible_truncation, reason = "whole and in range")]
                    let ns = ns as i64;
                    Ok(ns)
                } else {
                    Err(RowFault::Stamp)
                }
            }
            _ => Err(RowFault::Stamp),
        }
    }

    fn check_frame(self, slot: usize, frame: &str) -> Result<()> {
        match self.get(slot) {
            Value::Text(text) if text.is(frame) => Ok(()),
            Value::Absent => Err(RowFault::NoValue(slot)),
            _ => Err(RowFault::OtherFrame),
        }
    }
}

impl JointOrder {
    fn read(
        &mut self,
        values: Values<'_>,
        first: usize,
        joint_names: &[String],
        joints: &mut DecodedJoints,
    ) -> Result<()> {
        if self.reads_as_before(values, first, joints) {
            return Ok(());
        }
        let (names, angles) = (values.get(first), values.get(first + 1));
        let names = names.texts().ok_or(RowFault::NoArray(first))?;
        let angles = angles.numbers().ok_or(RowFault::NoArray(first + 1))?;
        if angles.is_empty() {
            return Err(RowFault::NotOfArm);
        }
        if names.len() != angles.len() {
            return Err(RowFault::UnequalArrays);
        }
        // The order hardly ever changes, so the names are compared only when their bytes differ.
        let filled = Some(values.row.filled());
        let seen = self.seen_in == filled || names.are(&self.names);
        if self.places.len() != joint_names.len() || !seen {
            self.find(&names, joint_names)?;
        }
        self.seen_in = filled;
        let angle = |&place| angles.get(place).ok_or(RowFault::NoNumber(first + 1));
        joints.angles.try_push(self.places.iter().map(angle))
    }

    /// Takes the angles where names and form are those of nearly every message: unchanged names, and doubles.
    #[inline]
    fn reads_as_before(
        &mut self,
        values: Values<'_>,
        first: usize,
        joints: &mut DecodedJoints,
    ) -> bool {
        let Values { row, payload } = values;
        let Some(angles) = row.doubles(payload, first + 1) else { return false };
        let known = self.places.len() == joints.angles.joints() && angles.len() == self.of;
        let seen = self.seen_in == Some(row.filled());
        if !known || !(seen || row.texts_are(payload, first, &self.names)) {
            return false;
        }
        self.seen_in = Some(row.filled());
        let angle = |&place: &usize| f64::from_le_bytes(angles[place]);
        joints.angles.push(self.places.iter().map(angle));
        true
    }

    fn find(&mut self, names: &Texts<'_>, joints: &[String]) -> Result<()> {
        self.places.clear();
        self.seen_in = None;
        self.of = names.len();
        for (place, joint) in joints.iter().enumerate() {
            let named = names.iter().enumerate();
            let mut found = named.filter(|(_, name)| name.is_some_and(|name| name.is(joint)));
            match (found.next(), found.next()) {
                (Some((index, _)), None) => self.places.push(index),
                (None, _) => {
                    let is_joint = |name: Text<'_>| joints.iter().any(|joint| name.is(joint));
                    let is_of_arm = names.iter().flatten().any(is_joint);
                    let fault = RowFault::JointMissing(place);
                    return Err(if is_of_arm { fault } else { RowFault::NotOfArm });
                }
                (Some(_), Some(_)) => return Err(RowFault::JointTwice(place)),
            }
        }
        names.remember(&mut self.names);
        Ok(())
    }
}

fn push_pose(
    poses: &mut DecodedPoses,
    times: Times,
    values: Values<'_>,
    first: usize,
    parts: PoseParts,
) -> Result<()> {
    let number = |place: usize| values.number(first + place);
    let position = [number(0)?, number(1)?, number(2)?];
    let quaternion = || all(|place| number(3 + place));
    let quaternion = parts.orientation.then(quaternion).transpose()?;
    let slot = first + if parts.orientation { 7 } else { 3 };
    let covariance = parts.covariance.then(|| logged_covariance(values, slot)).transpose()?;
    push_row(poses, times, (position, quaternion, covariance));
    Ok(())
}

fn push_row(poses: &mut DecodedPoses, times: Times, (position, quaternion, covariance): Element) {
    if let Some(quaternion) = quaternion {
        poses.orientations.get_or_insert_default().push(quaternion);
    }
    if let Some(covariance) = covariance {
        poses.covariances.get_or_insert_default().push(covariance);
    }
    poses.positions.push(position);
    poses.stamps.push(times.0);
    poses.logged.push(times.1);
}

/// Rows of three, or of rows of six: x y z and three rotations.
fn logged_covariance(values: Values<'_>, slot: usize) -> Result<LoggedCovariance> {
    let covariance = values.get(slot).numbers().ok_or(RowFault::NoArray(slot))?;
    let entry = |place: usize| covariance.get(place).ok_or(RowFault::NoNumber(slot));
    match covariance.len() {
        9 => all(entry).map(LoggedCovariance::Position),
        36 => all(entry).map(LoggedCovariance::Pose),
        _ => Err(RowFault::Covariance),
    }
}

fn all<const N: usize>(entry: impl Fn(usize) -> Result<f64>) -> Result<[f64; N]> {
    let mut found = [0.0; N];
    for (place, found) in found.iter_mut().enumerate() {
        *found = entry(place)?;
    }
    Ok(found)
}
