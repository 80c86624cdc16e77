//! Values written in a program, as trees that keep where each number stands: `{X 1, CM {X 0}}` of KRL, `[[1, 2], 9E9]` of
//! RAPID.

use std::ops::Range;

use crate::lex::{Kind, Token, capitals};

/// A tenth of a micrometre and less is nothing to a controller, whose numbers are single precision.
pub const MM_DECIMALS: usize = 4;
/// 1e-5° at 2 m is a third of a micrometre.
pub const DEGREE_DECIMALS: usize = 5;

#[derive(Debug, Clone, PartialEq)]
pub struct Number {
    /// With its sign.
    pub span: Range<usize>,
    /// mm or degrees, where it is of a position.
    pub value: f64,
    /// The value of one that is written.
    pub unit: f64,
    /// Digits behind the point.
    pub decimals: usize,
    /// Whether it is in a form other than decimal digits: with an exponent, or of another base.
    pub is_special: bool,
    /// Whether its sign or point alone parts it from a name: `A1-90`, `C.5`.
    pub is_glued: bool,
}

impl Number {
    /// As one of bits; `None` for any other.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole and small")]
    pub fn byte(&self) -> Option<u8> {
        let is_byte = self.value.fract() == 0.0 && (0.0..256.0).contains(&self.value);
        is_byte.then_some(self.value as u8)
    }
}

#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    Number(Number),
    /// A name, with its element where one is named: `P10`, `BASE_DATA[1]`, `#TCP` as `#TCP`.
    Name(String),
    /// `[…]` of RAPID.
    List(Vec<Value>),
    /// `{…}` of KRL.
    Fields {
        kind: Option<String>,
        fields: Vec<(String, Value)>,
    },
    Text,
    /// A value that the program computes when it runs.
    Expression,
}

/// Values nested deeper than this are not positions of any dialect.
const DEEPEST: usize = 12;

/// A position in a slice of tokens.
#[derive(Debug, Clone, Copy)]
pub struct Cursor<'t> {
    pub bytes: &'t [u8],
    pub tokens: &'t [Token],
}

impl<'t> Cursor<'t> {
    pub const fn new(bytes: &'t [u8], tokens: &'t [Token]) -> Self {
        Self { bytes, tokens }
    }

