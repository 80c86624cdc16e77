//! `ros2msg` and `ros1msg`: concatenated `.msg` texts as recorders embed them → [`Definition`]. Sections are separated
//! by lines of `=`; each except the first begins with `MSG: package/Type`. A `T` alone belongs to the package of the
//! type that uses it. Sources: ROS 2 documentation, "About ROS 2 interfaces"; ROS 1 wiki, "msg"; MCAP registry of
//! well-known schema encodings.

use std::collections::BTreeMap;

use super::{
    Definition, Extensibility, Field, FieldType, MessageType, Parsed, Primitive, SchemaError,
    Serialization, Shape,
};

/// Types that recorders may leave out of the text.
const BUILT_IN: [(&str, &str); 2] = [
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec\n"),
];

/// Types of ROS 1 that need no text; that of the header has the name of another package in the oldest recordings.
const BUILT_IN_ROS_1: [(&str, &str); 3] = [
    ("time", "uint32 secs\nuint32 nsecs\n"),
    ("duration", "int32 secs\nint32 nsecs\n"),
    ("std_msgs/Header", "uint32 seq\ntime stamp\nstring frame_id\n"),
];

struct RawField {
    type_name: String,
    name: String,
    shape: Shape,
}

struct Section {
    name: String,
    fields: Vec<RawField>,
}

pub fn parse(name: &str, text: &str, serialization: Serialization) -> Parsed<Definition> {
    let mut sections = sections(name, text)?;
    add_built_in(&mut sections, serialization)?;
    let indices = sections.iter().enumerate().rev();
    // Where a type is defined twice the first definition counts.
    let indices: BTreeMap<_, _> = indices.map(|(i, section)| (section.name.as_str(), i)).collect();
    let types = sections.iter().map(|section| resolve(section, &indices, serialization));
    Ok(Definition { types: types.collect::<Result<_, _>>()?, serialization })
}

/// The field that rosidl puts into a message without fields.
pub(super) fn placeholder() -> Field {
    let name = "structure_needs_at_least_one_member".to_owned();
    Field { name, of: FieldType::Primitive(Primitive::U8), shape: Shape::One }
}

pub fn short_name(name: &str) -> String {
    let name = name.trim().trim_start_matches('/');
    match name.split('/').collect::<Vec<_>>()[..] {
        [package, _, type_name] => format!("{package}/{type_name}"),
        _ => name.to_owned(),
    }
}

/// Adds the sections of types that need no definition, where `sections` has none of them.
fn add_built_in(sections: &mut Vec<Section>, serialization: Serialization) -> Parsed<()> {
    let built_in: &[_] = match serialization {
        Serialization::Cdr => &BUILT_IN,
        Serialization::Ros1 => &BUILT_IN_ROS_1,
    };
    for &(built_in, fields) in built_in {
        if !sections.iter().any(|section| section.name == built_in) {
            sections.push(section(built_in, fields.lines().enumerate())?);
        }
    }
    Ok(())
}

fn sections(name: &str, text: &str) -> Parsed<Vec<Section>> {
    let mut found = Vec::new();
    let mut current = short_name(name);
    let mut lines = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.len() >= 3 && line.bytes().all(|byte| byte == b'=') {
            found.push(section(&current, lines.drain(..))?);
            current.clear();
        } else if let Some(next) = line.strip_prefix("MSG:") {
            current = short_name(next);
        } else {
            lines.push((number, line));
        }
    }
    found.push(section(&current, lines.into_iter())?);
    Ok(found)
}

fn section<'t>(name: &str, lines: impl Iterator<Item = (usize, &'t str)>) -> Parsed<Section> {
    let mut fields = Vec::new();
    for (number, line) in lines {
        let bad_line =
            || SchemaError::Line { line: number + 1, text: line.chars().take(80).collect() };
        let line = line.trim();
        if !line.is_empty() && !line.starts_with('#') {
            fields.extend(field(line).ok_or_else(bad_line)?);
        }
    }
    Ok(Section { name: name.to_owned(), fields })
}

/// The field in a line: `Some(None)` for a constant, `None` for a line that makes no sense.
#[expect(
    clippy::option_option,
    reason = "the outer one is an error, to which the caller adds its place"
)]
fn field(line: &str) -> Option<Option<RawField>> {
    let (type_text, rest) = line.split_once(char::is_whitespace)?;
    let rest = rest.trim_start();
    let name_length =
        rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(rest.len());
    let (name, after) = rest.split_at(name_length);
    if name.is_empty() {
        return None;
    }
    if after.trim_start().starts_with('=') {
        return Some(None);
    }
    // Only a default value or a comment may follow, after a space.
    if !(after.is_empty() || after.starts_with(char::is_whitespace) || after.starts_with('#')) {
        return None;
    }
    let (type_name, shape) = type_and_shape(type_text)?;
    Some(Some(RawField { type_name: type_name.to_owned(), name: name.to_owned(), shape }))
}

