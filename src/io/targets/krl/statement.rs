//! One line of code → what it declares or gives a value.

use std::ops::Range;

use super::super::RowProblem;
use super::KrlProblem;
use super::lines::trimmed;

/// A statement that matters here; names and types in capitals, as KRL does not tell them apart.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Statement {
    /// Names of a type.
    Declared(Declaration),
    /// A value for a name.
    Valued {
        /// The type, where the line says it.
        kind: Option<String>,
        /// The name.
        name: Name,
        /// Where the value stands.
        value: Range<usize>,
    },
}

/// Names of a type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Declaration {
    pub(super) kind: String,
    pub(super) names: Vec<String>,
}

/// What has a value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Name {
    /// The variable, in capitals.
    pub(super) variable: String,
    /// With the index of an element, without blanks, in capitals.
    pub(super) shown: String,
}

/// Words before a type.
const BEFORE_TYPE: [&str; 4] = ["DECL", "GLOBAL", "CONST", "PUBLIC"];

/// The statement of a line; `None` where there is nothing to declare.
pub(super) fn parse(text: &[u8], code: &Range<usize>) -> Result<Option<Statement>, RowProblem> {
    let line = &text[code.clone()];
    let Some(equals) = line.iter().position(|&byte| byte == b'=') else {
        return Ok(declared(line).map(Statement::Declared));
    };
    let value = trimmed(text, code.start + equals + 1..code.end);
    let Some(Left { kind, name }) = Left::of(&line[..equals]) else {
        // Not a statement of this language; only where it would hold a position is that a matter.
        return match text[value].first() {
            Some(b'{') => Err(KrlProblem::NoStatement.into()),
            _ => Ok(None),
        };
    };
    Ok(Some(Statement::Valued { kind, name, value }))
}

/// The left side of a value.
struct Left {
    kind: Option<String>,
    name: Name,
}

impl Left {
    fn of(left: &[u8]) -> Option<Self> {
        let left = std::str::from_utf8(left).ok()?.trim().to_ascii_uppercase();
        // Blanks may stand before an index and in it.
        let (words, index) = match left.split_once('[') {
            Some((words, index)) => (words, format!("[{index}")),
            None => (left.as_str(), String::new()),
        };
        let index: String = index.split_ascii_whitespace().collect();
        let is_index =
            index.is_empty() || (index.ends_with(']') && index.matches('[').count() == 1);
        let mut words = typed(words);
        let variable = words.pop().filter(|name| is_index && is_name(name))?;
        let kind = words.pop().map(str::to_owned);
        words.is_empty().then(|| Self {
            kind,
            name: Name {
                variable: variable.to_owned(),
                shown: format!("{variable}{index}"),
            },
        })
    }
}

/// The words of a left side without those before a type.
fn typed(words: &str) -> Vec<&str> {
    let words = words.split_ascii_whitespace();
    words
        .skip_while(|word| BEFORE_TYPE.contains(word))
        .collect()
}

fn is_name(word: &str) -> bool {
    word.bytes()
        .all(|byte| byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'$')
}

/// Type and names of a declaration without a value: `DECL E6POS P[5], Q`.
fn declared(line: &[u8]) -> Option<Declaration> {
    let line = std::str::from_utf8(line).ok()?.to_ascii_uppercase();
    let mut parts = line.split(',');
    let first = typed(parts.next()?);
    let [kind, name, ..] = first[..] else {
        return None;
    };
    let own = |name: &str| {
        let name = name.split('[').next().unwrap_or_default().trim();
        (!name.is_empty() && is_name(name)).then(|| name.to_owned())
    };
    let names = own(name).into_iter().chain(parts.filter_map(own));
    Some(Declaration {
        kind: kind.to_owned(),
        names: names.collect(),
    })
}
