//! Ingest: decoded log messages → columns in the crate's units, with every message that is left out accounted for.
//!
//! Inputs are the two logs of a session, decoded as the pipeline file maps them; output is a [`Recording`].
//!
//! 1. Judge each row: numbers must be finite, quaternions must not be zero.
//! 2. Order the kept rows by stamp (stable), counting duplicate and backward stamps.
//! 3. Convert to rad and mm, normalise quaternions.

mod angles;
mod decoded;
mod in_order;
mod pose_samples;
mod poses;
mod rows;
mod settings;

use std::collections::BTreeMap;

use thiserror::Error;

pub use angles::JointAngles;
pub use decoded::{Decoded, DecodedJoints, DecodedPoses, DecodedTemperatures, Origin, Origins};
pub use in_order::{HELD_BACK, Held, HeldJoints, HeldPoses, InOrder, StreamAccount};
pub use pose_samples::{CommandSamples, PoseSamples, Poses, PosesError, TargetReadings};
pub use settings::{
    AngleFields, AngleUnit, CommandedSettings, ControllerSettings, JointFields, LengthUnit,
    Mapping, NumberStamp, PoseFields, StampField, TimeSource, TimeUnit, TrackerSettings,
    WrongFields,
};
pub(crate) use settings::{CommandedFile, MissingConvention, TrackerFile};

use crate::units::{Controller, Stamp, Tracker};
use rows::{RowFault, Rows};

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
    /// rad.
    pub angles: JointAngles,
}

/// Temperatures; columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TemperatureSamples {
    /// Tracker time, not decreasing.
    pub stamps: Vec<Stamp<Tracker>>,
    /// °C.
    pub celsius: Vec<f64>,
}

/// What a reject of a log says of the log.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum LossKind {
    /// Bytes cannot be read, and with them whatever they held.
    #[default]
    Bytes,
    /// Messages were read and cannot be used.
    Unusable,
    /// Messages that the log's own summary counts are not there: they were cut out, or stand where nothing tells that they
    /// are messages.
    Missing,
    /// No message is lost.
    Nothing,
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
    /// First and last moment lost, ns, where known.
    pub time_span_ns: Option<(i64, i64)>,
    /// The clock of these moments.
    pub clock: SpanClock,
    /// How many messages were lost, where known.
    pub messages: Option<u64>,
    /// What it says of the log.
    pub loss: LossKind,
    /// Why, in words.
    pub reason: String,
}

/// Which clock a time span is in.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum SpanClock {
    /// The recorder's: log times.
    #[default]
    Log,
    /// The time source that the pipeline file names for the controller.
    Controller,
    /// The time source that it names for the tracker.
    Tracker,
}

impl SpanClock {
    /// As the tables call it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Log => "log",
            Self::Controller => "controller",
            Self::Tracker => "tracker",
        }
    }
}

impl LogReject {
    /// Whether bytes of the file are lost: not messages that were read or are not there, and not bytes without messages.
    pub fn is_damage(&self) -> bool {
        self.loss == LossKind::Bytes
    }

    /// Counts one more message, logged at `time_ns`.
    pub fn widen(&mut self, time_ns: i64) {
        let (first, last) = self.time_span_ns.unwrap_or((time_ns, time_ns));
        self.time_span_ns = Some((first.min(time_ns), last.max(time_ns)));
        self.messages = Some(self.messages.unwrap_or(0) + 1);
    }

    /// Takes another reject of the same file into this one; how many messages is known only if both know.
    pub fn join(&mut self, other: &Self) {
        self.byte_start = self.byte_start.min(other.byte_start);
        self.byte_end = self.byte_end.max(other.byte_end);
        self.messages = self
            .messages
            .zip(other.messages)
            .map(|(a, b)| a.saturating_add(b));
        self.time_span_ns = match (self.time_span_ns, other.time_span_ns) {
            (Some((a, b)), Some((c, d))) => Some((a.min(c), b.max(d))),
            (one, another) => one.or(another),
        };
    }
}

/// What became of the decoded rows of one stream.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct StreamCounts {
    kept: u64,
    rejected: u64,
    backward_stamps: u64,
    duplicate_stamps: u64,
}

/// Why two decoded logs make no recording.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum IngestError {
    /// Nothing of a stream is left.
    #[error(
        "{file}: topic {topic:?} has no usable message: {decoded} decoded, all rejected{first_reason}; \
         see `posegrid inspect`"
    )]
    NoSamples {
        /// The file.
        file: String,
        /// The topic.
        topic: String,
        /// Rows that were decoded.
        decoded: u64,
        /// Of the first reject, with a leading colon, or empty.
        first_reason: String,
    },
    /// Header stamps that nobody set.
    #[error(
        "{file}: all {messages} messages of topic {topic:?} have the header stamp 0: the publisher does not set it; \
         try time = \"publish\" or time = \"log\""
    )]
    StampsUnset {
        /// The file.
        file: String,
        /// The topic.
        topic: String,
        /// How many messages.
        messages: usize,
    },
}

/// Makes the recording of a session from what was decoded of its logs.
///
/// Zero positions are kept: some instruments write them for a missing reflector, and the join counts them as such.
pub fn ingest(decoded: Decoded, mapping: &Mapping) -> Result<Recording, IngestError> {
    ingest_beside(decoded, mapping, None)
}

/// What became of the long streams where their samples were given on in order while the logs were read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GivenOn {
    /// Of the joint states.
    pub joints: StreamAccount,
    /// Of the commanded poses, where the pipeline file names their topic.
    pub commands: Option<StreamAccount>,
    /// Of the target's readings.
    pub readings: StreamAccount,
}

