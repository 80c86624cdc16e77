//! A channel's schema in any language, and its plan for any encoding.

use super::cdr_plan::leaves;
use super::json::{JsonPlan, JsonSchema};
use super::protobuf::{Descriptors, ProtobufPlan};
use super::{CdrPlan, Definition, FieldPath, MessageFault, Row, SchemaError, ros2idl, ros2msg};

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

/// The plan that reads the wanted values of one channel's messages.
#[derive(Debug, Clone, PartialEq)]
pub enum Plan {
    /// For ROS 2 messages in CDR.
    Cdr(CdrPlan),
    /// For protobuf messages.
    Protobuf(ProtobufPlan),
    /// For JSON messages.
    Json(JsonPlan),
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

    /// The plan that takes the fields at `wanted`, in that order.
    pub fn plan(&self, wanted: &[FieldPath]) -> Result<Plan, SchemaError> {
        match self {
            Self::Cdr(definition) => CdrPlan::resolve(definition, wanted).map(Plan::Cdr),
            Self::Protobuf(types) => ProtobufPlan::resolve(types, wanted).map(Plan::Protobuf),
            Self::Json(_) => Ok(Plan::Json(JsonPlan::new(wanted))),
        }
    }

    /// Whether messages have a field at this path, as far as the schema shows.
    pub fn has(&self, path: &FieldPath) -> bool {
        match self {
            Self::Json(schema) => schema.has(path),
            schema => schema.plan(std::slice::from_ref(path)).is_ok(),
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

impl Plan {
    /// Puts the wanted values of one message into the row, in the order they were asked for.
    ///
    /// After a fault, the values in the row must not be used.
    pub fn read(&self, message: &[u8], row: &mut Row) -> Result<(), MessageFault> {
        match self {
            Self::Cdr(plan) => plan.read(message, row),
            Self::Protobuf(plan) => plan.read(message, row),
            Self::Json(plan) => plan.read(message, row),
        }
    }
}
