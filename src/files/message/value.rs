use chrono::DateTime;

use super::Primitive;
use super::cell::{Cell, List, number};

/// What a reader lends out of one message for one wanted path.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Value<'m> {
    #[default]
    Absent,
    /// An integer or a truth value; unsigned integers above the range of `i64` are numbers.
    Integer(i64),
    Number(f64),
    Text(Text<'m>),
    Numbers(Numbers<'m>),
    Texts(Texts<'m>),
    /// An array that was gathered element by element, of numbers or of strings.
    List(Gathered<'m>),
}

impl<'m> Value<'m> {
    /// The number; `None` for any other value.
    pub fn number(&self) -> Option<f64> {
        match *self {
            Self::Number(number) => Some(number),
            Self::Integer(integer) => Some(integer as f64),
            _ => None,
        }
    }

    /// The integer; `None` for any other value.
    pub const fn integer(&self) -> Option<i64> {
        match *self {
            Self::Integer(integer) => Some(integer),
            _ => None,
        }
    }

    /// The numbers; `None` where it is no array.
    pub const fn numbers(&self) -> Option<Numbers<'m>> {
        match *self {
            Self::Numbers(numbers) => Some(numbers),
            Self::List(list) => Some(Numbers::Gathered(list)),
            _ => None,
        }
    }

    /// The strings; `None` where it is no array.
    pub const fn texts(&self) -> Option<Texts<'m>> {
        match *self {
            Self::Texts(texts) => Some(texts),
            Self::List(list) => Some(Texts::Gathered(list)),
            _ => None,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Text<'m> {
    pub(super) bytes: &'m [u8],
    /// The string contains JSON escapes.
    pub(super) escaped: bool,
}

impl Text<'_> {
    /// Whether the text is the same, after JSON escapes are replaced.
    pub fn is(&self, text: &str) -> bool {
        if self.escaped {
            super::json::unescaped(self.bytes).is_some_and(|mine| mine == text)
        } else {
            self.bytes == text.as_bytes()
        }
    }

    /// The time in the text, written by RFC 3339 (`2026-11-22T08:30:00.25Z`), ns since 1970; `None` without a zone.
    pub fn date_time_ns(&self) -> Option<i64> {
        let time = DateTime::parse_from_rfc3339(&self.to_text()).ok()?;
        time.timestamp_nanos_opt()
    }

    /// The text for people: bytes that are no UTF-8 are replaced.
    pub fn to_text(&self) -> String {
        let unescaped = self.escaped.then(|| super::json::unescaped(self.bytes));
        unescaped.flatten().unwrap_or_else(|| String::from_utf8_lossy(self.bytes).into_owned())
    }
}

/// An array gathered element by element; an element that is no number or no string is absent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gathered<'m> {
    pub(super) message: &'m [u8],
    pub(super) list: &'m List,
}

/// Numbers that are stored one after another in the message, or gathered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Numbers<'m> {
    Stored { bytes: &'m [u8], of: Primitive, big_endian: bool },
    Gathered(Gathered<'m>),
}

impl Numbers<'_> {
    pub const fn len(&self) -> usize {
        match self {
            Self::Stored { bytes, of, .. } => bytes.len() / of.size(),
            Self::Gathered(gathered) => gathered.list.len(),
        }
    }

    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The number at `index`; `None` where there is none.
    #[inline]
    pub fn get(&self, index: usize) -> Option<f64> {
        match *self {
            Self::Stored { bytes, of, big_endian } => {
                let size = of.size();
                let start = index.checked_mul(size)?;
                let bytes = bytes.get(start..start.checked_add(size)?)?;
                number(bytes, of, big_endian).as_number()
            }
            Self::Gathered(gathered) => gathered.list.element(index).as_number(),
        }
    }
}

/// How strings are stored one after another: for each a length of four bytes and the characters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TextForm {
    /// CDR: the length is aligned to four bytes and counts a terminating zero.
    LittleEndian,
    BigEndian,
    /// ROS 1: little-endian, without padding or terminating zero.
    Packed,
}

