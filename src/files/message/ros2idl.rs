//! `ros2idl`: concatenated `.idl` texts as recorders embed them → [`Definition`].
//!
//! The part of OMG IDL 4.2 that ROS 2 generates (ROS 2 design, "IDL - interface definition and language mapping").
//! Sections are separated by lines of `=` and begin with `IDL: package/msg/Type`; each repeats its modules. Unions,
//! enums, maps and optional members are refused: their layout in a message would have to be guessed.

mod parser;
mod tokens;

use std::collections::BTreeMap;

use super::rosmsg::{placeholder, short_name};
use super::{Definition, Field, FieldType, MessageType, SchemaError, Serialization, Shape};
use parser::{Parsed, RawType, Struct};

const MOST_ALIASES: usize = 16;

/// Types that recorders may leave out of the text.
const BUILT_IN: &str = "module builtin_interfaces { module msg {
    struct Time { int32 sec; uint32 nanosec; };
    struct Duration { int32 sec; uint32 nanosec; };
}; };";

pub fn parse(name: &str, text: &str) -> Result<Definition, SchemaError> {
    let mut parsed = parser::parse(text)?;
    let wanted = short_name(name);
    let root = parsed
        .structs
        .iter()
        .position(|found| found.short_name() == wanted)
        .ok_or_else(|| SchemaError::UnknownType { name: name.to_owned() })?;
    parsed.structs.swap(0, root);
    for built_in in parser::parse(BUILT_IN)?.structs {
        if !parsed.structs.iter().any(|found| found.short_name() == built_in.short_name()) {
            parsed.structs.push(built_in);
        }
    }
    let structs = parsed.structs.iter().enumerate();
    let structs: BTreeMap<_, _> = structs.map(|(i, found)| (found.full_name(), i)).collect();
    let types = parsed.structs.iter().map(|found| resolve(found, &structs, &parsed));
    let types = types.collect::<Result<_, _>>()?;
    Ok(Definition { types, serialization: Serialization::Cdr })
}

fn resolve(
    found: &Struct,
    structs: &BTreeMap<String, usize>,
    parsed: &Parsed,
) -> Result<MessageType, SchemaError> {
    let mut fields = Vec::new();
    for member in &found.members {
        let (of, shape) = resolve_type(&member.of, &found.scope, structs, parsed, MOST_ALIASES)?;
        fields.push(Field {
            name: member.name.clone(),
            of,
            shape: nest(member.shape, shape).ok_or_else(|| SchemaError::Idl {
                line: member.line,
                found: format!("{:?}, an array of arrays of unfixed length", member.name),
            })?,
        });
    }
    if fields.is_empty() {
        fields.push(placeholder());
    }
    Ok(MessageType { name: found.short_name(), fields, extensibility: found.extensibility })
}

fn resolve_type(
    of: &RawType,
    scope: &[String],
    structs: &BTreeMap<String, usize>,
    parsed: &Parsed,
    aliases_left: usize,
) -> Result<(FieldType, Shape), SchemaError> {
    let name = match of {
        RawType::Known(known) => return Ok((*known, Shape::One)),
        RawType::Named(name) => name,
        RawType::Sequence(element) => {
            let (of, shape) = resolve_type(element, scope, structs, parsed, aliases_left)?;
            return match shape {
                Shape::One => Ok((of, Shape::Sequence)),
                _ => Err(SchemaError::UnknownType { name: "sequence of sequences".to_owned() }),
            };
        }
    };
    let unknown = || SchemaError::UnknownType { name: name.clone() };
    for candidate in candidates(name, scope) {
        if let Some(&index) = structs.get(&candidate) {
            return Ok((FieldType::Message(index), Shape::One));
        }
        if let Some(alias) = parsed.aliases.get(&candidate) {
            let left = aliases_left.checked_sub(1).ok_or_else(unknown)?;
            let (of, shape) = resolve_type(&alias.of, &alias.scope, structs, parsed, left)?;
            let shape = nest(alias.shape, shape).ok_or_else(unknown)?;
            return Ok((of, shape));
        }
    }
    Err(unknown())
}

/// The full names that a name may mean: in the scope that uses it, then in those around it.
fn candidates<'a>(name: &'a str, scope: &'a [String]) -> impl Iterator<Item = String> + 'a {
    let (name, depth) = match name.strip_prefix("::") {
        Some(absolute) => (absolute, 0),
        None => (name, scope.len()),
    };
    (0..=depth).rev().map(move |depth| {
        let mut parts = scope[..depth].to_vec();
        parts.push(name.to_owned());
        parts.join("::")
    })
}

/// `outer` elements, each of which is `inner`: arrays of fixed length are stored one after another.
const fn nest(outer: Shape, inner: Shape) -> Option<Shape> {
    match (outer, inner) {
        (shape, Shape::One) | (Shape::One, shape) => Some(shape),
        (Shape::Fixed(a), Shape::Fixed(b)) => match a.checked_mul(b) {
            Some(count) => Some(Shape::Fixed(count)),
            None => None,
        },
        _ => None,
    }
}

