//! Ingest: decoded log messages → columns in the crate's units, with every message that is left out accounted for.
//!
//! Inputs are the two logs of a session, mapped by the pipeline file; output is a [`Recording`]. Samples are in the
//! order of the time source that the pipeline file names.

use std::collections::BTreeMap;

use crate::units::{Controller, Stamp, Tracker};

/// One session as columns: what the controller and the tracker said, and what was left out.
#[derive(Debug, Clone, Default)]
pub struct Recording {
    /// Joint angles over controller time.
    pub joints: JointSamples,
    /// Commanded poses over controller time.
    pub commands: CommandSamples,
    /// Readings of the target over tracker time.
    pub readings: TargetReadings,
    /// Temperatures over tracker time.
    pub temperatures: TemperatureSamples,
    /// Messages and byte ranges left out, with reasons.
    pub rejects: Vec<LogReject>,
    /// Metadata records of the logs, as `record.key` → value, controller first.
    pub metadata: BTreeMap<String, String>,
    /// How much was read, for the manifest.
    pub counts: BTreeMap<String, u64>,
}

/// Joint angles as the controller reported them; columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct JointSamples {
    /// Controller time, not decreasing.
    pub stamps: Vec<Stamp<Controller>>,
    /// One column per joint of the arm, in the arm's order, rad.
    pub angles: Vec<Vec<f64>>,
}

/// Commanded tool poses, as the controller stated them; columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CommandSamples {
    /// Controller time, not decreasing.
    pub stamps: Vec<Stamp<Controller>>,
    /// Position of the tool point in the command frame, mm.
    pub positions: Vec<[f64; 3]>,
    /// Orientation of the tool as a unit quaternion x y z w, where the message has one.
    pub orientations: Option<Vec<[f64; 4]>>,
}

/// Readings of the target; columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TargetReadings {
    /// Tracker time, not decreasing.
    pub stamps: Vec<Stamp<Tracker>>,
    /// Position in the tracker frame, mm.
    pub positions: Vec<[f64; 3]>,
    /// Orientation in the tracker frame as a unit quaternion x y z w, where the target is a 6-DoF one.
    pub orientations: Option<Vec<[f64; 4]>>,
    /// Position covariance as the tracker stated it (xx xy xz yy yz zz, mm²), where the message has one.
    pub covariances: Option<Vec<[f64; 6]>>,
}

/// Temperatures; columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TemperatureSamples {
    /// Tracker time, not decreasing.
    pub stamps: Vec<Stamp<Tracker>>,
    /// °C.
    pub celsius: Vec<f64>,
}

/// Something in a log that was left out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogReject {
    /// The file, as the pipeline names it.
    pub file: String,
    /// The topic, where the loss is of a known channel.
    pub topic: Option<String>,
    /// First byte of what was left out, in the file as stored.
    pub byte_start: u64,
    /// One past its last byte.
    pub byte_end: u64,
    /// First and last log time lost, ns of the log's clock, where known.
    pub time_span_ns: Option<(i64, i64)>,
    /// How many messages were lost, where known.
    pub messages: Option<u64>,
    /// Why, in words.
    pub reason: String,
}
