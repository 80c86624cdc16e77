//! The one way from a session's logs to the input of the join. Each replay gives the samples of every stream in order
//! of time; memory grows with the dwells, not with the log. Joint samples go into the detector ([`Finder`]) and to any
//! other receiver; commanded poses and readings are spilled to disk.
//!
//! A second replay is needed where stamps are no times, a clock stepped, a second publisher says nothing, readings are held or joints are
//! wrapped, with that known ([`Amendments`]); where messages are further out of order than the buffer reaches, with all samples buffered; and where
//! the detector finds the stationary threshold too late, with that threshold alone ([`stationary_of`]). Dwells and samples are always
//! those of a single replay, to the last bit.

use std::collections::BTreeMap;
use std::mem::take;
use std::sync::{Mutex, PoisonError};

use super::ordered::{Ordered, SessionStreams};
use super::session::{ReadFiles, SessionLogs};
use super::streams::Stream;
use super::{Limits, LogError};
use crate::ingest::{Amendments, BUFFERED, LogReject, Mapping, Poses};
use crate::join::stationary::{Finder, Stationary, StationaryRule, stationary_of};
use crate::join::{JoinInput, LengthReadings, ReferenceReadings};
use crate::progress::Progress;
use crate::units::Tracker;

/// A receiver of the joint samples of a session in order of time, while its logs are read.
pub trait JointSink: Send {
    /// Discards the samples given so far: all of them will be given again.
    fn restart(&mut self);
    /// Takes the next 65 536 samples, or the remaining ones: stamps that do not decrease, and angles (rad), row after
    /// row.
    fn take(&mut self, stamps_ns: &[i64], angles: &[f64]);
}

impl JointSink for () {
    fn restart(&mut self) {}
    fn take(&mut self, _: &[i64], _: &[f64]) {}
}

#[derive(Debug)]
pub struct SessionRead {
    pub input: JoinInput,
    pub rejects: Vec<LogReject>,
    /// Metadata records of the logs, as `record.key` → value, controller first.
    pub metadata: BTreeMap<String, String>,
    pub counts: BTreeMap<String, u64>,
}

/// Finds where the joints are stationary by `rule`, and gives each joint sample to `sink` too (`&mut ()` for none).
/// Damage is no error here: the pipeline's limit judges the rejects. Zero positions are kept: some instruments write
/// them for a missing reflector.
pub fn read_session(
    logs: &SessionLogs,
    mapping: &Mapping,
    limits: Limits,
    rule: &StationaryRule,
    sink: &mut dyn JointSink,
    progress: &dyn Progress,
) -> Result<SessionRead, LogError> {
    let mut source = LogSource {
        logs,
        mapping,
        limits,
        progress,
        buffered: BUFFERED,
        amendments: Amendments::default(),
    };
    // Where the detector needs the samples once more, the sink has had them all.
    let mut sink = Some(sink);
    let (joints, replayed) = stationary_of(mapping.joints.len(), rule, |finder| {
        finder.count_as(mapping.counted());
        let beside = sink.take();
        source.replay(&mut Detecting { finder, beside })
    })?;
    let Replayed { mut ordered, files } = replayed;
    let (mut counts, mut rejects) = (files.counts, files.rejects);
    rejects.extend(source.amendments.rejects());
    for (stream, summary) in take(&mut ordered.summaries) {
        summary.add_to(stream.name(), &mut counts, &mut rejects);
    }
    rejects
        .sort_by(|a, b| (&a.file, a.byte_start, &a.topic).cmp(&(&b.file, b.byte_start, &b.topic)));
    let (input, metadata) = (input(joints, ordered, mapping), files.metadata);
    Ok(SessionRead { input, rejects, metadata, counts })
}

