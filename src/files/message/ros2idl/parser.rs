//! Words and characters → structs, typedefs and constants with their scopes.

use std::collections::BTreeMap;

use super::tokens::{Token, tokens};
use crate::message::{Extensibility, FieldType, Primitive, SchemaError, Shape};

const MOST_LEVELS: usize = 32;

#[derive(Debug, Default)]
pub(super) struct Parsed {
    pub(super) structs: Vec<Struct>,
    pub(super) aliases: BTreeMap<String, Alias>,
    constants: BTreeMap<String, u32>,
}

#[derive(Debug)]
pub(super) struct Struct {
    pub(super) scope: Vec<String>,
    pub(super) name: String,
    pub(super) members: Vec<Member>,
    pub(super) extensibility: Extensibility,
}

#[derive(Debug)]
pub(super) struct Member {
    pub(super) line: usize,
    pub(super) name: String,
    pub(super) of: RawType,
    pub(super) shape: Shape,
}

#[derive(Debug)]
pub(super) struct Alias {
    pub(super) scope: Vec<String>,
    pub(super) of: RawType,
    pub(super) shape: Shape,
}

#[derive(Debug, Clone)]
pub(super) enum RawType {
    Known(FieldType),
    Named(String),
    Sequence(Box<RawType>),
}

pub(super) fn parse(text: &str) -> Result<Parsed, SchemaError> {
    let tokens = tokens(text);
    let mut parser =
        Parser { tokens: &tokens, at: 0, scope: Vec::new(), parsed: Parsed::default() };
    while parser.peek().is_some() {
        parser.declaration()?;
    }
    Ok(parser.parsed)
}

struct Parser<'t> {
    tokens: &'t [Token<'t>],
    at: usize,
    scope: Vec<String>,
    parsed: Parsed,
}

