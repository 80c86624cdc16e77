//! An aggregate's components: `{E6POS: X 1650.0,Y -120.5,…}`, each a name and one value. Any other text between the
//! braces is an error: a controller would refuse it.

use std::ops::Range;

use super::super::RowProblem;
use super::lines::trimmed;
use super::{KrlProblem, Status};

/// Most levels of nested braces; KRL's own structures have three at most.
const DEEPEST: usize = 16;

/// An aggregate with its own components, but not those of nested ones.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Aggregate {
    /// The type before a colon, in capitals.
    pub(super) kind: Option<String>,
    /// Names in capitals, and the places of their values.
    components: Vec<(String, Range<usize>)>,
}

/// The aggregate of a value; `None` for a value that is none.
pub(super) fn parse(text: &[u8], value: Range<usize>) -> Result<Option<Aggregate>, RowProblem> {
    if text[value.clone()].first() != Some(&b'{') {
        return Ok(None);
    }
    of_braces(text, &value, DEEPEST).map(Some)
}

fn of_braces(text: &[u8], value: &Range<usize>, depth: usize) -> Result<Aggregate, RowProblem> {
    let pieces = pieces(text, value).ok_or(KrlProblem::Open)?;
    let mut kind = None;
    let mut components: Vec<(String, Range<usize>)> = Vec::with_capacity(pieces.len());
    for (place, piece) in pieces.into_iter().enumerate() {
        let mut piece = trimmed(text, piece);
        if let Some((word, rest)) = typed(text, &piece).filter(|_| place == 0) {
            kind = Some(word);
            piece = rest;
        }
        let (name, value) = component(text, piece)?;
        if components.iter().any(|(other, _)| *other == name) {
            return Err(KrlProblem::SameComponent { component: name }.into());
        }
        if text[value.start] == b'{' {
            of_braces(text, &value, depth.checked_sub(1).ok_or(KrlProblem::Open)?)?;
        }
        components.push((name, value));
    }
    Ok(Aggregate { kind, components })
}

/// Separated by commas outside texts and inner braces; `None` where the braces are not closed, or something follows
/// them.
fn pieces(text: &[u8], value: &Range<usize>) -> Option<Vec<Range<usize>>> {
    let mut pieces = Vec::new();
    let mut open = Vec::new();
    let (mut quoted, mut start) = (false, value.start + 1);
    for place in value.clone() {
        match text[place] {
            b'"' => quoted = !quoted,
            _ if quoted => {}
            b'{' => open.push(b'}'),
            b'[' => open.push(b']'),
            b',' if open.len() == 1 => {
                pieces.push(start..place);
                start = place + 1;
            }
            end @ (b'}' | b']') => {
                if open.pop() != Some(end) {
                    return None;
                }
                if open.is_empty() {
                    pieces.push(start..place);
                    return (place + 1 == value.end).then_some(pieces);
                }
            }
            _ => {}
        }
    }
    None
}

fn typed(text: &[u8], piece: &Range<usize>) -> Option<(String, Range<usize>)> {
    let own = &text[piece.clone()];
    let colon = own.iter().position(|&byte| byte == b':')?;
    let word = own[..colon].trim_ascii();
    is_word(word).then(|| {
        let rest = trimmed(text, piece.start + colon + 1..piece.end);
        (capitals(word), rest)
    })
}

/// Name and value, separated by blanks; the value is one word, text or aggregate.
fn component(text: &[u8], piece: Range<usize>) -> Result<(String, Range<usize>), RowProblem> {
    let own = &text[piece.clone()];
    let wrong = || KrlProblem::NoComponent { text: String::from_utf8_lossy(own).into_owned() };
    let end = own.iter().position(u8::is_ascii_whitespace);
    let (name, rest) = own.split_at(end.unwrap_or(own.len()));
    let bare = name.split(|&byte| byte == b'[').next().unwrap_or_default();
    let is_name = is_word(bare) && !bare[0].is_ascii_digit();
    if !is_name || !is_one_value(rest.trim_ascii()) {
        return Err(wrong().into());
    }
    let value = trimmed(text, piece.start + name.len()..piece.end);
    Ok((capitals(name), value))
}

