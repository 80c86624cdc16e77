//! Log writer: a recording → the two MCAP logs that a cell would have written, in ROS 2 CDR: metres, radians, header
//! stamps in each instrument's own clock. The same recording gives the same bytes.

use std::collections::BTreeMap;
use std::io::{Seek, Write};

use mcap::WriteOptions;
use mcap::records::{MessageHeader, Metadata};
use nalgebra::Matrix3;
use thiserror::Error;

use crate::geometry::{PoseCovariance, pose_covariance, symmetric};
use crate::ingest::{
    CommandSamples, JointSamples, LengthSamples, Recording, TargetReadings, TemperatureSamples,
};
use crate::units::{MM_PER_M, Stamp};

mod cdr;
mod topic;

use cdr::Cdr;
use topic::{
    Topic, covariance_topic, joint_topic, length_topic, point_topic, pose_topic, targets_topic,
    temperature_topic,
};

/// Time from a message's stamp to its logging, ns.
const LATENCY_NS: u64 = 200_000;
const CHUNK_BYTES: u64 = 1 << 20;

type Result<T, E = LogWriteError> = std::result::Result<T, E>;

#[derive(Debug, Error)]
pub enum LogWriteError {
    #[error(
        "the log was not written: {0}; check the space and the permissions of the output folder"
    )]
    Mcap(#[from] mcap::McapError),
    #[error(
        "{topic}: stamp {ns} ns does not fit a ROS 2 time (1970 to 2038); choose another clock origin or offset"
    )]
    Stamp { topic: String, ns: i64 },
    #[error("{topic}: a message has {found} values, the format counts at most 4294967295")]
    TooLong { topic: String, found: usize },
}

/// Columns of the recording have one length.
pub fn write_controller_log<W: Write + Seek>(
    sink: W,
    recording: &Recording,
    joint_names: &[&str],
    session: &BTreeMap<String, String>,
) -> Result<()> {
    let joints = joint_messages(&recording.joints, joint_names)?;
    let commands = command_messages(&recording.commands)?;
    let commands = (pose_topic("/commanded_pose"), commands);
    write_in_time_order(sink, session, vec![(joint_topic(), joints), commands])
}

#[derive(Debug, Clone, Copy)]
pub struct TrackerLog<'a> {
    /// Readings of a single target, or of several that are not named.
    pub readings: &'a TargetReadings,
    /// Stands in place of `readings`: each message names its target (`child_frame_id`) and has no rotation.
    pub targets: &'a [(String, TargetReadings)],
    /// Readings of references with their names, likewise; empty without references.
    pub references: &'a [(String, TargetReadings)],
    pub temperatures: &'a TemperatureSamples,
    /// Readings of instruments of one length with their names; empty without any.
    pub lengths: &'a [(String, LengthSamples)],
}

impl TrackerLog<'_> {
    /// The session's record stands in the log's metadata.
    pub fn write<W: Write + Seek>(
        &self,
        sink: W,
        session: &BTreeMap<String, String>,
    ) -> Result<()> {
        let mut topics = vec![self.of_targets()?];
        if !self.references.is_empty() {
            let topic = Topic { name: "/tracker/references".to_owned(), ..targets_topic() };
            topics.push(named_messages(topic, self.references)?);
        }
        let temperatures = temperature_messages(self.temperatures)?;
        topics.push((temperature_topic(), temperatures));
        for (name, own) in self.lengths {
            let topic = length_topic(name);
            let messages = length_messages(&topic.name, own)?;
            topics.push((topic, messages));
        }
        write_in_time_order(sink, session, topics)
    }

    fn of_targets(&self) -> Result<(Topic, Vec<Encoded>)> {
        if !self.targets.is_empty() {
            return named_messages(targets_topic(), self.targets);
        }
        let topic = if self.readings.covariances.is_some() {
            covariance_topic()
        } else if self.readings.orientations.is_some() {
            pose_topic("/tracker/pose")
        } else {
            point_topic()
        };
        let readings = reading_messages(&topic.name, self.readings)?;
        Ok((topic, readings))
    }
}

fn named_messages(topic: Topic, all: &[(String, TargetReadings)]) -> Result<(Topic, Vec<Encoded>)> {
    let mut messages = Vec::new();
    for (name, own) in all {
        messages.extend(transform_messages(&topic.name, name, own)?);
    }
    Ok((topic, messages))
}

/// An encoded message and its stamp, ns.
struct Encoded {
    ns: u64,
    body: Vec<u8>,
}

