use std::collections::BTreeMap;
use std::ops::Range;

use super::super::spread::length;
use super::lines::{CORRECTED, REFUSED};
use super::{DataList, MARK, Point};
use crate::compensation::{Corrected, Refused};
use crate::table::Word as _;

impl DataList {
    /// A target without a command becomes a comment; `outcomes` are in the targets' order.
    pub fn write(&self, outcomes: &[Result<Corrected, Refused>], table_id: &str) -> Vec<u8> {
        let bytes = Vec::with_capacity(self.text.len() + 64 * outcomes.len());
        let mut written = Written { text: &self.text, bytes, end: self.end_of_lines(), copied: 0 };
        written.copy_until(self.head);
        if !self.text[..self.head].ends_with(b"\n") {
            written.bytes.extend(written.end);
        }
        written.comment(&head(outcomes, table_id));
        for (point, outcome) in self.points.iter().zip(outcomes) {
            match outcome {
                Ok(done) => written.command(point, done),
                Err(refused) => written.refused(point, refused, table_id),
            }
        }
        written.copy_until(self.end);
        written.mark(table_id);
        written.copy_until(self.text.len());
        written.bytes
    }

    fn end_of_lines(&self) -> &'static [u8] {
        let first = self.text.iter().position(|&byte| byte == b'\n');
        match first {
            Some(place) if place > 0 && self.text[place - 1] != b'\r' => b"\n",
            _ => b"\r\n",
        }
    }
}

struct Written<'t> {
    text: &'t [u8],
    bytes: Vec<u8>,
    end: &'static [u8],
    copied: usize,
}

impl Written<'_> {
    fn copy_until(&mut self, place: usize) {
        self.bytes.extend(&self.text[self.copied..place]);
        self.copied = place;
    }

    fn comment(&mut self, words: &str) {
        self.bytes.extend(b"; ");
        self.bytes.extend(plain(words));
        self.bytes.extend(self.end);
    }

    fn mark(&mut self, table_id: &str) {
        // A text has at least one letter and no quotation mark.
        let table = plain(table_id).into_iter();
        let table: Vec<u8> = table.map(|byte| if byte == b'"' { b'?' } else { byte }).collect();
        let table = if table.is_empty() { b"?".to_vec() } else { table };
        let head = format!("DECL CHAR {MARK}[{}]=\"", table.len());
        self.bytes.extend(head.bytes());
        self.bytes.extend(table);
        self.bytes.push(b'"');
        self.bytes.extend(self.end);
    }

    fn command(&mut self, point: &Point, done: &Corrected) {
        let command = <[f64; 3]>::from(done.command.coords());
        let mut numbers: Vec<(&Range<usize>, f64)> = point.xyz.iter().zip(command).collect();
        numbers.sort_by_key(|(range, _)| range.start);
        for (range, number) in numbers {
            self.copy_until(range.start);
            self.bytes.extend(unsigned_zero(length(number)).bytes());
            self.copied = range.end;
        }
    }

    fn refused(&mut self, point: &Point, refused: &Refused, table_id: &str) {
        self.copy_until(point.line.start);
        self.comment(&format!("{REFUSED} table {table_id}: {refused}"));
        self.bytes.push(b';');
        self.copy_until(point.line.end);
    }
}

fn head(outcomes: &[Result<Corrected, Refused>], table_id: &str) -> String {
    let done = outcomes.iter().filter_map(|outcome| outcome.as_ref().ok());
    let mut allowed = BTreeMap::<&str, usize>::new();
    for name in done.clone().flat_map(|done| done.allowed.iter().map(|own| own.word())) {
        *allowed.entry(name).or_default() += 1;
    }
    let corrected = done.count();
    let refused = outcomes.len() - corrected;
    let allowed = allowed.iter();
    let allowed: Vec<String> =
        allowed.map(|(name, count)| format!(", exception {name} allowed for {count}")).collect();
    format!(
        "{CORRECTED} table {table_id}: {corrected} positions corrected, {refused} refused{}",
        allowed.concat()
    )
}

/// Text that cannot end its comment: printable ASCII only.
fn plain(words: &str) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(words.len());
    for letter in words.chars() {
        match letter {
            '°' => bytes.extend(b" deg"),
            '−' | '–' => bytes.push(b'-'),
            ' '..='~' => bytes.extend(letter.encode_utf8(&mut [0; 4]).bytes()),
            _ => bytes.push(b'?'),
        }
    }
    bytes
}

fn unsigned_zero(number: String) -> String {
    let is_zero = number.bytes().all(|byte| b"-0.".contains(&byte));
    match number.strip_prefix('-') {
        Some(zero) if is_zero => zero.to_owned(),
        _ => number,
    }
}
