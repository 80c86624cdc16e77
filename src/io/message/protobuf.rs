//! Protobuf: the descriptor set that a log carries → a reader over field numbers → the wanted values of each message.
//!
//! Source: Protocol Buffers documentation, "Encoding" and `descriptor.proto`. As in official readers, unknown fields and
//! fields of another wire type are skipped, the last value of a field given twice counts, nested messages given twice are
//! merged, repeated numbers may be packed or not, and a member of a oneof removes the others. A missing number without
//! presence (proto3) is 0; a missing field with presence, or one inside a missing message, has no value.
//!
//! 1. [`Descriptors::read`]: descriptor set → message types.
//! 2. [`ProtobufReader::resolve`]: types + paths → for each message type on the way, what to do with which field number.
//! 3. [`ProtobufReader::read`]: payload → the wanted values in a row.
//!
//! Where a message has the same template as the one before, only the numbers are read ([`template`](super::template)).

mod descriptor;
mod read;
mod reader;
mod wire;

pub use descriptor::Descriptors;
pub(super) use read::NumberSlot;
pub use reader::ProtobufReader;
