//! A block: one chunk, or a run of records outside chunks → its messages, given to a visitor. If a record defines
//! something new, or a message belongs to a channel not yet known, the walk ends: definitions are recorded one block
//! after another, in the order of the file.

use std::collections::BTreeMap;
use std::io;

use thiserror::Error;

use super::chunk::{ChunkFault, Decompressor, within};
use super::frames::Records;
use super::record::{ChannelRecord, ChunkRecord, MessageRecord, MetadataRecord, SchemaRecord, op};
use super::registry::{MOST_DEFINITIONS, Refused, Registry};
use super::scan::Visitor;
use super::source::Source;

/// A byte range of the file, and how it is stored.
#[derive(Debug, Clone, Default)]
pub struct Extent {
    pub start: u64,
    /// One past the last byte.
    pub end: u64,
    /// The chunk's header; `None` for a run of records.
    pub chunk: Option<ChunkRecord>,
}

#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum BlockFault {
    #[error(transparent)]
    Chunk(#[from] ChunkFault),
    #[error(
        "records inside the chunk end in the middle of one, at its byte {0} after decompression"
    )]
    Framing(usize),
    #[error("a record with opcode 0x{0:02x} does not belong in a chunk")]
    Opcode(u8),
    #[error("the fields of a record with opcode 0x{0:02x} do not fit its length")]
    Malformed(u8),
    #[error("messages of channel {0}, which no record before them defines")]
    UnknownChannel(u16),
    #[error(
        "channel or schema {0} is defined again and differently: which of the two is meant is not known"
    )]
    Redefined(u16),
    #[error("messages of other channels that no record before them defines")]
    UnknownChannels,
    #[error("the log defines more than {} MiB of schemas and channels", MOST_DEFINITIONS >> 20)]
    TooManyDefinitions,
    #[error("the log has more than {} MiB of metadata records; the rest was not read, no message is lost", MOST_METADATA >> 20)]
    TooMuchMetadata,
}

pub const MOST_METADATA: usize = 1024 * 1024;
/// Most channels of a block without a definition that are named one by one.
const MOST_UNKNOWN: usize = 1000;

/// Messages of a block that were left out for one reason.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Tally {
    /// Their number; `None`: not known.
    pub messages: Option<u64>,
    /// Earliest and latest log time, ns.
    pub times: Option<(u64, u64)>,
}

impl Tally {
    pub fn add(&mut self, log_time: u64) {
        let (first, last) = self.times.unwrap_or((log_time, log_time));
        self.times = Some((first.min(log_time), last.max(log_time)));
        self.messages = Some(self.messages.unwrap_or(0) + 1);
    }
}

#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum Outcome {
    #[default]
    Walked,
    /// The block defines something new: it has to be walked again when its turn comes.
    Defines,
    Rejected(BlockFault),
}

#[derive(Default)]
pub struct Block<P> {
    pub extent: Extent,
    pub stored: Vec<u8>,
    pub part: P,
    pub outcome: Outcome,
    pub faults: Vec<(BlockFault, Tally)>,
    /// Its metadata records: name, key, value.
    pub metadata: Metadata,
    pub messages: u64,
    /// The channel of each run of successive messages, and their number, in the order of the block.
    pub of_channels: Vec<(u16, u32)>,
    pub private_records: BTreeMap<u8, u64>,
    /// Number of messages that the message indexes after a chunk list, where the chunk cannot be read.
    pub indexed: Option<u64>,
    records: Vec<u8>,
    decompressor: Decompressor,
}

impl<P> Block<P> {
    /// Reads the stored bytes. A chunk above the limit is refused by its header, and never read.
    pub fn read(&mut self, source: &Source, limit: u64) -> io::Result<()> {
        let Extent { start, end, .. } = self.extent;
        let chunk = self.extent.chunk.as_ref();
        if chunk.is_some_and(|chunk| within(chunk, limit).is_err()) {
            self.stored.clear();
            return Ok(());
        }
        source.read(start, end - start, &mut self.stored)
    }

    /// Decompresses and walks the block, if it defines nothing new.
    pub fn open<V: Visitor<Part = P>>(
        &mut self,
        visitor: &V,
        registry: &Registry<V::Decoder>,
        chunk_limit: u64,
    ) {
        self.metadata = Metadata::default();
        if let Some(chunk) = &self.extent.chunk {
            let stored = body(chunk, &self.stored);
            let opened = self.decompressor.run(chunk, stored, chunk_limit, &mut self.records);
            if let Err(fault) = opened {
                self.clear(visitor);
                self.outcome = Outcome::Rejected(fault.into());
                return;
            }
        }
        self.walk(visitor, registry, false);
    }

