//! Samples of one stream, block by block in the order of the file → in order of time, while the log is read.
//!
//! Keeps and orders what [`Rows`] keeps and orders of a whole log, with the same account of it. Stamps that go back are
//! put in their place as long as it is among the samples held back; where one belongs before a sample that was given on
//! already, the log has to be read as a whole.

mod joints;
mod poses;

use std::ops::Range;

pub use joints::HeldJoints;
pub use poses::HeldPoses;

use super::decoded::{Origin, Origins};
use super::rows::Rows;
use super::{LogReject, StreamCounts};

/// Samples of one stream that are held back, in the units of a recording.
pub trait Held: Sized {
    /// The columns that the rows of a block are decoded into.
    type Block;
    /// Time of each row of a block, ns.
    fn stamps_of(block: &Self::Block) -> &[i64];
    /// Which rows of a block are kept.
    fn judge(&self, block: &Self::Block, origins: &Origins) -> Rows;
    /// Adds the kept rows of a block; tells whether they are of one kind with those before.
    fn take(&mut self, rows: &Rows, block: &Self::Block) -> bool;
    /// Time of each sample, ns.
    fn stamps(&self) -> &[i64];
    /// Puts the samples in this order.
    fn reorder(&mut self, order: &[usize]);
    /// Lets the first ones go.
    fn let_go(&mut self, count: usize);
    /// Further counts of the whole stream.
    fn further_counts(&self) -> Vec<(&'static str, u64)> {
        Vec::new()
    }
}

/// The samples of a stream on their way.
#[derive(Debug)]
pub struct InOrder<H> {
    /// Samples that are given on together.
    piece: usize,
    topic: String,
    held: H,
    /// Whether those held are out of order.
    unsorted: bool,
    /// Stamp of the sample given on last.
    given_on: Option<i64>,
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

/// What became of the messages of a stream whose samples were given on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StreamAccount {
    pub(super) counts: StreamCounts,
    pub(super) further: Vec<(&'static str, u64)>,
    pub(super) rejects: Vec<LogReject>,
}

/// Samples held back: half a minute at 500 Hz, more than chunks in recorders' logs overlap.
pub const HELD_BACK: usize = 16_384;

impl<H: Held> InOrder<H> {
    /// Nothing read of the topic yet, so that `held` is empty; samples will be given on in pieces of so many, but for the
    /// last.
    pub fn new(held: H, topic: &str, piece: usize) -> Self {
        Self {
            piece,
            topic: topic.to_owned(),
            held,
            unsorted: false,
            given_on: None,
            before: None,
            stamped: false,
            counts: StreamCounts::default(),
            rejects: Vec::new(),
            files: Vec::new(),
            fits: true,
        }
    }

    /// Takes the rows of one block of `file`, from byte to byte, and calls `give_on` with those rows of the samples that
    /// no later one can come before.
    pub fn push(
        &mut self,
        block: &H::Block,
        file: &str,
        place: (u64, u64),
        mut give_on: impl FnMut(&H, Range<usize>),
    ) {
        let stamps = H::stamps_of(block);
        let (Some(&first), Some(&last)) = (stamps.first(), stamps.last()) else {
            return;
        };
        let rows = self
            .held
            .judge(block, &self.origins(stamps.len(), file, place));
        self.counts.kept += rows.counts.kept;
        self.counts.rejected += rows.counts.rejected;
        let backward = self.before.is_some_and(|before| first < before);
        self.counts.backward_stamps += rows.counts.backward_stamps + u64::from(backward);
        self.before = Some(last);
        self.stamped |= stamps.iter().any(|&stamp| stamp != 0);
        self.note_file(file, stamps);
        let held = self.held.stamps().len();
        self.fits &= self.held.take(&rows, block);
        let edge = self.held.stamps().get(held.saturating_sub(1)..=held);
        self.unsorted |= edge.is_some_and(|edge| edge[0] > edge[edge.len() - 1]);
        self.rejects.extend(rows.rejects);
        let due = self.held.stamps().len().saturating_sub(HELD_BACK) / self.piece * self.piece;
        self.give_on(due, &mut give_on);
    }

    /// Gives on what is left; `None` where the log has to be read as a whole, to be put in order or to say why nothing
    /// of it can be used.
    pub fn finish(mut self, mut give_on: impl FnMut(&H, Range<usize>)) -> Option<StreamAccount> {
        self.give_on(self.held.stamps().len(), &mut give_on);
        // Files are put in the order of their earliest stamps.
        let in_order = self.files.windows(2).all(|pair| pair[0].1 < pair[1].1);
        let usable = self.counts.kept > 0 && self.stamped;
        (self.fits && in_order && usable).then_some(StreamAccount {
            counts: self.counts,
            further: self.held.further_counts(),
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
    fn give_on(&mut self, count: usize, give_on: &mut impl FnMut(&H, Range<usize>)) {
        if count == 0 {
            return;
        }
        self.sort();
        let stamps = &self.held.stamps()[..count];
        let (first, last) = (stamps[0], stamps[count - 1]);
        self.fits &= self.given_on.is_none_or(|given_on| given_on <= first);
        let repeated = stamps.windows(2).filter(|pair| pair[0] == pair[1]).count();
        self.counts.duplicate_stamps += repeated as u64 + u64::from(self.given_on == Some(first));
        for from in (0..count).step_by(self.piece).take_while(|_| self.fits) {
            give_on(&self.held, from..(from + self.piece).min(count));
        }
        self.given_on = Some(last);
        self.held.let_go(count);
    }

    /// By stamp; equal ones stay in the order of the file.
    fn sort(&mut self) {
        if !std::mem::take(&mut self.unsorted) {
            return;
        }
        let stamps = self.held.stamps();
        let mut order: Vec<usize> = (0..stamps.len()).collect();
        order.sort_by_key(|&row| stamps[row]);
        self.held.reorder(&order);
    }
}

/// A column in another order.
fn reordered<T: Copy>(column: &[T], order: &[usize]) -> Vec<T> {
    order.iter().map(|&row| column[row]).collect()
}
