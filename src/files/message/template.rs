//! The template of the message read last. Wanted numbers and unwanted values are slots in it. A message with the same
//! bytes before, between and after its slots is read in the same way, each wanted text at the same distance after the
//! slot before it.

use std::sync::Arc;

use super::cell::{Cell, Span};
use super::row::{CellsMut, Place};
use super::{Decoded, json, protobuf};

/// Most bytes, and most slots, that are worth recording for each message.
const LONGEST: usize = 1 << 16;
const MOST: usize = 1 << 12;
const LONGEST_PAUSE: u32 = 32;

/// The bytes of the message read last, except its slots.
#[derive(Debug, Clone, Default)]
pub(super) struct Template {
    /// The reader that read it; `None` where the next message has to be walked.
    reader: Option<Arc<()>>,
    /// What stands around the slots, without them.
    bytes: Vec<u8>,
    /// The bytes before each slot, and the slot.
    parts: Vec<Part>,
    texts: Vec<(Span, Place)>,
    places: Vec<Place>,
    /// The end of the last slot in its message.
    gap_end: usize,
    /// Some value depends on more, or the message is too long, or it is not worth recording.
    is_other: bool,
    /// Messages that are not recorded after one that was recorded without use; more with each in a row.
    pause: u32,
    pause_left: u32,
}

/// Bytes, texts and the places of the number begin where those of the part before end.
#[derive(Debug, Clone, Copy)]
struct Part {
    start: usize,
    bytes_end: usize,
    texts_end: usize,
    places_end: usize,
    slot: NumberSlot,
}

#[derive(Debug, Clone, Copy)]
pub(super) enum NumberSlot {
    Json(json::NumberSlot),
    Protobuf(protobuf::NumberSlot),
}

impl Template {
    /// Forgets the template: the next message has to be walked.
    pub fn forget(&mut self) {
        self.reader = None;
        self.bytes.clear();
        self.parts.clear();
        self.texts.clear();
        self.places.clear();
        self.gap_end = 0;
        self.is_other = self.pause_left > 0;
        self.pause_left = self.pause_left.saturating_sub(1);
    }

    pub(super) const fn is_recorded(&self) -> bool {
        !self.is_other
    }

    /// Records a slot: a wanted number, or an unwanted value, read from `start` to `end`.
    #[inline]
    pub fn slot(&mut self, message: &[u8], start: usize, end: usize, slot: NumberSlot) {
        if self.is_other || end > LONGEST || self.parts.len() == MOST {
            self.is_other = true;
            return;
        }
        self.bytes.extend_from_slice(&message[self.gap_end..start]);
        let (bytes_end, texts_end) = (self.bytes.len(), self.texts.len());
        let (start, places_end) = (self.gap_end, self.places.len());
        self.parts.push(Part { start, bytes_end, texts_end, places_end, slot });
        self.gap_end = end;
    }

    #[inline]
    pub fn taken(&mut self, cell: Cell, end: usize, place: Place) {
        match cell {
            Cell::Text(span) => self.texts.push((span.counted_from(self.gap_end), place)),
            _ if end == self.gap_end => {
                self.places.push(place);
                if let Some(part) = self.parts.last_mut() {
                    part.places_end = self.places.len();
                }
            }
            // A word such as JSON's `true`: it belongs to the bytes between slots.
            _ => {}
        }
    }

    /// Records that a value depends on more: on a number's value, or on another value at its place.
    pub(super) const fn depends_on_more(&mut self) {
        self.is_other = true;
    }

    /// A message was walked to its end by `reader`, and all that was noted is of it.
    pub fn keep(&mut self, reader: &Arc<()>, message: &[u8]) {
        if !self.is_other && message.len() <= LONGEST {
            self.bytes.extend_from_slice(&message[self.gap_end..]);
            self.reader = Some(Arc::clone(reader));
        }
    }

    /// Reads a message worded alike for `reader`; if it is not, some values may have been put into the row.
    #[inline]
    pub fn read(&mut self, reader: &Arc<()>, message: &[u8], values: CellsMut<'_>) -> bool {
        let known = self.reader.as_ref().is_some_and(|of| Arc::ptr_eq(of, reader));
        if !known {
            return false;
        }
        let alike = self.read_known(message, values);
        self.pause = if alike { 0 } else { (2 * self.pause).clamp(1, LONGEST_PAUSE) };
        self.pause_left = self.pause;
        alike
    }

    #[inline]
    fn read_known(&mut self, message: &[u8], mut values: CellsMut<'_>) -> bool {
        if message.len() > LONGEST {
            return false;
        }
        let mut start = 0;
        let (mut bytes, mut texts, mut places) = (0, 0, 0);
        for part in &mut self.parts {
            let same = &self.bytes[bytes..part.bytes_end];
            let slot = start + same.len();
            let found = message.get(start..slot);
            if !found.is_some_and(|found| alike(same, found)) {
                return false;
            }
            // Its texts are at the same distances, unless a part before got longer or shorter.
            if part.start != start {
                part.start = start;
                put(&self.texts[texts..part.texts_end], start, &mut values);
            }
            let mut unwanted = Cell::Absent;
            let (cell, others) = match &self.places[places..part.places_end] {
                [] => (&mut unwanted, &[][..]),
                [first, others @ ..] => (values.at(*first), others),
            };
            let Ok(end) = part.slot.take(message, slot, cell) else { return false };
            if !others.is_empty() {
                let cell = *cell;
                for &place in others {
                    *values.at(place) = cell;
                }
            }
            start = end;
            (bytes, texts, places) = (part.bytes_end, part.texts_end, part.places_end);
        }
        put(&self.texts[texts..], start, &mut values);
        message[start..] == self.bytes[bytes..]
    }
}

fn put(texts: &[(Span, Place)], part_start: usize, values: &mut CellsMut<'_>) {
    for &(span, place) in texts {
        *values.at(place) = Cell::Text(span.moved_on(part_start));
    }
}

/// Whether the bytes are equal; most stretches between slots are short.
#[inline]
fn alike(known: &[u8], found: &[u8]) -> bool {
    match (known.first_chunk::<8>(), found.first_chunk::<8>()) {
        (Some(first), Some(found_first)) if known.len() <= 16 => {
            first == found_first && known.last_chunk::<8>() == found.last_chunk::<8>()
        }
        _ => known == found,
    }
}

impl NumberSlot {
    /// Puts the number at this place into the cell, if it is wanted; returns the end of the slot.
    #[inline]
    fn take(self, message: &[u8], at: usize, cell: &mut Cell) -> Decoded<usize> {
        match self {
            Self::Json(slot) => slot.take(message, at, cell),
            Self::Protobuf(slot) => slot.take(message, at, cell),
        }
    }
}
