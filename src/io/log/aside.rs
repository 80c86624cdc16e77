//! Readings while the log is read: put in order of time, then aside.

use std::io;
use std::ops::Range;

use super::LogError;
use super::block::Extent;
use super::spilled::SpilledReadings;
use super::waiting::Waiting;
use crate::ingest::{DecodedPoses, HeldReadings, InOrder, Mapping, StreamAccount};

/// Readings that are put aside together.
const TOGETHER: usize = 4096;

/// Readings, being put aside.
pub struct AsideReadings {
    in_order: InOrder<HeldReadings>,
    spilled: SpilledReadings,
    waiting: Waiting<DecodedPoses>,
    /// Whether there was room for all of them so far.
    room: io::Result<()>,
}

impl AsideReadings {
    /// None yet.
    pub fn new(mapping: &Mapping) -> Self {
        Self {
            in_order: InOrder::new(mapping, TOGETHER),
            spilled: SpilledReadings::default(),
            waiting: Waiting::default(),
            room: Ok(()),
        }
    }

    /// Takes the readings of a block of `file`, and leaves a buffer for those of another.
    pub fn take(&mut self, readings: &mut DecodedPoses, file: &str, extent: &Extent) {
        self.waiting.take(readings, file, extent);
    }

    /// Works on the readings that wait, in the order they came in.
    pub fn work(&mut self) {
        let (in_order, spilled, room) = (&mut self.in_order, &mut self.spilled, &mut self.room);
        self.waiting.work(|block| {
            in_order.push(&block.rows, &block.file, block.place, |held, rows| {
                put_aside(spilled, room, held, rows);
            });
        });
    }

    /// All of them, and what became of the messages; `None` where the log has to be read as a whole.
    pub fn finish(mut self) -> Result<(Option<StreamAccount>, SpilledReadings), LogError> {
        let (spilled, room) = (&mut self.spilled, &mut self.room);
        let account = self
            .in_order
            .finish(|held, rows| put_aside(spilled, room, held, rows));
        self.room.map_err(|source| LogError::NoRoom {
            folder: std::env::temp_dir().display().to_string(),
            source,
        })?;
        Ok((account, self.spilled))
    }
}

/// What is wrong is told at the end.
fn put_aside(
    spilled: &mut SpilledReadings,
    room: &mut io::Result<()>,
    held: &HeldReadings,
    rows: Range<usize>,
) {
    if room.is_ok() {
        *room = spilled.append(&held.rows(rows));
    }
}
