//! Dwells while the log is read: joint states → where the joints rest, and no sample kept.
//!
//! 1. The rows of each block are checked and put in order of time ([`JointsInOrder`]);
//! 2. those that none can come before any more go to the [`Finder`];
//! 3. where a row comes too late for that, or the right threshold shows too late, the log is read again as a whole.
//!    What is found is the same, to the last bit.

use super::block::Extent;
use super::session::{SessionLogs, decode_all};
use super::{Limits, LogError, read_session};
use crate::ingest::{
    DecodedJoints, JointAccount, JointSamples, JointsInOrder, Mapping, Recording, ingest_beside,
};
use crate::join::rest::{Finder, Rest, RestRule, at_rest};
use crate::progress::Progress;

/// The joints' dwells, being found.
#[derive(Debug)]
pub struct JointDwells {
    in_order: JointsInOrder,
    finder: Finder,
}

impl JointDwells {
    fn new(mapping: &Mapping, rule: &RestRule) -> Self {
        Self {
            in_order: JointsInOrder::new(mapping),
            finder: Finder::new(mapping.joints.len(), rule),
        }
    }

    /// Takes the rows of a block of `file`.
    pub fn take(&mut self, rows: &DecodedJoints, file: &str, extent: &Extent) {
        let (finder, place) = (&mut self.finder, (extent.start, extent.end));
        self.in_order.push(rows, file, place, |stamps, angles| {
            finder.push(stamps, angles);
        });
    }

    fn finish(mut self) -> Option<(JointAccount, Rest)> {
        let account = self.in_order.finish(|stamps, angles| {
            self.finder.push(stamps, angles);
        })?;
        Some((account, self.finder.finish().ok()?))
    }
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
    let mut dwells = Some(JointDwells::new(mapping, rule));
    let decoded = decode_all(logs, mapping, limits, &mut dwells, progress)?;
    if let Some((account, rest)) = dwells.and_then(JointDwells::finish) {
        return Ok((ingest_beside(decoded, mapping, Some(account))?, rest));
    }
    drop(decoded);
    let mut recording = read_session(logs, mapping, limits, progress)?;
    let JointSamples { stamps, angles } = std::mem::take(&mut recording.joints);
    let stamps_ns: Vec<i64> = stamps.iter().map(|stamp| stamp.ns()).collect();
    Ok((recording, at_rest(&stamps_ns, &angles, rule)))
}
