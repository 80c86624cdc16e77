//! MCAP records (format specification, version 0): fields read with no allocation by a length that the file states;
//! `None` where a record is shorter than its fields. The parsers of the `mcap` crate panic or abort on some hostile
//! lengths.

use std::collections::BTreeMap;

pub mod op {
    pub use mcap::records::op::*;

    /// Opcodes from here on are application-specific.
    pub const FIRST_PRIVATE: u8 = 0x80;
}

pub const FRAME_HEADER: u64 = 9;

/// Opcode and length of the record whose frame begins with these bytes; `None` where the frame's header is cut.
pub fn frame_header(bytes: &[u8]) -> Option<(u8, u64)> {
    let (&opcode, rest) = bytes.split_first()?;
    Some((opcode, u64::from_le_bytes(*rest.first_chunk()?)))
}

#[derive(Debug, Clone)]
pub struct Fields<'a> {
    rest: &'a [u8],
}

impl<'a> Fields<'a> {
    pub const fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes }
    }

    /// Except for an extension: a record much longer than its fields has a damaged length.
    fn end(&self) -> Option<()> {
        (self.rest.len() as u64 <= MOST_EXTENSION).then_some(())
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (bytes, rest) = self.rest.split_first_chunk::<N>()?;
        self.rest = rest;
        Some(*bytes)
    }

    fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    /// Bytes after a count of four bytes.
    fn bytes(&mut self) -> Option<&'a [u8]> {
        let length = usize::try_from(self.u32()?).ok()?;
        let (bytes, rest) = self.rest.split_at_checked(length)?;
        self.rest = rest;
        Some(bytes)
    }

    fn text(&mut self) -> Option<&'a str> {
        std::str::from_utf8(self.bytes()?).ok()
    }

    fn text_map(&mut self) -> Option<TextMap<'a>> {
        let fields = Fields::new(self.bytes()?);
        let mut rest = fields.clone();
        while !rest.rest.is_empty() {
            rest.text()?;
            rest.text()?;
        }
        Some(TextMap { fields })
    }
}

/// Read on demand: a list of pairs would take many times the record's memory.
#[derive(Debug, Clone)]
pub struct TextMap<'a> {
    fields: Fields<'a>,
}

impl<'a> Iterator for TextMap<'a> {
    type Item = (&'a str, &'a str);

    fn next(&mut self) -> Option<Self::Item> {
        Some((self.fields.text()?, self.fields.text()?))
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HeaderRecord<'a> {
    /// Conventions of the log, such as `ros2`.
    pub profile: &'a str,
    pub library: &'a str,
}

impl<'a> HeaderRecord<'a> {
    pub fn read(body: &'a [u8]) -> Option<Self> {
        let mut fields = Fields::new(body);
        let header = Self { profile: fields.text()?, library: fields.text()? };
        fields.end().map(|()| header)
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SchemaRecord<'a> {
    /// Not zero.
    pub id: u16,
    pub name: &'a str,
    pub encoding: &'a str,
    pub definition: &'a [u8],
}

impl<'a> SchemaRecord<'a> {
    pub fn read(body: &'a [u8]) -> Option<Self> {
        let mut fields = Fields::new(body);
        let id = fields.u16().filter(|&id| id != 0)?;
        let (name, encoding, definition) = (fields.text()?, fields.text()?, fields.bytes()?);
        let schema = Self { id, name, encoding, definition };
        fields.end().map(|()| schema)
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChannelRecord<'a> {
    /// Id of the channel, valid in this log only.
    pub id: u16,
    /// Id of the schema; 0: none.
    pub schema_id: u16,
    pub topic: &'a str,
    pub encoding: &'a str,
}

impl<'a> ChannelRecord<'a> {
    pub fn read(body: &'a [u8]) -> Option<Self> {
        let mut fields = Fields::new(body);
        let (id, schema_id) = (fields.u16()?, fields.u16()?);
        let (topic, encoding) = (fields.text()?, fields.text()?);
        let channel = Self { id, schema_id, topic, encoding };
        fields.text_map()?;
        fields.end().map(|()| channel)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MessageRecord<'a> {
    pub channel_id: u16,
    /// Number given by the publisher; 0 where it gives none.
    pub sequence: u32,
    /// Time of recording, ns.
    pub log_time: u64,
    /// Time of publishing, ns.
    pub publish_time: u64,
    pub payload: &'a [u8],
}

impl<'a> MessageRecord<'a> {
    pub const HEADER: u64 = 22;

