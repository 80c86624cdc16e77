//! Messages: the schema text that a log carries → a reader of the wanted fields → the few values a stream wants of each
//! message. A message is never made into a tree of values.
//!
//! 1. [`MessageSchema::read`]: schema text → schema ([`rosmsg`], [`ros2idl`], [`Descriptors`]; JSON needs none).
//! 2. [`MessageSchema::reader`]: schema + paths such as `pose.position.x` → reader.
//! 3. [`FieldReader::read`]: payload → one [`Value`] per path in a [`Row`], whose buffers are used again
//!    ([`CdrReader`], [`ProtobufReader`], [`JsonReader`]).

mod cdr;
mod cdr_reader;
mod cell;
mod definition;
mod json;
mod path;
mod protobuf;
pub mod ros2idl;
pub mod rosmsg;
mod row;
mod schema;
mod template;
mod value;

pub use cdr_reader::CdrReader;
pub use definition::{
    Definition, Extensibility, Field, FieldType, MessageType, Primitive, Serialization, Shape,
};
pub use json::{JsonReader, JsonSchema};
pub use path::FieldPath;
pub use protobuf::{Descriptors, ProtobufReader};
pub use row::Row;
pub use schema::{FieldReader, MessageSchema};
pub use value::{Gathered, Numbers, Text, TextForm, Texts, Value};

use thiserror::Error;

type Parsed<T> = Result<T, SchemaError>;
type Decoded<T> = Result<T, MessageFault>;

#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SchemaError {
    #[error("line {line} of the schema is no field, constant or comment: {text:?}")]
    Line { line: usize, text: String },
    #[error("line {line} of the schema's IDL: {found} is not understood there")]
    Idl { line: usize, found: String },
    #[error("the schema uses the type {name:?} but does not define it; the recorder left it out")]
    UnknownType { name: String },
    #[error("the schema is no descriptor set of protobuf: {source}")]
    Descriptor { source: MessageFault },
    #[error(
        "the type {name:?} contains itself or expands to more than {limit} fields: the schema is damaged"
    )]
    Unbounded { name: String, limit: usize },
    #[error(
        "the type {name:?} is @mutable: its messages are parameter lists, which are not read; record it as @appendable \
         or @final"
    )]
    Mutable { name: String },
    #[error(
        "{path:?} is no field path; write it like pose.position.x, joints[2].angle or joints[].name"
    )]
    Path { path: String },
    #[error("there is no field {path:?}; fields of {message}: {fields}")]
    NoField { path: String, message: String, fields: String },
    #[error("there is no element {path:?}: the array has {count}, counted from 0")]
    NoElement { path: String, count: usize },
    #[error(
        "the field {path:?} is {found}, wanted is a number, a text, or an array of either: name a field or an element \
         in it"
    )]
    WrongType { path: String, found: String },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Error)]
pub enum MessageFault {
    #[error("the message ends before its last field")]
    Short,
    #[error(
        "the message continues after its last field: its schema is of another version, or bytes are damaged"
    )]
    LeftOver,
    #[error(
        "the message's CDR encapsulation is 0x{0:04x}; read are plain CDR (0x0000, 0x0001), plain CDR 2 (0x0006, \
         0x0007) and delimited CDR 2 (0x0008, 0x0009), not parameter lists"
    )]
    Encapsulation(u16),
    #[error(
        "the message has a wide string, whose characters have two or four bytes by implementation, and fits its schema \
         either way with different values"
    )]
    WideText,
    #[error("the bytes are no protobuf message: a field number, wire type or number is not valid")]
    Wire,
    #[error("the message's parts are nested more than 64 deep")]
    Deep,
    #[error("a wanted array of the message has more than 100000 elements")]
    LongArray,
    #[error("the message has 4 GiB or more")]
    Long,
    #[error("the bytes are no JSON: there is a character where none is allowed")]
    Json,
}
