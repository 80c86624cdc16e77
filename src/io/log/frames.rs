//! The frames of a log's data section: the place of each record, and the bytes that are lost. A frame is trusted when
//! its opcode belongs here and its length fits the file and its body.
//!
//! The end of the data section is not trusted: data records after it are read, and another log that begins there (as
//! `cat a.mcap b.mcap` leaves it) is walked too. An unsound record in a sound frame is lost alone. Where framing itself
//! is lost, the walk searches for the next frame that cannot be there by chance: a chunk whose lengths add up, the end
//! of the data section or, in logs without chunks, three sound records in a row.

mod again;
mod behind;
mod judge;

use std::collections::BTreeMap;
use std::io;

use thiserror::Error;

use super::Limits;
use super::record::{ChunkRecord, FRAME_HEADER, frame_header, indexed_messages, op};
use super::source::Source;
use judge::Judged;
pub(super) use judge::belongs_to_summary;

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

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lost {
    pub start: u64,
    pub end: u64,
    pub why: Loss,
    /// Earliest and latest log time that a chunk's header states, ns; `None` for other bytes.
    pub times: Option<(u64, u64)>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Loss {
    #[error(
        "no sound record begins at byte {0}; reading continued at the next one that can be trusted"
    )]
    Framing(u64),
    #[error("the file ends inside a record: it was cut, or its recorder was stopped hard")]
    Truncated,
    #[error(
        "the file ends without a data end record: it was cut or its recorder was stopped hard, and what is missing \
         cannot be known"
    )]
    NoDataEnd,
    #[error(
        "the log states that its data ends at byte {0}, but data records follow: they were read; readers that trust the log \
         leave them out"
    )]
    EarlyEnd(u64),
    #[error(
        "a record with opcode 0x{0:02x} does not belong here: its opcode is damaged, or another format wrote it"
    )]
    Opcode(u8),
    #[error("the fields of a record with opcode 0x{0:02x} do not fit its length")]
    Malformed(u8),
    #[error(
        "a record is longer than the limit of {0} bytes; if that is right, raise record_bytes in [limits]"
    )]
    TooLong(u64),
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

/// The numbers of messages by channel in a chunk that cannot be read, from the message indexes after it; `None` where there are none.
pub fn indexed_behind(source: &mut Source, mut at: u64) -> io::Result<Option<BTreeMap<u16, u64>>> {
    let mut found = BTreeMap::new();
    loop {
        let header = source.probe(at, 15)?;
        let Some((op::MESSAGE_INDEX, length)) = frame_header(header) else { break };
        let Some((channel, messages)) = header.get(9..).and_then(|b| indexed_messages(b, length))
        else {
            break;
        };
        let end = at.saturating_add(FRAME_HEADER).saturating_add(length);
        if end > source.length() {
            break;
        }
        *found.entry(channel).or_default() += messages;
        at = end;
    }
    Ok((!found.is_empty()).then_some(found))
}

/// The records in a sound run of frames, such as a chunk's.
pub struct Records<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Records<'a> {
    pub const fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }
}

impl<'a> Iterator for Records<'a> {
    /// Place of the frame, opcode, body; or the place where a frame does not fit.
    type Item = Result<(usize, u8, &'a [u8]), usize>;

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        let start = self.at;
        let rest = self.bytes.get(start..).filter(|rest| !rest.is_empty())?;
        // An unsound frame is always the last one.
        self.at = self.bytes.len();
        let body = rest.get(1..9).and_then(|length| {
            let length = usize::try_from(u64::from_le_bytes(*length.first_chunk()?)).ok()?;
            rest.get(9..length.checked_add(9)?)
        });
        let Some(body) = body else { return Some(Err(start)) };
        self.at = start + 9 + body.len();
        Some(Ok((start, rest[0], body)))
    }
}
