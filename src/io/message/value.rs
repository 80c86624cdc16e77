//! Values lent out of a message's bytes.

use super::Primitive;

/// What a plan lends out of one message for one wanted path.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Value<'m> {
    /// The message was not read yet.
    #[default]
    Unread,
    /// An integer or a truth value, in the width of any but the largest unsigned ones.
    Integer(i64),
    /// A floating-point number.
    Number(f64),
    /// A string without its end mark.
    Text(&'m [u8]),
    /// An array of numbers.
    Numbers(Numbers<'m>),
    /// An array of strings.
    Texts(Texts<'m>),
}

impl Value<'_> {
    /// The number, if it is one.
    pub fn number(&self) -> Option<f64> {
        match *self {
            Self::Number(number) => Some(number),
            Self::Integer(integer) => Some(integer as f64),
            _ => None,
        }
    }

    /// The integer, if it is one.
    pub const fn integer(&self) -> Option<i64> {
        match *self {
            Self::Integer(integer) => Some(integer),
            _ => None,
        }
    }
}

/// An array of numbers in the byte order of its message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Numbers<'m> {
    pub(super) bytes: &'m [u8],
    pub(super) of: Primitive,
    pub(super) big_endian: bool,
}

impl Numbers<'_> {
    /// How many.
    pub const fn len(&self) -> usize {
        self.bytes.len() / self.of.size()
    }

    /// Whether there are none.
    pub const fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// The number at `index`, if there are that many.
    pub fn get(&self, index: usize) -> Option<f64> {
        let size = self.of.size();
        let start = index.checked_mul(size)?;
        let bytes = self.bytes.get(start..start.checked_add(size)?)?;
        number(bytes, self.of, self.big_endian).number()
    }
}

/// An array of strings as it stands in its message: for each a length, the characters, an end mark, padding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Texts<'m> {
    pub(super) bytes: &'m [u8],
    pub(super) count: usize,
    pub(super) big_endian: bool,
}

impl<'m> Texts<'m> {
    /// The array as stored. Equal bytes mean equal strings (not the other way: padding may differ).
    pub const fn as_stored(&self) -> &'m [u8] {
        self.bytes
    }

    /// How many.
    pub const fn len(&self) -> usize {
        self.count
    }

    /// Whether there are none.
    pub const fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The strings. The plan has walked them, so all are there.
    pub fn iter(&self) -> impl Iterator<Item = &'m [u8]> + use<'m> {
        let (bytes, big_endian) = (self.bytes, self.big_endian);
        let mut at = 0_usize;
        (0..self.count).map_while(move |_| {
            at = at.next_multiple_of(4);
            let length = bytes.get(at..at + 4)?;
            let Value::Integer(length) = number(length, Primitive::U32, big_endian) else {
                return None;
            };
            let length = usize::try_from(length).ok()?;
            let text = bytes.get(at + 4..(at + 4).checked_add(length)?)?;
            at += 4 + length;
            Some(without_end_mark(text))
        })
    }
}

/// CDR counts a terminating zero into a string's length; some writers leave it out of empty ones.
pub(super) fn without_end_mark(text: &[u8]) -> &[u8] {
    text.strip_suffix(&[0]).unwrap_or(text)
}

/// The number in `bytes`, which are as many as `of` needs.
pub(super) fn number(bytes: &[u8], of: Primitive, big_endian: bool) -> Value<'static> {
    macro_rules! integer {
        ($t:ty) => {{
            let bytes = bytes.try_into().expect("as many bytes as the type has");
            let stored = if big_endian {
                <$t>::from_be_bytes(bytes)
            } else {
                <$t>::from_le_bytes(bytes)
            };
            Value::Integer(i64::from(stored))
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
            Value::Number(stored.into())
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
            i64::try_from(stored).map_or(Value::Number(stored as f64), Value::Integer)
        }
        Primitive::F32 => float!(f32),
        Primitive::F64 => float!(f64),
    }
}
