//! Messages: the schema text that a log carries → a decoding plan → the few values a stream wants of each message.
//!
//! A message is never made into a tree of values. The schema becomes a [`Definition`]; definition and wanted field
//! paths become, once per channel, a [`CdrPlan`], a flat list of steps; the plan then reads each message in one pass
//! and lends the wanted values out of its bytes.
//!
//! 1. [`ros2msg::parse`]: schema text → [`Definition`] (other schema languages produce the same type).
//! 2. [`CdrPlan::resolve`]: definition + paths such as `pose.position.x` → plan.
//! 3. [`CdrPlan::read`]: payload → one [`Value`] per path.

mod cdr;
mod cdr_plan;
mod definition;
pub mod ros2msg;
mod value;

pub use cdr::MessageFault;
pub use cdr_plan::CdrPlan;
pub use definition::{Definition, Field, FieldType, MessageType, Primitive, Shape};
pub use value::{Numbers, Texts, Value};

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
    /// A type that the schema uses but does not define.
    #[error("the schema uses the type {name:?} but does not define it; the recorder left it out")]
    UnknownType {
        /// As written.
        name: String,
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
    /// A wanted field of a type that cannot be used.
    #[error("the field {path:?} is {found}, wanted is a number, a text, or an array of either")]
    WrongType {
        /// The path.
        path: String,
        /// What the schema says.
        found: String,
    },
    /// A wide string, whose length the implementations do not agree on.
    #[error(
        "the field {path:?} is a wstring, which CDR implementations write in two ways; such messages cannot be read"
    )]
    WideString {
        /// The path.
        path: String,
    },
}
