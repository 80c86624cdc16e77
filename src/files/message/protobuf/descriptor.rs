use std::collections::BTreeMap;

use super::wire::{Wire, wire_type};
use crate::message::cell::{Cell, Span};
use crate::message::{Decoded, MessageFault, Parsed, SchemaError};

/// Most levels of message types defined inside one another.
const MOST_LEVELS: usize = 64;

#[derive(Debug, Clone, PartialEq)]
pub struct Descriptors {
    pub(super) root: usize,
    pub(super) types: Vec<Type>,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Type {
    pub(super) name: String,
    pub(super) fields: Vec<Field>,
    /// The type is the key and value of a map field.
    pub(super) is_map_entry: bool,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) number: u32,
    pub(super) kind: Kind,
    pub(super) repeated: bool,
    pub(super) oneof: Option<u32>,
    /// Value of the field where it is missing.
    pub(super) default: Cell,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Double,
    Float,
    Int64,
    Uint64,
    Int32,
    Uint32,
    Sint32,
    Sint64,
    Fixed64,
    Fixed32,
    Sfixed64,
    Sfixed32,
    Bool,
    Text,
    Message(usize),
}

enum Raw<'d> {
    Number(u64),
    Bytes(&'d [u8]),
    Other,
}

struct RawType<'d> {
    name: String,
    fields: Vec<&'d [u8]>,
    is_map_entry: bool,
    presence: Presence,
}

/// Whether a missing single number is distinguished from one that is 0.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Presence {
    Explicit,
    Implicit,
}

impl Descriptors {
    pub fn read(name: &str, bytes: &[u8]) -> Parsed<Self> {
        let mut raw = Vec::new();
        each(bytes, |number, value| match (number, value) {
            (1, Raw::Bytes(file)) => read_file(file, &mut raw),
            _ => Ok(()),
        })
        .map_err(|source| SchemaError::Descriptor { source })?;
        let indices = raw.iter().enumerate().map(|(index, of)| (of.name.clone(), index));
        let indices: BTreeMap<_, _> = indices.collect();
        let unknown = |name: &str| SchemaError::UnknownType { name: name.to_owned() };
        let root = *indices.get(name.trim_start_matches('.')).ok_or_else(|| unknown(name))?;
        let types = raw.iter().map(|of| {
            let fields = of.fields.iter().map(|field| read_field(field, of.presence, &indices));
            let fields = fields.collect::<Result<_, _>>()?;
            Ok(Type { name: of.name.clone(), fields, is_map_entry: of.is_map_entry })
        });
        Ok(Self { root, types: types.collect::<Parsed<_>>()? })
    }

    /// Paths of the fields that can be wanted; not all of a very large type.
    pub fn leaves(&self) -> Vec<String> {
        let mut found = Vec::new();
        let mut open = vec![(self.root, String::new(), 0_usize)];
        while let Some((index, prefix, depth)) = open.pop() {
            for field in &self.types[index].fields {
                let path = format!("{prefix}{}", field.name);
                match field.kind {
                    Kind::Message(inner) if self.types[inner].is_map_entry || depth >= 8 => {}
                    Kind::Message(inner) if !field.repeated => {
                        open.push((inner, format!("{path}."), depth + 1));
                    }
                    Kind::Message(inner) if !prefix.contains("[]") => {
                        open.push((inner, format!("{path}[]."), depth + 1));
                    }
                    _ => found.push(path),
                }
                if found.len() >= 40 || open.len() > 1000 {
                    found.push("…".to_owned());
                    return found;
                }
            }
        }
        found.sort();
        found
    }
}

/// Gives each field of a message in the descriptors' own encoding to `take`.
fn each<'d>(bytes: &'d [u8], mut take: impl FnMut(u32, Raw<'d>) -> Decoded<()>) -> Decoded<()> {
    let mut wire = Wire::new(bytes);
    while let Some((number, wire_type)) = wire.tag()? {
        let value = match wire_type {
            wire_type::VARINT => Raw::Number(wire.varint()?),
            wire_type::LENGTH => {
                let end = wire.length()?;
                let start = std::mem::replace(&mut wire.at, end);
                Raw::Bytes(&bytes[start..end])
            }
            other => {
                wire.skip(number, other)?;
                Raw::Other
            }
        };
        take(number, value)?;
    }
    Ok(())
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn read_file<'d>(bytes: &'d [u8], types: &mut Vec<RawType<'d>>) -> Decoded<()> {
    let (mut package, mut messages) = (String::new(), Vec::new());
    let mut presence = Presence::Explicit;
    each(bytes, |number, value| {
        match (number, value) {
            (2, Raw::Bytes(name)) => package = text(name),
            (4, Raw::Bytes(message)) => messages.push(message),
            (8, Raw::Bytes(options)) => presence = presence_in(options, 50)?.unwrap_or(presence),
            (12, Raw::Bytes(b"proto3")) => presence = Presence::Implicit,
            _ => {}
        }
        Ok(())
    })?;
    for message in messages {
        read_type(message, &package, presence, types, MOST_LEVELS)?;
    }
    Ok(())
}

