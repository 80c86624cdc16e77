//! Ingest: decoded log messages → samples in the crate's units and in order of time. Every message that is left out is
//! counted with its reason.
//!
//! Input is one stream's decoded rows, block by block in order of the file; output is its samples, in order of time a piece
//! at a time, and a [`StreamSummary`]. A log of a night need not fit into memory: only the latest are buffered.
//!
//! 1. Judge each row: numbers must be finite, quaternions must not be zero (`rows`).
//! 2. Convert the rows kept to rad and mm and normalise quaternions, in the [`Buffer`] of the stream.
//! 3. Order them by stamp (stable), leave out those that were logged before with equal stamp and content, count other duplicate and
//!    backward stamps, and emit those that no later one can come before ([`InOrder`]).
//! 4. Where stamps are no times, a clock stepped (`clock_steps`), a topic has a second publisher (`publishers`) or states each reading in
//!    several messages (`held`), the logs are read again with that known, or the session is refused.

mod angles;
mod clock_steps;
pub mod covariances;
mod decoded;
mod held;
mod in_order;
mod pose_samples;
mod poses;
mod publishers;
mod rows;
mod settings;
mod summary;

pub use angles::JointAngles;
pub use clock_steps::Amendments;
pub use covariances::LoggedCovariance;
pub use decoded::{DecodedJoints, DecodedPoses, DecodedTemperatures};
pub use in_order::{BUFFERED, Buffer, InOrder, JointBuffer, PoseBuffer, TemperatureBuffer};
pub use pose_samples::{CommandSamples, PoseSamples, Poses, PosesError, TargetReadings};
pub use rows::CELSIUS;
pub use settings::{
    AngleFields, AngleUnit, CommandedSettings, ControllerSettings, CovarianceColumns, JointFields,
    KnownOffset, KnownPlace, LengthColumns, LengthRead, LengthSource, LengthUnit, LoggedLength,
    LoggedReference, LoggedTarget, MISSING, Mapping, NumberStamp, OrientationColumns,
    OrientationForm, PoseColumns, PoseFields, ReadingColumns, ReferenceColumns, Seen, StampField,
    StandsOn, StationsSettings, TableTime, TargetName, TimeColumn, TimeSource, TimeUnit,
    TrackerSettings, WrongFields, is_length,
};
pub use summary::{IngestError, StreamSummary};

use serde::{Deserialize, Serialize};

use crate::units::{Controller, Stamp, Tracker};

#[derive(Debug, Clone, Default)]
pub struct Recording {
    pub joints: JointSamples,
    pub commands: CommandSamples,
    pub readings: TargetReadings,
    pub temperatures: TemperatureSamples,
}

/// Joint angles as the controller reported them; columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct JointSamples {
    pub stamps: Vec<Stamp<Controller>>,
    pub angles: JointAngles,
}

/// Temperatures; columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TemperatureSamples {
    pub stamps: Vec<Stamp<Tracker>>,
    pub celsius: Vec<f64>,
}

/// Readings of an instrument of one length; columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LengthSamples {
    pub stamps: Vec<Stamp<Tracker>>,
    pub lengths_mm: Vec<f64>,
}

/// The kind of loss that a reject of a log stands for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum LossKind {
    #[default]
    Bytes,
    /// Messages were read but cannot be used.
    Unusable,
    /// Messages that the log's own summary counts were not found: they were cut out, or are in bytes that do not show it.
    Missing,
    Nothing,
    /// Nothing is lost, and the reason says how stamps of a topic are read.
    Stamps,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LogReject {
    pub file: String,
    pub topic: Option<String>,
    /// First byte of what was left out, in the file as stored.
    pub byte_start: u64,
    /// One past its last byte.
    pub byte_end: u64,
    /// First and last moment lost, ns of [`Self::clock`], where known.
    pub time_span_ns: Option<(i64, i64)>,
    pub clock: SpanClock,
    pub messages: Option<u64>,
    pub loss: LossKind,
    pub reason: String,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum SpanClock {
    /// The recorder's clock: log times.
    #[default]
    Log,
    Controller,
    Tracker,
}

impl SpanClock {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Log => "log",
            Self::Controller => "controller",
            Self::Tracker => "tracker",
        }
    }
}

impl LogReject {
    /// Whether bytes of the file are lost. False for messages that were read or not found, and for bytes without messages.
    pub fn is_damage(&self) -> bool {
        self.loss == LossKind::Bytes
    }

    /// A remark on the stamps of a topic, by which nothing is lost.
    fn of_stamps(reason: String) -> Self {
        Self {
            file: String::new(),
            topic: None,
            byte_start: 0,
            byte_end: 0,
            time_span_ns: None,
            clock: SpanClock::Log,
            messages: Some(0),
            loss: LossKind::Stamps,
            reason,
        }
    }

    /// Counts one more message, logged at `time_ns`.
    pub fn widen(&mut self, time_ns: i64) {
        let (first, last) = self.time_span_ns.unwrap_or((time_ns, time_ns));
        self.time_span_ns = Some((first.min(time_ns), last.max(time_ns)));
        self.messages = Some(self.messages.unwrap_or(0) + 1);
    }

    /// Joins another reject of the same file to this one; the number of messages is known only if both rejects have it.
    pub fn join(&mut self, other: &Self) {
        self.byte_start = self.byte_start.min(other.byte_start);
        self.byte_end = self.byte_end.max(other.byte_end);
        self.messages = self.messages.zip(other.messages).map(|(a, b)| a.saturating_add(b));
        self.time_span_ns = match (self.time_span_ns, other.time_span_ns) {
            (Some((a, b)), Some((c, d))) => Some((a.min(c), b.max(d))),
            (one, another) => one.or(another),
        };
    }

    /// Merges a reject of another kind into this one: bytes that are no loss are not counted as lost because of it.
    pub fn absorb(&mut self, other: Self) {
        match (self.is_damage(), other.is_damage()) {
            (true, false) => self.messages = None,
            (false, true) => *self = other,
            _ => self.join(&other),
        }
    }
}
