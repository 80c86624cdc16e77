//! The one road from a session's logs to what the join needs: a source of samples, replayed into a detector of dwells.
//!
//! The logs are the source, and can be read as often as it takes. Each time ([`LogSource::replay`]) the samples of every
//! stream come out in order of time, however they stand in the files (`ordered`); memory grows with the dwells, not with
//! the log:
//! 1. Joint samples go into the detector ([`Finder`]), and to whoever else wants them ([`JointSink`]); none is kept.
//! 2. Commanded poses and readings are spilled to disk; the join detects the target's dwells on them in the same way.
//!
//! One replay is enough for nearly every session. There is another
//! - where messages are further out of order than the buffer reaches: with all samples buffered;
//! - where the detector finds the stationary threshold too late to have kept the dwells by it: with that threshold alone
//!   ([`stationary_of`]).
//!
//! Dwells and samples are then those of a single replay, to the last bit.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use super::ordered::{Ordered, SessionStreams};
use super::session::{ReadFiles, SessionLogs};
use super::{Limits, LogError};
use crate::ingest::{BUFFERED, LogReject, Mapping};
use crate::join::JoinInput;
use crate::join::stationary::{Finder, StationaryRule, stationary_of};
use crate::progress::Progress;

/// What wants the joint samples of a session in order of time, while its logs are read.
pub trait JointSink: Send {
    /// What was given so far does not count: all samples come again.
    fn restart(&mut self);
    /// Takes the next 65 536 samples, or what is left of them: stamps that do not decrease, and angles (rad) row
    /// behind row.
    fn take(&mut self, stamps_ns: &[i64], angles: &[f64]);
}

/// Wants nothing.
impl JointSink for () {
    fn restart(&mut self) {}
    fn take(&mut self, _: &[i64], _: &[f64]) {}
}

/// What was read of a session's logs.
#[derive(Debug)]
pub struct SessionRead {
    /// The dwells of the arm, and the samples that the join looks at.
    pub input: JoinInput,
    /// Messages and byte ranges left out, with reasons.
    pub rejects: Vec<LogReject>,
    /// Metadata records of the logs, as `record.key` → value, controller first.
    pub metadata: BTreeMap<String, String>,
    /// How much was read, for the manifest.
    pub counts: BTreeMap<String, u64>,
}

/// Reads all logs of a session: finds where the joints are stationary by `rule`, and gives each joint sample to `sink` too
/// (`&mut ()` where nobody wants them).
///
/// Damage does not fail it: what is lost is in the rejects, for the pipeline's limit to judge. Zero positions are kept: some
/// instruments write them for a missing reflector, and the join counts them as such.
///
/// ```
/// use std::path::Path;
/// use posegrid::io::log::{SessionLogs, read_session};
/// use posegrid::pipeline::configuration::{Configuration, Overrides};
/// use posegrid::progress::Quiet;
///
/// let configuration = Configuration::load(Path::new("pipelines/quickstart.toml"), &Overrides::default())?;
/// let log = |side: &str| Path::new("tests/recordings/quickstart").join(side);
/// let logs = SessionLogs::of_two(&log("controller.mcap"), &log("tracker.mcap"));
/// let rule = configuration.join.arm_rule();
/// let read = read_session(&logs, &configuration.mapping, configuration.limits, &rule, &mut (), &Quiet)?;
/// assert!(read.rejects.is_empty(), "nothing is lost");
/// assert!(read.input.joints.stretches.len() > 50, "dwells of the arm");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
    };
    // Where the detector needs the samples once more, the sink has had them all.
    let mut sink = Some(sink);
    let (joints, replayed) = stationary_of(mapping.joints.len(), rule, |finder| {
        let beside = sink.take();
        source.replay(&mut Detecting { finder, beside })
    })?;
    let Replayed { ordered, files } = replayed;
    let (mut counts, mut rejects) = (files.counts, files.rejects);
    for (stream, summary) in ordered.summaries {
        summary.add_to(stream.name(), &mut counts, &mut rejects);
    }
    rejects
        .sort_by(|a, b| (&a.file, a.byte_start, &a.topic).cmp(&(&b.file, b.byte_start, &b.topic)));
    Ok(SessionRead {
        input: JoinInput {
            joints,
            commands: Box::new(ordered.commands),
            readings: Box::new(ordered.readings),
            temperatures: ordered.temperatures,
        },
        rejects,
        metadata: files.metadata,
        counts,
    })
}

/// The logs of a session, as a source of samples.
struct LogSource<'a> {
    logs: &'a SessionLogs,
    mapping: &'a Mapping,
    limits: Limits,
    progress: &'a dyn Progress,
    /// Samples of each stream that are buffered to be put in order of time.
    buffered: usize,
}

/// What one replay left behind.
struct Replayed {
    ordered: Ordered,
    files: ReadFiles,
}

impl LogSource<'_> {
    /// Gives all joint samples to `joints`, in order of time.
    fn replay(&mut self, joints: &mut dyn JointSink) -> Result<Replayed, LogError> {
        let replayed = self.replay_buffered(joints)?;
        let mut summaries = replayed.ordered.summaries.iter();
        if summaries.all(|(_, summary)| summary.is_in_order()) {
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
        self.replay_buffered(joints)
    }

    /// One replay with `buffered` samples in the buffer; its summaries say whether that was enough.
    fn replay_buffered(&self, joints: &mut dyn JointSink) -> Result<Replayed, LogError> {
        let streams = Mutex::new(SessionStreams::new(self.mapping, self.buffered, joints));
        let files = self
            .logs
            .read(self.mapping, self.limits, &streams, self.progress)?;
        let streams = streams.into_inner().unwrap_or_else(PoisonError::into_inner);
        let ordered = streams.finish()?;
        for (stream, summary) in &ordered.summaries {
            if stream.is_needed() {
                summary.check(&files.rejects)?;
            }
        }
        Ok(Replayed { ordered, files })
    }
}

/// The detector of dwells, and whoever else wants the joint samples.
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
