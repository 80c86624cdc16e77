//! The wanted values of one message, kept in buffers that are filled again for each message.
//!
//! A decoder fills a [`Row`]: numbers are copied, strings and CDR's arrays stay where they lie in the message and are
//! lent out of it afterwards ([`Row::value`]).

use std::sync::Arc;

use super::cdr::Layout;
use super::value::{Gathered, Text};
use super::wording::Wording;
use super::{MessageFault, Numbers, Primitive, Texts, Value};

/// Elements of an array that are gathered one by one: far more than an arm has joints.
const MOST_ELEMENTS: usize = 100_000;

/// One message's wanted values.
#[derive(Debug, Clone, Default)]
pub struct Row {
    cells: Vec<Cell>,
    lists: Vec<List>,
    /// Some list was begun.
    listed: bool,
    /// How often it was filled anew.
    filled: u64,
    /// How the message was laid out, where it was in CDR.
    layout: Layout,
    /// How the message was worded, where it was in protobuf or JSON.
    pub(super) wording: Wording,
}

/// What was found for one wanted path; places are byte ranges of the message, in which a message has to be shorter than
/// 4 GiB.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) enum Cell {
    #[default]
    Absent,
    Integer(i64),
    Number(f64),
    Text(Span),
    Numbers {
        start: u32,
        end: u32,
        of: Primitive,
        big_endian: bool,
    },
    Texts {
        start: u32,
        end: u32,
        count: u32,
        big_endian: bool,
    },
    /// In the list of the slot.
    List,
}

/// Where a string lies in its message.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Span {
    start: u32,
    end: u32,
    /// It has JSON's escapes in it.
    pub(super) escaped: bool,
}

/// An array met element by element; an element that is neither number nor string is absent.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct List(Vec<Cell>);

/// Where a single value stands in a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    slot: usize,
    /// In the slot's list.
    element: Option<usize>,
}

/// A row's cells and lists, lent out to be written.
pub(super) struct CellsMut<'r> {
    cells: &'r mut [Cell],
    lists: &'r mut [List],
}

impl CellsMut<'_> {
    /// The cell at a place, which is one of the row.
    #[inline]
    pub(super) fn at(&mut self, place: Place) -> &mut Cell {
        match place.element {
            Some(element) => &mut self.lists[place.slot].0[element],
            None => &mut self.cells[place.slot],
        }
    }
}

/// A place in a message, whose length [`Row::begin`] has looked at.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a message is shorter than 4 GiB"
)]
pub(super) const fn place(at: usize) -> u32 {
    at as u32
}

impl Span {
    pub(super) const fn new(start: usize, end: usize, escaped: bool) -> Self {
        Self {
            start: place(start),
            end: place(end),
            escaped,
        }
    }

    /// The same span in what begins at `start`.
    pub(super) const fn counted_from(self, start: usize) -> Self {
        Self {
            start: self.start - place(start),
            end: self.end - place(start),
            ..self
        }
    }

    /// The same span in a message in which as many bytes stand before it.
    pub(super) const fn moved_on(self, bytes: usize) -> Self {
        Self {
            start: self.start + place(bytes),
            end: self.end + place(bytes),
            ..self
        }
    }

    /// The bytes that lie there.
    #[inline]
    pub(super) fn bytes(self, message: &[u8]) -> &[u8] {
        bytes(message, self.start, self.end)
    }

    /// The string that lies there.
    pub(super) fn of(self, message: &[u8]) -> Text<'_> {
        Text {
            bytes: self.bytes(message),
            escaped: self.escaped,
        }
    }
}

#[inline]
fn bytes(message: &[u8], start: u32, end: u32) -> &[u8] {
    message
        .get(start as usize..end as usize)
        .unwrap_or_default()
}

impl Cell {
    pub(super) fn as_number(self) -> Option<f64> {
        match self {
            Self::Integer(integer) => Some(integer as f64),
            Self::Number(number) => Some(number),
            _ => None,
        }
    }

    pub(super) const fn as_text(self) -> Option<Span> {
        match self {
            Self::Text(span) => Some(span),
            _ => None,
        }
    }
}

