//! Joint angles, block by block in the order of the file → in order of time, while the log is read.
//!
//! Keeps and orders what [`Rows`] keeps and orders of a whole log, with the same account of it. Stamps that go back are
//! put in their place as long as it is among the samples held back; where one belongs before a sample that was given on
//! already, the log has to be read as a whole.

use super::decoded::{DecodedJoints, Origin, Origins};
use super::rows::Rows;
use super::{AngleUnit, LogReject, Mapping, RowFault, SpanClock, StreamCounts};

/// Joint angles on their way.
#[derive(Debug)]
pub struct JointsInOrder {
    unit: AngleUnit,
    /// Samples that are given on together.
    piece: usize,
    topic: String,
    held: Held,
    /// Stamp of the last row of the block before.
    before: Option<i64>,
    /// Whether some stamp is set.
    stamped: bool,
    counts: StreamCounts,
    rejects: Vec<LogReject>,
    /// Name and earliest stamp of the files so far, without those that have no rows.
    files: Vec<(String, i64)>,
    fits: bool,
}

/// Samples held back, in rad.
#[derive(Debug, Default)]
struct Held {
    stamps: Vec<i64>,
    angles: Vec<Vec<f64>>,
    unsorted: bool,
    /// Stamp of the sample given on last.
    given_on: Option<i64>,
}

/// What became of the joint states that were given on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JointAccount {
    pub(super) counts: StreamCounts,
    pub(super) rejects: Vec<LogReject>,
}

impl JointsInOrder {
    /// Samples held back: half a minute at 500 Hz, more than chunks in recorders' logs overlap.
    pub const HELD_BACK: usize = 16_384;

    /// Nothing read yet; samples will be given on in pieces of so many, but for the last.
    pub fn new(mapping: &Mapping, piece: usize) -> Self {
        Self {
            unit: mapping.controller.unit,
            piece,
            topic: mapping.controller.topic.clone(),
            held: Held {
                angles: vec![Vec::new(); mapping.joints.len()],
                ..Held::default()
            },
            before: None,
            stamped: false,
            counts: StreamCounts::default(),
            rejects: Vec::new(),
            files: Vec::new(),
            fits: true,
        }
    }

    /// Takes the rows of one block of `file`, from byte to byte, and calls `give_on` with stamps and angles (rad, a column a joint) that no
    /// later row can come before.
    pub fn push(
        &mut self,
        block: &DecodedJoints,
        file: &str,
        place: (u64, u64),
        mut give_on: impl FnMut(&[i64], &[&[f64]]),
    ) {
        let stamps = &block.stamps;
        let (Some(&first), Some(&last)) = (stamps.first(), stamps.last()) else {
            return;
        };
        let origins = self.origins(stamps.len(), file, place);
        let faulty = RowFault::in_angles(&block.angles);
        let rows = Rows::judge(stamps, &origins, SpanClock::Controller, |row| {
            if faulty {
                RowFault::of_angles(&block.angles, row)
            } else {
                None
            }
        });
        self.counts.kept += rows.counts.kept;
        self.counts.rejected += rows.counts.rejected;
        let backward = self.before.is_some_and(|before| first < before);
        self.counts.backward_stamps += rows.counts.backward_stamps + u64::from(backward);
        self.before = Some(last);
        self.stamped |= stamps.iter().any(|&stamp| stamp != 0);
        self.note_file(file, stamps);
        self.held.take(&rows, block, self.unit);
        self.rejects.extend(rows.rejects);
        let due = |held: usize| held.saturating_sub(Self::HELD_BACK) / self.piece * self.piece;
        self.give_on(due(self.held.stamps.len()), &mut give_on);
    }

    /// Gives on what is left; `None` where the log has to be read as a whole, to be put in order or to say why nothing
    /// of it can be used.
    pub fn finish(mut self, mut give_on: impl FnMut(&[i64], &[&[f64]])) -> Option<JointAccount> {
        self.give_on(self.held.stamps.len(), &mut give_on);
        // Files are put in the order of their earliest stamps.
        let in_order = self.files.windows(2).all(|pair| pair[0].1 < pair[1].1);
        let usable = self.counts.kept > 0 && self.stamped;
        (self.fits && in_order && usable).then_some(JointAccount {
            counts: self.counts,
            rejects: self.rejects,
        })
    }

    /// Where the rows of one block come from.
    fn origins(&self, rows: usize, file: &str, (byte_start, byte_end): (u64, u64)) -> Origins {
        let origin = Origin {
            rows_end: rows,
            file: 0,
            byte_start,
            byte_end,
        };
        Origins {
            files: vec![file.to_owned()],
            topic: self.topic.clone(),
            blocks: vec![origin],
        }
    }

    fn note_file(&mut self, file: &str, stamps: &[i64]) {
        let earliest = stamps.iter().copied().min().unwrap_or(i64::MAX);
        match self.files.last_mut() {
            Some((known, so_far)) if known == file => *so_far = earliest.min(*so_far),
            _ => self.files.push((file.to_owned(), earliest)),
        }
    }

    /// Gives on the earliest `count` of the samples held back.
    fn give_on(&mut self, count: usize, give_on: &mut impl FnMut(&[i64], &[&[f64]])) {
        if count == 0 {
            return;
        }
        let held = &mut self.held;
        held.sort();
        let (first, last) = (held.stamps[0], held.stamps[count - 1]);
        self.fits &= held.given_on.is_none_or(|given_on| given_on <= first);
        let stamps = &held.stamps[..count];
        let repeated = stamps.windows(2).filter(|pair| pair[0] == pair[1]).count();
        self.counts.duplicate_stamps += repeated as u64 + u64::from(held.given_on == Some(first));
        for from in (0..count).step_by(self.piece).take_while(|_| self.fits) {
            let piece = from..(from + self.piece).min(count);
            let columns = held.angles.iter().map(|column| &column[piece.clone()]);
            give_on(&stamps[piece.clone()], &columns.collect::<Vec<_>>());
        }
        held.given_on = Some(last);
        held.stamps.drain(..count);
        for column in &mut held.angles {
            column.drain(..count);
        }
    }
}

impl Held {
    fn take(&mut self, rows: &Rows, block: &DecodedJoints, unit: AngleUnit) {
        let held = self.stamps.len();
        rows.append(&block.stamps, &mut self.stamps);
        for (column, more) in self.angles.iter_mut().zip(&block.angles) {
            rows.append(more, column);
            if unit != AngleUnit::Rad {
                let to_rad = unit.to_rad();
                column[held..].iter_mut().for_each(|angle| *angle *= to_rad);
            }
        }
        let edge = self.stamps.get(held.saturating_sub(1)..=held);
        self.unsorted |= edge.is_some_and(|edge| edge[0] > edge[edge.len() - 1]);
    }

    /// By stamp; equal ones stay in the order of the file.
    fn sort(&mut self) {
        if !std::mem::take(&mut self.unsorted) {
            return;
        }
        let mut order: Vec<usize> = (0..self.stamps.len()).collect();
        order.sort_by_key(|&row| self.stamps[row]);
        self.stamps = order.iter().map(|&row| self.stamps[row]).collect();
        for column in &mut self.angles {
            *column = order.iter().map(|&row| column[row]).collect();
        }
    }
}
