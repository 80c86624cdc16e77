//! The frames of a log's data section: the place of each record, and the bytes that are lost. A frame is trusted when
//! its opcode belongs here and its length fits the file and its body.
//!
//! The end of the data section is not trusted: data records after it are read, and another log that begins there (as
//! `cat a.mcap b.mcap` leaves it) is walked too. An unsound record in a sound frame is lost alone. Where framing itself
//! is lost, the walk searches for the next frame that cannot be there by chance: a chunk whose lengths add up, the end
//! of the data section or, in logs without chunks, three sound records in a row.

mod again;
mod behind;
mod indexed;
mod judge;
mod loss;
mod records;

use std::io;

use super::Limits;
use super::record::{ChunkRecord, op};
use super::source::Source;
pub use indexed::indexed_behind;
use judge::Judged;
pub(super) use judge::belongs_to_summary;
pub use loss::{Loss, Lost};
pub use records::Records;

/// Most candidates for a new frame that are tried in one log; it bounds the time that a hostile log takes.
const MOST_PROBES: u32 = 1_000_000;

/// What stands from `start` to `end`. A record is a schema, a channel, a message or metadata; a log is another one, which begins with
/// its magic bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Piece {
    Record { start: u64, end: u64, is_message: bool },
    Chunk { start: u64, end: u64, chunk: ChunkRecord },
    Private { start: u64, end: u64, opcode: u8 },
    Log { start: u64 },
    Lost(Lost),
}

pub struct Frames<'s> {
    pub(super) source: &'s mut Source,
    limits: Limits,
    pub(super) at: u64,
    probes_left: u32,
    /// Start of the record before, if it ends where the walk is and may contain the start of another record.
    before: Option<u64>,
    ended: bool,
    pub(super) log: LogSoFar,
}

#[derive(Debug, Default)]
pub(super) struct LogSoFar {
    pub(super) start: u64,
    chunked: bool,
    /// Data records were found after a mark that data ends.
    went_on: bool,
    /// The end of its data section and its checksum; `None` where no end record was found or it has no checksum.
    pub(super) data_crc: Option<(u64, u32)>,
    /// One past the record that ends the data section; `None` where none was found.
    pub(super) data_end: Option<u64>,
    /// One past its closing mark; `None` until that is found.
    pub(super) end: Option<u64>,
}

impl<'s> Frames<'s> {
    pub fn new(source: &'s mut Source, at: u64, limits: Limits) -> Self {
        Self {
            source,
            limits,
            at,
            probes_left: MOST_PROBES,
            before: None,
            ended: false,
            log: LogSoFar::default(),
        }
    }

    /// Continues with the log that begins at `start`; its header ends at byte `at`.
    pub fn begin(&mut self, start: u64, at: u64) {
        self.at = at;
        self.before = None;
        self.log = LogSoFar { start, ..LogSoFar::default() };
    }

    /// The next part of the file's data; `None` after its end.
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
                    // An attachment may itself be a log.
                    self.before = (opcode != op::ATTACHMENT).then_some(start);
                    if let Some(piece) = self.piece(start, end, opcode)? {
                        return Ok(Some(piece));
                    }
                }
                Judged::Unsound { end, why } => {
                    self.at = end;
                    return Ok(Some(lost(start, end, why)));
                }
                // Magic bytes are no record.
                Judged::Broken(_) if self.begins_log(start)? => {
                    return Ok(Some(self.next_log(start)));
                }
                Judged::Broken(why) => return self.lose_framing(start, why).map(Some),
            }
        }
        Ok(None)
    }

    /// The part of a sound frame; `None` for frames of no interest.
    fn piece(&mut self, start: u64, end: u64, opcode: u8) -> io::Result<Option<Piece>> {
        Ok(match opcode {
            op::SCHEMA | op::CHANNEL | op::MESSAGE | op::METADATA => {
                Some(Piece::Record { start, end, is_message: opcode == op::MESSAGE })
            }
            op::CHUNK => {
                self.log.chunked = true;
                // The file may have been cut since it was judged.
                Some(match self.chunk(start, op::CHUNK)? {
                    Some(chunk) => Piece::Chunk { start, end, chunk },
                    None => lost(start, end, Loss::Truncated),
                })
            }
            op::DATA_END => self.end_data(start, end)?,
            op::FOOTER => self.end_log(end)?,
            op::FIRST_PRIVATE.. => Some(Piece::Private { start, end, opcode }),
            // An attachment, a message index, a summary before the last data.
            _ => None,
        })
    }

    /// The header of the chunk whose frame begins at `start`, with this opcode; `None` where no chunk does.
    fn chunk(&mut self, start: u64, opcode: u8) -> io::Result<Option<ChunkRecord>> {
        let bytes = self.source.probe(start, 9 + ChunkRecord::MOST_HEADER)?;
        let is_chunk = bytes.first() == Some(&opcode);
        let body = bytes.get(9..).filter(|_| is_chunk);
        Ok(body.and_then(ChunkRecord::read))
    }
}

const fn lost(start: u64, end: u64, why: Loss) -> Piece {
    Piece::Lost(Lost { start, end, why, times: None })
}
