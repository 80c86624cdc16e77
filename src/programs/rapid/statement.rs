//! Tokens of a module → statements. A statement ends at `;`, a header of a block or a routine where its words end.

use crate::lex::{Kind, Token, capitals};
use crate::reading::has;
use crate::value::Cursor;

#[derive(Debug, Clone, Copy)]
pub(super) struct Statement<'t> {
    /// Its tokens, without the `;`.
    pub(super) all: Cursor<'t>,
    pub(super) line: u32,
}

pub(super) fn without_line_ends(tokens: &[Token]) -> Vec<Token> {
    tokens.iter().filter(|token| token.kind != Kind::LineEnd).copied().collect()
}

/// Words that are a statement each.
const ALONE: &str = "BACKWARD ELSE ENDFOR ENDFUNC ENDIF ENDMODULE ENDPROC ENDRECORD ENDTEST ENDTRAP ENDWHILE ERROR UNDO";

pub(super) fn all<'t>(bytes: &'t [u8], tokens: &'t [Token]) -> Vec<Statement<'t>> {
    let mut statements = Vec::new();
    let mut rest = tokens;
    while let Some(first) = rest.first() {
        let length = length(bytes, rest).clamp(1, rest.len());
        let (own, behind) = rest.split_at(length);
        let is_ended = own.last().is_some_and(|token| token.is(b';'));
        let own = if is_ended { &own[..length - 1] } else { own };
        if !own.is_empty() {
            statements.push(Statement { all: Cursor::new(bytes, own), line: first.line });
        }
        rest = behind;
    }
    statements
}

fn word(bytes: &[u8], token: &Token) -> String {
    if token.kind == Kind::Name { capitals(&bytes[token.span()]) } else { String::new() }
}

/// How many tokens the first statement has, with its `;`.
fn length(bytes: &[u8], tokens: &[Token]) -> usize {
    // A sign too many is no part of what follows; a call whose name is worked out begins with one.
    if matches!(tokens[0].kind, Kind::Sign(sign) if sign != b'%') {
        return 1;
    }
    let own = word(bytes, &tokens[0]);
    let until = |is_end: &dyn Fn(&str) -> bool| ends(bytes, tokens, is_end);
    match own.as_str() {
        "ERROR" if tokens.get(1).is_some_and(|token| token.is(b'(')) => 1 + brackets(&tokens[1..]),
        own if has(ALONE, own) => 1,
        "MODULE" => {
            let named = 2;
            let is_listed = tokens.get(named).is_some_and(|token| token.is(b'('));
            if is_listed { named + brackets(&tokens[named..]) } else { named }
        }
        "RECORD" | "TRAP" => 2,
        "LOCAL" if tokens.len() > 1 => {
            let next = word(bytes, &tokens[1]);
            if matches!(next.as_str(), "PROC" | "FUNC" | "TRAP" | "RECORD") {
                1 + length(bytes, &tokens[1..])
            } else {
                until(&|_| false)
            }
        }
        "PROC" | "FUNC" => {
            let open = tokens.iter().take(6).position(|token| token.is(b'('));
            open.map_or(2, |open| open + brackets(&tokens[open..]))
        }
        "IF" | "ELSEIF" => until(&|word| word == "THEN"),
        "WHILE" | "FOR" => until(&|word| word == "DO"),
        "TEST" => before_case(bytes, tokens),
        "CASE" | "DEFAULT" => colon(tokens),
        _ if is_label(tokens) => 2,
        _ => until(&|_| false),
    }
}

