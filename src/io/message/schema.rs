//! A channel's schema, whatever its language, and the reader made of it, whatever its encoding.

use super::cdr_reader::leaves;
use super::json::{JsonReader, JsonSchema};
use super::protobuf::{Descriptors, ProtobufReader};
use super::{CdrReader, Definition, FieldPath, MessageFault, Row, SchemaError, ros2idl, ros2msg};

/// The fields of the messages of a channel.
#[derive(Debug, Clone, PartialEq)]
pub enum MessageSchema {
    /// ROS 2 messages in CDR.
    Cdr(Definition),
    /// Protobuf messages.
    Protobuf(Descriptors),
    /// JSON messages, which may have any fields.
    Json(JsonSchema),
}

/// The reader of the wanted values of one channel's messages.
#[derive(Debug, Clone, PartialEq)]
pub enum FieldReader {
    /// Of ROS 2 messages in CDR.
    Cdr(CdrReader),
    /// Of protobuf messages.
    Protobuf(ProtobufReader),
    /// Of JSON messages.
    Json(JsonReader),
}

impl MessageSchema {
    /// Reads the schema of the type `name`, written in `language`, for messages in `encoding`; `None` where such messages
    /// are not supported.
    pub fn read(
        encoding: &str,
        name: &str,
        language: &str,
        definition: &[u8],
    ) -> Option<Result<Self, SchemaError>> {
        let text = || String::from_utf8_lossy(definition);
        Some(match (encoding, language) {
            ("cdr", "ros2msg") => ros2msg::parse(name, &text()).map(Self::Cdr),
            ("cdr", "ros2idl") => ros2idl::parse(name, &text()).map(Self::Cdr),
            ("protobuf", "protobuf") => Descriptors::read(name, definition).map(Self::Protobuf),
            ("json", _) => Ok(Self::Json(JsonSchema::read(definition))),
            _ => return None,
        })
    }

    /// The reader that takes the fields at `wanted`, in that order.
    pub fn reader(&self, wanted: &[FieldPath]) -> Result<FieldReader, SchemaError> {
        match self {
            Self::Cdr(definition) => CdrReader::resolve(definition, wanted).map(FieldReader::Cdr),
            Self::Protobuf(types) => {
                ProtobufReader::resolve(types, wanted).map(FieldReader::Protobuf)
            }
            Self::Json(_) => Ok(FieldReader::Json(JsonReader::new(wanted))),
        }
    }

    /// Whether messages have a field at this path, as far as the schema shows.
    pub fn has(&self, path: &FieldPath) -> bool {
        match self {
            Self::Json(schema) => schema.has(path),
            schema => schema.reader(std::slice::from_ref(path)).is_ok(),
        }
    }

    /// Paths of the numbers, strings and arrays in the schema; not all of a very large type.
    pub fn leaves(&self) -> Vec<String> {
        match self {
            Self::Cdr(definition) => leaves(definition),
            Self::Protobuf(types) => types.leaves(),
            Self::Json(schema) => schema.leaves.clone(),
        }
    }
}

impl FieldReader {
    /// Takes the wanted values of one message into the row, in the order they were asked for.
    ///
    /// After a fault, the values in the row must not be used.
    pub fn read(&self, message: &[u8], row: &mut Row) -> Result<(), MessageFault> {
        match self {
            Self::Cdr(reader) => reader.read(message, row),
            Self::Protobuf(reader) => reader.read(message, row),
            Self::Json(reader) => reader.read(message, row),
        }
    }
}