impl List {
    /// Adds an element of which nothing is known yet.
    #[inline]
    pub(super) fn begin_element(&mut self) -> Result<(), MessageFault> {
        self.push(Cell::Absent)
    }

    /// Adds an element.
    #[inline]
    pub(super) fn push(&mut self, cell: Cell) -> Result<(), MessageFault> {
        if self.0.len() >= MOST_ELEMENTS {
            return Err(MessageFault::LongArray);
        }
        self.0.push(cell);
        Ok(())
    }

    /// Gives the element last added its value.
    #[inline]
    pub(super) fn set_last(&mut self, cell: Cell) {
        if let Some(last) = self.0.last_mut() {
            *last = cell;
        }
    }

    /// Whether nothing is known of the element last added.
    pub(super) fn last_is_absent(&self) -> bool {
        matches!(self.0.last(), Some(Cell::Absent))
    }

    /// The element at `index`, if there is one.
    #[inline]
    pub(super) fn element(&self, index: usize) -> Cell {
        self.0.get(index).copied().unwrap_or_default()
    }

    pub(super) const fn len(&self) -> usize {
        self.0.len()
    }

    /// The strings among the elements.
    pub(super) fn texts(&self) -> impl Iterator<Item = Option<Span>> {
        self.0.iter().map(|cell| cell.as_text())
    }

    fn clear(&mut self) {
        self.0.clear();
    }
}

impl Row {
    /// Empties it for a message with so many wanted values.
    #[inline]
    pub(super) fn begin(&mut self, message: &[u8], wanted: usize) -> Result<(), MessageFault> {
        self.layout.forget();
        self.wording.forget();
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

    /// Fills it from a message laid out as the one before, which the same plan read; tells whether it is.
    #[inline]
    pub(super) fn fill_as_before(&mut self, plan: &Arc<()>, message: &[u8]) -> bool {
        let alike = self.layout.is_of(plan, message);
        if alike {
            self.layout.numbers_of(message, &mut self.cells);
        }
        alike
    }

    /// Fills it from a message worded as the one before, which the same plan read; tells whether it is.
    #[inline]
    pub(super) fn fill_as_worded_before(&mut self, plan: &Arc<()>, message: &[u8]) -> bool {
        let (cells, lists) = (&mut self.cells, &mut self.lists);
        self.wording.read(plan, message, CellsMut { cells, lists })
    }

    /// Changes whenever it is filled with anything but numbers: while it stays, texts and the lengths of arrays do.
    #[inline]
    pub const fn filled(&self) -> u64 {
        self.filled
    }

    /// Takes the place of another reading of the same message.
    pub(super) fn instead_of(self, other: &mut Self) {
        let filled = other.filled + 1;
        *other = Self { filled, ..self };
    }

    /// Lends the layout out, to be written.
    pub(super) fn take_layout(&mut self) -> Layout {
        std::mem::take(&mut self.layout)
    }

    pub(super) fn put_layout(&mut self, layout: Layout) {
        self.layout = layout;
    }

    /// Notes for the wording what the slot, or the list in it, got last; it was read up to `end`.
    #[inline]
    pub(super) fn taken(&mut self, slot: usize, end: usize) {
        let (mut cell, mut element) = (self.cells[slot], None);
        if cell == Cell::List {
            let last = self.lists[slot].len().saturating_sub(1);
            (cell, element) = (self.lists[slot].element(last), Some(last));
        }
        self.wording.taken(cell, end, Place { slot, element });
    }

    /// Whether some list was begun.
    pub(super) const fn has_lists(&self) -> bool {
        self.listed
    }

    /// Whether it holds the same values as another.
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

    /// Takes out what is in a slot.
    pub(super) fn forget(&mut self, slot: usize) {
        self.cells[slot] = Cell::Absent;
        self.lists[slot].clear();
    }

    /// Begins a list in a slot; one that was there before goes on.
    #[inline]
    pub(super) fn list(&mut self, slot: usize) -> &mut List {
        self.listed = true;
        self.cells[slot] = Cell::List;
        &mut self.lists[slot]
    }

    /// How many values there are.
    pub const fn len(&self) -> usize {
        self.cells.len()
    }

    /// Whether nothing was wanted.
    pub const fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// The integer in a slot, if it is one.
    #[inline]
    pub fn integer(&self, slot: usize) -> Option<i64> {
        match self.cells.get(slot) {
            Some(&Cell::Integer(integer)) => Some(integer),
            _ => None,
        }
    }

    /// The number in a slot, if it is one.
    #[inline]
    pub fn number(&self, slot: usize) -> Option<f64> {
        match self.cells.get(slot) {
            Some(&Cell::Number(number)) => Some(number),
            Some(&Cell::Integer(integer)) => Some(integer as f64),
            _ => None,
        }
    }

    /// The array of numbers in a slot, if they are stored as doubles, least byte first.
    #[inline]
    pub fn doubles<'m>(&self, message: &'m [u8], slot: usize) -> Option<&'m [[u8; 8]]> {
        match self.cells.get(slot) {
            Some(&Cell::Numbers {
                start,
                end,
                of: Primitive::F64,
                big_endian: false,
            }) => Some(bytes(message, start, end).as_chunks().0),
            _ => None,
        }
    }

    /// Whether the array of strings in a slot is the one that [`Texts::remember`] wrote down. Never true of another.
    #[inline]
    pub fn texts_are(&self, message: &[u8], slot: usize, key: &[u8]) -> bool {
        match self.cells.get(slot) {
            Some(&Cell::Texts {
                start,
                end,
                big_endian,
                ..
            }) => key.split_first() == Some((&u8::from(big_endian), bytes(message, start, end))),
            _ => false,
        }
    }

    /// The value of the path at `slot` among the wanted ones; `message` is the one the row was filled from.
    #[inline]
    pub fn value<'m>(&'m self, message: &'m [u8], slot: usize) -> Value<'m> {
        match self.cells.get(slot).copied().unwrap_or_default() {
            Cell::Absent => Value::Absent,
            Cell::Integer(integer) => Value::Integer(integer),
            Cell::Number(number) => Value::Number(number),
            Cell::Text(span) => Value::Text(span.of(message)),
            Cell::Numbers {
                start,
                end,
                of,
                big_endian,
            } => Value::Numbers(Numbers::Stored {
                bytes: bytes(message, start, end),
                of,
                big_endian,
            }),
            Cell::Texts {
                start,
                end,
                count,
                big_endian,
            } => Value::Texts(Texts::Stored {
                bytes: bytes(message, start, end),
                count: count as usize,
                big_endian,
            }),
            Cell::List => Value::List(Gathered {
                message,
                list: &self.lists[slot],
            }),
        }
    }
}

