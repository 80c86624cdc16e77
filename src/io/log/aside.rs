//! Poses while the log is read: put in order of time, then aside.

use std::io;
use std::ops::Range;

use super::LogError;
use super::block::Extent;
use super::spilled::SpilledPoses;
use super::waiting::Waiting;
use crate::ingest::{DecodedPoses, HeldPoses, InOrder, StreamAccount};

/// Poses that are put aside together.
const TOGETHER: usize = 4096;

/// Poses of one topic, being put aside.
pub struct AsidePoses<C> {
    in_order: InOrder<HeldPoses>,
    spilled: SpilledPoses<C>,
    waiting: Waiting<DecodedPoses>,
    /// Whether there was room for all of them so far.
    room: io::Result<()>,
}

impl<C> AsidePoses<C> {
    /// None yet, to be held back in `held`.
    pub fn new(held: HeldPoses, topic: &str) -> Self {
        Self {
            in_order: InOrder::new(held, topic, TOGETHER),
            spilled: SpilledPoses::default(),
            waiting: Waiting::default(),
            room: Ok(()),
        }
    }

    /// Takes the poses of a block of `file`, and leaves a buffer for those of another.
    pub fn take(&mut self, poses: &mut DecodedPoses, file: &str, extent: &Extent) {
        if !poses.stamps.is_empty() {
            self.waiting.take(poses, file, extent);
        }
    }

    /// Works on the poses that wait, in the order they came in.
    pub fn work(&mut self) {
        let (in_order, spilled, room) = (&mut self.in_order, &mut self.spilled, &mut self.room);
        self.waiting.work(|block| {
            in_order.push(&block.rows, &block.file, block.place, |held, rows| {
                put_aside(spilled, room, held, rows);
            });
        });
    }

    /// What became of the messages, and all of them; `None` where the log has to be read as a whole.
    pub fn finish(mut self) -> Result<Option<(StreamAccount, SpilledPoses<C>)>, LogError> {
        let (spilled, room) = (&mut self.spilled, &mut self.room);
        let account = self
            .in_order
            .finish(|held, rows| put_aside(spilled, room, held, rows));
        self.room.map_err(|source| LogError::NoRoom {
            folder: std::env::temp_dir().display().to_string(),
            source,
        })?;
        Ok(account.map(|account| (account, self.spilled)))
    }
}

/// What is wrong is told at the end.
fn put_aside<C>(
    spilled: &mut SpilledPoses<C>,
    room: &mut io::Result<()>,
    held: &HeldPoses,
    rows: Range<usize>,
) {
    if room.is_ok() {
        *room = spilled.append(&held.rows(rows));
    }
}
