//! The long streams while the log is read: joint states → where the joints rest, and no sample kept; readings → put aside.
//!
//! 1. The rows of each block wait until the next blocks are being opened ([`LongStreams::take`]); meanwhile
//!    ([`LongStreams::work`]) they are checked and put in order of time ([`InOrder`]);
//! 2. joint samples that none can come before any more go to the [`Finder`] and to whoever else wants them
//!    ([`JointSink`]); such readings are put aside ([`AsideReadings`]), as the join needs to see them again;
//! 3. where the right threshold shows too late, the log is read again with it alone; where a row comes too late, it is read
//!    again as a whole. What is found is the same, to the last bit.

use std::sync::PoisonError;

use super::aside::AsideReadings;
use super::block::Extent;
use super::session::{SessionLogs, decode_all};
use super::spilled::SpilledReadings;
use super::waiting::Waiting;
use super::{Limits, LogError, read_session};
use crate::ingest::{
    DecodedJoints, DecodedPoses, GivenOn, HELD_BACK, HeldJoints, InOrder, JointSamples, Mapping,
    Readings, Recording, StreamAccount, ingest_beside,
};
use crate::io::table::ROW_GROUP_ROWS;
use crate::join::rest::{Finder, Forgotten, Rest, RestRule, at_rest};
use crate::progress::Progress;

/// Joint samples that are given on together: those of a row group, so that a table needs no copy of its own.
const PIECE: usize = ROW_GROUP_ROWS;

/// What wants the joint samples of a session in order of time, while its logs are read.
pub trait JointSink: Send {
    /// What was given so far does not count: all samples come again.
    fn begin_again(&mut self);
    /// Takes the next 65 536 samples, or what is left of them: stamps that do not decrease, and angles (rad) row
    /// behind row.
    fn take(&mut self, stamps_ns: &[i64], angles: &[f64]);
}

/// Wants nothing.
impl JointSink for () {
    fn begin_again(&mut self) {}
    fn take(&mut self, _: &[i64], _: &[f64]) {}
}

/// What was read of a session whose long streams are not in memory.
#[derive(Debug)]
pub struct SessionRead {
    /// All but joint samples and readings; it accounts for both.
    pub recording: Recording,
    /// Where the joints rest.
    pub joints: Rest,
    /// The target's readings.
    pub readings: Box<dyn Readings>,
}

/// Joint states and readings of a session, being read.
pub struct LongStreams<'s> {
    joints: JointDwells<'s>,
    readings: AsideReadings,
}

/// The joints' dwells, being found.
struct JointDwells<'s> {
    in_order: InOrder<HeldJoints>,
    finder: Finder,
    sink: &'s mut dyn JointSink,
    waiting: Waiting<DecodedJoints>,
}

/// Why what was found while reading cannot stand.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Again {
    /// The threshold was found too late to keep the stretches by it.
    With(Forgotten),
    /// Samples cannot be put in order of time, or none can be used.
    AsAWhole,
}

impl<'s> LongStreams<'s> {
    fn new(mapping: &Mapping, rule: &RestRule, sink: &'s mut dyn JointSink) -> Self {
        Self {
            joints: JointDwells {
                in_order: InOrder::new(mapping, PIECE),
                finder: Finder::new(mapping.joints.len(), rule),
                sink,
                waiting: Waiting::default(),
            },
            readings: AsideReadings::new(mapping),
        }
    }

    /// Takes the rows of a block of `file`, and leaves buffers for those of another.
    pub fn take(
        &mut self,
        joints: &mut DecodedJoints,
        readings: &mut DecodedPoses,
        file: &str,
        extent: &Extent,
    ) {
        if !joints.stamps.is_empty() {
            self.joints.waiting.take(joints, file, extent);
        }
        if !readings.stamps.is_empty() {
            self.readings.take(readings, file, extent);
        }
    }

    /// Works on the rows that wait, in the order they came in.
    pub fn work(&mut self) {
        self.joints.work();
        self.readings.work();
    }

    fn finish(mut self) -> Result<Result<(GivenOn, Rest, SpilledReadings), Again>, LogError> {
        self.work();
        let joints = self.joints.finish();
        let (readings, spilled) = self.readings.finish()?;
        let Some(readings) = readings else {
            return Ok(Err(Again::AsAWhole));
        };
        Ok(joints.map(|(joints, rest)| (GivenOn { joints, readings }, rest, spilled)))
    }
}

