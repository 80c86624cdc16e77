//! The frames of a log's data section: where each record lies, and which bytes are lost.
//!
//! Only the data section is walked; the summary after it is a hint that can be missing or lie. Each record is an
//! opcode, a length and a body. A frame is believed when its opcode belongs here and its length fits the file and,
//! where the body says so again, the body.
//!
//! A record that is unsound but well framed is lost alone. Where framing itself is lost, the next frame that cannot
//! be there by chance is looked for: a chunk whose lengths add up, the end of the data section or, in logs
//! without chunks, three sound records in a row.

mod again;
mod judge;
mod loss;
mod records;

use std::io;

use super::Limits;
use super::record::{ChunkRecord, FRAME_HEADER, indexed_messages, op};
use super::source::Source;
use judge::Judged;

pub use loss::{Loss, Lost};
pub use records::Records;

/// Candidates for a new frame that are looked at in one log; keeps a hostile one from taking forever.
const MOST_PROBES: u32 = 1_000_000;

/// A part of the data section.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Piece {
    /// A schema, channel, message or metadata record from `start` to `end`; `is_message` tells which.
    Record {
        start: u64,
        end: u64,
        is_message: bool,
    },
    /// A chunk.
    Chunk {
        start: u64,
        end: u64,
        chunk: ChunkRecord,
    },
    /// A message index: how many messages of the chunk before it lists.
    Index { messages: u64 },
    /// Bytes that cannot be read.
    Lost(Lost),
}

/// Walks the frames of one log.
pub struct Frames<'s> {
    source: &'s mut Source,
    limits: Limits,
    at: u64,
    probes_left: u32,
    chunked: bool,
    ended: bool,
    data_crc: Option<(u64, u32)>,
    data_end: Option<u64>,
}

impl<'s> Frames<'s> {
    /// Starts at byte `at`, after the header.
    pub const fn new(source: &'s mut Source, at: u64, limits: Limits) -> Self {
        Self {
            source,
            limits,
            at,
            probes_left: MOST_PROBES,
            chunked: false,
            ended: false,
            data_crc: None,
            data_end: None,
        }
    }

    /// How far the walk has come.
    pub const fn at(&self) -> u64 {
        self.at
    }

    /// The file walked.
    pub const fn source(&mut self) -> &mut Source {
        self.source
    }

    /// Where the data section ends and its checksum, where its end record was met and gives one.
    pub const fn data_crc(&self) -> Option<(u64, u32)> {
        self.data_crc
    }

    /// One past the record that ends the data section, if it was met.
    pub const fn data_end(&self) -> Option<u64> {
        self.data_end
    }

    /// The next part of the data section; `None` after its end.
    pub fn next(&mut self) -> io::Result<Option<Piece>> {
        while !self.ended {
            let start = self.at;
            if start >= self.source.length() {
                self.ended = true;
                return Ok(Some(lost(start, start, Loss::NoDataEnd)));
            }
            match self.judge(start)? {
                Judged::Sound { end, opcode } => {
                    self.at = end;
                    if let Some(piece) = self.piece(start, end, opcode)? {
                        return Ok(Some(piece));
                    }
                }
                Judged::Unsound { end, why } => {
                    self.at = end;
                    return Ok(Some(lost(start, end, why)));
                }
                Judged::Broken(why) => return self.lose_framing(start, why).map(Some),
            }
        }
        Ok(None)
    }

    /// The part that a sound frame is; `None` for frames of no interest.
    fn piece(&mut self, start: u64, end: u64, opcode: u8) -> io::Result<Option<Piece>> {
        let length = end - start - FRAME_HEADER;
        Ok(match opcode {
            op::SCHEMA | op::CHANNEL | op::MESSAGE | op::METADATA => Some(Piece::Record {
                start,
                end,
                is_message: opcode == op::MESSAGE,
            }),
            op::CHUNK => {
                self.chunked = true;
                // The file may have been cut since it was judged.
                Some(match self.chunk(start)? {
                    Some(chunk) => Piece::Chunk { start, end, chunk },
                    None => lost(start, end, Loss::Truncated),
                })
            }
            op::MESSAGE_INDEX => {
                let messages =
                    indexed_messages(self.source.probe(start + FRAME_HEADER, 6)?, length);
                messages.map(|messages| Piece::Index { messages })
            }
            op::DATA_END => {
                let body = self.source.probe(start + FRAME_HEADER, 4)?;
                let crc = body.first_chunk::<4>().map(|crc| u32::from_le_bytes(*crc));
                self.data_crc = crc.filter(|&crc| crc != 0).map(|crc| (start, crc));
                self.data_end = Some(end);
                self.ended = true;
                None
            }
            op::FOOTER => {
                self.ended = true;
                None
            }
            // An attachment.
            _ => None,
        })
    }

    /// The header of the chunk whose frame begins at `start`, if one does.
    fn chunk(&mut self, start: u64) -> io::Result<Option<ChunkRecord>> {
        let bytes = self.source.probe(start, 9 + ChunkRecord::MOST_HEADER)?;
        let is_chunk = bytes.first() == Some(&op::CHUNK);
        let body = bytes.get(9..).filter(|_| is_chunk);
        Ok(body.and_then(ChunkRecord::read))
    }
}

const fn lost(start: u64, end: u64, why: Loss) -> Piece {
    Piece::Lost(Lost {
        start,
        end,
        why,
        times: None,
    })
}
