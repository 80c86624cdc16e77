//! Further points of a listing: statements before their motion, positions behind all others, and other numbers of the statements that follow.

use std::fmt::Write as _;
use std::ops::Range;

use super::FANUC;
use super::listing::{lines as lines_of, section as section_of};
use super::position::number;
use crate::edit::{Edit, insert, line_end};
use crate::lex::{Kind, Token, tokens};
use crate::program::Added;
use crate::value::{Cursor, Number};

/// The comment of each added position.
const NAME: &str = "posegrid";

/// The edits of a listing for further points, in its order.
pub(crate) fn lines(bytes: &[u8], added: &[&Added]) -> Vec<Edit> {
    let all = tokens(bytes, &FANUC);
    let mut waiting = added.iter().peekable();
    let (mut section, mut end) = (String::new(), bytes.len());
    let mut own = Further {
        bytes,
        line_end: line_end(bytes),
        last: greatest(bytes, &all),
        count: 0,
        entries: String::new(),
        edits: Vec::new(),
    };
    let mut numbers = Numbers::default();
    for line in lines_of(&all) {
        let begin = line[0].span().start;
        if let Some(word) = section_of(bytes, line) {
            if section == "POS" {
                end = begin;
                break;
            }
            section = word;
        }
        let number = if section == "MN" { numbers.of(bytes, line) } else { None };
        let Some(number) = number else { continue };
        while let Some(before) = waiting.next_if(|own| own.split.line_start <= begin) {
            own.add(before, number.value);
        }
        own.renumber(&number);
    }
    let Further { entries, mut edits, line_end, .. } = own;
    edits.extend((!entries.is_empty()).then(|| insert(bytes, end, entries, line_end)));
    edits
}

/// The numbers of a listing's own statements: what a PLC does along a motion is numbered from 1 again, up to a line of dashes.
#[derive(Default)]
pub(super) struct Numbers {
    is_begun: bool,
    is_within: bool,
}

impl Numbers {
    /// The number of the statement that a line begins.
    pub(super) fn of(&mut self, bytes: &[u8], line: &[Token]) -> Option<Number> {
        let mut rest = Cursor::new(bytes, line);
        let Some(number) = rest.take_number().filter(|_| rest.take_sign(b':')) else {
            let is_end = line.len() > 1 && line[..2].iter().all(|token| token.is(b'-'));
            self.is_within &= !is_end;
            return None;
        };
        self.is_within |= self.is_begun && number.value < 2.0;
        self.is_begun = true;
        (!self.is_within).then_some(number)
    }
}

/// What becomes of a listing, statement by statement.
struct Further<'b> {
    bytes: &'b [u8],
    line_end: &'static str,
    /// The greatest number of a position so far.
    last: u32,
    /// Statements that were added so far.
    count: u32,
    /// The added positions, as `/POS` has them.
    entries: String,
    edits: Vec<Edit>,
}

impl Further<'_> {
    /// Adds statements before the one of a number.
    fn add(&mut self, added: &Added, number: f64) {
        let Self { bytes, line_end, .. } = *self;
        let mut text = String::new();
        for points in &added.points {
            let targets: Vec<String> = points.iter().map(|entry| self.position(entry)).collect();
            let statement = added.split.with(bytes, &targets);
            let number = number + f64::from(self.count);
            write!(text, "{number:>4}:{statement}    ;{line_end}").expect("a string");
            self.count += 1;
        }
        let place = added.split.line_start;
        self.edits.push(Edit { span: place..place, text });
    }

    /// Adds a position; as a statement names it.
    fn position(&mut self, entry: &str) -> String {
        self.last += 1;
        let Self { last, line_end, .. } = *self;
        write!(self.entries, "P[{last}:\"{NAME}\"{entry}{line_end}").expect("a string");
        format!("P[{last}:{NAME}]")
    }

    /// The number of a statement behind those that were added; the column behind it stays where blanks are before it.
    fn renumber(&mut self, number: &Number) {
        if self.count == 0 {
            return;
        }
        let Range { start, end } = number.span;
        let text = (number.value + f64::from(self.count)).to_string();
        let longer = text.len().saturating_sub(end - start);
        let is_blank = self.bytes[..start].iter().rev().take(longer).all(|byte| *byte == b' ');
        let start = if is_blank { start - longer } else { start };
        self.edits.push(Edit { span: start..end, text });
    }
}

/// The greatest number of a position in a listing.
fn greatest(bytes: &[u8], all: &[Token]) -> u32 {
    let all = all.windows(3).filter_map(|own| {
        let is_position =
            own[0].kind == Kind::Name && bytes[own[0].span()].eq_ignore_ascii_case(b"P");
        number(Cursor::new(bytes, &own[2..])).filter(|_| is_position && own[1].is(b'['))
    });
    all.max().unwrap_or(0)
}
