//! Lines of a listing → statements and positions.
//!
//! A statement of `/MN` begins with its number and a colon, and ends at the `;` at the end of a line; lines without a number carry it on.
//! Comments and statements that are remarked out are none.

use std::ops::Range;

use super::FANUC;
use super::position::{Listed, entries};
use crate::lex::{Kind, Token, capitals, tokens};
use crate::program::File;
use crate::value::Cursor;

#[derive(Debug, Clone, Copy)]
pub(super) struct Statement<'t> {
    /// Its tokens, without number and `;`.
    pub(super) all: Cursor<'t>,
    pub(super) line: u32,
}

pub(super) struct Listing<'f> {
    pub(super) file: usize,
    /// The program's name, in capitals.
    pub(super) name: String,
    /// The line that says that its positions move with a conveyor.
    pub(super) tracks: Option<u32>,
    bytes: &'f [u8],
    /// Of statements, without their numbers and line ends.
    tokens: Vec<Token>,
    statements: Vec<(Range<usize>, u32)>,
    /// Of `/POS`, without line ends.
    positions: Vec<Token>,
}

/// The word of a line that begins a section: `/MN`.
pub(super) fn section(bytes: &[u8], line: &[Token]) -> Option<String> {
    let [slash, word, ..] = line else { return None };
    let begins = slash.is(b'/') && slash.span().end == word.span().start;
    let word = (begins && word.kind == Kind::Name).then(|| capitals(&bytes[word.span()]))?;
    matches!(word.as_str(), "PROG" | "ATTR" | "APPL" | "MN" | "POS" | "END").then_some(word)
}

pub(super) fn lines(tokens: &[Token]) -> impl Iterator<Item = &[Token]> {
    tokens.split(|token| token.kind == Kind::LineEnd).filter(|line| !line.is_empty())
}

impl<'f> Listing<'f> {
    pub(super) fn new(file: usize, own: &'f File) -> Self {
        let bytes = own.bytes.as_slice();
        let all = tokens(bytes, &FANUC);
        let mut listing = Self {
            file,
            name: own.name.to_ascii_uppercase(),
            tracks: None,
            bytes,
            tokens: Vec::new(),
            statements: Vec::new(),
            positions: Vec::new(),
        };
        let mut inside = String::new();
        let mut is_open = false;
        for line in lines(&all) {
            if let Some(word) = section(bytes, line) {
                if let (Some(name), "PROG") = (line.get(2), word.as_str()) {
                    listing.name = capitals(&bytes[name.span()]);
                }
                (inside, is_open) = (word, false);
                continue;
            }
            match inside.as_str() {
                "MN" => is_open = listing.statement(line, is_open),
                "POS" => listing.positions.extend(line),
                _ => listing.track(line),
            }
        }
        listing
    }

    /// Adds a line of `/MN`; true where its statement goes on.
    fn statement(&mut self, line: &[Token], is_open: bool) -> bool {
        let is_colon = |place: usize| line.get(place).is_some_and(|token| token.is(b':'));
        let is_numbered = line[0].kind == Kind::Number && is_colon(1);
        let head = if is_numbered { 2 } else { usize::from(is_colon(0)) };
        let mut own = &line[head..];
        let begins = |sign: u8, count: usize| {
            own.len() >= count && own[..count].iter().all(|token| token.is(sign))
        };
        let is_remark = begins(b'/', 2);
        if begins(b'!', 1) || begins(b'-', 2) {
            return false;
        }
        // What a text without its end hides is seen in the bytes.
        let is_end = |byte: &u8| matches!(byte, b'\n' | b'\r');
        let rest = &self.bytes[line[line.len() - 1].span().start..];
        let rest = &rest[..rest.iter().position(is_end).unwrap_or(rest.len())];
        let is_ended = rest.trim_ascii_end().ends_with(b";");
        if own.last().is_some_and(|token| token.is(b';')) {
            own = &own[..own.len() - 1];
        }
        let start = self.tokens.len();
        self.tokens.extend(if is_remark { &[] } else { own });
        let end = self.tokens.len();
        match self.statements.last_mut() {
            // What carries a remark on is one too.
            Some((range, _)) if is_open && head < 2 && range.start == range.end => {}
            Some((range, _)) if is_open && head < 2 => range.end = end,
            _ => self.statements.push((start..end, line[0].line)),
        }
        !is_ended
    }

    fn track(&mut self, line: &[Token]) {
        let mut rest = Cursor::new(self.bytes, line);
        let is_number = rest.take_word("LINE_TRACK_SCHEDULE_NUMBER") && rest.take_sign(b':');
        if is_number && rest.take_number().is_none_or(|number| number.value != 0.0) {
            self.tracks = Some(line[0].line);
        }
    }

    pub(super) fn statements(&self) -> impl Iterator<Item = Statement<'_>> {
        self.statements.iter().map(|(range, line)| {
            let all = Cursor::new(self.bytes, &self.tokens[range.clone()]);
            Statement { all, line: *line }
        })
    }

    pub(super) fn positions(&self) -> Vec<(u32, Listed)> {
        entries(Cursor::new(self.bytes, &self.positions))
    }
}
