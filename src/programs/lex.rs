//! Bytes of a program → tokens. One lexer reads every dialect; a [`Dialect`] describes what differs.
//!
//! A file is read as bytes and never decoded: names, numbers and signs are ASCII in every dialect, and bytes from 0x80 on
//! stand in comments, texts and a few names only. A second byte of Shift-JIS may look like `\`, `{` or `|` but never
//! like a quotation mark, an end of line or what begins a comment, so texts and comments end where they do; but it may look like the `]`
//! that ends the comment of an element, whose rest is then no listing and is refused.

use std::ops::Range;

/// What distinguishes one dialect from another: all that is asked of a file by its ending stands here.
///
/// | | comment | header line | quotes | statement ends at |
/// |---|---|---|---|---|
/// | KRL | `;` | `&` | `"`, and `'` around numbers of another base | the end of the line |
/// | RAPID | `!` | `%%%` | `"`, doubled inside | `;` |
/// | FANUC TP | none: `!`, `//` and `--` begin one at the head of a statement only | | `"` | `;` at the end of a line |
/// | URScript | `#` | | `"` | the end of the line, outside brackets |
#[derive(Debug, Clone, Copy)]
pub struct Dialect {
    /// As the lake's record of a correction names it.
    pub name: &'static str,
    /// Of its files, in small letters.
    pub endings: &'static [&'static str],
    /// The sign before a comment of posegrid's own.
    pub comment: char,
    /// What ends a statement that another comment follows in its line.
    pub statement_end: &'static str,
    /// Each begins a comment that ends with the line.
    pub comments: &'static [&'static [u8]],
    /// The beginning of a line that is no code.
    pub header: Option<&'static [u8]>,
    /// A text is between two of these.
    pub text_quote: u8,
    /// A number of another base is between two of these: `'B0101'`, `'H1F'`.
    pub number_quote: Option<u8>,
    /// Whether a `:` inside square brackets begins a comment that ends with them: `P[1:left)]`.
    pub comments_elements: bool,
    /// Bytes of names besides letters, digits and bytes from 0x80 on.
    pub in_names: &'static [u8],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Name,
    /// Without its sign.
    Number,
    Text,
    /// Any other byte.
    Sign(u8),
    LineEnd,
    /// A text that does not end in its line.
    OpenText,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Token {
    pub kind: Kind,
    start: u32,
    end: u32,
    /// From 1.
    pub line: u32,
}

impl Token {
    pub const fn span(&self) -> Range<usize> {
        self.start as usize..self.end as usize
    }

    pub fn is(&self, sign: u8) -> bool {
        self.kind == Kind::Sign(sign)
    }
}

/// A longer file is not read: places in it would not fit their numbers.
pub const LONGEST: usize = u32::MAX as usize;

/// The tokens of a file; comments, blanks and header lines are none.
pub fn tokens(bytes: &[u8], dialect: &Dialect) -> Vec<Token> {
    let bytes = &bytes[..bytes.len().min(LONGEST)];
    let mut lexer = Lexer {
        bytes,
        dialect,
        at: after_mark(bytes),
        line: 1,
        at_line_start: true,
        in_element: false,
    };
    let mut tokens = Vec::with_capacity(bytes.len() / 4);
    while let Some(token) = lexer.next() {
        tokens.push(token);
    }
    tokens
}

/// A mark of UTF-8 at the beginning is no part of the first name.
pub(crate) fn after_mark(bytes: &[u8]) -> usize {
    if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 }
}

struct Lexer<'b> {
    bytes: &'b [u8],
    dialect: &'b Dialect,
    at: usize,
    line: u32,
    at_line_start: bool,
    /// Whether a square bracket is open in a dialect that comments elements.
    in_element: bool,
}

impl Lexer<'_> {
    fn next(&mut self) -> Option<Token> {
        self.skip();
        let start = self.at;
        let line = self.line;
        let first = *self.bytes.get(start)?;
        let kind = match first {
            b'\n' | b'\r' => self.line_end(first),
            _ if self.is_name_start(first) => {
                self.while_byte(Self::is_in_name);
                Kind::Name
            }
            b'0'..=b'9' | b'.' if self.is_number() => self.number(),
            _ if first == self.dialect.text_quote => self.quoted(first, Kind::Text),
            _ if Some(first) == self.dialect.number_quote => self.quoted(first, Kind::Number),
            _ => {
                self.at += 1;
                Kind::Sign(first)
            }
        };
        self.at_line_start = kind == Kind::LineEnd;
        self.in_element = match kind {
            Kind::Sign(b'[') => self.dialect.comments_elements,
            Kind::Sign(b']') | Kind::LineEnd => false,
            _ => self.in_element,
        };
        let [start, end] = [start, self.at].map(|place| u32::try_from(place).unwrap_or(u32::MAX));
        Some(Token { kind, start, end, line })
    }

    /// Blanks, comments and header lines.
    fn skip(&mut self) {
        loop {
            self.while_byte(|_, byte| matches!(byte, b' ' | b'\t' | 0x0b | 0x0c | 0x1a | 0));
            let rest = &self.bytes[self.at..];
            let is_header = self.at_line_start
                && self.dialect.header.is_some_and(|begin| rest.starts_with(begin));
            if self.in_element && rest.starts_with(b":") {
                self.at += element_comment(rest);
                return;
            }
            if !is_header && !self.dialect.comments.iter().any(|begin| rest.starts_with(begin)) {
                return;
            }
            self.while_byte(|_, byte| byte != b'\n' && byte != b'\r');
        }
    }

    fn while_byte(&mut self, is: impl Fn(&Self, u8) -> bool) {
        while self.bytes.get(self.at).is_some_and(|byte| is(self, *byte)) {
            self.at += 1;
        }
    }

    /// CR LF, LF or CR.
    fn line_end(&mut self, first: u8) -> Kind {
        self.at += 1;
        if first == b'\r' && self.bytes.get(self.at) == Some(&b'\n') {
            self.at += 1;
        }
        self.line += 1;
        Kind::LineEnd
    }

    fn is_name_start(&self, byte: u8) -> bool {
        byte.is_ascii_alphabetic() || byte >= 0x80 || self.dialect.in_names.contains(&byte)
    }

    fn is_in_name(&self, byte: u8) -> bool {
        self.is_name_start(byte) || byte.is_ascii_digit()
    }

    fn is_number(&self) -> bool {
        let second = self.bytes.get(self.at + 1);
        self.bytes[self.at] != b'.' || second.is_some_and(u8::is_ascii_digit)
    }

    fn number(&mut self) -> Kind {
        let digits = |lexer: &mut Self| lexer.while_byte(|_, byte| byte.is_ascii_digit());
        digits(self);
        if self.bytes.get(self.at) == Some(&b'.') {
            self.at += 1;
            digits(self);
        }
        let exponent = match self.bytes[self.at..] {
            [b'e' | b'E', b'+' | b'-', b'0'..=b'9', ..] => 2,
            [b'e' | b'E', b'0'..=b'9', ..] => 1,
            _ => 0,
        };
        if exponent > 0 {
            self.at += exponent;
            digits(self);
        }
        Kind::Number
    }

    fn quoted(&mut self, quote: u8, kind: Kind) -> Kind {
        self.at += 1;
        self.while_byte(|_, byte| byte != quote && byte != b'\n' && byte != b'\r');
        if self.bytes.get(self.at) != Some(&quote) {
            return Kind::OpenText;
        }
        self.at += 1;
        kind
    }
}

