//! The long streams while the log is read: joint states → where the joints rest, and no sample kept; poses → put aside.
//!
//! 1. The rows of each block wait until the next blocks are being opened ([`LongStreams::take`]); meanwhile
//!    ([`LongStreams::work`]) they are checked and put in order of time ([`InOrder`]);
//! 2. joint samples that none can come before any more go to the [`Finder`] and to whoever else wants them
//!    ([`JointSink`]); commanded poses and readings are put aside ([`AsidePoses`]), as the join needs to see them again;
//! 3. where the right threshold shows too late, the log is read again with it alone; where a row comes too late, it is read
//!    again as a whole. What is found is the same, to the last bit.

use std::sync::PoisonError;

use super::aside::AsidePoses;
use super::block::Extent;
use super::session::{SessionLogs, decode_all};
use super::spilled::SpilledPoses;
use super::waiting::Waiting;
use super::{Limits, LogError, read_session};
use crate::ingest::{
    DecodedJoints, DecodedPoses, GivenOn, HELD_BACK, HeldJoints, HeldPoses, InOrder, JointSamples,
    Mapping, Poses, Recording, StreamAccount, ingest_beside,
};
use crate::io::table::ROW_GROUP_ROWS;
use crate::join::rest::{Finder, Forgotten, Rest, RestRule, at_rest};
use crate::progress::Progress;
use crate::units::{Controller, Tracker};

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
    /// All but joint samples, commanded poses and readings; it accounts for them.
    pub recording: Recording,
    /// Where the joints rest.
    pub joints: Rest,
    /// The commanded poses; none where the pipeline file names no topic of them.
    pub commands: Box<dyn Poses<Controller>>,
    /// The target's readings.
    pub readings: Box<dyn Poses<Tracker>>,
}

/// Joint states, commanded poses and readings of a session, being read.
pub struct LongStreams<'s> {
    joints: JointDwells<'s>,
    commands: Option<AsidePoses<Controller>>,
    readings: AsidePoses<Tracker>,
}

/// The joints' dwells, being found.
struct JointDwells<'s> {
    in_order: InOrder<HeldJoints>,
    finder: Finder,
    sink: &'s mut dyn JointSink,
    waiting: Waiting<DecodedJoints>,
}

/// What is left of the streams when all is read.
struct Finished {
    given_on: GivenOn,
    rest: Rest,
    commands: SpilledPoses<Controller>,
    readings: SpilledPoses<Tracker>,
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
        let (controller, tracker) = (&mapping.controller, &mapping.tracker);
        let commanded = mapping.commanded.as_ref();
        Self {
            joints: JointDwells {
                in_order: InOrder::new(HeldJoints::of(mapping), &controller.topic, PIECE),
                finder: Finder::new(mapping.joints.len(), rule),
                sink,
                waiting: Waiting::default(),
            },
            commands: commanded.map(|of| AsidePoses::new(HeldPoses::commands(of), &of.topic)),
            readings: AsidePoses::new(HeldPoses::readings(tracker), &tracker.topic),
        }
    }

    /// Takes the rows of a block of `file`, and leaves buffers for those of another.
    pub fn take(
        &mut self,
        joints: &mut DecodedJoints,
        commands: &mut DecodedPoses,
        readings: &mut DecodedPoses,
        file: &str,
        extent: &Extent,
    ) {
        if !joints.stamps.is_empty() {
            self.joints.waiting.take(joints, file, extent);
        }
        if let Some(aside) = &mut self.commands {
            aside.take(commands, file, extent);
        }
        self.readings.take(readings, file, extent);
    }

    /// Works on the rows that wait, in the order they came in.
    pub fn work(&mut self) {
        self.joints.work();
        if let Some(commands) = &mut self.commands {
            commands.work();
        }
        self.readings.work();
    }

    fn finish(mut self) -> Result<Result<Finished, Again>, LogError> {
        self.work();
        let joints = self.joints.finish();
        let commands = self.commands.map(AsidePoses::finish).transpose()?;
        let (of_readings, readings) = match self.readings.finish()? {
            Some(found) if !matches!(commands, Some(None)) => found,
            _ => return Ok(Err(Again::AsAWhole)),
        };
        let (of_commands, commands) = commands.flatten().unzip();
        Ok(joints.map(|(of_joints, rest)| Finished {
            given_on: GivenOn {
                joints: of_joints,
                commands: of_commands,
                readings: of_readings,
            },
            rest,
            commands: commands.unwrap_or_default(),
            readings,
        }))
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

/// Reads all logs of a session as [`read_session`] does, but holds neither joint samples nor poses in memory: of the
/// joints only the rest by `rule` is returned, and poses are put aside. Memory grows with the dwells, not with the log.
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
        let found = match long.finish()? {
            Ok(found) => found,
            Err(again) => return Ok(Err(again)),
        };
        Ok(Ok(SessionRead {
            recording: ingest_beside(decoded, mapping, Some(found.given_on))?,
            joints: found.rest,
            commands: Box::new(found.commands),
            readings: Box::new(found.readings),
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
            commands: Box::new(std::mem::take(&mut recording.commands)),
            readings: Box::new(std::mem::take(&mut recording.readings)),
            joints: at_rest(&stamps_ns, angles.all(), angles.joints(), rule),
            recording,
        })
    }
}