    pub fn text(&self, token: &Token) -> &'t [u8] {
        &self.bytes[token.span()]
    }

    pub fn first(&self) -> Option<&'t Token> {
        self.tokens.first()
    }

    /// Bytes from the first token to the last; empty without tokens.
    pub fn span(&self) -> Range<usize> {
        let ends = self.tokens.first().zip(self.tokens.last());
        ends.map_or(0..0, |(first, last)| first.span().start..last.span().end)
    }

    /// The line of the token that begins at a byte, or of the last before it.
    pub fn line_at(&self, byte: usize) -> Option<u32> {
        let behind = self.tokens.partition_point(|token| token.span().start <= byte);
        self.tokens.get(behind.checked_sub(1)?).map(|token| token.line)
    }

    pub fn is_empty(&self) -> bool {
        self.tokens.is_empty()
    }

    pub fn take(&mut self) -> Option<&'t Token> {
        let (first, rest) = self.tokens.split_first()?;
        self.tokens = rest;
        Some(first)
    }

    pub fn take_sign(&mut self, sign: u8) -> bool {
        let is = self.first().is_some_and(|token| token.is(sign));
        if is {
            self.take();
        }
        is
    }

    pub fn peek_name(&self) -> Option<String> {
        let token = self.first().filter(|token| token.kind == Kind::Name)?;
        Some(capitals(self.text(token)))
    }

    /// Whether one of these words, in capitals, is among its names.
    pub fn has_name(&self, words: &[&str]) -> bool {
        let mut names = self.tokens.iter().filter(|token| token.kind == Kind::Name);
        names.any(|token| {
            words.iter().any(|own| self.text(token).eq_ignore_ascii_case(own.as_bytes()))
        })
    }

    pub fn take_name(&mut self) -> Option<String> {
        let name = self.peek_name()?;
        self.take();
        Some(name)
    }

    pub fn take_word(&mut self, word: &str) -> bool {
        let is = self.peek_name().is_some_and(|name| name == word);
        if is {
            self.take();
        }
        is
    }

    /// A number with its sign.
    pub fn take_number(&mut self) -> Option<Number> {
        let mut ahead = *self;
        let mut first = ahead.take()?;
        let start = first.span().start;
        let is_negative = first.is(b'-');
        if is_negative || first.is(b'+') {
            first = ahead.take()?;
        }
        if first.kind != Kind::Number {
            return None;
        }
        let mut number = number(self.text(first), first.span())?;
        number.is_glued = start.checked_sub(1).is_some_and(|before| is_of_name(self.bytes[before]));
        number.span.start = start;
        if is_negative {
            number.value = -number.value;
        }
        *self = ahead;
        Some(number)
    }

    /// Everything up to a sign outside brackets, without it; the sign is taken too. `None` at the end.
    pub fn take_part(&mut self, until: u8) -> Option<Cursor<'t>> {
        if self.is_empty() {
            return None;
        }
        let (part, rest) = split(self.tokens, until);
        self.tokens = rest;
        Some(Cursor { bytes: self.bytes, tokens: part })
    }

    /// The value that all the tokens make.
    pub fn value(mut self) -> Value {
        let value = self.take_value(0);
        if self.is_empty() { value } else { Value::Expression }
    }

    fn take_value(&mut self, depth: usize) -> Value {
        if depth > DEEPEST {
            return Value::Expression;
        }
        if let Some(number) = self.take_number() {
            return Value::Number(number);
        }
        let Some(first) = self.first() else { return Value::Expression };
        match first.kind {
            Kind::Sign(b'[') => self.list(depth),
            Kind::Sign(b'{') => self.fields(depth),
            Kind::Text => {
                self.take();
                Value::Text
            }
            Kind::Sign(b'#') => {
                self.take();
                self.take_name().map_or(Value::Expression, |name| Value::Name(format!("#{name}")))
            }
            Kind::Name => self.element().map_or(Value::Expression, Value::Name),
            _ => Value::Expression,
        }
    }

    /// A name, with the numbers of its element: `P[2,3]`, `P{2}`.
    pub fn element(&mut self) -> Option<String> {
        let name = self.take_name()?;
        let close = match self.first().map(|token| token.kind) {
            Some(Kind::Sign(b'[')) => b']',
            Some(Kind::Sign(b'{')) => b'}',
            _ => return Some(name),
        };
        self.take();
        let mut indices = Vec::new();
        loop {
            let number = self.take_number()?;
            indices.push(format!("{}", number.value));
            if self.take_sign(close) {
                break;
            }
            if !self.take_sign(b',') {
                return None;
            }
        }
        Some(format!("{name}[{}]", indices.join(",")))
    }

    fn list(&mut self, depth: usize) -> Value {
        self.take();
        let mut values = Vec::new();
        loop {
            values.push(self.take_value(depth + 1));
            if self.take_sign(b']') {
                return Value::List(values);
            }
            if !self.take_sign(b',') {
                return Value::Expression;
            }
        }
    }

    fn fields(&mut self, depth: usize) -> Value {
        self.take();
        let mut ahead = *self;
        let kind = ahead.take_name().filter(|_| ahead.take_sign(b':'));
        if kind.is_some() {
            *self = ahead;
        }
        let mut fields = Vec::new();
        loop {
            let Some(name) = self.field_name() else { return Value::Expression };
            fields.push((name, self.take_value(depth + 1)));
            if self.take_sign(b'}') {
                return Value::Fields { kind, fields };
            }
            if !self.take_sign(b',') {
                return Value::Expression;
            }
        }
    }

    /// A component of KRL: `X`, `POINT2[]`.
    fn field_name(&mut self) -> Option<String> {
        let name = self.take_name()?;
        if self.take_sign(b'[') {
            while self.first().is_some_and(|token| !token.is(b']')) {
                self.take();
            }
            self.take_sign(b']');
        }
        Some(name)
    }
}

fn is_of_name(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_'
}

/// The tokens before a sign outside brackets, and those behind it.
fn split(tokens: &[Token], until: u8) -> (&[Token], &[Token]) {
    let mut depth = 0_i32;
    for (place, token) in tokens.iter().enumerate() {
        match token.kind {
            Kind::Sign(sign) if sign == until && depth == 0 => {
                return (&tokens[..place], &tokens[place + 1..]);
            }
            Kind::Sign(b'[' | b'{' | b'(') => depth += 1,
            Kind::Sign(b']' | b'}' | b')') => depth -= 1,
            _ => {}
        }
    }
    (tokens, &[])
}