    pub fn define<V: Visitor<Part = P>>(
        &mut self,
        visitor: &mut V,
        registry: &mut Registry<V::Decoder>,
    ) -> Result<(), V::Error> {
        let bytes = records(&self.extent, &self.stored, &self.records);
        if let Some(fault) = define(bytes, visitor, registry)? {
            self.clear(visitor);
            self.outcome = Outcome::Rejected(fault);
            return Ok(());
        }
        self.walk(visitor, registry, true);
        Ok(())
    }

    /// Channels whose messages were left out because nothing defines them.
    pub(super) fn unknown_channels(&self) -> impl Iterator<Item = u16> {
        self.faults.iter().filter_map(|(fault, _)| match fault {
            BlockFault::UnknownChannel(id) => Some(*id),
            _ => None,
        })
    }

    /// Bytes of the buffers that are reused for the next block.
    pub fn kept(&self) -> u64 {
        let of_channels = self.of_channels.capacity() * size_of::<(u16, u32)>();
        (self.stored.capacity() + self.records.capacity() + of_channels) as u64
    }

    fn clear<V: Visitor<Part = P>>(&mut self, visitor: &V) {
        visitor.clear(&mut self.part);
        self.faults.clear();
        self.metadata = Metadata::default();
        self.messages = 0;
        self.of_channels.clear();
        self.private_records.clear();
        self.indexed = None;
    }

    fn walk<V: Visitor<Part = P>>(
        &mut self,
        visitor: &V,
        registry: &Registry<V::Decoder>,
        last: bool,
    ) {
        self.clear(visitor);
        self.outcome = Outcome::Walked;
        let in_chunk = self.extent.chunk.is_some();
        let bytes = records(&self.extent, &self.stored, &self.records);
        let mut unknown = Unknown::default();
        // Most messages are of the same channel as the one before.
        let mut known: Option<(u16, &V::Decoder)> = None;
        for record in Records::new(bytes) {
            let seen = match record {
                Err(at) => Seen::Fault(BlockFault::Framing(at)),
                Ok((_, op::MESSAGE, body)) => match MessageRecord::read(body) {
                    None => Seen::Fault(BlockFault::Malformed(op::MESSAGE)),
                    Some(message) => {
                        self.messages += 1;
                        let id = message.channel_id;
                        match self.of_channels.last_mut() {
                            Some((of, count)) if *of == id && *count < u32::MAX => *count += 1,
                            _ => self.of_channels.push((id, 1)),
                        }
                        if known.is_none_or(|(of, _)| of != id) {
                            known = registry.decoder(id).map(|decoder| (id, decoder));
                        }
                        match known {
                            Some((_, decoder)) => {
                                visitor.message(decoder, &message, &mut self.part);
                            }
                            None => unknown.add(&message),
                        }
                        Seen::Known
                    }
                },
                Ok((_, op::SCHEMA, body)) => {
                    let schema = SchemaRecord::read(body);
                    Seen::of(op::SCHEMA, schema.map(|own| registry.has_schema(&own)))
                }
                Ok((_, op::CHANNEL, body)) => {
                    let channel = ChannelRecord::read(body);
                    Seen::of(op::CHANNEL, channel.map(|own| registry.has_channel(&own)))
                }
                Ok((_, op::METADATA, body)) if !in_chunk => self.metadata.take(body),
                Ok((_, opcode @ op::FIRST_PRIVATE.., _)) => {
                    *self.private_records.entry(opcode).or_default() += 1;
                    Seen::Known
                }
                Ok((_, opcode, _)) => Seen::Fault(BlockFault::Opcode(opcode)),
            };
            match seen {
                Seen::Known => {}
                Seen::Fault(fault) if self.faults.iter().any(|(noted, _)| *noted == fault) => {}
                Seen::Fault(fault) => self.faults.push((fault, Tally::default())),
                Seen::New if last => {
                    unreachable!("the definitions of the block were taken in before")
                }
                Seen::New => {
                    self.outcome = Outcome::Defines;
                    return;
                }
            }
        }
        if !unknown.channels.is_empty() && !last {
            self.outcome = Outcome::Defines;
        }
        self.faults.extend(unknown.into_faults());
    }
}