impl JointDwells<'_> {
    fn work(&mut self) {
        let (in_order, finder) = (&mut self.in_order, &mut self.finder);
        let sink = &mut *self.sink;
        self.waiting.work(|block| {
            in_order.push(&block.rows, &block.file, block.place, |held, rows| {
                let (stamps, angles) = held.rows(rows);
                give_on(finder, sink, stamps, angles);
            });
        });
    }

    fn finish(mut self) -> Result<(StreamAccount, Rest), Again> {
        let (finder, sink) = (&mut self.finder, self.sink);
        let account = self.in_order.finish(|held, rows| {
            let (stamps, angles) = held.rows(rows);
            give_on(finder, sink, stamps, angles);
        });
        let rest = self.finder.finish();
        Ok((account.ok_or(Again::AsAWhole)?, rest.map_err(Again::With)?))
    }
}

fn give_on(finder: &mut Finder, sink: &mut dyn JointSink, stamps: &[i64], angles: &[f64]) {
    rayon::join(|| finder.push(stamps, angles), || sink.take(stamps, angles));
}

/// Reads all logs of a session as [`read_session`] does, but holds neither joint samples nor readings in memory: of the
/// joints only the rest by `rule` is returned, and readings are put aside. Memory grows with the dwells, not with the log.
pub fn read_dwells(
    logs: &SessionLogs,
    mapping: &Mapping,
    limits: Limits,
    rule: &RestRule,
    progress: &dyn Progress,
) -> Result<SessionRead, LogError> {
    read_dwells_beside(logs, mapping, limits, rule, &mut (), progress)
}

/// The same, with each joint sample given to `sink` too.
pub fn read_dwells_beside(
    logs: &SessionLogs,
    mapping: &Mapping,
    limits: Limits,
    rule: &RestRule,
    sink: &mut dyn JointSink,
    progress: &dyn Progress,
) -> Result<SessionRead, LogError> {
    let reading = Reading {
        logs,
        mapping,
        limits,
        progress,
    };
    match reading.streamed(rule, sink)? {
        Ok(found) => return Ok(found),
        Err(Again::With(Forgotten { threshold })) => {
            let threshold = Some(threshold);
            // The samples were all given to the sink before.
            if let Ok(found) = reading.streamed(&RestRule { threshold, ..*rule }, &mut ())? {
                return Ok(found);
            }
        }
        Err(Again::AsAWhole) => {}
    }
    reading.as_a_whole(rule, sink)
}

/// What is read, and how.
struct Reading<'a> {
    logs: &'a SessionLogs,
    mapping: &'a Mapping,
    limits: Limits,
    progress: &'a dyn Progress,
}

impl Reading<'_> {
    /// Each sample is looked at once and let go, or put aside.
    fn streamed(
        &self,
        rule: &RestRule,
        sink: &mut dyn JointSink,
    ) -> Result<Result<SessionRead, Again>, LogError> {
        let mut long = Some(LongStreams::new(self.mapping, rule, sink).into());
        let (logs, mapping) = (self.logs, self.mapping);
        let decoded = decode_all(logs, mapping, self.limits, &mut long, self.progress)?;
        let long = long.expect("given back by each file").into_inner();
        let long = long.unwrap_or_else(PoisonError::into_inner);
        let (given_on, joints, spilled) = match long.finish()? {
            Ok(found) => found,
            Err(again) => return Ok(Err(again)),
        };
        Ok(Ok(SessionRead {
            recording: ingest_beside(decoded, mapping, Some(given_on))?,
            joints,
            readings: Box::new(spilled),
        }))
    }

    /// All samples are held in memory, to be put in order.
    fn as_a_whole(
        &self,
        rule: &RestRule,
        sink: &mut dyn JointSink,
    ) -> Result<SessionRead, LogError> {
        let mut recording = read_session(self.logs, self.mapping, self.limits, self.progress)?;
        if recording.joints.stamps.len() > 1 {
            tracing::warn!(
                "{}: messages are far out of order in time, over more than {HELD_BACK} of a topic or from one file to the \
                 next: they were read again, and held in memory to be put in order",
                self.logs.names(),
            );
        }
        let JointSamples { stamps, angles } = std::mem::take(&mut recording.joints);
        let stamps_ns: Vec<i64> = stamps.iter().map(|stamp| stamp.ns()).collect();
        sink.begin_again();
        for first in (0..stamps_ns.len()).step_by(PIECE) {
            let piece = first..(first + PIECE).min(stamps_ns.len());
            sink.take(&stamps_ns[piece.clone()], angles.of_rows(piece));
        }
        Ok(SessionRead {
            readings: Box::new(std::mem::take(&mut recording.readings)),
            joints: at_rest(&stamps_ns, angles.all(), angles.joints(), rule),
            recording,
        })
    }
}
