//! JSON's characters, strings and numbers, and the skipping of values.

use super::{bytes, number};
use crate::message::cell::{Cell, Span};
use crate::message::{Decoded, MessageFault};

pub(super) const MOST_LEVELS: usize = 64;

pub(super) struct Scan<'m> {
    pub(super) bytes: &'m [u8],
    pub(super) at: usize,
}

impl Scan<'_> {
    /// The next character that is no space; it is not consumed.
    #[inline]
    pub(super) fn peek(&mut self) -> Decoded<u8> {
        while let Some(&byte) = self.bytes.get(self.at) {
            if !matches!(byte, b' ' | b'\n' | b'\r' | b'\t') {
                return Ok(byte);
            }
            self.at += 1;
        }
        Err(MessageFault::Short)
    }

    #[inline]
    pub(super) fn take_if(&mut self, sign: u8) -> Decoded<bool> {
        let is = self.peek()? == sign;
        self.at += usize::from(is);
        Ok(is)
    }

    #[inline]
    pub(super) fn expect(&mut self, sign: u8) -> Decoded<()> {
        if self.take_if(sign)? { Ok(()) } else { Err(MessageFault::Json) }
    }

    #[inline]
    pub(super) fn text(&mut self) -> Decoded<Span> {
        self.expect(b'"')?;
        let start = self.at;
        let mut escaped = false;
        loop {
            let rest = self.bytes.get(self.at..).unwrap_or_default();
            let stop = self.at + bytes::quote_or_backslash(rest).ok_or(MessageFault::Short)?;
            if self.bytes[stop] == b'"' {
                self.at = stop + 1;
                return Ok(Span::new(start, stop, escaped));
            }
            // A backslash, and the character that it changes.
            escaped = true;
            self.at = stop + 2;
        }
    }

    #[inline]
    pub(super) fn scalar(&mut self) -> Decoded<Cell> {
        match self.peek()? {
            b'"' => self.text().map(Cell::Text),
            _ if self.is_number() => self.number(),
            b'-' => self.word("-Infinity", Cell::Number(f64::NEG_INFINITY)),
            b't' => self.word("true", Cell::Integer(1)),
            b'f' => self.word("false", Cell::Integer(0)),
            b'n' => self.word("null", Cell::Absent),
            b'N' => self.word("NaN", Cell::Number(f64::NAN)),
            b'I' => self.word("Infinity", Cell::Number(f64::INFINITY)),
            _ => Err(MessageFault::Json),
        }
    }

    fn word(&mut self, word: &str, meaning: Cell) -> Decoded<Cell> {
        let rest = &self.bytes[self.at..];
        if rest.starts_with(word.as_bytes()) {
            self.at += word.len();
            Ok(meaning)
        } else if word.as_bytes().starts_with(rest) {
            Err(MessageFault::Short)
        } else {
            Err(MessageFault::Json)
        }
    }

    fn number(&mut self) -> Decoded<Cell> {
        let mut cell = Cell::Absent;
        self.at = number::take(self.bytes, self.at, &mut cell)?;
        Ok(cell)
    }

    #[inline]
    pub(super) fn is_number(&self) -> bool {
        match self.bytes.get(self.at) {
            Some(b'0'..=b'9') => true,
            Some(b'-') => self.bytes.get(self.at + 1) != Some(&b'I'),
            _ => false,
        }
    }

    pub(super) fn skip(&mut self, levels: usize) -> Decoded<()> {
        let levels = levels.checked_sub(1).ok_or(MessageFault::Deep)?;
        match self.peek()? {
            b'{' => self.members(|scan, _| scan.skip(levels)),
            b'[' => self.elements(|scan, _| scan.skip(levels)),
            _ if self.is_number() => {
                (self.at, _) = number::end(self.bytes, self.at)?;
                Ok(())
            }
            _ => self.scalar().map(drop),
        }
    }

    /// Reads an object, whose brace comes next: `member` gets each name and reads its value.
    #[inline]
    pub(super) fn members(
        &mut self,
        mut member: impl FnMut(&mut Self, Span) -> Decoded<()>,
    ) -> Decoded<()> {
        self.expect(b'{')?;
        if self.take_if(b'}')? {
            return Ok(());
        }
        loop {
            let name = self.text()?;
            self.expect(b':')?;
            member(self, name)?;
            if !self.take_if(b',')? {
                return self.expect(b'}');
            }
        }
    }

    /// Reads an array, whose bracket comes next: `element` gets each index and reads its value.
    #[inline]
    pub(super) fn elements(
        &mut self,
        mut element: impl FnMut(&mut Self, usize) -> Decoded<()>,
    ) -> Decoded<()> {
        self.expect(b'[')?;
        if self.take_if(b']')? {
            return Ok(());
        }
        let mut index = 0;
        loop {
            element(self, index)?;
            index += 1;
            if !self.take_if(b',')? {
                return self.expect(b']');
            }
        }
    }

    /// Checks that only spaces, or the zeros that some writers end a text with, follow the value.
    pub(super) fn finish(&self) -> Decoded<()> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let blank = |byte: &u8| matches!(byte, b' ' | b'\n' | b'\r' | b'\t' | 0);
        if rest.iter().all(blank) { Ok(()) } else { Err(MessageFault::LeftOver) }
    }
}