/// Whether the bytes are one value: no blank outside texts and braces, and nothing after those.
fn is_one_value(value: &[u8]) -> bool {
    let (mut quoted, mut depth) = (false, 0_usize);
    let mut is_whole = false;
    for &byte in value {
        // Nothing may follow the end of a text or of braces.
        if is_whole || (byte.is_ascii_whitespace() && !quoted && depth == 0) {
            return false;
        }
        match byte {
            b'"' => quoted = !quoted,
            _ if quoted => {}
            b'{' => depth += 1,
            b'}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        is_whole = b"\"}".contains(&byte) && !quoted && depth == 0;
    }
    !value.is_empty() && !quoted && depth == 0
}

fn is_word(word: &[u8]) -> bool {
    let is_letter = |byte: &u8| byte.is_ascii_alphanumeric() || b"_$".contains(byte);
    !word.is_empty() && word.iter().all(is_letter)
}

fn capitals(word: &[u8]) -> String {
    String::from_utf8_lossy(word).to_ascii_uppercase()
}

impl Aggregate {
    pub(super) fn has(&self, components: &[&str]) -> usize {
        let there = components.iter().filter(|own| self.range(own).is_some());
        there.count()
    }

    pub(super) fn other_than(&self, components: &[&str]) -> Option<&str> {
        let mut names = self.components.iter().map(|(name, _)| name.as_str());
        names.find(|name| !components.contains(name))
    }

    pub(super) fn range(&self, component: &str) -> Option<Range<usize>> {
        let found = self.components.iter().find(|(own, _)| own == component);
        found.map(|(_, value)| value.clone())
    }

    fn value<'t>(&self, text: &'t [u8], component: &str) -> Option<&'t [u8]> {
        self.range(component).map(|value| &text[value])
    }

    /// The number of a component; `None` where it is missing.
    pub(super) fn number(&self, text: &[u8], component: &str) -> Result<Option<f64>, RowProblem> {
        let Some(value) = self.value(text, component) else { return Ok(None) };
        let of_number = |byte: &u8| byte.is_ascii_digit() || b"+-.eE".contains(byte);
        let number = std::str::from_utf8(value)
            .ok()
            .filter(|text| text.bytes().all(|byte| of_number(&byte)))
            .and_then(|text| text.parse::<f64>().ok());
        match number.filter(|number| number.is_finite()) {
            Some(number) => Ok(Some(number)),
            None => Err(KrlProblem::NoNumber {
                component: component.to_owned(),
                text: String::from_utf8_lossy(value).into_owned(),
            }
            .into()),
        }
    }

    /// The whole number of a component, in decimal, `'B101'` or `'H1A'`; `None` where it is missing.
    pub(super) fn whole(&self, text: &[u8], component: &str) -> Result<Option<i64>, RowProblem> {
        let Some(value) = self.value(text, component) else { return Ok(None) };
        let text = String::from_utf8_lossy(value).to_ascii_uppercase();
        let quoted = text.strip_prefix('\'').and_then(|t| t.strip_suffix('\''));
        let digits = |digits: &str, radix| {
            // A sign is not allowed among bits.
            let all = digits.chars().all(|digit| digit.is_digit(radix));
            all.then(|| i64::from_str_radix(digits, radix).ok())?
        };
        let number = match quoted.map(|inside| inside.split_at_checked(1)) {
            None => text.parse().ok(),
            Some(Some(("B", bits))) => digits(bits, 2),
            Some(Some(("H", own))) => digits(own, 16),
            Some(_) => None,
        };
        let wrong = || KrlProblem::NoWhole { component: component.to_owned(), text: text.clone() };
        number.map(Some).ok_or_else(|| wrong().into())
    }

    /// The value of S; `None` where it is missing.
    pub(super) fn status(&self, text: &[u8]) -> Result<Option<Status>, RowProblem> {
        let Some(number) = self.whole(text, "S")? else { return Ok(None) };
        match Status::of(number) {
            Some(status) => Ok(Some(status)),
            None => Err(KrlProblem::NoStatus { number }.into()),
        }
    }

    pub(super) fn is_word(&self, text: &[u8], component: &str, word: &str) -> bool {
        let value = self.value(text, component);
        value.is_some_and(|value| value.eq_ignore_ascii_case(word.as_bytes()))
    }
}
