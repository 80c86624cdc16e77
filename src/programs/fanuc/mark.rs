//! The mark of a corrected listing: comments behind the last statement, so that no other line gets another number, and `LINE_COUNT`.

use super::FANUC;
use super::further::Numbers;
use super::listing::{lines, section};
use crate::edit::{CORRECTED, Edit, insert, line_end};
use crate::lex::{Token, tokens};
use crate::program::File;
use crate::value::{Cursor, Number};

/// Letters of a comment.
const LONGEST: usize = 32;

pub(crate) fn marks(file: &File, words: &str, _: &str, edits: &[Edit]) -> Vec<Edit> {
    let bytes = &file.bytes;
    let all = tokens(bytes, &FANUC);
    let lines: Vec<&[Token]> = lines(&all).collect();
    let is_head = |line: &&[Token]| section(bytes, line).is_some_and(|own| own == "MN");
    let Some(head) = lines.iter().position(is_head) else { return Vec::new() };
    let (before, behind) = lines.split_at(head + 1);
    let end = behind.iter().position(|line| section(bytes, line).is_some());
    let (statements, behind) = behind.split_at(end.unwrap_or(behind.len()));
    let count = before.iter().find_map(|line| line_count(bytes, line));
    let mut own = Numbers::default();
    let numbers = statements.iter().filter_map(|line| own.of(bytes, line));
    // A count may be less than the numbers that the statements have.
    let numbers = numbers.chain(count.clone());
    let last = numbers.fold(0.0, |last, number| number.value.max(last)) + added(edits) as f64;
    let comments = comments(words);
    let line_end = line_end(bytes);
    let numbered = comments.iter().zip(1_u32..);
    let line =
        |(comment, number)| format!("{:>4}:  !{comment} ;{line_end}", last + f64::from(number));
    let text = numbered.map(line).collect::<Vec<_>>().concat();
    let place = behind.first().map_or(bytes.len(), |line| line[0].span().start);
    let is_blank = |byte: &&u8| matches!(byte, b' ' | b'\t');
    let blanks = bytes[..place].iter().rev().take_while(is_blank).count();
    let mut edits = vec![insert(bytes, place - blanks, text, line_end)];
    if let Some(Number { span, .. }) = count {
        edits.push(Edit { span, text: (last + comments.len() as f64).to_string() });
    }
    edits
}

/// Statements among the texts of edits: lines with a number.
fn added(edits: &[Edit]) -> usize {
    let lines = edits.iter().flat_map(|edit| edit.text.split(['\r', '\n']));
    let number = |line: &str| line.split_once(':').map(|(number, _)| number.trim().to_owned());
    lines.filter_map(number).filter(|number| number.parse::<u32>().is_ok()).count()
}

/// The mark and its words in comments of a few letters.
fn comments(words: &str) -> Vec<String> {
    // A `;` would end the comment.
    let letters: Vec<char> = words.replace(';', ",").chars().collect();
    let parts = letters.chunks(LONGEST).map(|part| part.iter().collect());
    std::iter::once(CORRECTED.to_owned()).chain(parts).collect()
}

/// The number of `LINE_COUNT = 12;`, `ZEILEN = 12;` of a controller in German.
fn line_count(bytes: &[u8], line: &[Token]) -> Option<Number> {
    let mut rest = Cursor::new(bytes, line);
    let is_count = rest.take_word("LINE_COUNT") || rest.take_word("ZEILEN");
    let is_count = is_count && rest.take_sign(b'=');
    rest.take_number().filter(|_| is_count)
}
