use std::fmt;

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Definition {
    /// The first one is the channel's own; fields refer to the others by index.
    pub types: Vec<MessageType>,
    pub serialization: Serialization,
}

/// How messages of the definition are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Serialization {
    /// ROS 2: the encapsulation states the rest.
    Cdr,
    /// ROS 1: little-endian fields one after another, without encapsulation, alignment or ends of strings.
    Ros1,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MessageType {
    pub name: String,
    /// In CDR at least one: an empty message carries a placeholder byte.
    pub fields: Vec<Field>,
    pub extensibility: Extensibility,
}

/// The ways in which other versions of a type may differ, which decide how it is delimited in CDR version 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Extensibility {
    /// Not stated: taken as appendable where a message is in a delimited encoding.
    #[default]
    Unstated,
    Final,
    Appendable,
    Mutable,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    pub name: String,
    pub of: FieldType,
    pub shape: Shape,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FieldType {
    Primitive(Primitive),
    Text,
    WideText,
    Message(usize),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    One,
    /// An array of fixed length: that many elements in every message.
    Fixed(u32),
    /// A sequence: each message states its number of elements, bounded or not.
    Sequence,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Primitive {
    /// 0 or 1 in one byte.
    Bool,
    /// Also ROS 1's `byte`.
    I8,
    /// Also `char`, and ROS 2's `byte`.
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Primitive {
    /// Bytes of one element; also what CDR aligns it to.
    pub const fn size(self) -> usize {
        match self {
            Self::Bool | Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

impl fmt::Display for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let of = match self.of {
            FieldType::Primitive(primitive) => format!("{primitive:?}").to_lowercase(),
            FieldType::Text => "string".to_owned(),
            FieldType::WideText => "wstring".to_owned(),
            FieldType::Message(_) => "message".to_owned(),
        };
        match self.shape {
            Shape::One => f.write_str(&of),
            Shape::Fixed(count) => write!(f, "{of}[{count}]"),
            Shape::Sequence => write!(f, "{of}[]"),
        }
    }
}
