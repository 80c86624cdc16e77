//! A channel's schema, whatever its language, and the plan made of it, whatever its encoding.

use super::cdr_plan::leaves;
use super::{CdrPlan, Definition, FieldPath, MessageFault, Row, SchemaError, ros2idl, ros2msg};

/// What the messages of a channel have in them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MessageSchema {
    /// ROS 2 messages in CDR.
    Cdr(Definition),
}

/// How to take the wanted values of one channel's messages.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Plan {
    /// Of ROS 2 messages in CDR.
    Cdr(CdrPlan),
}

impl MessageSchema {
    /// Reads the schema of the type `name`, written in `language`, of messages in `encoding`; `None` where such messages
    /// are not read.
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
            _ => return None,
        })
    }

    /// The plan that takes the fields at `wanted`, in that order.
    pub fn plan(&self, wanted: &[FieldPath]) -> Result<Plan, SchemaError> {
        match self {
            Self::Cdr(definition) => CdrPlan::resolve(definition, wanted).map(Plan::Cdr),
        }
    }

    /// Whether messages have a field there, as far as is known.
    pub fn has(&self, path: &FieldPath) -> bool {
        match self {
            Self::Cdr(definition) => {
                CdrPlan::resolve(definition, std::slice::from_ref(path)).is_ok()
            }
        }
    }

    /// Paths of the numbers, strings and arrays that it says messages have; not all of a very large type.
    pub fn leaves(&self) -> Vec<String> {
        match self {
            Self::Cdr(definition) => leaves(definition),
        }
    }
}

impl Plan {
    /// Takes the wanted values of one message into the row, in the order they were asked for.
    ///
    /// What was taken before a fault was met must not be used.
    pub fn read(&self, message: &[u8], row: &mut Row) -> Result<(), MessageFault> {
        match self {
            Self::Cdr(plan) => plan.read(message, row),
        }
    }
}
