//! A message definition, whatever language it was written in.

use std::fmt;

/// The message type of a channel with every type that it uses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Definition {
    /// The first one is the channel's own; fields refer to the others by index.
    pub types: Vec<MessageType>,
}

/// A message type: named fields in the order they are serialised in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MessageType {
    /// `package/Name`.
    pub name: String,
    /// At least one: an empty message carries a placeholder byte.
    pub fields: Vec<Field>,
    /// The ways in which other versions of the type may differ.
    pub extensibility: Extensibility,
}

/// The ways in which other versions of a type may differ, which decide how it is delimited in CDR version 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Extensibility {
    /// Not stated: taken as appendable where a message is in a delimited encoding.
    #[default]
    Unstated,
    /// `@final`: they do not differ.
    Final,
    /// `@appendable`: they may have more fields at their end.
    Appendable,
    /// `@mutable`: any field may be missing or moved.
    Mutable,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// Name of the field.
    pub name: String,
    /// Type of one element.
    pub of: FieldType,
    /// Number of elements.
    pub shape: Shape,
}

/// The type of one element of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FieldType {
    /// A number.
    Primitive(Primitive),
    /// A string, bounded or not.
    Text,
    /// A string of wide characters.
    WideText,
    /// A nested message: its index in [`Definition::types`].
    Message(usize),
}

/// The number of elements of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// One element.
    One,
    /// An array of fixed length: that many elements in every message.
    Fixed(u32),
    /// A sequence: each message states its number of elements, bounded or not.
    Sequence,
}

/// The type of a stored number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Primitive {
    /// 0 or 1 in one byte.
    Bool,
    /// Also `char` in the older sense.
    I8,
    /// Also `byte` and `char`.
    U8,
    /// Two bytes, signed.
    I16,
    /// Two bytes.
    U16,
    /// Four bytes, signed.
    I32,
    /// Four bytes.
    U32,
    /// Eight bytes, signed.
    I64,
    /// Eight bytes.
    U64,
    /// IEEE single.
    F32,
    /// IEEE double.
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
