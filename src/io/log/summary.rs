//! The summary at the end of a log, as a hint: definitions of channels whose own records were lost.
//!
//! Nothing depends on it. It is used only where its checksum, if given, is right.

use std::io;

use mcap::MAGIC;

use super::frames::Records;
use super::record::{ChannelRecord, FRAME_HEADER, SchemaRecord, op};
use super::source::Source;

/// Bytes of a footer and the closing magic.
const TAIL: u64 = FRAME_HEADER + 20 + 8;

/// The records of a summary; empty where there is none that can be trusted. At most `limit` bytes are read.
pub fn read(source: &mut Source, limit: u64) -> io::Result<Vec<u8>> {
    let none = Ok(Vec::new());
    let Some(footer) = source.length().checked_sub(TAIL) else {
        return none;
    };
    let mut tail = Vec::new();
    source.append(footer, TAIL, &mut tail)?;
    let Some((start, crc)) = summary_start(&tail) else {
        return none;
    };
    if start < 8 || start >= footer || footer - start > limit {
        return none;
    }
    let mut bytes = Vec::new();
    // The checksum reaches over the footer, up to itself.
    source.append(start, footer - start + FRAME_HEADER + 16, &mut bytes)?;
    if crc != 0 && crc32fast::hash(&bytes) != crc {
        return none;
    }
    bytes.truncate(usize::try_from(footer - start).unwrap_or(0));
    Ok(bytes)
}

/// Where the summary starts and its checksum, if `tail` is a footer and the closing magic.
fn summary_start(tail: &[u8]) -> Option<(u64, u32)> {
    let (&opcode, rest) = tail.split_first()?;
    let (length, rest) = rest.split_first_chunk::<8>()?;
    let (start, rest) = rest.split_first_chunk::<8>()?;
    let (_offsets, rest) = rest.split_first_chunk::<8>()?;
    let (crc, magic) = rest.split_first_chunk::<4>()?;
    let sound = opcode == op::FOOTER && u64::from_le_bytes(*length) == 20 && magic == MAGIC;
    sound.then_some((u64::from_le_bytes(*start), u32::from_le_bytes(*crc)))
}

/// The channel `id` and its schema, if the summary repeats them.
pub fn definition(
    summary: &[u8],
    id: u16,
) -> Option<(ChannelRecord<'_>, Option<SchemaRecord<'_>>)> {
    let records = || Records::new(summary).map_while(Result::ok);
    let channel = records()
        .filter(|record| record.1 == op::CHANNEL)
        .filter_map(|record| ChannelRecord::read(record.2))
        .find(|channel| channel.id == id)?;
    let schema = records()
        .filter(|record| record.1 == op::SCHEMA)
        .filter_map(|record| SchemaRecord::read(record.2))
        .find(|schema| schema.id == channel.schema_id);
    Some((channel, schema))
}