/// The same where joint states, commanded poses and readings were given on while the logs were read: the recording is
/// without them, but accounts for them as `given_on` says.
pub fn ingest_beside(
    mut decoded: Decoded,
    mapping: &Mapping,
    given_on: Option<GivenOn>,
) -> Result<Recording, IngestError> {
    let mut recording = Recording {
        rejects: std::mem::take(&mut decoded.rejects),
        metadata: std::mem::take(&mut decoded.metadata),
        counts: std::mem::take(&mut decoded.counts),
        ..Recording::default()
    };
    if let Some(given_on) = given_on {
        recording.account_for("joints", given_on.joints);
        if let Some(commands) = given_on.commands {
            recording.account_for("commands", commands);
        }
        recording.account_for("readings", given_on.readings);
    } else {
        recording.joints = joints(decoded.joints, mapping, &mut recording)?;
        recording.commands = commands(decoded.commands, mapping, &mut recording)?;
        let held = HeldPoses::readings(&mapping.tracker);
        recording.readings = poses(&decoded.readings, held, "readings", &mut recording)?;
    }
    if let Some(temperatures) = decoded.temperatures {
        recording.temperatures = self::temperatures(temperatures, &mut recording);
    }
    recording
        .rejects
        .sort_by(|a, b| (&a.file, a.byte_start, &a.topic).cmp(&(&b.file, b.byte_start, &b.topic)));
    Ok(recording)
}

fn joints(
    decoded: DecodedJoints,
    mapping: &Mapping,
    recording: &mut Recording,
) -> Result<JointSamples, IngestError> {
    let clock = SpanClock::Controller;
    let rows = Rows::judge(&decoded.stamps, &decoded.origins, clock, |row| {
        RowFault::of_angles(&decoded.angles, row)
    });
    rows.require(&decoded.origins, &decoded.stamps, recording)?;
    let mut angles = rows.of_angles(decoded.angles);
    angles.scale_from(0, mapping.controller.unit.to_rad());
    let samples = JointSamples {
        angles,
        stamps: stamps(rows.of(decoded.stamps)),
    };
    recording.account("joints", rows.counts, rows.rejects);
    Ok(samples)
}

fn commands(
    decoded: Option<DecodedPoses>,
    mapping: &Mapping,
    recording: &mut Recording,
) -> Result<CommandSamples, IngestError> {
    match (decoded, &mapping.commanded) {
        (Some(decoded), Some(settings)) => {
            let held = HeldPoses::commands(settings);
            poses(&decoded, held, "commands", recording)
        }
        _ => Ok(CommandSamples::default()),
    }
}

/// All poses of a stream, as `held` keeps them.
fn poses<C>(
    decoded: &DecodedPoses,
    mut held: HeldPoses,
    stream: &str,
    recording: &mut Recording,
) -> Result<PoseSamples<C>, IngestError> {
    let rows = held.judge(decoded, &decoded.origins);
    rows.require(&decoded.origins, &decoded.stamps, recording)?;
    let alike = held.take(&rows, decoded);
    assert!(alike, "a topic of two kinds is refused when it is decoded");
    let account = StreamAccount {
        counts: rows.counts,
        further: held.further_counts(),
        rejects: rows.rejects,
    };
    recording.account_for(stream, account);
    Ok(held.into_samples())
}

fn temperatures(decoded: DecodedTemperatures, recording: &mut Recording) -> TemperatureSamples {
    let clock = SpanClock::Tracker;
    let rows = Rows::judge(&decoded.stamps, &decoded.origins, clock, |row| {
        (!decoded.celsius[row].is_finite()).then_some(RowFault::Temperature)
    });
    let samples = TemperatureSamples {
        stamps: stamps(rows.of(decoded.stamps)),
        celsius: rows.of(decoded.celsius),
    };
    recording.account("temperatures", rows.counts, rows.rejects);
    samples
}

fn stamps<C>(ns: Vec<i64>) -> Vec<Stamp<C>> {
    ns.into_iter().map(Stamp::from_ns).collect()
}

impl Rows {
    fn require(
        &self,
        origins: &Origins,
        stamps: &[i64],
        recording: &Recording,
    ) -> Result<(), IngestError> {
        let (file, topic) = (origins.names(), origins.topic.clone());
        if stamps.len() > 1 && stamps.iter().all(|&stamp| stamp == 0) {
            return Err(IngestError::StampsUnset {
                file,
                topic,
                messages: stamps.len(),
            });
        }
        if self.counts.kept > 0 {
            return Ok(());
        }
        let earlier = recording.rejects.iter().filter(|reject| {
            origins.files.contains(&reject.file)
                && reject.topic.as_ref().is_none_or(|of| *of == topic)
        });
        let first = self.rejects.iter().chain(earlier).next();
        Err(IngestError::NoSamples {
            file,
            topic,
            decoded: stamps.len() as u64,
            first_reason: first
                .map(|reject| format!(": {}", reject.reason))
                .unwrap_or_default(),
        })
    }
}

impl Recording {
    fn account_for(&mut self, stream: &str, account: StreamAccount) {
        self.account(stream, account.counts, account.rejects);
        for (name, count) in account.further {
            self.counts.insert(format!("{stream}.{name}"), count);
        }
    }

    fn account(&mut self, stream: &str, counts: StreamCounts, rejects: Vec<LogReject>) {
        let mut add = |name: &str, count: u64| {
            *self.counts.entry(format!("{stream}.{name}")).or_default() += count;
        };
        add("kept", counts.kept);
        add("rejected", counts.rejected);
        add("duplicate_stamps", counts.duplicate_stamps);
        add("backward_stamps", counts.backward_stamps);
        self.rejects.extend(rejects);
    }
}
