//! Joint samples while the log is read: joint states → where the joints rest, and no sample kept.
//!
//! 1. The rows of each block wait until the next blocks are being opened ([`JointDwells::take`]); meanwhile
//!    ([`JointDwells::work`]) they are checked and put in order of time ([`JointsInOrder`]);
//! 2. those that none can come before any more go to the [`Finder`] and to whoever else wants them ([`JointSink`]);
//! 3. where the right threshold shows too late, the log is read again with it alone; where a row comes too late, it is read
//!    again as a whole. What is found is the same, to the last bit.

use std::sync::PoisonError;

use super::block::Extent;
use super::session::{SessionLogs, decode_all};
use super::{Limits, LogError, read_session};
use crate::ingest::{
    DecodedJoints, JointAccount, JointSamples, JointsInOrder, Mapping, Recording, ingest_beside,
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
    /// Takes the next 65 536 samples, or what is left of them: stamps that do not decrease, and a column a joint, rad.
    fn take(&mut self, stamps_ns: &[i64], angles: &[&[f64]]);
}

/// Wants nothing.
impl JointSink for () {
    fn begin_again(&mut self) {}
    fn take(&mut self, _: &[i64], _: &[&[f64]]) {}
}

/// The joints' dwells, being found.
pub struct JointDwells<'s> {
    in_order: JointsInOrder,
    finder: Finder,
    sink: &'s mut dyn JointSink,
    waiting: Vec<BlockRows>,
    /// Buffers for the rows of blocks to come.
    spare: Vec<DecodedJoints>,
}

/// The rows of one block, and where it lies.
struct BlockRows {
    rows: DecodedJoints,
    file: String,
    place: (u64, u64),
}

/// Why what was found while reading cannot stand.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Again {
    /// The threshold was found too late to keep the stretches by it.
    With(Forgotten),
    /// The samples cannot be put in order of time, or none can be used.
    AsAWhole,
}

impl<'s> JointDwells<'s> {
    fn new(mapping: &Mapping, rule: &RestRule, sink: &'s mut dyn JointSink) -> Self {
        Self {
            in_order: JointsInOrder::new(mapping, PIECE),
            finder: Finder::new(mapping.joints.len(), rule),
            sink,
            waiting: Vec::new(),
            spare: Vec::new(),
        }
    }

    /// Takes the rows of a block of `file`, and leaves a buffer for those of another.
    pub fn take(&mut self, rows: &mut DecodedJoints, file: &str, extent: &Extent) {
        if rows.stamps.is_empty() {
            return;
        }
        let spare = self.spare.pop().unwrap_or_default();
        self.waiting.push(BlockRows {
            rows: std::mem::replace(rows, spare),
            file: file.to_owned(),
            place: (extent.start, extent.end),
        });
    }

    /// Works on the rows that wait, in the order they came in.
    pub fn work(&mut self) {
        let (finder, sink) = (&mut self.finder, &mut *self.sink);
        for BlockRows { rows, file, place } in self.waiting.drain(..) {
            self.in_order.push(&rows, &file, place, |stamps, angles| {
                give_on(finder, sink, stamps, angles);
            });
            self.spare.push(rows);
        }
    }

    fn finish(mut self) -> Result<(JointAccount, Rest), Again> {
        self.work();
        let (finder, sink) = (&mut self.finder, self.sink);
        let account = self.in_order.finish(|stamps, angles| {
            give_on(finder, sink, stamps, angles);
        });
        let rest = self.finder.finish();
        Ok((account.ok_or(Again::AsAWhole)?, rest.map_err(Again::With)?))
    }
}

fn give_on(finder: &mut Finder, sink: &mut dyn JointSink, stamps: &[i64], angles: &[&[f64]]) {
    rayon::join(|| finder.push(stamps, angles), || sink.take(stamps, angles));
}

/// Reads all logs of a session as [`read_session`] does, but for the joint samples: of them only the rest by `rule` is
/// returned, and memory does not grow with them.
pub fn read_dwells(
    logs: &SessionLogs,
    mapping: &Mapping,
    limits: Limits,
    rule: &RestRule,
    progress: &dyn Progress,
) -> Result<(Recording, Rest), LogError> {
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
) -> Result<(Recording, Rest), LogError> {
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

/// What was read, or why it has to be read again.
type Streamed = Result<(Recording, Rest), Again>;

impl Reading<'_> {
    /// Each joint sample is looked at once and let go.
    fn streamed(&self, rule: &RestRule, sink: &mut dyn JointSink) -> Result<Streamed, LogError> {
        let mut dwells = Some(JointDwells::new(self.mapping, rule, sink).into());
        let (logs, mapping) = (self.logs, self.mapping);
        let decoded = decode_all(logs, mapping, self.limits, &mut dwells, self.progress)?;
        let dwells = dwells.expect("given back by each file").into_inner();
        Ok(
            match dwells.unwrap_or_else(PoisonError::into_inner).finish() {
                Ok((account, rest)) => Ok((ingest_beside(decoded, mapping, Some(account))?, rest)),
                Err(again) => Err(again),
            },
        )
    }

    /// All joint samples are held in memory, to be put in order.
    fn as_a_whole(
        &self,
        rule: &RestRule,
        sink: &mut dyn JointSink,
    ) -> Result<(Recording, Rest), LogError> {
        let mut recording = read_session(self.logs, self.mapping, self.limits, self.progress)?;
        if recording.joints.stamps.len() > 1 {
            tracing::warn!(
                "{}: joint states are far out of order in time, over more than {} of them or from one file to the next: they \
             were read again, and held in memory to be put in order",
                self.logs.controller_names(),
                JointsInOrder::HELD_BACK
            );
        }
        let JointSamples { stamps, angles } = std::mem::take(&mut recording.joints);
        let stamps_ns: Vec<i64> = stamps.iter().map(|stamp| stamp.ns()).collect();
        sink.begin_again();
        for first in (0..stamps_ns.len()).step_by(PIECE) {
            let piece = first..(first + PIECE).min(stamps_ns.len());
            let angles: Vec<&[f64]> = angles.iter().map(|joint| &joint[piece.clone()]).collect();
            sink.take(&stamps_ns[piece], &angles);
        }
        Ok((recording, at_rest(&stamps_ns, &angles, rule)))
    }
}
