//! The cell of one wanted path: a number, or the place of the value in the message.

use super::value::{Text, TextForm};
use super::{Decoded, MessageFault, Primitive};

/// Most elements of an array that are gathered one by one: far more than an arm has joints.
const MOST_ELEMENTS: usize = 100_000;

/// The value found for one wanted path; places are byte ranges of the message, which has to be shorter than 4 GiB.
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
        form: TextForm,
    },
    List,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Span {
    start: u32,
    end: u32,
    pub(super) escaped: bool,
}

/// An array gathered element by element; an element that is neither number nor string is absent.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct List(Vec<Cell>);

/// A place in a message, whose length [`Row::begin`](super::Row) has checked.
#[expect(clippy::cast_possible_truncation, reason = "a message is shorter than 4 GiB")]
pub(super) const fn place(at: usize) -> u32 {
    at as u32
}

impl Span {
    pub(super) const fn new(start: usize, end: usize, escaped: bool) -> Self {
        Self { start: place(start), end: place(end), escaped }
    }

    /// The span counted from `start`; `self` is counted from an earlier byte.
    pub(super) const fn counted_from(self, start: usize) -> Self {
        Self { start: self.start - place(start), end: self.end - place(start), ..self }
    }

    pub(super) const fn moved_on(self, bytes: usize) -> Self {
        Self { start: self.start + place(bytes), end: self.end + place(bytes), ..self }
    }

    #[inline]
    pub(super) fn bytes(self, message: &[u8]) -> &[u8] {
        bytes(message, self.start, self.end)
    }

    pub(super) fn of(self, message: &[u8]) -> Text<'_> {
        Text { bytes: self.bytes(message), escaped: self.escaped }
    }
}

#[inline]
pub(super) fn bytes(message: &[u8], start: u32, end: u32) -> &[u8] {
    message.get(start as usize..end as usize).unwrap_or_default()
}

impl Cell {
    #[inline]
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
    #[inline]
    pub(super) fn begin_element(&mut self) -> Decoded<()> {
        self.push(Cell::Absent)
    }

    #[inline]
    pub(super) fn push(&mut self, cell: Cell) -> Decoded<()> {
        if self.0.len() >= MOST_ELEMENTS {
            return Err(MessageFault::LongArray);
        }
        self.0.push(cell);
        Ok(())
    }

    #[inline]
    pub(super) fn set_last(&mut self, cell: Cell) {
        if let Some(last) = self.0.last_mut() {
            *last = cell;
        }
    }

    pub(super) fn last_is_absent(&self) -> bool {
        matches!(self.0.last(), Some(Cell::Absent))
    }

    /// The element at `index`, which must exist, for writing.
    #[inline]
    pub(super) fn element_mut(&mut self, index: usize) -> &mut Cell {
        &mut self.0[index]
    }

    /// The element at `index`; absent where there is none.
    #[inline]
    pub(super) fn element(&self, index: usize) -> Cell {
        self.0.get(index).copied().unwrap_or_default()
    }

    pub(super) const fn len(&self) -> usize {
        self.0.len()
    }

    pub(super) fn texts(&self) -> impl Iterator<Item = Option<Span>> {
        self.0.iter().map(|cell| cell.as_text())
    }

    pub(super) fn clear(&mut self) {
        self.0.clear();
    }
}

#[inline]
pub(super) fn number(bytes: &[u8], of: Primitive, big_endian: bool) -> Cell {
    let mut cell = Cell::Absent;
    cell.take(bytes, of, big_endian);
    cell
}

impl Cell {
    /// An integer above the largest `i64` becomes the nearest double.
    pub(super) fn unsigned(stored: u64) -> Self {
        i64::try_from(stored).map_or(Self::Number(stored as f64), Self::Integer)
    }

    /// Writes in place: copying a cell that was just written waits for its two parts, once for each number of each
    /// message.
    #[inline]
    pub(super) fn take(&mut self, bytes: &[u8], of: Primitive, big_endian: bool) {
        macro_rules! stored {
            ($t:ty) => {{
                let bytes = bytes.try_into().expect("as many bytes as the type has");
                if big_endian { <$t>::from_be_bytes(bytes) } else { <$t>::from_le_bytes(bytes) }
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
            Primitive::U64 => Self::unsigned(stored!(u64)),
            Primitive::F32 => Self::Number(stored!(f32).into()),
            Primitive::F64 => Self::Number(stored!(f64)),
        };
    }
}
