//! Protobuf: the descriptor set that a log carries → a reader over field numbers → the wanted values of each message.
//!
//! Source: Protocol Buffers documentation, "Encoding" and `descriptor.proto`. As in official readers, unknown fields
//! and fields of another wire type are skipped, the last value of a field given twice counts, nested messages given
//! twice are merged, and a member of a oneof removes the others. A missing number without presence (proto3) is 0; a
//! missing field with presence has no value. Where a message has the same template as the one before, only the numbers
//! are read ([`template`](super::template)).

mod descriptor;
mod read;
mod reader;
mod wire;

pub use descriptor::Descriptors;
pub(super) use read::NumberSlot;
pub use reader::ProtobufReader;
