//! The layout of the message read last: a message as long as it, with the same counts at the same places, has its
//! fields at the same places, so only single numbers have to be read. The texts after counts are compared too: a few
//! long stretches of bytes are compared faster than many short ones.

use std::ops::Range;
use std::sync::Arc;

use crate::message::Primitive;
use crate::message::cell::Cell;

/// More stretches or numbers than this are not worth comparing.
const MOST: usize = 32;
/// Bytes between two stretches that may be padding: they are compared too, though they may hold anything.
const PADDING: usize = 3;

#[derive(Debug, Clone, Default)]
pub struct Layout {
    /// The reader that read it; `None` where the next message has to be walked.
    reader: Option<Arc<()>>,
    length: usize,
    /// The encapsulation, counts, and the texts between them: their places, and their bytes one after another.
    stretches: Vec<Range<usize>>,
    same: Vec<u8>,
    /// Single numbers: place, slot, type.
    numbers: Vec<(usize, usize, Primitive)>,
    big_endian: bool,
    /// Some value depends on more than counts.
    is_other: bool,
}

impl Layout {
    /// Forgets the layout: the next message has to be walked.
    pub fn forget(&mut self) {
        self.reader = None;
        self.stretches.clear();
        self.numbers.clear();
        self.is_other = false;
    }

    pub fn count(&mut self, place: usize) {
        let is_full = self.stretches.len() == MOST;
        match self.stretches.last_mut() {
            Some(last) if (last.end..=last.end + PADDING).contains(&place) => last.end = place + 4,
            _ if is_full => self.is_other = true,
            _ => self.stretches.push(place..place + 4),
        }
    }

    pub fn text(&mut self, end: usize) {
        if let Some(last) = self.stretches.last_mut() {
            last.end = end;
        }
    }

    pub fn number(&mut self, place: usize, slot: usize, of: Primitive) {
        if self.numbers.len() < MOST {
            self.numbers.push((place, slot, of));
        } else {
            self.is_other = true;
        }
    }

    /// Records that a value depends on more than counts.
    pub const fn depends_on_more(&mut self) {
        self.is_other = true;
    }

    /// A message was walked to its end by `reader`, and all that was noted is of it.
    pub fn keep(&mut self, reader: &Arc<()>, message: &[u8], big_endian: bool) {
        if !self.is_other {
            self.reader = Some(Arc::clone(reader));
            self.length = message.len();
            self.big_endian = big_endian;
            self.same.clear();
            for stretch in &self.stretches {
                self.same.extend_from_slice(&message[stretch.clone()]);
            }
        }
    }

    #[inline]
    pub fn is_of(&self, reader: &Arc<()>, message: &[u8]) -> bool {
        let mut same = self.same.as_slice();
        let mut is_same = |stretch: &Range<usize>| {
            let known = same.split_off(..stretch.len());
            let found = message.get(stretch.clone());
            known.zip(found).is_some_and(|(known, found)| alike(known, found))
        };
        self.reader.as_ref().is_some_and(|of| Arc::ptr_eq(of, reader))
            && message.len() == self.length
            && self.stretches.iter().all(&mut is_same)
    }

    #[inline]
    pub fn numbers_of(&self, message: &[u8], cells: &mut [Cell]) {
        for &(place, slot, of) in &self.numbers {
            cells[slot].take(&message[place..place + of.size()], of, self.big_endian);
        }
    }
}

/// Whether the bytes are equal; many stretches are a single count.
#[inline]
fn alike(known: &[u8], found: &[u8]) -> bool {
    match (known.as_array::<4>(), found.as_array::<4>()) {
        (Some(known), Some(found)) => known == found,
        _ => known == found,
    }
}