fn encoded(
    topic: &str,
    ns: i64,
    frame: &str,
    fill: impl FnOnce(&mut Cdr) -> Result<()>,
) -> Result<Encoded> {
    let unfit = LogWriteError::Stamp { topic: topic.to_owned(), ns };
    let Ok(unsigned) = u64::try_from(ns) else { return Err(unfit) };
    let (seconds, rest) = (unsigned / 1_000_000_000, unsigned % 1_000_000_000);
    let (Ok(seconds), Ok(rest)) = (i32::try_from(seconds), u32::try_from(rest)) else {
        return Err(unfit);
    };
    let mut cdr = Cdr::new();
    cdr.number(seconds.to_le_bytes());
    cdr.number(rest.to_le_bytes());
    cdr.string(topic, frame)?;
    fill(&mut cdr)?;
    Ok(Encoded { ns: unsigned, body: cdr.into_bytes() })
}

/// A message for each stamp; `fill` writes what follows the header in the message of a row.
fn messages<C: Copy>(
    topic: &str,
    frame: &str,
    stamps: &[Stamp<C>],
    fill: impl Fn(&mut Cdr, usize) -> Result<()>,
) -> Result<Vec<Encoded>> {
    let message =
        |(row, stamp): (usize, &Stamp<C>)| encoded(topic, stamp.ns(), frame, |cdr| fill(cdr, row));
    stamps.iter().enumerate().map(message).collect()
}

fn joint_messages(joints: &JointSamples, joint_names: &[&str]) -> Result<Vec<Encoded>> {
    let topic = "/joint_states";
    messages(topic, "base", &joints.stamps, |cdr, row| {
        cdr.length(topic, joint_names.len())?;
        for name in joint_names {
            cdr.string(topic, name)?;
        }
        cdr.length(topic, joints.angles.joints())?;
        for &angle in joints.angles.row(row) {
            cdr.f64(angle);
        }
        // Velocity and effort are not recorded.
        cdr.length(topic, 0)?;
        cdr.length(topic, 0)
    })
}

fn command_messages(commands: &CommandSamples) -> Result<Vec<Encoded>> {
    messages("/commanded_pose", "base", &commands.stamps, |cdr, row| {
        push_point(cdr, &commands.positions[row]);
        push_quaternion(cdr, commands.orientations.as_ref().map_or(&UPRIGHT, |all| &all[row]));
        Ok(())
    })
}

fn reading_messages(topic: &str, readings: &TargetReadings) -> Result<Vec<Encoded>> {
    messages(topic, "tracker", &readings.stamps, |cdr, row| {
        push_point(cdr, &readings.positions[row]);
        let orientations = readings.orientations.as_ref();
        match (orientations, &readings.covariances) {
            (Some(all), _) => push_quaternion(cdr, &all[row]),
            (None, Some(_)) => push_quaternion(cdr, &UPRIGHT),
            (None, None) => {}
        }
        if let Some(covariances) = &readings.covariances {
            push_covariance(cdr, &covariances[row]);
        }
        Ok(())
    })
}

fn transform_messages(topic: &str, name: &str, readings: &TargetReadings) -> Result<Vec<Encoded>> {
    messages(topic, "tracker", &readings.stamps, |cdr, row| {
        cdr.string(topic, name)?;
        push_point(cdr, &readings.positions[row]);
        push_quaternion(cdr, &UPRIGHT);
        Ok(())
    })
}

fn temperature_messages(temperatures: &TemperatureSamples) -> Result<Vec<Encoded>> {
    messages("/tracker/temperature", "tracker", &temperatures.stamps, |cdr, row| {
        cdr.f64(temperatures.celsius[row]);
        cdr.f64(0.0);
        Ok(())
    })
}

fn length_messages(topic: &str, lengths: &LengthSamples) -> Result<Vec<Encoded>> {
    messages(topic, "tracker", &lengths.stamps, |cdr, row| {
        #[expect(clippy::cast_possible_truncation, reason = "the message's own resolution")]
        let length = (lengths.lengths_mm[row] / MM_PER_M) as f32;
        // Neither sound nor light, and no limits of its range.
        cdr.number([0]);
        for number in [0.0, 0.0, f32::MAX, length] {
            cdr.number(number.to_le_bytes());
        }
        Ok(())
    })
}

/// The quaternion x y z w of no rotation.
const UPRIGHT: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

fn push_point(cdr: &mut Cdr, position_mm: &[f64; 3]) {
    for x in position_mm {
        cdr.f64(x / MM_PER_M);
    }
}

fn push_quaternion(cdr: &mut Cdr, quaternion: &[f64; 4]) {
    for q in quaternion {
        cdr.f64(*q);
    }
}

/// All 36 numbers, row by row, m² to rad²; zeros, which say that it is not known, of a part that is not stated.
fn push_covariance(cdr: &mut Cdr, stated: &PoseCovariance) {
    let position = stated.position.map_or_else(Matrix3::zeros, symmetric);
    let whole = pose_covariance::joint(&position, &stated.turn.unwrap_or_default());
    let in_m = |place: usize| if place < 3 { MM_PER_M.recip() } else { 1.0 };
    for (row, column) in (0..6).flat_map(|row| (0..6).map(move |column| (row, column))) {
        cdr.f64(whole[(row, column)] * in_m(row) * in_m(column));
    }
}

