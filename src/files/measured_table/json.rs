//! JSON and JSON lines → values.

use super::number::Numbers;
use super::tree::{Document, Keys, MOST_LEVELS, MOST_NODES, Map, Node};
use super::{Counted, Form, MeasuredTable, MeasuredTableErrorKind, Result, decoded, tree};

pub(super) fn read(bytes: &[u8], form: &Form) -> Result<MeasuredTable> {
    let decoded = decoded::decode(bytes)?;
    let mut parser = Parser {
        text: &decoded.text,
        at: 0,
        line: 1,
        keys: Keys::default(),
        numbers: Numbers::default(),
        nodes: 0,
    };
    let mut roots = Vec::new();
    while parser.peek().is_some() {
        roots.push((parser.line, parser.value(MOST_LEVELS)?));
    }
    if roots.is_empty() {
        return Err(MeasuredTableErrorKind::Empty);
    }
    let counted = Counted::Record;
    tree::table(&Document { roots, counted }, form)
}

struct Parser<'t> {
    text: &'t str,
    at: usize,
    line: u64,
    keys: Keys,
    numbers: Numbers,
    nodes: usize,
}

impl Parser<'_> {
    fn peek(&mut self) -> Option<u8> {
        let bytes = self.text.as_bytes();
        while let Some(&byte) = bytes.get(self.at) {
            match byte {
                b'\n' => self.line += 1,
                b' ' | b'\t' | b'\r' => {}
                _ => return Some(byte),
            }
            self.at += 1;
        }
        None
    }

    fn take_if(&mut self, sign: u8) -> bool {
        let is = self.peek() == Some(sign);
        self.at += usize::from(is);
        is
    }

    fn expect(&mut self, sign: u8, wanted: &'static str) -> Result<()> {
        if self.take_if(sign) { Ok(()) } else { Err(self.wrong(wanted)) }
    }

    fn wrong(&self, problem: &'static str) -> MeasuredTableErrorKind {
        let before = self.text.get(..self.at).unwrap_or(self.text);
        let line = before.rsplit('\n').next().unwrap_or_default();
        MeasuredTableErrorKind::Json { line: self.line, column: line.chars().count() + 1, problem }
    }

    fn value(&mut self, levels: usize) -> Result<Node> {
        self.nodes += 1;
        if self.nodes > MOST_NODES {
            return Err(MeasuredTableErrorKind::TooManyCells);
        }
        let Some(levels) = levels.checked_sub(1) else {
            return Err(self.wrong("values are nested too deeply"));
        };
        match self.peek() {
            Some(b'{') => self.map(levels).map(Node::Map),
            Some(b'[') => self.list(levels).map(Node::List),
            Some(b'"') => self.string().map(|text| Node::Text(text.into())),
            Some(_) => self.word(),
            None => Err(self.wrong("a value is missing at the end")),
        }
    }

    fn map(&mut self, levels: usize) -> Result<Map> {
        self.at += 1;
        let mut map = Map { line: self.line, members: Vec::new() };
        if self.take_if(b'}') {
            return Ok(map);
        }
        loop {
            if self.peek() != Some(b'"') {
                return Err(self.wrong("a key in quotes is missing"));
            }
            let key = self.string()?;
            let key = self.keys.one(&key);
            self.expect(b':', "a colon is missing")?;
            map.members.push((key, self.value(levels)?));
            if !self.take_if(b',') {
                self.expect(b'}', "a comma or a brace is missing")?;
                return Ok(map);
            }
        }
    }

    fn list(&mut self, levels: usize) -> Result<Vec<Node>> {
        self.at += 1;
        let mut list = Vec::new();
        if self.take_if(b']') {
            return Ok(list);
        }
        loop {
            list.push(self.value(levels)?);
            if !self.take_if(b',') {
                self.expect(b']', "a comma or a bracket is missing")?;
                return Ok(list);
            }
        }
    }

    fn word(&mut self) -> Result<Node> {
        let rest = &self.text[self.at..];
        let is_part = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'-' | b'.');
        let length = rest.bytes().position(|byte| !is_part(byte)).unwrap_or(rest.len());
        let word = &rest[..length];
        let node = match word {
            "null" => Node::Blank,
            "true" | "false" => Node::Text(word.into()),
            _ => match self.numbers.parse(word.as_bytes()) {
                Some(number) => Node::Number(number),
                // A number that no double holds.
                None if is_number(word) => Node::Text(word.into()),
                None => return Err(self.wrong("no value of JSON stands here")),
            },
        };
        self.at += length;
        Ok(node)
    }

    fn string(&mut self) -> Result<String> {
        self.at += 1;
        let mut text = String::new();
        loop {
            let rest = &self.text[self.at..];
            let Some(stop) = rest.find(['"', '\\']) else {
                return Err(self.wrong("a string is never closed"));
            };
            text.push_str(&rest[..stop]);
            self.line += rest[..stop].bytes().filter(|&byte| byte == b'\n').count() as u64;
            let is_end = rest.as_bytes()[stop] == b'"';
            self.at += stop + 1;
            if is_end {
                return Ok(text);
            }
            text.push(self.escape()?);
        }
    }

    fn escape(&mut self) -> Result<char> {
        let sign = self.text.as_bytes().get(self.at).copied();
        self.at += 1;
        Ok(match sign {
            Some(sign @ (b'"' | b'\\' | b'/')) => char::from(sign),
            Some(b'b') => '\u{8}',
            Some(b'f') => '\u{c}',
            Some(b'n') => '\n',
            Some(b'r') => '\r',
            Some(b't') => '\t',
            Some(b'u') => return self.code(),
            _ => {
                self.at -= 1;
                return Err(self.wrong("a backslash stands before no sign of JSON"));
            }
        })
    }

    /// The character of four digits, or of two times four.
    fn code(&mut self) -> Result<char> {
        let first = self.four()?;
        if !(0xd800..0xdc00).contains(&first) || !self.text[self.at..].starts_with("\\u") {
            return Ok(char::from_u32(first.into()).unwrap_or(char::REPLACEMENT_CHARACTER));
        }
        self.at += 2;
        let second = self.four()?;
        let mut pair = char::decode_utf16([first, second]);
        let found = pair.next().and_then(Result::ok);
        Ok(found.unwrap_or(char::REPLACEMENT_CHARACTER))
    }

    fn four(&mut self) -> Result<u16> {
        let digits = self.text.get(self.at..self.at + 4);
        let is_code = |text: &&str| text.bytes().all(|byte| byte.is_ascii_hexdigit());
        let code = digits.filter(is_code).and_then(|text| u16::from_str_radix(text, 16).ok());
        let code = code.ok_or_else(|| self.wrong("four hexadecimal digits are missing"))?;
        self.at += 4;
        Ok(code)
    }
}

fn is_number(word: &str) -> bool {
    word.starts_with(|c: char| c.is_ascii_digit() || c == '-') && word.parse::<f64>().is_ok()
}