/// The streams as the join takes them, each under the name that the mapping gives it.
fn input(joints: Stationary, ordered: Ordered, mapping: &Mapping) -> JoinInput {
    let mut readings = ordered.readings.into_iter();
    let main = readings.next().unwrap_or_default();
    let boxed = |own| Box::new(own) as Box<dyn Poses<Tracker>>;
    let others = mapping.tracker.target_count() - 1;
    let others = readings.by_ref().take(others).map(boxed).collect();
    let references = mapping.tracker.references.iter().zip(readings);
    let references = references.map(|(own, readings)| ReferenceReadings {
        name: own.name.clone(),
        on: own.on,
        readings: boxed(readings),
    });
    let lengths = mapping.tracker.lengths.iter().zip(ordered.lengths);
    let lengths = lengths.map(|(own, readings)| {
        LengthReadings::of(&own.source(), &mapping.tracker.target_names(), boxed(readings))
    });
    JoinInput {
        joints,
        commands: Box::new(ordered.commands),
        readings: Box::new(main),
        others,
        references: references.collect(),
        lengths: lengths.collect(),
        temperatures: ordered.temperatures,
    }
}

struct LogSource<'a> {
    logs: &'a SessionLogs,
    mapping: &'a Mapping,
    limits: Limits,
    progress: &'a dyn Progress,
    /// Number of samples of each stream that are buffered to be put in order of time.
    buffered: usize,
    /// What the stamps have to be read with, by an earlier replay.
    amendments: Amendments,
}

struct Replayed {
    ordered: Ordered,
    files: ReadFiles,
}

impl LogSource<'_> {
    /// Gives all joint samples to `joints`, in order of time.
    fn replay(&mut self, joints: &mut dyn JointSink) -> Result<Replayed, LogError> {
        let mut replayed = self.replay_buffered(joints)?;
        if self.amendments.is_empty() {
            for (_, summary) in &replayed.ordered.summaries {
                self.amendments.extend(summary.amendments.clone());
            }
            if !self.amendments.is_empty() {
                drop(replayed);
                joints.restart();
                replayed = self.replay_buffered(joints)?;
            }
        }
        replayed.check(self.mapping)?;
        let mut summaries = replayed.ordered.summaries.iter();
        if summaries.all(|(_, summary)| summary.in_order) {
            return Ok(replayed);
        }
        drop(replayed);
        tracing::warn!(
            "{}: messages are far out of order in time, over more than {BUFFERED} of a topic or from one file to the next: \
             they are read again, and all buffered in memory to be put in order",
            self.logs.names(),
        );
        self.buffered = usize::MAX;
        joints.restart();
        let replayed = self.replay_buffered(joints)?;
        replayed.check(self.mapping)?;
        Ok(replayed)
    }

    /// One replay with `buffered` samples in the buffer; its summaries state whether that was enough.
    fn replay_buffered(&self, joints: &mut dyn JointSink) -> Result<Replayed, LogError> {
        let streams = SessionStreams::new(self.mapping, self.buffered, &self.amendments, joints);
        let streams = Mutex::new(streams);
        let files = self.logs.read(self.mapping, self.limits, &streams, self.progress)?;
        let streams = streams.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok(Replayed { ordered: streams.finish()?, files })
    }
}

impl Replayed {
    fn check(&self, mapping: &Mapping) -> Result<(), LogError> {
        let mut targets = mapping.tracker.target_count();
        for (stream, summary) in &self.ordered.summaries {
            // References, whose readings come after those of the targets, are measured now and then, or not at all.
            let is_reference = *stream == Stream::Readings && targets == 0;
            if stream.is_needed() && !is_reference {
                summary.check(&self.files.rejects)?;
            }
            if *stream == Stream::Readings {
                targets = targets.saturating_sub(1);
            }
        }
        Ok(())
    }
}

/// The detector of dwells, and the other receiver of joint samples.
struct Detecting<'f, 's> {
    finder: &'f mut Finder,
    beside: Option<&'s mut dyn JointSink>,
}

impl JointSink for Detecting<'_, '_> {
    fn restart(&mut self) {
        self.finder.restart();
        if let Some(sink) = &mut self.beside {
            sink.restart();
        }
    }

    fn take(&mut self, stamps_ns: &[i64], angles: &[f64]) {
        let finder = &mut *self.finder;
        match &mut self.beside {
            None => finder.push(stamps_ns, angles),
            Some(sink) => {
                let find = || finder.push(stamps_ns, angles);
                rayon::join(find, || sink.take(stamps_ns, angles));
            }
        }
    }
}
