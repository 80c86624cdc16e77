//! The words and characters of an IDL text, without comments, preprocessor lines and section headings.

/// A word or character and the number of its line, counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Token<'t> {
    pub(super) line: usize,
    pub(super) text: &'t str,
}

/// Cuts a text into words (names with their scopes, numbers), literals and single characters.
pub(super) fn tokens(text: &str) -> Vec<Token<'_>> {
    let mut found = Vec::new();
    let mut rest = text;
    let mut line = 1;
    while let Some(first) = rest.chars().next() {
        let length = match first {
            '\n' | '\r' | ' ' | '\t' => first.len_utf8(),
            '#' | '=' | 'I'
                if ["#", "===", "IDL: "].iter().any(|heading| rest.starts_with(heading))
                    && at_line_start(text, rest) =>
            {
                to_line_end(rest)
            }
            '/' if rest.starts_with("//") => to_line_end(rest),
            '/' if rest.starts_with("/*") => rest.find("*/").map_or(rest.len(), |end| end + 2),
            _ => {
                let length = token_length(rest, first);
                let text = &rest[..length];
                found.push(Token { line, text });
                length
            }
        };
        line += rest[..length].matches('\n').count();
        rest = &rest[length..];
    }
    found
}

fn at_line_start(text: &str, rest: &str) -> bool {
    let before = &text[..text.len() - rest.len()];
    let line = before.rsplit('\n').next().unwrap_or(before);
    line.trim().is_empty()
}

fn to_line_end(rest: &str) -> usize {
    rest.find('\n').unwrap_or(rest.len())
}

fn token_length(rest: &str, first: char) -> usize {
    match first {
        '"' | '\'' => literal_length(rest, first),
        c if is_word(c) || rest.starts_with("::") => word_length(rest),
        c => c.len_utf8(),
    }
}

const fn is_word(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_' || c == '.'
}

/// A name with its scopes: `a::b::C`.
fn word_length(rest: &str) -> usize {
    let mut length = 0;
    loop {
        let after = &rest[length..];
        if after.starts_with("::") {
            length += 2;
        } else if after.starts_with(is_word) {
            length += 1;
        } else {
            return length;
        }
    }
}

/// The length up to the closing quote; a quote after a backslash does not close.
fn literal_length(rest: &str, quote: char) -> usize {
    let mut escaped = false;
    for (at, c) in rest.char_indices().skip(1) {
        if c == quote && !escaped {
            return at + 1;
        }
        escaped = c == '\\' && !escaped;
    }
    rest.len()
}
