//! How the message read last was laid out: a recorder writes the same frame, names and array lengths over and over.
//!
//! Where everything stands in a message follows from its encapsulation and the counts in it. A message as long as the
//! one before, with the same counts at the same places, is laid out alike: what was found in it stands there again,
//! and only single numbers have to be read anew.

use std::sync::Arc;

use super::HEADER;
use crate::io::message::Primitive;
use crate::io::message::row::{Cell, number};

/// More counts than this are not worth comparing.
const MOST_COUNTS: usize = 32;

/// What the layout of a message follows from.
#[derive(Debug, Clone, Default)]
pub struct Layout {
    /// The plan that read it; `None` where the next message has to be walked.
    plan: Option<Arc<()>>,
    length: usize,
    header: [u8; HEADER],
    /// Place and bytes.
    counts: Vec<(usize, [u8; 4])>,
    /// Single numbers: place, slot, as what.
    numbers: Vec<(usize, usize, Primitive)>,
    big_endian: bool,
    /// Something in it depends on more than counts.
    is_other: bool,
}

impl Layout {
    /// The next message has to be walked.
    pub fn forget(&mut self) {
        self.plan = None;
        self.counts.clear();
        self.numbers.clear();
        self.is_other = false;
    }

    /// A count was read.
    pub fn count(&mut self, place: usize, bytes: [u8; 4]) {
        if self.counts.len() < MOST_COUNTS {
            self.counts.push((place, bytes));
        } else {
            self.is_other = true;
        }
    }

    /// A single number was taken.
    pub fn number(&mut self, place: usize, slot: usize, of: Primitive) {
        if self.numbers.len() < MOST_COUNTS {
            self.numbers.push((place, slot, of));
        } else {
            self.is_other = true;
        }
    }

    /// Something was taken that depends on more than counts.
    pub const fn depends_on_more(&mut self) {
        self.is_other = true;
    }

    /// A message was walked to its end by `plan`, and all that was noted is of it.
    pub fn keep(&mut self, plan: &Arc<()>, message: &[u8], big_endian: bool) {
        let header = message.first_chunk().filter(|_| !self.is_other);
        if let Some(header) = header {
            self.plan = Some(Arc::clone(plan));
            self.length = message.len();
            self.header = *header;
            self.big_endian = big_endian;
        }
    }

    /// Whether `message` is laid out alike for `plan`.
    #[inline]
    pub fn is_of(&self, plan: &Arc<()>, message: &[u8]) -> bool {
        let same = |&(place, bytes): &(usize, [u8; 4])| {
            message
                .get(place..place + 4)
                .is_some_and(|found| found == bytes)
        };
        self.plan.as_ref().is_some_and(|of| Arc::ptr_eq(of, plan))
            && message.len() == self.length
            && message.starts_with(&self.header)
            && self.counts.iter().all(same)
    }

    /// Reads the single numbers of a message laid out alike: slot and value.
    #[inline]
    pub fn numbers_of(&self, message: &[u8], mut set: impl FnMut(usize, Cell)) {
        for &(place, slot, of) in &self.numbers {
            set(
                slot,
                number(&message[place..place + of.size()], of, self.big_endian),
            );
        }
    }
}