/// The length of the comment of an element, up to its bracket: of one in quotes the bracket behind these.
fn element_comment(rest: &[u8]) -> usize {
    let line = rest.split(|byte| matches!(byte, b'\n' | b'\r')).next().unwrap_or_default();
    let quoted =
        line.windows(2).position(|own| own == b"\"]").filter(|_| line[1..].starts_with(b"\""));
    let plain = || line.iter().position(|byte| *byte == b']');
    quoted.map(|end| end + 1).or_else(plain).unwrap_or(line.len())
}

/// A name in capitals, as dialects compare names; one that is no UTF-8 is of Latin-1, so that no two names become one.
pub fn capitals(bytes: &[u8]) -> String {
    let capital = |letter: char| {
        let mut all = letter.to_uppercase();
        // ß has none of one letter.
        if all.len() == 1 { all.next().unwrap_or(letter) } else { letter }
    };
    match std::str::from_utf8(bytes) {
        Ok(text) => text.chars().map(capital).collect(),
        Err(_) => bytes.iter().map(|byte| capital(char::from(*byte))).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KRL: Dialect = crate::krl::KRL;

    fn kinds(text: &[u8]) -> Vec<(Kind, String)> {
        let shown =
            |token: Token| (token.kind, String::from_utf8_lossy(&text[token.span()]).into_owned());
        tokens(text, &KRL).into_iter().map(shown).collect()
    }

    #[test]
    fn comments_headers_and_blanks_are_no_tokens() {
        let found = kinds(b"&ACCESS RVP\r\nLIN XP1 C_DIS ; {X 1}\r\n");
        let names = ["LIN", "XP1", "C_DIS"].map(|name| (Kind::Name, name.to_owned()));
        let end = (Kind::LineEnd, "\r\n".to_owned());
        let [lin, point, zone] = names;
        assert_eq!(found, [end.clone(), lin, point, zone, end]);
    }

    #[test]
    fn numbers_have_no_sign_and_may_have_an_exponent() {
        let found = kinds(b"-1.5e+3 .5 7. 2E9 'B01'");
        let numbers: Vec<&str> =
            found.iter().filter(|own| own.0 == Kind::Number).map(|own| own.1.as_str()).collect();
        assert_eq!(numbers, ["1.5e+3", ".5", "7.", "2E9", "'B01'"]);
        assert_eq!(found[0].0, Kind::Sign(b'-'));
    }

    #[test]
    fn a_text_that_does_not_end_ends_with_its_line() {
        let found = kinds(b"\"a;b\nX");
        assert_eq!(found[0].0, Kind::OpenText);
        assert_eq!(found[2], (Kind::Name, "X".to_owned()));
    }

    #[test]
    fn bytes_of_any_encoding_stay_inside_names_texts_and_comments() {
        let found = kinds(b"\xef\xbb\xbfDEF \x83\x5c ; \x83\x7b\n");
        assert_eq!(found[0], (Kind::Name, "DEF".to_owned()));
        assert_eq!(found.last().map(|own| own.0), Some(Kind::LineEnd));
    }

    #[test]
    fn names_of_other_letters_are_other_names_in_any_encoding() {
        for text in ["Part_\u{e4}\u{df}", "part_\u{c4}\u{df}"] {
            let latin: Vec<u8> =
                text.chars().map(|letter| u8::try_from(u32::from(letter)).unwrap()).collect();
            assert_eq!(capitals(text.as_bytes()), "PART_\u{c4}\u{df}");
            assert_eq!(capitals(&latin), "PART_\u{c4}\u{df}");
        }
        assert_ne!(capitals(b"w\xe4"), capitals(b"w\xf6"));
    }

    #[test]
    fn lines_are_counted_with_any_end() {
        let lines: Vec<u32> = tokens(b"A\rB\r\nC\nD", &KRL)
            .iter()
            .filter(|token| token.kind == Kind::Name)
            .map(|token| token.line)
            .collect();
        assert_eq!(lines, [1, 2, 3, 4]);
    }
}
