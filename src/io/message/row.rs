//! The wanted values of one message, kept in buffers that are filled again for each message.
//!
//! A decoder fills a [`Row`]: numbers are copied, strings and CDR's arrays stay where they lie in the message and are
//! lent out of it afterwards ([`Row::value`]).

use super::value::{Gathered, Text};
use super::{MessageFault, Numbers, Primitive, Texts, Value};

/// Elements of an array that are gathered one by one: far more than an arm has joints.
const MOST_ELEMENTS: usize = 100_000;

/// One message's wanted values.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Row {
    cells: Vec<Cell>,
    lists: Vec<List>,
}

/// What was found for one wanted path; places are byte ranges of the message.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) enum Cell {
    #[default]
    Absent,
    Integer(i64),
    Number(f64),
    Text(Span),
    Numbers {
        start: usize,
        end: usize,
        of: Primitive,
        big_endian: bool,
    },
    Texts {
        start: usize,
        end: usize,
        count: usize,
        big_endian: bool,
    },
    /// In the list of the slot.
    List,
}

/// Where a string lies in its message.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) start: usize,
    pub(super) end: usize,
    /// It has JSON's escapes in it.
    pub(super) escaped: bool,
}

/// An array met element by element: as numbers and as strings.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct List {
    pub(super) numbers: Vec<Option<f64>>,
    pub(super) texts: Vec<Option<Span>>,
}

impl Cell {
    pub(super) fn as_number(self) -> Option<f64> {
        match self {
            Self::Integer(integer) => Some(integer as f64),
            Self::Number(number) => Some(number),
            _ => None,
        }
    }
}

impl List {
    /// Adds an element of which nothing is known yet.
    pub(super) fn begin_element(&mut self) -> Result<(), MessageFault> {
        if self.numbers.len() >= MOST_ELEMENTS {
            return Err(MessageFault::LongArray);
        }
        self.numbers.push(None);
        self.texts.push(None);
        Ok(())
    }

    /// Gives the element last added its value.
    pub(super) fn set_last(&mut self, cell: Cell) {
        let number = cell.as_number();
        let text = match cell {
            Cell::Text(span) => Some(span),
            _ => None,
        };
        if let (Some(last_number), Some(last_text)) =
            (self.numbers.last_mut(), self.texts.last_mut())
        {
            (*last_number, *last_text) = (number, text);
        }
    }

    /// Whether nothing is known of the element last added.
    pub(super) fn last_is_absent(&self) -> bool {
        self.numbers.last() == Some(&None) && self.texts.last() == Some(&None)
    }

    /// The element at `index`, if there is one.
    pub(super) fn element(&self, index: usize) -> Cell {
        let number = self.numbers.get(index).copied().flatten();
        let text = self.texts.get(index).copied().flatten();
        let text = text.map_or(Cell::Absent, Cell::Text);
        number.map_or(text, Cell::Number)
    }

    fn clear(&mut self) {
        self.numbers.clear();
        self.texts.clear();
    }
}

impl Row {
    /// Empties it for a message with so many wanted values.
    pub(super) fn begin(&mut self, wanted: usize) {
        self.cells.clear();
        self.cells.resize(wanted, Cell::Absent);
        if self.lists.len() < wanted {
            self.lists.resize_with(wanted, List::default);
        }
        self.lists.iter_mut().for_each(List::clear);
    }

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
    pub(super) fn list(&mut self, slot: usize) -> &mut List {
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

    /// The value of the path at `slot` among the wanted ones; `message` is the one the row was filled from.
    pub fn value<'m>(&'m self, message: &'m [u8], slot: usize) -> Value<'m> {
        let lent = |start: usize, end: usize| message.get(start..end).unwrap_or_default();
        match self.cells.get(slot).copied().unwrap_or_default() {
            Cell::Absent => Value::Absent,
            Cell::Integer(integer) => Value::Integer(integer),
            Cell::Number(number) => Value::Number(number),
            Cell::Text(span) => Value::Text(Text {
                bytes: lent(span.start, span.end),
                escaped: span.escaped,
            }),
            Cell::Numbers {
                start,
                end,
                of,
                big_endian,
            } => Value::Numbers(Numbers::Stored {
                bytes: lent(start, end),
                of,
                big_endian,
            }),
            Cell::Texts {
                start,
                end,
                count,
                big_endian,
            } => Value::Texts(Texts::Stored {
                bytes: lent(start, end),
                count,
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
pub(super) fn number(bytes: &[u8], of: Primitive, big_endian: bool) -> Cell {
    macro_rules! integer {
        ($t:ty) => {{
            let bytes = bytes.try_into().expect("as many bytes as the type has");
            let stored = if big_endian {
                <$t>::from_be_bytes(bytes)
            } else {
                <$t>::from_le_bytes(bytes)
            };
            Cell::Integer(i64::from(stored))
        }};
    }
    macro_rules! float {
        ($t:ty) => {{
            let bytes = bytes.try_into().expect("as many bytes as the type has");
            let stored = if big_endian {
                <$t>::from_be_bytes(bytes)
            } else {
                <$t>::from_le_bytes(bytes)
            };
            Cell::Number(stored.into())
        }};
    }
    match of {
        Primitive::Bool | Primitive::U8 => integer!(u8),
        Primitive::I8 => integer!(i8),
        Primitive::I16 => integer!(i16),
        Primitive::U16 => integer!(u16),
        Primitive::I32 => integer!(i32),
        Primitive::U32 => integer!(u32),
        Primitive::I64 => integer!(i64),
        Primitive::U64 => {
            let bytes = bytes.try_into().expect("as many bytes as the type has");
            let stored = if big_endian {
                u64::from_be_bytes(bytes)
            } else {
                u64::from_le_bytes(bytes)
            };
            i64::try_from(stored).map_or(Cell::Number(stored as f64), Cell::Integer)
        }
        Primitive::F32 => float!(f32),
        Primitive::F64 => float!(f64),
    }
}
