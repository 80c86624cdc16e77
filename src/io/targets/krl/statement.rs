//! One line of code → the declaration or the value in it, or one of [`WITHOUT_VALUES`]. Any other line is an error: a
//! controller refuses it, and a skipped line may be a position.

use std::ops::Range;

use super::super::RowProblem;
use super::KrlProblem;
use super::lines::{begins, trimmed};

/// A statement that is used here; names and types in capitals, since KRL does not distinguish them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Statement {
    Declared(Declaration),
    Valued {
        /// The type; `None` where the line does not state it.
        kind: Option<String>,
        name: Name,
        value: Range<usize>,
    },
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Declaration {
    pub(super) kind: String,
    pub(super) names: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Name {
    pub(super) variable: String,
    /// The name with the index of an element, without blanks, in capitals; numbers without a sign and leading zeros.
    pub(super) shown: String,
    /// Whether the index, if there is one, consists of whole numbers.
    pub(super) is_counted: bool,
    pub(super) is_part: bool,
}

impl Name {
    /// A variable as a whole, by its name in capitals.
    pub(super) fn of(variable: &str) -> Self {
        Self {
            variable: variable.to_owned(),
            shown: variable.to_owned(),
            is_counted: true,
            is_part: false,
        }
    }
}

const BEFORE_TYPE: [&str; 4] = ["DECL", "GLOBAL", "CONST", "PUBLIC"];

/// Declarations of anything but variables: they hold no values.
const WITHOUT_VALUES: [&str; 8] =
    ["EXT", "EXTP", "EXTFCT", "EXTFCTP", "IMPORT", "STRUC", "ENUM", "SIGNAL"];

pub(super) fn parse(text: &[u8], code: &Range<usize>) -> Result<Option<Statement>, RowProblem> {
    let line = &text[code.clone()];
    if line.is_empty() || is_without_values(line) {
        return Ok(None);
    }
    if line.split(|&byte| byte == b'"').count() % 2 == 0 {
        return Err(KrlProblem::OpenText.into());
    }
    let Some(equals) = line.iter().position(|&byte| byte == b'=') else {
        let declared = declared(line).ok_or(KrlProblem::NoDeclaration)?;
        return Ok(Some(Statement::Declared(declared)));
    };
    let value = trimmed(text, code.start + equals + 1..code.end);
    let (kind, name) = left(&line[..equals]).ok_or(KrlProblem::NoStatement)?;
    let own = &text[value.clone()];
    if !own.starts_with(b"{") && !is_plain_value(own) {
        return Err(KrlProblem::NoValue { text: String::from_utf8_lossy(own).into_owned() }.into());
    }
    Ok(Some(Statement::Valued { kind, name, value }))
}

fn is_without_values(line: &[u8]) -> bool {
    let mut rest = line;
    while let Some(word) = BEFORE_TYPE.iter().find(|word| begins(rest, word)) {
        rest = rest[word.len()..].trim_ascii_start();
    }
    WITHOUT_VALUES.iter().any(|word| begins(rest, word))
}

/// Whether the bytes are one value that is no aggregate: a text, or a word without blanks, commas and braces.
fn is_plain_value(value: &[u8]) -> bool {
    if let Some(text) = value.strip_prefix(b"\"") {
        return text.iter().position(|&byte| byte == b'"') == text.len().checked_sub(1);
    }
    let part = |byte: &u8| byte.is_ascii_whitespace() || b",{}\"=".contains(byte);
    !value.is_empty() && !value.iter().any(part)
}

fn left(left: &[u8]) -> Option<(Option<String>, Name)> {
    let left = std::str::from_utf8(left).ok()?.trim().to_ascii_uppercase();
    // Blanks are allowed before an index and in it.
    let (words, rest) = left.split_at(left.find(['[', '.']).unwrap_or(left.len()));
    let rest: String = rest.split_ascii_whitespace().collect();
    let (index, part) = rest.split_once('.').unwrap_or((&rest, ""));
    let mut words = typed(words);
    let variable = words.pop().filter(|name| is_name(name))?;
    let kind = words.pop().map(str::to_owned);
    let index = Index::of(index)?;
    words.is_empty().then(|| {
        let name = Name {
            variable: variable.to_owned(),
            shown: format!("{variable}{}", index.shown),
            is_counted: index.is_counted,
            is_part: !part.is_empty(),
        };
        (kind, name)
    })
}

/// The text in square brackets after a name.
struct Index {
    shown: String,
    is_counted: bool,
}

impl Index {
    /// The index in a text without blanks: `[2]`, `[1,4]`, `[]`, `[1,]`, or none at all.
    fn of(text: &str) -> Option<Self> {
        if text.is_empty() {
            return Some(Self { shown: String::new(), is_counted: true });
        }
        let inside = text.strip_prefix('[')?.strip_suffix(']')?;
        if inside.contains(['[', ']']) {
            return None;
        }
        let numbers: Vec<Option<u32>> = inside.split(',').map(|own| own.parse().ok()).collect();
        let shown = inside.split(',').zip(&numbers);
        let shown: Vec<String> = shown
            .map(|(own, number)| number.map_or_else(|| own.to_owned(), |n| n.to_string()))
            .collect();
        Some(Self {
            shown: format!("[{}]", shown.join(",")),
            is_counted: numbers.iter().all(Option::is_some),
        })
    }
}

fn typed(words: &str) -> Vec<&str> {
    let words = words.split_ascii_whitespace();
    words.skip_while(|word| BEFORE_TYPE.contains(word)).collect()
}

fn is_name(word: &str) -> bool {
    !word.starts_with(|first: char| first.is_ascii_digit())
        && !word.is_empty()
        && word.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'$')
}

/// Type and names of a declaration without a value: `DECL E6POS P[5], Q[2,3]`.
fn declared(line: &[u8]) -> Option<Declaration> {
    let line = std::str::from_utf8(line).ok()?.to_ascii_uppercase();
    let mut rest = line.as_str();
    let (kind, names) = loop {
        let (word, behind) = rest.split_once(|letter: char| letter.is_ascii_whitespace())?;
        rest = behind.trim_start();
        if !BEFORE_TYPE.contains(&word) {
            break (word, rest);
        }
    };
    let names: Option<Vec<String>> = outside_brackets(names).into_iter().map(own_name).collect();
    is_name(kind).then_some(Declaration { kind: kind.to_owned(), names: names? })
}

fn own_name(name: &str) -> Option<String> {
    let name = name.trim();
    let (own, index) = match name.split_once('[') {
        Some((own, index)) => (own.trim_end(), index.strip_suffix(']')?),
        None => (name, ""),
    };
    (is_name(own) && !index.contains(['[', ']'])).then(|| own.to_owned())
}

/// Parts of a text, separated by commas outside brackets.
fn outside_brackets(text: &str) -> Vec<&str> {
    let mut depth = 0_i32;
    text.split(|letter| {
        depth += i32::from(letter == '[') - i32::from(letter == ']');
        letter == ',' && depth == 0
    })
    .collect()
}