/// Up to `;` or a word that ends the statement; a word that begins or ends a block or routine is not part of it.
fn ends(bytes: &[u8], tokens: &[Token], is_end: &dyn Fn(&str) -> bool) -> usize {
    let is_if = matches!(word(bytes, &tokens[0]).as_str(), "IF" | "ELSEIF");
    for (place, token) in tokens.iter().enumerate().skip(1) {
        match token.kind {
            Kind::Sign(b';') => return place + 1,
            Kind::Name => {
                let word = word(bytes, token);
                if is_end(&word) {
                    return place + 1;
                }
                let is_new =
                    matches!(word.as_str(), "PROC" | "FUNC" | "MODULE") || has(ALONE, &word);
                if is_new && !tokens[place - 1].is(b'\\') && !tokens[place - 1].is(b'.') {
                    return place;
                }
                // A sign is missing before it; that of a compact IF is none.
                let is_motion = !is_if && super::motion::is_motion(&word);
                if is_motion && ends_value(&tokens[place - 1]) {
                    return place;
                }
            }
            _ => {}
        }
    }
    tokens.len()
}

fn ends_value(token: &Token) -> bool {
    match token.kind {
        Kind::Sign(sign) => matches!(sign, b')' | b']' | b'}'),
        kind => kind != Kind::OpenText,
    }
}

fn before_case(bytes: &[u8], tokens: &[Token]) -> usize {
    let is_case = |token: &Token| matches!(word(bytes, token).as_str(), "CASE" | "DEFAULT");
    let found = tokens.iter().position(|token| token.is(b';') || is_case(token));
    found.map_or(tokens.len(), |place| place + usize::from(tokens[place].is(b';')))
}

/// Up to a `:` that begins no `:=`, or the end of a statement.
fn colon(tokens: &[Token]) -> usize {
    let is_end = |(place, token): (usize, &Token)| {
        token.is(b';') || (token.is(b':') && !is_assigned(tokens, place))
    };
    tokens.iter().enumerate().position(is_end).map_or(tokens.len(), |place| place + 1)
}

fn is_assigned(tokens: &[Token], colon: usize) -> bool {
    tokens.get(colon + 1).is_some_and(|token| token.is(b'='))
}

fn is_label(tokens: &[Token]) -> bool {
    tokens[0].kind == Kind::Name
        && tokens.get(1).is_some_and(|token| token.is(b':'))
        && !is_assigned(tokens, 1)
}

/// Tokens up to the bracket that closes the first, or to the end of a statement.
fn brackets(tokens: &[Token]) -> usize {
    let mut depth = 0_i32;
    for (place, token) in tokens.iter().enumerate() {
        depth += i32::from(token.is(b'(')) - i32::from(token.is(b')'));
        if depth == 0 || token.is(b';') {
            return place + 1;
        }
    }
    tokens.len()
}

/// Name and parameters of a routine's header.
pub(super) struct Header<'t> {
    pub(super) name: String,
    pub(super) parameters: Cursor<'t>,
    pub(super) is_local: bool,
    /// Whether an interrupt calls it.
    pub(super) is_trap: bool,
    /// Whether statements alone call it.
    pub(super) is_procedure: bool,
}

pub(super) fn header<'t>(statement: &Statement<'t>) -> Option<Header<'t>> {
    let mut all = statement.all;
    let is_local = all.take_word("LOCAL");
    let word = all.take_name()?;
    match word.as_str() {
        "PROC" | "TRAP" => {}
        "FUNC" => {
            all.take_name()?;
        }
        _ => return None,
    }
    let name = all.take_name()?;
    all.take_sign(b'(');
    let [is_trap, is_procedure] = ["TRAP", "PROC"].map(|own| word == own);
    Some(Header { name, parameters: all, is_local, is_trap, is_procedure })
}

/// The expression behind the `:=` of an assignment, and what is before it.
pub(super) fn assignment(all: Cursor<'_>) -> Option<(Cursor<'_>, Cursor<'_>)> {
    let mut rest = all;
    let left = rest.take_part(b':')?;
    let is_whole =
        rest.take_sign(b'=') && left.first().is_some_and(|token| token.kind == Kind::Name);
    // An option `\WObj:=…` has a backslash before its name.
    let is_option = left.tokens.iter().any(|token| token.is(b'\\') || token.is(b','));
    (is_whole && !is_option).then_some((left, rest))
}
