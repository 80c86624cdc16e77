//! Writes MCAP byte by byte, so that a test can say of every field what stands in it. Source: the MCAP specification.

use std::io::Write as _;

pub use mcap::records::op;

/// The body of a record, field by field.
#[derive(Debug, Clone, Default)]
pub struct Body(pub Vec<u8>);

impl Body {
    pub fn u16(mut self, value: u16) -> Self {
        self.0.extend(value.to_le_bytes());
        self
    }

    pub fn u32(mut self, value: u32) -> Self {
        self.0.extend(value.to_le_bytes());
        self
    }

    pub fn u64(mut self, value: u64) -> Self {
        self.0.extend(value.to_le_bytes());
        self
    }

    pub fn raw(mut self, bytes: &[u8]) -> Self {
        self.0.extend(bytes);
        self
    }

    /// Four bytes of length and the bytes.
    pub fn bytes(self, bytes: &[u8]) -> Self {
        self.u32(u32::try_from(bytes.len()).expect("short")).raw(bytes)
    }

    pub fn text(self, text: &str) -> Self {
        self.bytes(text.as_bytes())
    }

    /// A map of texts.
    pub fn map(self, pairs: &[(&str, &str)]) -> Self {
        let pairs =
            pairs.iter().fold(Self::default(), |map, (key, value)| map.text(key).text(value));
        self.bytes(&pairs.0)
    }

    /// With opcode and length before it.
    pub fn record(self, opcode: u8) -> Vec<u8> {
        let length = (self.0.len() as u64).to_le_bytes();
        [&[opcode][..], &length, &self.0].concat()
    }
}

pub fn header(profile: &str, library: &str) -> Body {
    Body::default().text(profile).text(library)
}

pub fn schema(id: u16, name: &str, encoding: &str, definition: &[u8]) -> Body {
    Body::default().u16(id).text(name).text(encoding).bytes(definition)
}

pub fn channel(id: u16, schema: u16, topic: &str, encoding: &str, pairs: &[(&str, &str)]) -> Body {
    Body::default().u16(id).u16(schema).text(topic).text(encoding).map(pairs)
}

pub fn message(channel: u16, sequence: u32, log: u64, publish: u64, payload: &[u8]) -> Body {
    Body::default().u16(channel).u32(sequence).u64(log).u64(publish).raw(payload)
}

/// How a chunk is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Packing {
    None,
    Zstd,
    Lz4,
}

impl Packing {
    const fn name(self) -> &'static str {
        match self {
            Self::None => "",
            Self::Zstd => "zstd",
            Self::Lz4 => "lz4",
        }
    }

    pub fn pack(self, records: &[u8]) -> Vec<u8> {
        match self {
            Self::None => records.to_vec(),
            Self::Zstd => zstd::bulk::compress(records, 1).expect("memory"),
            Self::Lz4 => {
                let mut encoder = lz4::EncoderBuilder::new().build(Vec::new()).expect("memory");
                encoder.write_all(records).expect("memory");
                encoder.finish().0
            }
        }
    }
}

pub fn chunk(times: (u64, u64), records: &[u8], packing: Packing) -> Body {
    let packed = packing.pack(records);
    Body::default()
        .u64(times.0)
        .u64(times.1)
        .u64(records.len() as u64)
        .u32(crc32fast::hash(records))
        .text(packing.name())
        .u64(packed.len() as u64)
        .raw(&packed)
}

/// Log time and place in the chunk of each message of a channel.
pub fn message_index(channel: u16, entries: &[(u64, u64)]) -> Body {
    let entries =
        entries.iter().fold(Body::default(), |body, (time, place)| body.u64(*time).u64(*place));
    Body::default().u16(channel).bytes(&entries.0)
}

pub fn data_end(crc: u32) -> Body {
    Body::default().u32(crc)
}

pub fn footer(summary: u64, offsets: u64, crc: u32) -> Body {
    Body::default().u64(summary).u64(offsets).u32(crc)
}

/// Magic, records, magic.
pub fn file(records: &[Vec<u8>]) -> Vec<u8> {
    [mcap::MAGIC, &records.concat(), mcap::MAGIC].concat()
}

/// The records of a data section as a whole file without summary.
pub fn log(records: &[Vec<u8>]) -> Vec<u8> {
    let head = header("ros2", "tests").record(op::HEADER);
    let end = [data_end(0).record(op::DATA_END), footer(0, 0, 0).record(op::FOOTER)];
    file(&[&[head][..], records, &end].concat())
}
