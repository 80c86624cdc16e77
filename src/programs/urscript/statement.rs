//! Lines of a script → statements: one goes on where a bracket is open and ends at a `;` too, and the head of a block and its `end` are
//! statements of their own, wherever they stand in a line.

use std::ops::Range;

use super::URSCRIPT;
use super::steps::is_function;
use crate::lex::{Kind, Token, capitals, tokens};
use crate::value::Cursor;

pub(super) struct Statements<'f> {
    pub(super) file: usize,
    bytes: &'f [u8],
    /// Without line ends.
    tokens: Vec<Token>,
    ranges: Vec<Range<usize>>,
}

impl<'f> Statements<'f> {
    pub(super) fn new(file: usize, bytes: &'f [u8]) -> Self {
        let mut own = Self { file, bytes, tokens: Vec::new(), ranges: Vec::new() };
        let (mut start, mut depth) = (0, 0_i32);
        for token in tokens(bytes, &URSCRIPT) {
            match token.kind {
                Kind::LineEnd if depth > 0 => {}
                Kind::LineEnd | Kind::Sign(b';') => own.end(&mut start),
                kind => {
                    depth += i32::from(matches!(kind, Kind::Sign(b'(' | b'[' | b'{')));
                    depth -= i32::from(matches!(kind, Kind::Sign(b')' | b']' | b'}')));
                    let text = if depth == 0 { &bytes[token.span()] } else { b"" };
                    if matches!(text, b"end" | b"else" | b"elif") {
                        own.end(&mut start);
                    }
                    own.tokens.push(token);
                    if text == b"end" || text == b":" && own.is_head(start) {
                        own.end(&mut start);
                    }
                }
            }
        }
        own.end(&mut start);
        own
    }

    /// Whether the statement that begins at a token is the head of a block.
    fn is_head(&self, start: usize) -> bool {
        let word = capitals(&self.bytes[self.tokens[start].span()]);
        is_function(&word) || matches!(word.as_str(), "IF" | "WHILE" | "ELIF" | "ELSE")
    }

    fn end(&mut self, start: &mut usize) {
        if *start < self.tokens.len() {
            self.ranges.push(*start..self.tokens.len());
            *start = self.tokens.len();
        }
    }

    /// All names as they are written, with their lines.
    pub(super) fn names(&self) -> impl Iterator<Item = (String, u32)> {
        let text = |token: &Token| String::from_utf8_lossy(&self.bytes[token.span()]).into_owned();
        let begins_pose = |place: usize| {
            let is_open = self.tokens.get(place + 1).is_some_and(|next| next.is(b'['));
            is_open && &self.bytes[self.tokens[place].span()] == b"p"
        };
        let names = self.tokens.iter().enumerate();
        let names =
            names.filter(move |(place, own)| own.kind == Kind::Name && !begins_pose(*place));
        names.map(move |(_, token)| (text(token), token.line))
    }

    pub(super) fn all(&self) -> impl Iterator<Item = (Cursor<'_>, u32)> {
        self.ranges.iter().map(|range| {
            let tokens = &self.tokens[range.clone()];
            (Cursor::new(self.bytes, tokens), tokens[0].line)
        })
    }
}

/// The name and the value of an assignment, and whether an element is assigned.
pub(super) fn assignment(statement: Cursor<'_>) -> Option<(String, Cursor<'_>, bool)> {
    let mut rest = statement;
    if is_global(statement).is_some() {
        rest.take();
    }
    let name = rest.take_name()?;
    let is_element = rest.take_sign(b'[');
    if is_element {
        rest.take_part(b']')?;
    }
    let is_assigned = rest.take_sign(b'=') && !rest.first().is_some_and(|own| own.is(b'='));
    is_assigned.then_some((name, rest, is_element))
}

/// Whether an assignment declares its variable for the whole file; `None` where it does not say.
pub(super) fn is_global(statement: Cursor<'_>) -> Option<bool> {
    match statement.peek_name()?.as_str() {
        "GLOBAL" => Some(true),
        "LOCAL" => Some(false),
        _ => None,
    }
}
