//! Further points of a listing: statements before their motion, positions behind all others, and other numbers of the statements that follow.

use std::fmt::Write as _;

use super::FANUC;
use super::listing::{lines as lines_of, section};
use super::position::number;
use crate::edit::{Edit, insert, line_end};
use crate::lex::{Kind, Token, tokens};
use crate::program::Added;
use crate::value::Cursor;

/// The comment of each added position.
const NAME: &str = "posegrid";

/// The edits of a listing for further points, in its order.
pub(crate) fn lines(bytes: &[u8], added: &[&Added]) -> Vec<Edit> {
    let all = tokens(bytes, &FANUC);
    let mut edits = Vec::new();
    let mut next = greatest(bytes, &all);
    let mut count = 0;
    let mut entries = String::new();
    let mut inside = String::new();
    let mut waiting = added.iter().peekable();
    let line_end = line_end(bytes);
    let mut end = bytes.len();
    for line in lines_of(&all) {
        let begin = line[0].span().start;
        if let Some(word) = section(bytes, line) {
            if inside == "POS" {
                end = begin;
                break;
            }
            inside = word;
        }
        let mut rest = Cursor::new(bytes, line);
        let Some(own) = rest.take_number().filter(|_| inside == "MN" && rest.take_sign(b':'))
        else {
            continue;
        };
        let mut text = String::new();
        while let Some(before) = waiting.next_if(|own| own.split.line_start <= begin) {
            for points in &before.points {
                let targets = points.iter().map(|entry| {
                    next += 1;
                    let _ = write!(entries, "P[{next}:\"{NAME}\"{entry}{line_end}");
                    format!("P[{next}:{NAME}]")
                });
                let statement = before.split.with(bytes, &targets.collect::<Vec<_>>());
                let _ =
                    write!(text, "{:>4}:{statement}    ;{line_end}", own.value + f64::from(count));
                count += 1;
            }
            edits.push(Edit {
                span: before.split.line_start..before.split.line_start,
                text: std::mem::take(&mut text),
            });
        }
        if count > 0 {
            let text = (own.value + f64::from(count)).to_string();
            // The column behind it stays where blanks are before it.
            let longer = text.len().saturating_sub(own.span.len());
            let is_blank =
                bytes[..own.span.start].iter().rev().take(longer).all(|byte| *byte == b' ');
            let start = own.span.start - if is_blank { longer } else { 0 };
            edits.push(Edit { span: start..own.span.end, text });
        }
    }
    if !entries.is_empty() {
        edits.push(insert(bytes, end, entries, line_end));
    }
    edits
}

/// The greatest number of a position in a listing.
fn greatest(bytes: &[u8], all: &[Token]) -> u32 {
    let all = all.windows(3).filter_map(|own| {
        let is_position =
            own[0].kind == Kind::Name && bytes[own[0].span()].eq_ignore_ascii_case(b"P");
        let number = number(Cursor::new(bytes, &own[2..]));
        number.filter(|_| is_position && own[1].is(b'['))
    });
    all.max().unwrap_or(0)
}