    pub fn read(body: &'a [u8]) -> Option<Self> {
        let mut fields = Fields::new(body);
        Some(Self {
            channel_id: fields.u16()?,
            sequence: fields.u32()?,
            log_time: fields.u64()?,
            publish_time: fields.u64()?,
            payload: fields.rest,
        })
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChunkRecord {
    /// Earliest log time, ns; a hint.
    pub start_time: u64,
    /// Latest log time, ns; a hint.
    pub end_time: u64,
    pub uncompressed_size: u64,
    /// CRC-32 of the uncompressed records; 0: not given.
    pub crc: u32,
    pub compression: String,
    pub compressed_size: u64,
    /// Bytes before the compressed records, from the start of the record's body.
    pub header_size: u64,
}

impl ChunkRecord {
    const LONGEST_NAME: usize = 32;
    pub const MOST_HEADER: usize = 40 + Self::LONGEST_NAME;

    pub fn read(body: &[u8]) -> Option<Self> {
        let mut fields = Fields::new(body);
        let (start_time, end_time) = (fields.u64()?, fields.u64()?);
        let (uncompressed_size, crc) = (fields.u64()?, fields.u32()?);
        let compression = fields.text().filter(|name| name.len() <= Self::LONGEST_NAME)?;
        Some(Self {
            start_time,
            end_time,
            uncompressed_size,
            crc,
            compression: compression.to_owned(),
            compressed_size: fields.u64()?,
            header_size: 40 + compression.len() as u64,
        })
    }

    /// Whether this can be nothing but a chunk: its length is exactly the sum of its fields.
    pub(super) fn is_certain(&self, length: u64) -> bool {
        self.has_known_compression()
            && self.header_size.checked_add(self.compressed_size) == Some(length)
    }

    /// Bytes that it takes while it is worked on: as stored and, where compressed, also decompressed.
    pub fn needs(&self) -> u64 {
        if self.compression.is_empty() {
            self.compressed_size
        } else {
            self.compressed_size.saturating_add(self.uncompressed_size)
        }
    }

    pub(super) fn has_known_compression(&self) -> bool {
        matches!(self.compression.as_str(), "" | "zstd" | "lz4")
    }

    pub fn fits(&self, length: u64) -> bool {
        let fields = self.header_size.checked_add(self.compressed_size);
        fields.is_some_and(|fields| extends(fields, length))
    }
}

#[derive(Debug, Clone)]
pub struct MetadataRecord<'a> {
    pub name: &'a str,
    pub pairs: TextMap<'a>,
}

impl<'a> MetadataRecord<'a> {
    pub fn read(body: &'a [u8]) -> Option<Self> {
        let mut fields = Fields::new(body);
        let metadata = Self { name: fields.text()?, pairs: fields.text_map()? };
        fields.end().map(|()| metadata)
    }
}

/// Bytes that a later version of the format may add to the end of a record.
pub const MOST_EXTENSION: u64 = 64;

/// Whether a record of `length` bytes holds fields of this many bytes, and at most an extension after them.
pub(super) fn extends(fields: u64, length: u64) -> bool {
    length.checked_sub(fields).is_some_and(|more| more <= MOST_EXTENSION)
}

/// Channel and count of a message index; `None` where the start of its body does not fit that length.
pub(super) fn indexed_messages(body_start: &[u8], length: u64) -> Option<(u16, u64)> {
    let mut fields = Fields::new(body_start);
    let (channel, bytes) = (fields.u16()?, u64::from(fields.u32()?));
    (extends(bytes + 6, length) && bytes.is_multiple_of(16)).then_some((channel, bytes / 16))
}

#[derive(Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    pub messages: u64,
    /// Number of messages of each channel; some writers leave it empty.
    pub of_channels: BTreeMap<u16, u64>,
}

impl Statistics {
    pub fn read(body: &[u8]) -> Option<Self> {
        let mut fields = Fields::new(body);
        let messages = fields.u64()?;
        // Schemas, channels, attachments, metadata records, chunks, first and last log time.
        fields.array::<{ 2 + 4 * 4 + 2 * 8 }>()?;
        let counts = fields.bytes()?.chunks(10).map(|count| {
            let mut count = Fields::new(count);
            Some((count.u16()?, count.u64()?))
        });
        fields.end()?;
        Some(Self { messages, of_channels: counts.collect::<Option<_>>()? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times 1 and 2, 30 bytes unpacked, checksum 4, "lz4", 20 bytes stored.
    fn chunk_header() -> Vec<u8> {
        let numbers = [1_u64, 2, 30].map(u64::to_le_bytes).concat();
        let name = [&3_u32.to_le_bytes()[..], b"lz4"].concat();
        [&numbers[..], &4_u32.to_le_bytes(), &name, &20_u64.to_le_bytes()].concat()
    }

    #[test]
    fn a_chunk_header_is_read_or_too_short() {
        let bytes = chunk_header();
        let chunk = ChunkRecord::read(&bytes).expect("whole");
        assert_eq!((chunk.start_time, chunk.end_time, chunk.uncompressed_size), (1, 2, 30));
        assert_eq!((chunk.crc, chunk.compression.as_str(), chunk.compressed_size), (4, "lz4", 20));
        assert_eq!(chunk.header_size, bytes.len() as u64);
        // 43 bytes of header and 20 stored, up to 64 more of a later version.
        let fits = [62, 63, 127, 128].map(|length| chunk.fits(length));
        assert_eq!(fits, [false, true, true, false]);
        assert!(chunk.is_certain(63) && !chunk.is_certain(64));
        for length in 0..bytes.len() {
            assert_eq!(ChunkRecord::read(&bytes[..length]), None);
        }
    }

    #[test]
    fn counts_larger_than_the_record_are_refused() {
        let lying = [&[1, 0, 2, 0][..], &u32::MAX.to_le_bytes(), b"/topic"].concat();
        assert_eq!(ChannelRecord::read(&lying), None);
        assert_eq!(SchemaRecord::read(&lying), None);
        assert!(MetadataRecord::read(&lying[4..]).is_none());
        // Two entries of sixteen bytes, then a count that does not fit the length.
        let index = [&[7, 0][..], &32_u32.to_le_bytes()].concat();
        assert_eq!(indexed_messages(&index, 38), Some((7, 2)));
        assert_eq!(indexed_messages(&index, 37), None);
    }
}
