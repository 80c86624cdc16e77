//! An aggregate's components: `{E6POS: X 1650.0,Y -120.5,…}`.

use std::ops::Range;

use super::super::RowProblem;
use super::lines::trimmed;
use super::{KrlProblem, Status};

/// An aggregate, as far as its own components go.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Aggregate {
    /// The type before a colon, in capitals.
    pub(super) kind: Option<String>,
    /// Names in capitals, and where their values stand.
    components: Vec<(String, Range<usize>)>,
}

/// The aggregate of a value; `None` for a value that is none.
pub(super) fn parse(text: &[u8], value: Range<usize>) -> Result<Option<Aggregate>, RowProblem> {
    if text[value.clone()].first() != Some(&b'{') {
        return Ok(None);
    }
    let pieces = pieces(text, &value).ok_or(KrlProblem::Open)?;
    let mut kind = None;
    let mut components: Vec<(String, Range<usize>)> = Vec::new();
    for (place, piece) in pieces.into_iter().enumerate() {
        let mut piece = trimmed(text, piece);
        if place == 0
            && let Some((word, rest)) = typed(text, &piece)
        {
            kind = Some(word);
            piece = rest;
        }
        if piece.is_empty() {
            continue;
        }
        let (name, value) = component(text, piece);
        if components.iter().any(|(other, _)| *other == name) {
            return Err(KrlProblem::SameComponent { component: name }.into());
        }
        components.push((name, value));
    }
    Ok(Some(Aggregate { kind, components }))
}

/// What stands between the outer braces, apart by commas that stand in nothing else; `None` where they are not closed, or
/// something follows them.
fn pieces(text: &[u8], value: &Range<usize>) -> Option<Vec<Range<usize>>> {
    let mut pieces = Vec::new();
    let (mut depth, mut quoted, mut start) = (0_usize, false, value.start + 1);
    for place in value.clone() {
        match text[place] {
            b'"' => quoted = !quoted,
            _ if quoted => {}
            b'{' | b'[' => depth += 1,
            b',' if depth == 1 => {
                pieces.push(start..place);
                start = place + 1;
            }
            b'}' | b']' => {
                depth = depth.checked_sub(1)?;
                if depth == 0 {
                    pieces.push(start..place);
                    return (place + 1 == value.end).then_some(pieces);
                }
            }
            _ => {}
        }
    }
    None
}

/// The type before a colon, and what follows it.
fn typed(text: &[u8], piece: &Range<usize>) -> Option<(String, Range<usize>)> {
    let own = &text[piece.clone()];
    let colon = own.iter().position(|&byte| byte == b':')?;
    let word = own[..colon].trim_ascii();
    let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'_';
    word.iter().all(is_word).then(|| {
        let rest = trimmed(text, piece.start + colon + 1..piece.end);
        (capitals(word), rest)
    })
}

/// Name and value: apart by blanks.
fn component(text: &[u8], piece: Range<usize>) -> (String, Range<usize>) {
    let own = &text[piece.clone()];
    let end = own.iter().position(u8::is_ascii_whitespace);
    let end = end.unwrap_or(own.len());
    let value = trimmed(text, piece.start + end..piece.end);
    (capitals(&own[..end]), value)
}

fn capitals(word: &[u8]) -> String {
    String::from_utf8_lossy(word).to_ascii_uppercase()
}

impl Aggregate {
    /// How many of some components there are.
    pub(super) fn has(&self, components: &[&str]) -> usize {
        let there = components.iter().filter(|own| self.range(own).is_some());
        there.count()
    }

    /// Where a component's value stands.
    pub(super) fn range(&self, component: &str) -> Option<Range<usize>> {
        let found = self.components.iter().find(|(own, _)| own == component);
        found.map(|(_, value)| value.clone())
    }

    fn value<'t>(&self, text: &'t [u8], component: &str) -> Option<&'t [u8]> {
        self.range(component).map(|value| &text[value])
    }

    /// A component's number.
    pub(super) fn number(&self, text: &[u8], component: &str) -> Result<Option<f64>, RowProblem> {
        let Some(value) = self.value(text, component) else {
            return Ok(None);
        };
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

    /// A component's whole number, in decimal, `'B101'` or `'H1A'`.
    pub(super) fn whole(&self, text: &[u8], component: &str) -> Result<Option<i64>, RowProblem> {
        let Some(value) = self.value(text, component) else {
            return Ok(None);
        };
        let text = String::from_utf8_lossy(value).to_ascii_uppercase();
        let quoted = text.strip_prefix('\'').and_then(|t| t.strip_suffix('\''));
        let number = match quoted.map(|inside| inside.split_at_checked(1)) {
            None => text.parse().ok(),
            Some(Some(("B", digits))) => i64::from_str_radix(digits, 2).ok(),
            Some(Some(("H", digits))) => i64::from_str_radix(digits, 16).ok(),
            Some(_) => None,
        };
        let wrong = || KrlProblem::NoWhole {
            component: component.to_owned(),
            text: text.clone(),
        };
        number.map(Some).ok_or_else(|| wrong().into())
    }

    /// S.
    pub(super) fn status(&self, text: &[u8]) -> Result<Option<Status>, RowProblem> {
        let Some(number) = self.whole(text, "S")? else {
            return Ok(None);
        };
        match Status::of(number) {
            Some(status) => Ok(Some(status)),
            None => Err(KrlProblem::NoStatus { number }.into()),
        }
    }

    /// Whether a component is this word.
    pub(super) fn is_word(&self, text: &[u8], component: &str, word: &str) -> bool {
        let value = self.value(text, component);
        value.is_some_and(|value| value.eq_ignore_ascii_case(word.as_bytes()))
    }
}
