//! The summary at the end of a log, as a hint: definitions of channels whose own records were lost, and the number of
//! messages that there should be. Definitions are taken from it only where its checksum, if given, is right.

use std::collections::BTreeMap;
use std::io;
use std::ops::Range;

use mcap::MAGIC;

use super::frames::{Records, belongs_to_summary};
use super::record::{ChannelRecord, FRAME_HEADER, SchemaRecord, Statistics, frame_header, op};
use super::registry::MOST_DEFINITIONS;
use super::source::Source;

const TAIL: u64 = FRAME_HEADER + 20 + 8;
const PIECE: u64 = 256 * 1024;

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Ending {
    /// No footer and no closing magic bytes: the end was cut off.
    #[default]
    Cut,
    NoSummary,
    Unchecked,
    Sound,
    /// A summary that is not where its footer states, or whose checksum is wrong.
    Damaged,
}

#[derive(Debug, Clone, Copy)]
struct Footer {
    at: u64,
    summary_start: u64,
    crc: u32,
}

/// `None` where no summary can be trusted.
pub fn ending(source: &mut Source, log: Range<u64>) -> io::Result<(Ending, Option<Range<u64>>)> {
    let Some(footer) = footer(source, &log)? else { return Ok((Ending::Cut, None)) };
    if footer.summary_start == 0 {
        return Ok((Ending::NoSummary, None));
    }
    // Places count from the start of the log, which may follow another one.
    let start = log.start.checked_add(footer.summary_start);
    let Some(range) = start
        .map(|start| start..footer.at)
        .filter(|range| footer.summary_start >= 8 && range.start <= range.end)
    else {
        return Ok((Ending::Damaged, None));
    };
    if footer.crc == 0 {
        return Ok((Ending::Unchecked, Some(range)));
    }
    // The checksum covers the footer, up to itself.
    let found = source.checksum(range.start..footer.at + FRAME_HEADER + 16)?;
    Ok(if found == footer.crc { (Ending::Sound, Some(range)) } else { (Ending::Damaged, None) })
}

/// The start of the summary of the log in these bytes, by its footer.
pub fn begin(source: &mut Source, log: Range<u64>) -> io::Result<Option<u64>> {
    let footer = footer(source, &log)?;
    Ok(footer.and_then(|footer| log.start.checked_add(footer.summary_start)))
}

fn footer(source: &mut Source, log: &Range<u64>) -> io::Result<Option<Footer>> {
    let Some(at) = log.end.checked_sub(TAIL).filter(|&at| at >= log.start) else { return Ok(None) };
    let mut tail = Vec::new();
    source.read(at, TAIL, &mut tail)?;
    Ok(read_footer(at, &tail))
}

fn read_footer(at: u64, tail: &[u8]) -> Option<Footer> {
    let header = frame_header(tail)?;
    let (start, rest) = tail.get(9..)?.split_first_chunk::<8>()?;
    let (_offsets, rest) = rest.split_first_chunk::<8>()?;
    let (crc, magic) = rest.split_first_chunk::<4>()?;
    let sound = header == (op::FOOTER, 20) && magic == MAGIC;
    let (summary_start, crc) = (u64::from_le_bytes(*start), u32::from_le_bytes(*crc));
    sound.then_some(Footer { at, summary_start, crc })
}

#[derive(Debug, Default)]
pub struct Definitions {
    bytes: Vec<u8>,
    channels: BTreeMap<u16, Range<usize>>,
    schemas: BTreeMap<u16, Range<usize>>,
}

impl Definitions {
    /// Reads the definitions of the log in these bytes; none where no summary can be trusted.
    pub fn read(source: &mut Source, log: Range<u64>) -> io::Result<Self> {
        let (_, Some(range)) = ending(source, log)? else { return Ok(Self::default()) };
        let bytes = definitions(source, range)?;
        let mut found = Self::default();
        for (start, opcode, body) in Records::new(&bytes).map_while(Result::ok) {
            let range = start + 9..start + 9 + body.len();
            if let (op::CHANNEL, Some(channel)) = (opcode, ChannelRecord::read(body)) {
                found.channels.insert(channel.id, range);
            } else if let (op::SCHEMA, Some(schema)) = (opcode, SchemaRecord::read(body)) {
                found.schemas.insert(schema.id, range);
            }
        }
        found.bytes = bytes;
        Ok(found)
    }

    /// The channel `id` and its schema; `None` where the summary does not repeat them.
    pub fn of(&self, id: u16) -> Option<(ChannelRecord<'_>, Option<SchemaRecord<'_>>)> {
        let body = |range: &Range<usize>| self.bytes.get(range.clone());
        let channel = ChannelRecord::read(body(self.channels.get(&id)?)?)?;
        let schema = self.schemas.get(&channel.schema_id);
        let schema = schema.and_then(body).and_then(SchemaRecord::read);
        Some((channel, schema))
    }
}

/// Indexes, which can be long, are skipped. Empty where other records are among them: then these are not the bytes of a
/// summary.
fn definitions(source: &mut Source, range: Range<u64>) -> io::Result<Vec<u8>> {
    let (mut found, mut frame) = (Vec::new(), Vec::new());
    let mut at = range.start;
    while let Some((opcode, end)) = next_frame(source, at, range.end)? {
        if !of_summary(opcode) {
            return Ok(Vec::new());
        }
        if matches!(opcode, op::SCHEMA | op::CHANNEL) {
            if found.len() as u64 + (end - at) > MOST_DEFINITIONS as u64 {
                break;
            }
            source.read(at, end - at, &mut frame)?;
            found.extend_from_slice(&frame);
        }
        at = end;
    }
    Ok(found)
}

pub const fn of_summary(opcode: u8) -> bool {
    matches!(opcode, op::SCHEMA | op::CHANNEL | op::FIRST_PRIVATE..) || belongs_to_summary(opcode)
}

/// Opcode and end of the frame at `at`; `None` where none ends by `end`.
pub fn next_frame(source: &mut Source, at: u64, end: u64) -> io::Result<Option<(u8, u64)>> {
    let Some((opcode, length)) = frame_header(source.peek(at, 9)?) else { return Ok(None) };
    let own_end = length.checked_add(at + FRAME_HEADER);
    Ok(own_end.filter(|&own| own <= end).map(|own| (opcode, own)))
}

/// Bytes of the longest statistics: a count for every possible id.
const MOST_STATISTICS: u64 = 64 + (1 << 16) * 10;

/// Reads the statistics from a summary; `None` where it has none.
pub fn statistics(source: &mut Source, range: Range<u64>) -> io::Result<Option<Statistics>> {
    let mut at = range.start;
    while let Some((opcode, end)) = next_frame(source, at, range.end)? {
        if opcode == op::STATISTICS && end - at <= MOST_STATISTICS {
            let mut frame = Vec::new();
            source.read(at, end - at, &mut frame)?;
            return Ok(frame.get(9..).and_then(Statistics::read));
        }
        at = end;
    }
    Ok(None)
}

impl Source {
    pub fn checksum(&mut self, range: Range<u64>) -> io::Result<u32> {
        let mut hasher = crc32fast::Hasher::new();
        let mut bytes = Vec::new();
        let mut at = range.start;
        while at < range.end {
            let count = PIECE.min(range.end - at);
            self.read(at, count, &mut bytes)?;
            hasher.update(&bytes);
            at += count;
        }
        Ok(hasher.finalize())
    }
}