/// The presence that options state: `features`, whose number is given, `field_presence`.
fn presence_in(options: &[u8], features: u32) -> Decoded<Option<Presence>> {
    let mut found = None;
    each(options, |number, value| match value {
        Raw::Bytes(bytes) if number == features => each(bytes, |number, value| {
            match (number, value) {
                (1, Raw::Number(2)) => found = Some(Presence::Implicit),
                (1, Raw::Number(1 | 3)) => found = Some(Presence::Explicit),
                _ => {}
            }
            Ok(())
        }),
        _ => Ok(()),
    })?;
    Ok(found)
}

fn read_type<'d>(
    bytes: &'d [u8],
    scope: &str,
    presence: Presence,
    types: &mut Vec<RawType<'d>>,
    levels: usize,
) -> Decoded<()> {
    let levels = levels.checked_sub(1).ok_or(MessageFault::Deep)?;
    let (mut name, mut fields, mut nested, mut is_map_entry) =
        (String::new(), vec![], vec![], false);
    each(bytes, |number, value| {
        match (number, value) {
            (1, Raw::Bytes(bytes)) => name = text(bytes),
            (2, Raw::Bytes(field)) => fields.push(field),
            (3, Raw::Bytes(message)) => nested.push(message),
            (7, Raw::Bytes(options)) => each(options, |number, value| {
                is_map_entry |= matches!((number, value), (7, Raw::Number(1)));
                Ok(())
            })?,
            _ => {}
        }
        Ok(())
    })?;
    if !scope.is_empty() {
        name = format!("{scope}.{name}");
    }
    for message in nested {
        read_type(message, &name, presence, types, levels)?;
    }
    types.push(RawType { name, fields, is_map_entry, presence });
    Ok(())
}

fn read_field(
    bytes: &[u8],
    presence: Presence,
    indices: &BTreeMap<String, usize>,
) -> Parsed<Field> {
    let (mut name, mut number, mut label, mut kind) = (String::new(), 0, 0, 0);
    let (mut type_name, mut default, mut oneof, mut presence) =
        (String::new(), None, None, presence);
    each(bytes, |field, value| {
        match (field, value) {
            (1, Raw::Bytes(bytes)) => name = text(bytes),
            (3, Raw::Number(found)) => number = found,
            (4, Raw::Number(found)) => label = found,
            (5, Raw::Number(found)) => kind = found,
            (6, Raw::Bytes(bytes)) => type_name = text(bytes),
            (7, Raw::Bytes(bytes)) => default = Some(text(bytes)),
            (8, Raw::Bytes(options)) => presence = presence_in(options, 21)?.unwrap_or(presence),
            (9, Raw::Number(found)) => oneof = u32::try_from(found).ok(),
            _ => {}
        }
        Ok(())
    })
    .map_err(|source| SchemaError::Descriptor { source })?;
    let unknown = |name: &str| SchemaError::UnknownType { name: name.to_owned() };
    let message = indices.get(type_name.trim_start_matches('.')).copied();
    let kind = Kind::numbered(kind, message).ok_or_else(|| unknown(&type_name))?;
    let number = u32::try_from(number).ok().filter(|&number| number > 0);
    Ok(Field {
        number: number.ok_or_else(|| unknown(&name))?,
        default: match default {
            Some(default) => kind.parse(&default),
            // A member of a oneof has presence; the compiler also writes `optional` as one.
            None if presence == Presence::Implicit && oneof.is_none() => kind.zero(),
            None => Cell::Absent,
        },
        name,
        kind,
        repeated: label == 3,
        oneof,
    })
}

impl Kind {
    /// The kind with this number in `descriptor.proto`.
    fn numbered(number: u64, message: Option<usize>) -> Option<Self> {
        Some(match number {
            1 => Self::Double,
            2 => Self::Float,
            3 => Self::Int64,
            4 => Self::Uint64,
            // An enum is stored like an int32.
            5 | 14 => Self::Int32,
            6 => Self::Fixed64,
            7 => Self::Fixed32,
            8 => Self::Bool,
            9 | 12 => Self::Text,
            10 | 11 => Self::Message(message?),
            13 => Self::Uint32,
            15 => Self::Sfixed32,
            16 => Self::Sfixed64,
            17 => Self::Sint32,
            18 => Self::Sint64,
            _ => return None,
        })
    }

    fn zero(self) -> Cell {
        match self {
            Self::Message(_) => Cell::Absent,
            Self::Text => Cell::Text(Span::default()),
            Self::Double | Self::Float => Cell::Number(0.0),
            _ => Cell::Integer(0),
        }
    }

    /// A default value as written in the descriptor; for numbers only.
    fn parse(self, text: &str) -> Cell {
        match (self, text) {
            (Self::Text | Self::Message(_), _) => Cell::Absent,
            (Self::Bool, text) => Cell::Integer(i64::from(text == "true")),
            (Self::Double | Self::Float, text) => text.parse().map_or(Cell::Absent, Cell::Number),
            (_, text) => text.parse().map_or(Cell::Absent, Cell::Integer),
        }
    }
}