/// A log with the session's record. Messages are in the order of stamps; where they are equal, the earlier topic comes first.
fn write_in_time_order<W: Write + Seek>(
    sink: W,
    session: &BTreeMap<String, String>,
    topics: Vec<(Topic, Vec<Encoded>)>,
) -> Result<()> {
    let mut writer = WriteOptions::new()
        .profile("ros2")
        .library("posegrid")
        .chunk_size(Some(CHUNK_BYTES))
        // Bytes must not depend on the number of cores of the machine.
        .compression_threads(0)
        .compression_level(9)
        .create(sink)?;
    writer.write_metadata(&Metadata { name: "session".to_owned(), metadata: session.clone() })?;
    let mut messages = Vec::new();
    for (topic, encoded) in topics {
        let definition = topic.definition.as_bytes();
        let schema = writer.add_schema(topic.schema, "ros2msg", definition)?;
        let channel = writer.add_channel(schema, &topic.name, "cdr", &BTreeMap::new())?;
        messages.extend(encoded.into_iter().map(|message| (message, channel)));
    }
    // A stable sort keeps the order of the topics.
    messages.sort_by_key(|(message, _)| message.ns);
    for (message, channel_id) in messages {
        let (publish_time, log_time) = (message.ns, message.ns.saturating_add(LATENCY_NS));
        let header = MessageHeader { channel_id, sequence: 0, log_time, publish_time };
        writer.write_to_known_channel(&header, &message.body)?;
    }
    writer.finish()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::ingest::JointAngles;
    use crate::units::Stamp;

    fn recording() -> Recording {
        let mut angles = JointAngles::of(2);
        angles.push([0.5, -0.25]);
        Recording {
            joints: JointSamples {
                stamps: vec![Stamp::from_ns(1_700_000_000_000_000_007)],
                angles,
            },
            commands: CommandSamples {
                stamps: vec![Stamp::from_ns(1_700_000_000_000_000_000)],
                positions: vec![[1500.0, 0.0, 800.0]],
                ..CommandSamples::default()
            },
            ..Recording::default()
        }
    }

    fn controller_log(recording: &Recording) -> Result<Vec<u8>> {
        let mut sink = Cursor::new(Vec::new());
        let session = BTreeMap::from([("robot".to_owned(), "r1".to_owned())]);
        write_controller_log(&mut sink, recording, &["a", "bc"], &session)?;
        Ok(sink.into_inner())
    }

    #[test]
    fn messages_are_in_time_order_and_encoded_as_cdr() {
        let log = controller_log(&recording()).expect("written to memory");
        let messages: Vec<_> = mcap::MessageStream::new(&log)
            .expect("an MCAP file")
            .map(|message| message.expect("a message"))
            .collect();
        // The command is stamped 7 ns before the joint state.
        let topics: Vec<_> = messages.iter().map(|m| m.channel.topic.clone()).collect();
        assert_eq!(topics, ["/commanded_pose", "/joint_states"]);
        assert_eq!(messages[1].publish_time, 1_700_000_000_000_000_007);
        let body = &messages[1].data;
        // Encapsulation (4 bytes), seconds, nanoseconds, then "base" with its length 5 (NUL counts).
        assert_eq!(body[..4], [0, 1, 0, 0]);
        assert_eq!(body[4..8], 1_700_000_000_i32.to_le_bytes());
        assert_eq!(body[8..12], 7_u32.to_le_bytes());
        assert_eq!(body[12..21], *b"\x05\0\0\0base\0");
        // Padding to 20 + 4; two names of 2 and 3 bytes, each padded to 4; two doubles aligned to 8 after their count.
        assert_eq!(body[24..28], 2_u32.to_le_bytes());
        assert_eq!(body[28..34], *b"\x02\0\0\0a\0");
        assert_eq!(body[36..43], *b"\x03\0\0\0bc\0");
        assert_eq!(body[44..48], 2_u32.to_le_bytes());
        // Offset 44 after the encapsulation is padded to 48.
        assert_eq!(body[52..60], 0.5_f64.to_le_bytes());
        assert_eq!(body[60..68], (-0.25_f64).to_le_bytes());
    }

    #[test]
    fn a_stamp_before_1970_or_after_2038_is_refused() {
        for ns in [-1, 3_000_000_000_000_000_000] {
            let mut recording = recording();
            recording.commands.stamps = vec![Stamp::from_ns(ns)];
            let error = controller_log(&recording).expect_err("does not fit");
            assert!(error.to_string().contains(&ns.to_string()), "{error}");
        }
    }
}
