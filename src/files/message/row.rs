//! The wanted values of one message, in buffers that are reused: numbers are copied, strings and the arrays of CDR and ROS 1
//! are borrowed from the message ([`Row::value`]).

use std::sync::Arc;

use super::cdr::Layout;
use super::cell::{Cell, List, bytes};
use super::template::Template;
use super::value::Gathered;
use super::{Decoded, MessageFault, Numbers, Primitive, Texts, Value};

#[derive(Debug, Clone, Default)]
pub struct Row {
    cells: Vec<Cell>,
    lists: Vec<List>,
    pub(super) listed: bool,
    filled: u64,
    pub(super) layout: Layout,
    pub(super) template: Template,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    slot: usize,
    /// Index in the slot's list; `None` for the slot itself.
    element: Option<usize>,
}

pub(super) struct CellsMut<'r> {
    cells: &'r mut [Cell],
    lists: &'r mut [List],
}

impl CellsMut<'_> {
    #[inline]
    pub(super) fn at(&mut self, place: Place) -> &mut Cell {
        match place.element {
            Some(element) => self.lists[place.slot].element_mut(element),
            None => &mut self.cells[place.slot],
        }
    }
}

/// Where a value goes: into a slot, or into the last element of the list in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Target {
    Slot(usize),
    Last(usize),
}

impl Target {
    #[inline]
    pub(super) fn set(self, cell: Cell, row: &mut Row) {
        match self {
            Self::Slot(slot) => row.set(slot, cell),
            Self::Last(slot) => row.list(slot).set_last(cell),
        }
    }

    pub(super) const fn slot(self) -> usize {
        match self {
            Self::Slot(slot) | Self::Last(slot) => slot,
        }
    }

    pub(super) fn is_absent(self, row: &mut Row) -> bool {
        match self {
            Self::Slot(slot) => row.cell(slot) == Cell::Absent,
            Self::Last(slot) => row.list(slot).last_is_absent(),
        }
    }
}

impl Row {
    /// Empties it for a message with this number of wanted values.
    #[inline]
    pub(super) fn begin(&mut self, message: &[u8], wanted: usize) -> Decoded<()> {
        self.layout.forget();
        self.template.forget();
        self.filled += 1;
        if u32::try_from(message.len()).is_err() {
            return Err(MessageFault::Long);
        }
        if self.listed || self.cells.len() != wanted {
            self.resize(wanted);
        } else {
            self.cells.fill(Cell::Absent);
        }
        Ok(())
    }

    /// Fills it from a message laid out as the one before, which the same reader read; tells whether it is.
    #[inline]
    pub(super) fn fill_as_before(&mut self, reader: &Arc<()>, message: &[u8]) -> bool {
        let alike = self.layout.is_of(reader, message);
        if alike {
            self.layout.numbers_of(message, &mut self.cells);
        }
        alike
    }

    /// Fills it from a message worded as the one before, which the same reader read; tells whether it is.
    #[inline]
    pub(super) fn fill_as_worded_before(&mut self, reader: &Arc<()>, message: &[u8]) -> bool {
        let (cells, lists) = (&mut self.cells, &mut self.lists);
        self.template.read(reader, message, CellsMut { cells, lists })
    }

    /// Changes whenever the row is filled with anything but numbers: while it stays, texts and lengths of arrays are
    /// unchanged.
    #[inline]
    pub const fn filled(&self) -> u64 {
        self.filled
    }

    pub(super) fn instead_of(self, other: &mut Self) {
        let filled = other.filled + 1;
        *other = Self { filled, ..self };
    }

    /// Records for the template the last value of the slot, or of the list in it; it was read up to `end`.
    #[inline]
    pub(super) fn taken(&mut self, slot: usize, end: usize) {
        if !self.template.is_recorded() {
            return;
        }
        let (mut cell, mut element) = (self.cells[slot], None);
        if cell == Cell::List {
            let last = self.lists[slot].len().saturating_sub(1);
            (cell, element) = (self.lists[slot].element(last), Some(last));
        }
        self.template.taken(cell, end, Place { slot, element });
    }

