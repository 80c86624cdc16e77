//! A chunk's compressed bytes → its records, checked before they are used.

use std::io::Read;

use thiserror::Error;

use super::record::ChunkRecord;

#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ChunkFault {
    #[error(
        "the chunk states that it takes {needed} bytes as stored and decompressed, the limit is {limit}; if that is right, raise \
         chunk_bytes in [limits]"
    )]
    TooLarge { needed: u64, limit: u64 },
    #[error("the chunk's compression is {0:?}; read are \"zstd\", \"lz4\" and none")]
    Compression(String),
    #[error("the chunk cannot be decompressed: {0}")]
    Damaged(String),
    #[error("the chunk holds {found} bytes where its header states {stated}")]
    Size { stated: u64, found: u64 },
    #[error(
        "the chunk's checksum is {found:08x} where its header states {stated:08x}: bytes are damaged"
    )]
    Checksum { stated: u32, found: u32 },
    #[error("there is no memory for a chunk of {0} bytes; lower chunk_bytes in [limits]")]
    Memory(u64),
}

pub fn within(chunk: &ChunkRecord, limit: u64) -> Result<(), ChunkFault> {
    let needed = chunk.needs();
    if needed > limit {
        return Err(ChunkFault::TooLarge { needed, limit });
    }
    Ok(())
}

/// Decompresses chunks, and reuses its context for the next one.
#[derive(Default)]
pub struct Decompressor {
    zstd: Option<zstd::bulk::Decompressor<'static>>,
}

impl Decompressor {
    /// Fills `records`, or leaves them where they are stored if not compressed; checks size and checksum.
    pub fn run(
        &mut self,
        chunk: &ChunkRecord,
        stored: &[u8],
        limit: u64,
        records: &mut Vec<u8>,
    ) -> Result<(), ChunkFault> {
        within(chunk, limit)?;
        let stated = chunk.uncompressed_size;
        let size = usize::try_from(stated).map_err(|_| ChunkFault::Memory(stated))?;
        records.clear();
        match chunk.compression.as_str() {
            "" => return check(chunk, stored),
            // Within the limit; only memory that is really filled is ever touched.
            "zstd" | "lz4" if records.try_reserve_exact(size + 1).is_err() => {
                return Err(ChunkFault::Memory(stated));
            }
            "zstd" => self.zstd(stored, records)?,
            "lz4" => lz4(stored, size, records)?,
            other => return Err(ChunkFault::Compression(other.to_owned())),
        }
        check(chunk, records)
    }

    fn zstd(&mut self, stored: &[u8], records: &mut Vec<u8>) -> Result<(), ChunkFault> {
        let damaged = |error: std::io::Error| ChunkFault::Damaged(error.to_string());
        let zstd = match &mut self.zstd {
            Some(zstd) => zstd,
            none => none.insert(zstd::bulk::Decompressor::new().map_err(damaged)?),
        };
        zstd.decompress_to_buffer(stored, records).map_err(damaged)?;
        Ok(())
    }
}

fn lz4(stored: &[u8], size: usize, records: &mut Vec<u8>) -> Result<(), ChunkFault> {
    let damaged = |error: std::io::Error| ChunkFault::Damaged(error.to_string());
    let decoder = lz4::Decoder::new(stored).map_err(damaged)?;
    // One more than stated, to notice a longer chunk.
    let mut limited = decoder.take(size as u64 + 1);
    limited.read_to_end(records).map_err(damaged)?;
    Ok(())
}

fn check(chunk: &ChunkRecord, records: &[u8]) -> Result<(), ChunkFault> {
    let (stated, found) = (chunk.uncompressed_size, records.len() as u64);
    if stated != found {
        return Err(ChunkFault::Size { stated, found });
    }
    if chunk.crc != 0 {
        let found = crc32fast::hash(records);
        if chunk.crc != found {
            let stated = chunk.crc;
            return Err(ChunkFault::Checksum { stated, found });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const RECORDS: &[u8] = b"records records records";

    fn lz4_frame() -> Vec<u8> {
        use std::io::Write;
        let mut encoder = lz4::EncoderBuilder::new().build(Vec::new()).expect("memory");
        encoder.write_all(RECORDS).expect("memory");
        encoder.finish().0
    }

    fn run(compression: &str, stored: &[u8], size: u64, crc: u32) -> Result<Vec<u8>, ChunkFault> {
        let chunk = ChunkRecord {
            start_time: 0,
            end_time: 0,
            uncompressed_size: size,
            crc,
            compression: compression.to_owned(),
            compressed_size: stored.len() as u64,
            header_size: 0,
        };
        let mut records = Vec::new();
        Decompressor::default().run(&chunk, stored, 1000, &mut records)?;
        Ok(if compression.is_empty() { stored.to_vec() } else { records })
    }

    #[test]
    fn every_compression_gives_the_records_back() {
        let (size, crc) = (RECORDS.len() as u64, crc32fast::hash(RECORDS));
        let zstd = zstd::bulk::compress(RECORDS, 1).expect("memory");
        for (name, stored) in [("", RECORDS.to_vec()), ("zstd", zstd), ("lz4", lz4_frame())] {
            assert_eq!(run(name, &stored, size, crc).as_deref(), Ok(RECORDS), "{name}");
            // 0: the log gives no checksum.
            assert_eq!(run(name, &stored, size, 0).as_deref(), Ok(RECORDS), "{name}");
            let wrong = run(name, &stored, size, crc ^ 1).expect_err("refused");
            assert!(matches!(wrong, ChunkFault::Checksum { .. }), "{name}");
            for lie in [size - 1, size + 1] {
                assert!(run(name, &stored, lie, crc).is_err(), "{name}");
            }
            let cut = run(name, &stored[..stored.len() / 2], size, crc);
            assert!(cut.is_err(), "{name}");
        }
    }

    #[test]
    fn a_chunk_above_the_limit_is_not_even_begun() {
        let refused = run("zstd", &[], u64::MAX, 0);
        assert_eq!(refused, Err(ChunkFault::TooLarge { needed: u64::MAX, limit: 1000 }));
        assert!(matches!(run("xz", &[], 1, 0), Err(ChunkFault::Compression(_))));
    }
}
