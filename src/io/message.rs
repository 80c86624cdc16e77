//! Messages: the schema text that a log carries → a reader of the wanted fields → the few values a stream wants of each message.
//!
//! A message is never made into a tree of values. The schema becomes a [`MessageSchema`]; schema and wanted field paths
//! become, once per channel, a [`FieldReader`]; the reader then reads each message in one pass and puts the wanted values into a
//! [`Row`], whose buffers are used again for the next message.
//!
//! 1. [`MessageSchema::read`]: schema text → schema ([`ros2msg`], [`ros2idl`], [`Descriptors`]; JSON needs none).
//! 2. [`MessageSchema::reader`]: schema + paths such as `pose.position.x` → reader.
//! 3. [`FieldReader::read`]: payload → one [`Value`] per path in a row ([`CdrReader`], [`ProtobufReader`], [`JsonReader`]).

mod cdr;
mod cdr_reader;
mod cell;
mod definition;
mod json;
mod path;
mod protobuf;
pub mod ros2idl;
pub mod ros2msg;
mod row;
mod schema;
mod template;
mod value;

pub use cdr_reader::CdrReader;
pub use definition::{Definition, Extensibility, Field, FieldType, MessageType, Primitive, Shape};
pub use json::{JsonReader, JsonSchema};
pub use path::FieldPath;
pub use protobuf::{Descriptors, ProtobufReader};
pub use row::Row;
pub use schema::{FieldReader, MessageSchema};
pub use value::{Gathered, Numbers, Text, Texts, Value};

use thiserror::Error;

/// Why a schema cannot be read, or does not hold what is wanted of it.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SchemaError {
    /// A line that is no field, constant or comment.
    #[error("line {line} of the schema is no field, constant or comment: {text:?}")]
    Line {
        /// Counted from 1.
        line: usize,
        /// The line.
        text: String,
    },
    /// Something in an IDL text that ROS 2 does not write.
    #[error("line {line} of the schema's IDL: {found} is not understood there")]
    Idl {
        /// Counted from 1.
        line: usize,
        /// What stands there, quoted where it is from the text.
        found: String,
    },
    /// A type that the schema uses but does not define.
    #[error("the schema uses the type {name:?} but does not define it; the recorder left it out")]
    UnknownType {
        /// As written.
        name: String,
    },
    /// A descriptor set that is none.
    #[error("the schema is no descriptor set of protobuf: {source}")]
    Descriptor {
        /// Why.
        source: MessageFault,
    },
    /// A type that contains itself, or so many fields that no message can be meant.
    #[error(
        "the type {name:?} contains itself or unfolds to more than {limit} fields: the schema is damaged"
    )]
    Unbounded {
        /// The type.
        name: String,
        /// The most fields that are unfolded.
        limit: usize,
    },
    /// A type whose messages are parameter lists.
    #[error(
        "the type {name:?} is @mutable: its messages are parameter lists, which are not read; record it as @appendable \
         or @final"
    )]
    Mutable {
        /// The type.
        name: String,
    },
    /// What is written for a path is none.
    #[error(
        "{path:?} is no field path; write it like pose.position.x, joints[2].angle or joints[].name"
    )]
    Path {
        /// As written.
        path: String,
    },
    /// A wanted field that is not there.
    #[error("there is no field {path:?}; fields of {message}: {fields}")]
    NoField {
        /// The path.
        path: String,
        /// The message type that was searched.
        message: String,
        /// What it has.
        fields: String,
    },
    /// A wanted element that is not there.
    #[error("there is no element {path:?}: the array has {count}, counted from 0")]
    NoElement {
        /// The path.
        path: String,
        /// How many there are.
        count: usize,
    },
    /// A wanted field of a type that cannot be used.
    #[error(
        "the field {path:?} is {found}, wanted is a number, a text, or an array of either: name a field or an element \
         in it"
    )]
    WrongType {
        /// The path.
        path: String,
        /// What the schema says.
        found: String,
    },
}

/// Why one message could not be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Error)]
pub enum MessageFault {
    /// It ends inside a field.
    #[error("the message ends before its last field")]
    Short,
    /// Bytes are left after the last field.
    #[error(
        "the message goes on after its last field: its schema is of another version, or bytes are damaged"
    )]
    LeftOver,
    /// Not an encapsulation that is read.
    #[error(
        "the message's CDR encapsulation is 0x{0:04x}; read are plain CDR (0x0000, 0x0001), plain CDR 2 (0x0006, \
         0x0007) and delimited CDR 2 (0x0008, 0x0009), not parameter lists"
    )]
    Encapsulation(u16),
    /// Wide strings that could be either of two things.
    #[error(
        "the message has a wide string, whose characters have two or four bytes by implementation, and fits its schema \
         either way with different values"
    )]
    WideText,
    /// No protobuf.
    #[error(
        "the bytes are no protobuf message: there is a field number, wire type or number that cannot be"
    )]
    Wire,
    /// Parts in parts in parts.
    #[error("the message's parts stand in one another more than 64 deep")]
    Deep,
    /// An array that no message of the field has.
    #[error("a wanted array of the message has more than 100000 elements")]
    LongArray,
    /// Longer than places in it can be told.
    #[error("the message has 4 GiB or more")]
    Long,
    /// No JSON.
    #[error("the bytes are no JSON: there is a sign where it cannot be")]
    Json,
}