fn number(text: &[u8], span: Range<usize>) -> Option<Number> {
    let text = std::str::from_utf8(text).ok()?;
    let of = |value, decimals, is_special| {
        Some(Number { span, value, unit: 1.0, decimals, is_special, is_glued: false })
    };
    if let Some(inside) = text.strip_prefix('\'') {
        return of(based(inside.strip_suffix('\'')?)?, 0, true);
    }
    let value: f64 = text.parse().ok().filter(|value: &f64| value.is_finite())?;
    let is_special = text.contains(['e', 'E']);
    let mantissa = text.split(['e', 'E']).next().unwrap_or(text);
    let decimals = mantissa.split_once('.').map_or(0, |(_, behind)| behind.len());
    of(value, decimals, is_special)
}

/// `B0101`, `H1F`.
fn based(text: &str) -> Option<f64> {
    let base = match text.as_bytes().first()? {
        b'B' | b'b' => 2,
        b'H' | b'h' => 16,
        _ => return None,
    };
    let digits = text.get(1..).filter(|digits| !digits.starts_with('+'))?;
    u32::from_str_radix(digits, base).ok().map(f64::from)
}

impl Value {
    pub fn first_number(&self) -> Option<&Number> {
        match self {
            Self::Number(number) => Some(number),
            Self::List(values) => values.iter().find_map(Self::first_number),
            Self::Fields { fields, .. } => fields.iter().find_map(|(_, own)| own.first_number()),
            Self::Name(_) | Self::Text | Self::Expression => None,
        }
    }

    /// Whether it has the same parts as another, wherever they are written.
    pub fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Number(own), Self::Number(other)) => own.value.total_cmp(&other.value).is_eq(),
            (Self::Name(own), Self::Name(other)) => own == other,
            (Self::List(own), Self::List(other)) => {
                own.len() == other.len()
                    && own.iter().zip(other).all(|(own, other)| own.is_same(other))
            }
            (Self::Fields { fields: own, .. }, Self::Fields { fields: other, .. }) => {
                let pairs = || own.iter().zip(other);
                own.len() == other.len()
                    && pairs().all(|(own, other)| own.0 == other.0 && own.1.is_same(&other.1))
            }
            (Self::Text, Self::Text) => true,
            _ => false,
        }
    }

    pub const fn number(&self) -> Option<&Number> {
        match self {
            Self::Number(number) => Some(number),
            _ => None,
        }
    }

    pub fn list(&self) -> Option<&[Self]> {
        match self {
            Self::List(values) => Some(values),
            _ => None,
        }
    }

    pub fn field(&self, name: &str) -> Option<&Self> {
        let Self::Fields { fields, .. } = self else { return None };
        fields.iter().find(|(own, _)| own == name).map(|(_, value)| value)
    }

    pub fn number_of(&self, name: &str) -> Option<&Number> {
        self.field(name)?.number()
    }

    /// The numbers of a list of exactly N numbers; `None` of any other value.
    pub fn numbers<const N: usize>(&self) -> Option<[&Number; N]> {
        let numbers: Option<Vec<&Number>> = self.list()?.iter().map(Self::number).collect();
        numbers?.try_into().ok()
    }
}

/// The letters of FANUC's `CONFIG`, each true for the first: F or N, D or U, B or T.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Letters {
    pub flip: bool,
    pub down: bool,
    pub back: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lex::tokens;

    fn value(text: &[u8]) -> Value {
        let tokens = tokens(text, &crate::krl::KRL);
        Cursor::new(text, &tokens).value()
    }

    #[test]
    fn an_aggregate_keeps_where_its_numbers_stand() {
        let text = b"{POS: x -1.50,Y 2E1, S 'B10', CM {X 0}, P2[] \" \"}";
        let found = value(text);
        let x = found.number_of("X").expect("X");
        assert_eq!((&text[x.span.clone()], x.decimals, x.is_special), (&b"-1.50"[..], 2, false));
        assert!(found.number_of("Y").expect("Y").is_special);
        assert!((found.number_of("S").expect("S").value - 2.0).abs() < 1e-12);
        assert!(matches!(&found, Value::Fields { kind: Some(kind), .. } if kind == "POS"));
    }

    #[test]
    fn what_is_worked_out_is_an_expression() {
        for text in ["{X a+1}", "{X 1 Y 2}", "[1,2", "1+2", "{X 1}:P", "[[1],", "{}"] {
            assert_eq!(value(text.as_bytes()), Value::Expression, "{text}");
        }
        let deep = vec![b'['; 100_000];
        assert_eq!(value(&deep), Value::Expression);
    }

    #[test]
    fn elements_are_named_with_their_numbers() {
        assert_eq!(value(b"p [ 1, 2 ]"), Value::Name("P[1,2]".to_owned()));
        assert_eq!(value(b"p[i]"), Value::Expression);
        assert_eq!(value(b"#tcp"), Value::Name("#TCP".to_owned()));
    }
}
