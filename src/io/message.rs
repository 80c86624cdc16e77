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

/// The reason why a schema cannot be read, or lacks the wanted fields.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SchemaError {
    /// A line that is no field, constant or comment.
    #[error("line {line} of the schema is no field, constant or comment: {text:?}")]
    Line {
        /// Counted from 1.
        line: usize,
        /// Text of the line.
        text: String,
    },
    /// A construct in an IDL text that ROS 2 does not write.
    #[error("line {line} of the schema's IDL: {found} is not understood there")]
    Idl {
        /// Counted from 1.
        line: usize,
        /// The unexpected text, in quotes, or a description of it.
        found: String,
    },
    /// A type that the schema uses but does not define.
    #[error("the schema uses the type {name:?} but does not define it; the recorder left it out")]
    UnknownType {
        /// Name of the type, as written.
        name: String,
    },
    /// The bytes are no protobuf descriptor set.
    #[error("the schema is no descriptor set of protobuf: {source}")]
    Descriptor {
        /// The fault in the bytes.
        source: MessageFault,
    },
    /// A type that contains itself, or more fields than any real message has.
    #[error(
        "the type {name:?} contains itself or expands to more than {limit} fields: the schema is damaged"
    )]
    Unbounded {
        /// Name of the type.
        name: String,
        /// The limit on the number of expanded fields.
        limit: usize,
    },
    /// A type whose messages are parameter lists.
    #[error(
        "the type {name:?} is @mutable: its messages are parameter lists, which are not read; record it as @appendable \
         or @final"
    )]
    Mutable {
        /// Name of the type.
        name: String,
    },
    /// A text that is no field path.
    #[error(
        "{path:?} is no field path; write it like pose.position.x, joints[2].angle or joints[].name"
    )]
    Path {
        /// The text, as written.
        path: String,
    },
    /// A wanted field that the type does not have.
    #[error("there is no field {path:?}; fields of {message}: {fields}")]
    NoField {
        /// The wanted path.
        path: String,
        /// The message type that was searched.
        message: String,
        /// The fields of that type.
        fields: String,
    },
    /// A wanted element that the array does not have.
    #[error("there is no element {path:?}: the array has {count}, counted from 0")]
    NoElement {
        /// The wanted path.
        path: String,
        /// Number of elements in the array.
        count: usize,
    },
    /// A wanted field of a type that cannot be used.
    #[error(
        "the field {path:?} is {found}, wanted is a number, a text, or an array of either: name a field or an element \
         in it"
    )]
    WrongType {
        /// The wanted path.
        path: String,
        /// The type in the schema.
        found: String,
    },
}

/// The reason why one message could not be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Error)]
pub enum MessageFault {
    /// It ends inside a field.
    #[error("the message ends before its last field")]
    Short,
    /// Bytes are left after the last field.
    #[error(
        "the message continues after its last field: its schema is of another version, or bytes are damaged"
    )]
    LeftOver,
    /// An encapsulation that is not supported.
    #[error(
        "the message's CDR encapsulation is 0x{0:04x}; read are plain CDR (0x0000, 0x0001), plain CDR 2 (0x0006, \
         0x0007) and delimited CDR 2 (0x0008, 0x0009), not parameter lists"
    )]
    Encapsulation(u16),
    /// Wide strings that can be read in two ways, with different results.
    #[error(
        "the message has a wide string, whose characters have two or four bytes by implementation, and fits its schema \
         either way with different values"
    )]
    WideText,
    /// The bytes are no protobuf.
    #[error("the bytes are no protobuf message: a field number, wire type or number is not valid")]
    Wire,
    /// Parts nested too deep.
    #[error("the message's parts are nested more than 64 deep")]
    Deep,
    /// An array longer than any real message has.
    #[error("a wanted array of the message has more than 100000 elements")]
    LongArray,
    /// A message longer than the places in a row can state.
    #[error("the message has 4 GiB or more")]
    Long,
    /// The bytes are no JSON.
    #[error("the bytes are no JSON: there is a character where none is allowed")]
    Json,
}