impl Struct {
    fn full_name(&self) -> String {
        [&self.scope[..], std::slice::from_ref(&self.name)].concat().join("::")
    }

    fn short_name(&self) -> String {
        short_name(&self.full_name().replace("::", "/"))
    }
}

#[cfg(test)]
mod tests {
    use super::super::Extensibility;
    use super::*;

    /// A text as rosidl writes it, with a constants module, a typedef for a fixed array and annotations.
    const TEXT: &str = r#"
================================================================================
IDL: demo/msg/Reading
// generated from rosidl_adapter/resource/msg.idl.em
#include "std_msgs/msg/Header.idl"

module demo {
  module msg {
    typedef double double__9[9];
    typedef demo::msg::Inner demo__msg__Inner__2[2];
    module Reading_Constants {
      @verbatim (language="comment", text="a ; b } \"quoted\"")
      const uint8 LASER = 1;
      const string NOTE = "struct { ; }";
      const double LIMIT = -1.5e-3;
    };
    @verbatim (language="comment", text=
      "first" "\n"
      "second ) { struct")
    @final
    struct Reading {
      std_msgs::msg::Header header;
      @verbatim (language="comment", text="x;") @unit (value="m")
      @default (value=-0.5)
      double x;
      float y, z;
      double__9 covariance;
      demo__msg__Inner__2 pair;
      sequence<Inner, 3> some;
      sequence<double> many;
      sequence<string<5>> names;
      string<10> word;
      wstring wide;
      octet o; boolean b; char c; int8 i8; uint8 u8; short s; unsigned short us; long l; unsigned long ul;
      long long ll; unsigned long long ull; int64 i64; uint64 u64;
      float grid[2][3];
    };
  };
};

================================================================================
IDL: std_msgs/msg/Header
module std_msgs { module msg { struct Header { builtin_interfaces::msg::Time stamp; string frame_id; }; }; };
================================================================================
IDL: demo/msg/Inner
module demo { module msg { struct Inner { }; }; };
"#;

    fn fields(definition: &Definition) -> Vec<String> {
        let fields = definition.types[0].fields.iter();
        fields.map(|field| format!("{} {field}", field.name)).collect()
    }

    #[test]
    fn what_rosidl_writes_is_read() {
        for text in [TEXT.to_owned(), TEXT.replace('\n', "\r\n")] {
            for name in ["demo/msg/Reading", "demo/Reading"] {
                let definition = parse(name, &text).expect("sound text");
                assert_eq!(
                    fields(&definition).join(", "),
                    "header message, x f64, y f32, z f32, covariance f64[9], pair message[2], some message[], \
                     many f64[], names string[], word string, wide wstring, o u8, b bool, c u8, i8 i8, u8 u8, s i16, \
                     us u16, l i32, ul u32, ll i64, ull u64, i64 i64, u64 u64, grid f32[6]"
                );
                assert_eq!(definition.types[0].extensibility, Extensibility::Final);
                let FieldType::Message(header) = definition.types[0].fields[0].of else {
                    panic!("header is a message")
                };
                assert_eq!(definition.types[header].name, "std_msgs/Header");
                // Left out of the text, and built in.
                let FieldType::Message(time) = definition.types[header].fields[0].of else {
                    panic!("stamp is a message")
                };
                assert_eq!(definition.types[time].fields.len(), 2);
                // Empty, so it carries the placeholder byte.
                let FieldType::Message(inner) = definition.types[0].fields[5].of else {
                    panic!("pair is of messages")
                };
                assert_eq!(definition.types[inner].fields.len(), 1);
            }
        }
    }

    #[test]
    fn what_cannot_be_read_is_named_with_its_line() {
        let within = |members: &str| {
            let text = format!("module a {{ module msg {{\nstruct B {{\n{members}\n}};\n}};}};");
            parse("a/msg/B", &text).expect_err("refused").to_string()
        };
        for (members, said) in [
            ("double x", "line 4"),
            ("union U x;", "line 3"),
            ("long double x;", "long double"),
            ("@optional double x;", "@optional"),
            ("C c;", "\"C\""),
            ("sequence<sequence<double>> x;", "sequence of sequences"),
            ("map<string, double> x;", "line 3"),
            ("double x[0];", "line 3"),
            ("double x[N];", "line 3"),
            ("wchar x;", "wchar"),
            ("sequence<double> x[3];", "arrays of unfixed length"),
        ] {
            assert!(within(members).contains(said), "{members}: {}", within(members));
        }
        let nothing = parse("a/B", "").expect_err("no struct").to_string();
        assert!(nothing.contains("\"a/B\""), "{nothing}");
        let endless = format!("{}struct", "module m { ".repeat(100_000));
        assert!(parse("a/B", &endless).is_err(), "no end, and no overflow either");
        let circle = "module a { typedef B C; typedef C B; struct D { B b; }; };";
        assert!(parse("a/D", circle).is_err());
        let deep = format!("struct D {{ {}", "sequence<".repeat(100_000));
        assert!(parse("D", &deep).is_err());
    }
}