impl<'t> Parser<'t> {
    fn peek(&self) -> Option<&'t str> {
        self.tokens.get(self.at).map(|token| token.text)
    }

    fn next(&mut self) -> &'t str {
        let text = self.peek().unwrap_or("");
        self.at += 1;
        text
    }

    fn take_if(&mut self, text: &str) -> bool {
        let is = self.peek() == Some(text);
        self.at += usize::from(is);
        is
    }

    fn expect(&mut self, text: &str) -> Result<(), SchemaError> {
        if self.take_if(text) {
            Ok(())
        } else {
            self.at += 1;
            Err(self.wrong())
        }
    }

    fn line(&self) -> usize {
        let token = self.tokens.get(self.at).or(self.tokens.last());
        token.map_or(1, |token| token.line)
    }

    fn wrong(&self) -> SchemaError {
        let at = self.at.saturating_sub(1);
        let found = self.tokens.get(at).map_or("the end of the text", |token| token.text);
        let line = self.tokens.get(at).or(self.tokens.last());
        SchemaError::Idl {
            line: line.map_or(1, |token| token.line),
            found: format!("{:?}", found.chars().take(80).collect::<String>()),
        }
    }

    fn name(&mut self) -> Result<String, SchemaError> {
        let name = self.next();
        if name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') && !name.contains(':') {
            Ok(name.to_owned())
        } else {
            Err(self.wrong())
        }
    }

    fn full(&self, name: &str) -> String {
        [&self.scope[..], &[name.to_owned()]].concat().join("::")
    }

    fn declaration(&mut self) -> Result<(), SchemaError> {
        let extensibility = self.annotations()?;
        match self.next() {
            "module" => self.module(),
            "const" => self.constant(),
            "typedef" => self.typedef(),
            "struct" => self.structure(extensibility),
            ";" => Ok(()),
            // The end of a module.
            "}" if self.scope.pop().is_some() => Ok(()),
            _ => Err(self.wrong()),
        }
    }

    fn module(&mut self) -> Result<(), SchemaError> {
        let name = self.name()?;
        if self.scope.len() >= MOST_LEVELS {
            return Err(self.wrong());
        }
        self.scope.push(name);
        self.expect("{")
    }

    /// Reads annotations; only those that change how a message is stored have an effect.
    fn annotations(&mut self) -> Result<Extensibility, SchemaError> {
        let mut extensibility = Extensibility::Unstated;
        while self.take_if("@") {
            let name = self.next();
            if name == "optional" {
                let mut error = self.wrong();
                if let SchemaError::Idl { found, .. } = &mut error {
                    "@optional, which changes how a message is stored".clone_into(found);
                }
                return Err(error);
            }
            let arguments = self.arguments()?;
            extensibility = match (name, arguments) {
                ("final", _) | ("extensibility", Some("FINAL")) => Extensibility::Final,
                ("appendable", _) | ("extensibility", Some("APPENDABLE")) => {
                    Extensibility::Appendable
                }
                ("mutable", _) | ("extensibility", Some("MUTABLE")) => Extensibility::Mutable,
                _ => extensibility,
            };
        }
        Ok(extensibility)
    }

    /// Reads the contents of parentheses; returns the last word.
    fn arguments(&mut self) -> Result<Option<&'t str>, SchemaError> {
        if !self.take_if("(") {
            return Ok(None);
        }
        let (mut open, mut last) = (1, None);
        while open > 0 {
            match self.next() {
                "" => return Err(self.wrong()),
                "(" => open += 1,
                ")" => open -= 1,
                word => last = Some(word),
            }
        }
        Ok(last)
    }

    fn constant(&mut self) -> Result<(), SchemaError> {
        let mut words = Vec::new();
        loop {
            match self.next() {
                "" => return Err(self.wrong()),
                ";" => break,
                word => words.push(word),
            }
        }
        if let [.., name, "=", value] = words[..]
            && let Ok(value) = value.parse()
        {
            let name = self.full(name);
            self.parsed.constants.insert(name, value);
        }
        Ok(())
    }

    fn typedef(&mut self) -> Result<(), SchemaError> {
        let of = self.type_spec(0)?;
        for (_, name, shape) in self.declarators()? {
            let (scope, of) = (self.scope.clone(), of.clone());
            self.parsed.aliases.insert(self.full(&name), Alias { scope, of, shape });
        }
        Ok(())
    }

    fn structure(&mut self, extensibility: Extensibility) -> Result<(), SchemaError> {
        let name = self.name()?;
        // A base type (`:`) would put its fields first; ROS 2 has none.
        self.expect("{")?;
        let mut members = Vec::new();
        while !self.take_if("}") {
            self.annotations()?;
            let of = self.type_spec(0)?;
            for (line, name, shape) in self.declarators()? {
                let of = of.clone();
                members.push(Member { line, name, of, shape });
            }
        }
        self.expect(";")?;
        let scope = self.scope.clone();
        self.parsed.structs.push(Struct { scope, name, members, extensibility });
        Ok(())
    }

    /// `a, b[3];`
    fn declarators(&mut self) -> Result<Vec<(usize, String, Shape)>, SchemaError> {
        let mut found = Vec::new();
        loop {
            let line = self.line();
            let name = self.name()?;
            let mut shape = Shape::One;
            while self.take_if("[") {
                let more = self.length()?;
                let count = if let Shape::Fixed(count) = shape { count } else { 1 };
                shape = Shape::Fixed(count.checked_mul(more).ok_or_else(|| self.wrong())?);
                self.expect("]")?;
            }
            found.push((line, name, shape));
            if !self.take_if(",") {
                self.expect(";")?;
                return Ok(found);
            }
        }
    }

    /// A number, or a constant in this scope or one around it.
    fn length(&mut self) -> Result<u32, SchemaError> {
        let text = self.next();
        let length = text.parse().ok().or_else(|| {
            let mut candidates = super::candidates(text, &self.scope);
            candidates.find_map(|name| self.parsed.constants.get(&name).copied())
        });
        length.filter(|&length| length > 0).ok_or_else(|| self.wrong())
    }

    fn type_spec(&mut self, level: usize) -> Result<RawType, SchemaError> {
        let primitive = |of| Ok(RawType::Known(FieldType::Primitive(of)));
        match self.next() {
            "boolean" => primitive(Primitive::Bool),
            "octet" | "char" | "uint8" => primitive(Primitive::U8),
            "int8" => primitive(Primitive::I8),
            "short" | "int16" => primitive(Primitive::I16),
            "uint16" => primitive(Primitive::U16),
            "uint32" => primitive(Primitive::U32),
            "int64" => primitive(Primitive::I64),
            "uint64" => primitive(Primitive::U64),
            "float" => primitive(Primitive::F32),
            "double" => primitive(Primitive::F64),
            "unsigned" => {
                let unsigned = [Primitive::U16, Primitive::U32, Primitive::U64];
                self.integer(unsigned).and_then(primitive)
            }
            "long" if self.take_if("double") => {
                Err(SchemaError::UnknownType { name: "long double".to_owned() })
            }
            "long" if self.take_if("long") => primitive(Primitive::I64),
            "long" | "int32" => primitive(Primitive::I32),
            "string" => self.bounded(FieldType::Text),
            "wstring" => self.bounded(FieldType::WideText),
            "sequence" if level < MOST_LEVELS => {
                self.expect("<")?;
                let element = self.type_spec(level + 1)?;
                if self.take_if(",") {
                    self.next();
                }
                self.expect(">")?;
                Ok(RawType::Sequence(Box::new(element)))
            }
            "wchar" | "union" | "enum" | "map" | "sequence" | "any" | "fixed" => Err(self.wrong()),
            name if name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_' || c == ':') => {
                Ok(RawType::Named(name.to_owned()))
            }
            _ => Err(self.wrong()),
        }
    }

    fn integer(&mut self, sizes: [Primitive; 3]) -> Result<Primitive, SchemaError> {
        match self.next() {
            "short" => Ok(sizes[0]),
            "long" if self.take_if("long") => Ok(sizes[2]),
            "long" => Ok(sizes[1]),
            _ => Err(self.wrong()),
        }
    }

    /// A bound does not change how a string is stored.
    fn bounded(&mut self, of: FieldType) -> Result<RawType, SchemaError> {
        if self.take_if("<") {
            self.next();
            self.expect(">")?;
        }
        Ok(RawType::Known(of))
    }
}