    pub(super) fn says_same(&self, other: &Self) -> bool {
        let mut listed = (0..self.cells.len()).filter(|&slot| self.cells[slot] == Cell::List);
        self.cells == other.cells && listed.all(|slot| self.lists[slot] == other.lists[slot])
    }

    fn resize(&mut self, wanted: usize) {
        self.cells.clear();
        self.cells.resize(wanted, Cell::Absent);
        if self.lists.len() < wanted {
            self.lists.resize_with(wanted, List::default);
        }
        self.lists.iter_mut().for_each(List::clear);
        self.listed = false;
    }

    #[inline]
    pub(super) fn set(&mut self, slot: usize, cell: Cell) {
        self.cells[slot] = cell;
    }

    pub(super) fn cell(&self, slot: usize) -> Cell {
        self.cells[slot]
    }

    fn forget(&mut self, slot: usize) {
        self.cells[slot] = Cell::Absent;
        self.lists[slot].clear();
    }

    /// Removes the values of these targets.
    pub(super) fn oust(&mut self, targets: &[Target]) {
        for &target in targets {
            if !target.is_absent(self) {
                self.template.depends_on_more();
            }
            match target {
                Target::Slot(slot) => self.forget(slot),
                Target::Last(_) => target.set(Cell::Absent, self),
            }
        }
    }

    /// Begins a list in a slot; an existing list continues.
    #[inline]
    pub(super) fn list(&mut self, slot: usize) -> &mut List {
        self.listed = true;
        self.cells[slot] = Cell::List;
        &mut self.lists[slot]
    }

    /// The integer in a slot; `None` for any other value.
    #[inline]
    pub fn integer(&self, slot: usize) -> Option<i64> {
        match self.cells.get(slot) {
            Some(&Cell::Integer(integer)) => Some(integer),
            _ => None,
        }
    }

    /// The number in a slot; `None` for any other value.
    #[inline]
    pub fn number(&self, slot: usize) -> Option<f64> {
        self.cells.get(slot)?.as_number()
    }

    /// The array of numbers in a slot, if they are stored as little-endian doubles; otherwise `None`.
    #[inline]
    pub fn doubles<'m>(&self, message: &'m [u8], slot: usize) -> Option<&'m [[u8; 8]]> {
        match self.cells.get(slot) {
            Some(&Cell::Numbers { start, end, of: Primitive::F64, big_endian: false }) => {
                Some(bytes(message, start, end).as_chunks().0)
            }
            _ => None,
        }
    }

    /// Whether the array of strings in a slot is the one that [`Texts::remember`] recorded; it is never true for
    /// another.
    #[inline]
    pub fn texts_are(&self, message: &[u8], slot: usize, key: &[u8]) -> bool {
        match self.cells.get(slot) {
            Some(&Cell::Texts { start, end, form, .. }) => {
                key.split_first() == Some((&(form as u8), bytes(message, start, end)))
            }
            _ => false,
        }
    }

    /// The value of the path at `slot` among the wanted ones; `message` is the one that the row was filled from.
    #[inline]
    pub fn value<'m>(&'m self, message: &'m [u8], slot: usize) -> Value<'m> {
        match self.cells.get(slot).copied().unwrap_or_default() {
            Cell::Absent => Value::Absent,
            Cell::Integer(integer) => Value::Integer(integer),
            Cell::Number(number) => Value::Number(number),
            Cell::Text(span) => Value::Text(span.of(message)),
            Cell::Numbers { start, end, of, big_endian } => Value::Numbers(Numbers::Stored {
                bytes: bytes(message, start, end),
                of,
                big_endian,
            }),
            Cell::Texts { start, end, count, form } => Value::Texts(Texts::Stored {
                bytes: bytes(message, start, end),
                count: count as usize,
                form,
            }),
            Cell::List => Value::List(Gathered { message, list: &self.lists[slot] }),
        }
    }
}