/// Messages whose channel nothing defines.
#[derive(Default)]
struct Unknown {
    channels: BTreeMap<u16, Tally>,
    others: Option<Tally>,
}

impl Unknown {
    fn add(&mut self, message: &MessageRecord<'_>) {
        let full = self.channels.len() >= MOST_UNKNOWN;
        let tally = match self.channels.get_mut(&message.channel_id) {
            Some(tally) => tally,
            None if full => self.others.get_or_insert_default(),
            None => self.channels.entry(message.channel_id).or_default(),
        };
        tally.add(message.log_time);
    }

    fn into_faults(self) -> impl Iterator<Item = (BlockFault, Tally)> {
        let others = self.others.map(|tally| (BlockFault::UnknownChannels, tally));
        self.channels
            .into_iter()
            .map(|(id, tally)| (BlockFault::UnknownChannel(id), tally))
            .chain(others)
    }
}

/// Metadata records, up to the limit.
#[derive(Debug, Clone, Default)]
pub struct Metadata {
    /// Name, key, value.
    pub entries: Vec<(String, String, String)>,
    size: usize,
}

impl Metadata {
    fn take(&mut self, body: &[u8]) -> Seen {
        let Some(record) = MetadataRecord::read(body) else {
            return Seen::Fault(BlockFault::Malformed(op::METADATA));
        };
        for (key, value) in record.pairs {
            if !self.push(record.name, key, value) {
                return Seen::Fault(BlockFault::TooMuchMetadata);
            }
        }
        Seen::Known
    }

    fn push(&mut self, name: &str, key: &str, value: &str) -> bool {
        // The name is stored again with each of its keys.
        let size = name.len() + key.len() + value.len() + size_of::<(String, String, String)>();
        let fits = self.size + size <= MOST_METADATA;
        if fits {
            self.size += size;
            let entry = (name.to_owned(), key.to_owned(), value.to_owned());
            self.entries.push(entry);
        }
        fits
    }

    /// Appends the entries of `later`; returns whether there was room for all.
    pub fn append(&mut self, later: &Self) -> bool {
        let mut entries = later.entries.iter();
        entries.all(|(name, key, value)| self.push(name, key, value))
    }
}

/// The records of a block: the stored bytes, or the decompressed ones.
fn records<'b>(extent: &Extent, stored: &'b [u8], decompressed: &'b [u8]) -> &'b [u8] {
    match &extent.chunk {
        None => stored,
        Some(chunk) if chunk.compression.is_empty() => body(chunk, stored),
        Some(_) => decompressed,
    }
}

fn body<'b>(chunk: &ChunkRecord, stored: &'b [u8]) -> &'b [u8] {
    let place = |bytes: u64| usize::try_from(bytes).unwrap_or(usize::MAX);
    let start = 9 + place(chunk.header_size);
    let end = start.saturating_add(place(chunk.compressed_size));
    // Bytes after them belong to a later version of the format.
    stored.get(start..end.min(stored.len())).unwrap_or_default()
}

enum Seen {
    Known,
    New,
    Fault(BlockFault),
}

impl Seen {
    /// A definition that may be known; `None` of one whose fields do not fit.
    const fn of(opcode: u8, known: Option<bool>) -> Self {
        match known {
            None => Self::Fault(BlockFault::Malformed(opcode)),
            Some(true) => Self::Known,
            Some(false) => Self::New,
        }
    }
}

/// Records the definitions of sound records; the walk notes the others afterwards.
fn define<V: Visitor>(
    bytes: &[u8],
    visitor: &mut V,
    registry: &mut Registry<V::Decoder>,
) -> Result<Option<BlockFault>, V::Error> {
    for (_, opcode, body) in Records::new(bytes).map_while(Result::ok) {
        let (id, refused) = match opcode {
            op::SCHEMA => match SchemaRecord::read(body) {
                Some(schema) => (schema.id, registry.add_schema(&schema)),
                None => continue,
            },
            op::CHANNEL => match ChannelRecord::read(body) {
                Some(channel) => {
                    let added = registry.add_channel(&channel, |channel, schema| {
                        visitor.channel(channel, schema)
                    })?;
                    (channel.id, added)
                }
                None => continue,
            },
            _ => continue,
        };
        match refused {
            Ok(()) => {}
            Err(Refused::Redefined) => return Ok(Some(BlockFault::Redefined(id))),
            Err(Refused::TooMuch) => return Ok(Some(BlockFault::TooManyDefinitions)),
        }
    }
    Ok(None)
}