impl TextForm {
    /// The bytes without CDR's terminating zero, which some writers leave out of empty strings.
    pub(super) fn characters(self, text: &[u8]) -> &[u8] {
        text.strip_suffix(&[0]).filter(|_| self != Self::Packed).unwrap_or(text)
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Texts<'m> {
    Stored { bytes: &'m [u8], count: usize, form: TextForm },
    Gathered(Gathered<'m>),
}

impl<'m> Texts<'m> {
    pub const fn len(&self) -> usize {
        match self {
            Self::Stored { count, .. } => *count,
            Self::Gathered(gathered) => gathered.list.len(),
        }
    }

    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The strings; the reader has walked them, so all are there. An element that is no string is `None`.
    pub fn iter(&self) -> impl Iterator<Item = Option<Text<'m>>> + use<'m> {
        let (stored, gathered) = match *self {
            Self::Stored { bytes, count, form } => (stored_texts(bytes, count, form), None),
            Self::Gathered(gathered) => {
                (stored_texts(&[], 0, TextForm::LittleEndian), Some(gathered))
            }
        };
        let gathered = gathered.into_iter().flat_map(|Gathered { message, list }| {
            list.texts().map(move |span| span.map(|span| span.of(message)))
        });
        stored.map(Some).chain(gathered)
    }

    /// Writes a key that identifies these strings.
    pub fn remember(&self, key: &mut Vec<u8>) {
        key.clear();
        match *self {
            Self::Stored { bytes, form, .. } => {
                key.push(form as u8);
                key.extend_from_slice(bytes);
            }
            Self::Gathered(_) => {
                key.push(GATHERED);
                for text in self.iter() {
                    let bytes = text.map_or(&[][..], |text| text.bytes);
                    key.extend(bytes.len().to_le_bytes());
                    key.push(text.map_or(2, |text| u8::from(text.escaped)));
                    key.extend_from_slice(bytes);
                }
            }
        }
    }

    /// Never true for other strings; it may be false for the same ones stored in another way.
    pub fn are(&self, key: &[u8]) -> bool {
        match *self {
            Self::Stored { bytes, form, .. } => key.split_first() == Some((&(form as u8), bytes)),
            Self::Gathered(Gathered { message, list }) => {
                let mut rest = key.strip_prefix(&[GATHERED]);
                for span in list.texts() {
                    rest = rest.and_then(|rest| after(rest, span.map(|span| span.of(message))));
                }
                rest.is_some_and(<[u8]>::is_empty)
            }
        }
    }
}

/// The first byte of the key of gathered strings; that of stored ones is their form.
const GATHERED: u8 = u8::MAX;

/// The part of a key after one string.
fn after<'k>(key: &'k [u8], text: Option<Text<'_>>) -> Option<&'k [u8]> {
    let bytes = text.map_or(&[][..], |text| text.bytes);
    let (length, rest) = key.split_first_chunk::<8>()?;
    let (escaped, rest) = rest.split_first()?;
    let same = usize::from_le_bytes(*length) == bytes.len()
        && *escaped == text.map_or(2, |text| u8::from(text.escaped));
    rest.strip_prefix(bytes).filter(|_| same)
}

fn stored_texts(bytes: &[u8], count: usize, form: TextForm) -> impl Iterator<Item = Text<'_>> {
    let mut at = 0_usize;
    (0..count).map_while(move |_| {
        at = at.next_multiple_of(if form == TextForm::Packed { 1 } else { 4 });
        let length = bytes.get(at..at + 4)?;
        let big_endian = form == TextForm::BigEndian;
        let Cell::Integer(length) = number(length, Primitive::U32, big_endian) else { return None };
        let length = usize::try_from(length).ok()?;
        let text = bytes.get(at + 4..(at + 4).checked_add(length)?)?;
        at += 4 + length;
        Some(Text { bytes: form.characters(text), escaped: false })
    })
}
