//! A channel's schema, whatever its language, and the reader made of it, whatever its encoding.

use super::cdr_reader::leaves;
use super::json::{JsonReader, JsonSchema};
use super::protobuf::{Descriptors, ProtobufReader};
use super::{
    CdrReader, Decoded, Definition, FieldPath, Parsed, Row, Serialization, ros2idl, rosmsg,
};

#[derive(Debug, Clone, PartialEq)]
pub enum MessageSchema {
    /// Also of ROS 1, which stores the same fields more simply.
    Cdr(Definition),
    Protobuf(Descriptors),
    Json(JsonSchema),
}

#[derive(Debug, Clone, PartialEq)]
pub enum FieldReader {
    Cdr(CdrReader),
    Protobuf(ProtobufReader),
    Json(JsonReader),
}

impl MessageSchema {
    /// `None` where messages in `encoding` with a schema in `language` are not supported.
    pub fn read(encoding: &str, name: &str, language: &str, schema: &[u8]) -> Option<Parsed<Self>> {
        let text = || String::from_utf8_lossy(schema);
        Some(match (encoding, language) {
            ("cdr", "ros2msg") => rosmsg::parse(name, &text(), Serialization::Cdr).map(Self::Cdr),
            ("ros1", "ros1msg") => rosmsg::parse(name, &text(), Serialization::Ros1).map(Self::Cdr),
            ("cdr", "ros2idl") => ros2idl::parse(name, &text()).map(Self::Cdr),
            ("protobuf", "protobuf") => Descriptors::read(name, schema).map(Self::Protobuf),
            ("json", _) => Ok(Self::Json(JsonSchema::read(schema))),
            _ => return None,
        })
    }

    pub fn reader(&self, wanted: &[FieldPath]) -> Parsed<FieldReader> {
        match self {
            Self::Cdr(definition) => CdrReader::resolve(definition, wanted).map(FieldReader::Cdr),
            Self::Protobuf(types) => {
                ProtobufReader::resolve(types, wanted).map(FieldReader::Protobuf)
            }
            Self::Json(_) => Ok(FieldReader::Json(JsonReader::new(wanted))),
        }
    }

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
    /// The wanted values of one message go into the row, in their order; after a fault they must not be used.
    pub fn read(&self, message: &[u8], row: &mut Row) -> Decoded<()> {
        match self {
            Self::Cdr(reader) => reader.read(message, row),
            Self::Protobuf(reader) => reader.read(message, row),
            Self::Json(reader) => reader.read(message, row),
        }
    }
}