/// `string<=5[<=3]` → (`string`, sequence). Bounds do not change how a value is stored.
fn type_and_shape(text: &str) -> Option<(&str, Shape)> {
    let (element, shape) = match text.split_once('[') {
        None => (text, Shape::One),
        Some((element, count)) => {
            let count = count.strip_suffix(']')?;
            let shape = match count.strip_prefix("<=") {
                Some(bound) => bound.parse::<u32>().ok().map(|_| Shape::Sequence)?,
                None if count.is_empty() => Shape::Sequence,
                None => Shape::Fixed(count.parse().ok().filter(|&count| count > 0)?),
            };
            (element, shape)
        }
    };
    let name = element.split_once("<=").map_or(element, |(name, _)| name);
    (!name.is_empty()).then_some((name, shape))
}

fn resolve(
    section: &Section,
    indices: &BTreeMap<&str, usize>,
    serialization: Serialization,
) -> Parsed<MessageType> {
    let package = section.name.split_once('/').map_or("", |(package, _)| package);
    let mut fields = section
        .fields
        .iter()
        .map(|field| {
            Ok(Field {
                name: field.name.clone(),
                of: match well_known(&field.type_name, serialization) {
                    Some(known) => known,
                    None => resolve_type(&field.type_name, package, indices)?,
                },
                shape: field.shape,
            })
        })
        .collect::<Result<Vec<_>, _>>()?;
    if fields.is_empty() && serialization == Serialization::Cdr {
        fields.push(placeholder());
    }
    Ok(MessageType { name: section.name.clone(), fields, extensibility: Extensibility::Unstated })
}

fn resolve_type(name: &str, package: &str, indices: &BTreeMap<&str, usize>) -> Parsed<FieldType> {
    let full = match name {
        "Header" => "std_msgs/Header".to_owned(),
        "time" | "duration" if indices.contains_key(name) => name.to_owned(),
        _ if name.contains('/') => short_name(name),
        _ => format!("{package}/{name}"),
    };
    indices
        .get(full.as_str())
        .map(|&index| FieldType::Message(index))
        .ok_or(SchemaError::UnknownType { name: name.to_owned() })
}

fn well_known(name: &str, serialization: Serialization) -> Option<FieldType> {
    let is_ros_1 = serialization == Serialization::Ros1;
    let primitive = match name {
        "bool" => Primitive::Bool,
        "int8" => Primitive::I8,
        "byte" if is_ros_1 => Primitive::I8,
        "uint8" | "byte" | "char" => Primitive::U8,
        "int16" => Primitive::I16,
        "uint16" => Primitive::U16,
        "int32" => Primitive::I32,
        "uint32" => Primitive::U32,
        "int64" => Primitive::I64,
        "uint64" => Primitive::U64,
        "float32" => Primitive::F32,
        "float64" => Primitive::F64,
        "string" => return Some(FieldType::Text),
        "wstring" if !is_ros_1 => return Some(FieldType::WideText),
        _ => return None,
    };
    Some(FieldType::Primitive(primitive))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_form_of_line_is_read() {
        let text = "# a comment\r\nuint8 DEBUG=10\r\nstring NOTE = 'a # b' # c\r\nHeader header # trailing\r\n\
            string<=5[<=3] words \"x\"\r\nfloat64[36] covariance\r\nInner[] inner\r\nint32 n -7\r\n\
            ================\r\nMSG: std_msgs/Header\r\nbuiltin_interfaces/Time stamp\r\nstring frame_id\r\n\
            ===\r\nMSG: my/msg/Inner\r\n\r\n";
        let definition =
            parse("my/msg/Outer", text, Serialization::Cdr).expect("all lines are sound");
        let outer = &definition.types[0];
        let fields: Vec<_> =
            outer.fields.iter().map(|field| format!("{} {field}", field.name)).collect();
        assert_eq!(
            fields,
            ["header message", "words string[]", "covariance f64[36]", "inner message[]", "n i32"]
        );
        // The inner type is empty, so it carries the placeholder byte; Time was left out and is built in.
        let FieldType::Message(inner) = outer.fields[3].of else { panic!("inner is a message") };
        assert_eq!(definition.types[inner].fields.len(), 1);
        assert!(definition.types.iter().any(|t| t.name == "builtin_interfaces/Time"));
    }

    #[test]
    fn nonsense_is_named_with_its_line() {
        let parse = |name, text| parse(name, text, Serialization::Cdr);
        assert_eq!(
            parse("a/B", "float64 x\nfloat64[-1] y"),
            Err(SchemaError::Line { line: 2, text: "float64[-1] y".to_owned() })
        );
        assert_eq!(parse("a/B", "C c"), Err(SchemaError::UnknownType { name: "C".to_owned() }));
        for line in ["float64", "float64[0] x", "float64[", "a b@c", "[] x", "<=3 x"] {
            assert!(parse("a/B", line).is_err(), "{line}");
        }
    }
}