/// The number in `bytes`, which are as many as `of` needs.
#[inline]
pub(super) fn number(bytes: &[u8], of: Primitive, big_endian: bool) -> Cell {
    let mut cell = Cell::Absent;
    cell.take(bytes, of, big_endian);
    cell
}

impl Cell {
    /// Becomes the number in `bytes`, which are as many as `of` needs. Written where it stays: copying a cell that was just
    /// written waits for its two parts, once for each number of each message.
    #[inline]
    pub(super) fn take(&mut self, bytes: &[u8], of: Primitive, big_endian: bool) {
        macro_rules! stored {
            ($t:ty) => {{
                let bytes = bytes.try_into().expect("as many bytes as the type has");
                if big_endian {
                    <$t>::from_be_bytes(bytes)
                } else {
                    <$t>::from_le_bytes(bytes)
                }
            }};
        }
        *self = match of {
            Primitive::Bool | Primitive::U8 => Self::Integer(stored!(u8).into()),
            Primitive::I8 => Self::Integer(stored!(i8).into()),
            Primitive::I16 => Self::Integer(stored!(i16).into()),
            Primitive::U16 => Self::Integer(stored!(u16).into()),
            Primitive::I32 => Self::Integer(stored!(i32).into()),
            Primitive::U32 => Self::Integer(stored!(u32).into()),
            Primitive::I64 => Self::Integer(stored!(i64)),
            Primitive::U64 => {
                let stored = stored!(u64);
                i64::try_from(stored).map_or(Self::Number(stored as f64), Self::Integer)
            }
            Primitive::F32 => Self::Number(stored!(f32).into()),
            Primitive::F64 => Self::Number(stored!(f64)),
        };
    }
}
