//! Protobuf: the descriptor set that a log carries → a reader over field numbers → the wanted values of each message.
//!
//! Source: Protocol Buffers documentation, "Encoding" and `descriptor.proto`. What official readers do is done here:
//! unknown fields and fields of another wire type are passed over, of a field given twice the last counts, nested
//! messages given twice are merged, repeated numbers may be packed or not, a member of a oneof ousts the others. A
//! number without presence (proto3) that is not there is 0; a field with presence, or inside a message that is not
//! there, has no value.
//!
//! 1. [`Descriptors::read`]: descriptor set → message types.
//! 2. [`ProtobufReader::resolve`]: types + paths → for each message type on the way, what to do with which field number.
//! 3. [`ProtobufReader::read`]: payload → the wanted values in a row.
//!
//! Of a message worded as the one before, only the numbers are read ([`template`](super::template)).

mod descriptor;
mod read;
mod reader;
mod wire;

pub use descriptor::Descriptors;
pub(super) use read::NumberSlot;
pub use reader::ProtobufReader;
