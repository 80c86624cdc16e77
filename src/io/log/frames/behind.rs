//! The bytes after the data of a log: its summary and its end, further data, or another log. Where a data record is
//! among the summary, the mark that data ends is wrong, and the walk continues after it.

use std::io;

use mcap::MAGIC;

use super::again::Among;
use super::judge::Judged;
use super::{Frames, Loss, Lost, Piece, lost};
use crate::log::record::{FRAME_HEADER, op};
use crate::log::summary::{self, Ending, next_frame};

const MARK: u64 = MAGIC.len() as u64;

enum Behind {
    /// No more data of the log; the byte where its end was found.
    End(u64),
    Data,
}

/// Whether a log begins with these bytes: magic bytes and the opcode of a header.
pub(super) fn begins_log(start: &[u8]) -> bool {
    start.starts_with(MAGIC) && start.get(MAGIC.len()) == Some(&op::HEADER)
}

impl Frames<'_> {
    pub(super) fn has_magic(&mut self, at: u64) -> io::Result<bool> {
        Ok(self.source.probe(at, MAGIC.len())? == MAGIC)
    }

    pub(super) fn begins_log(&mut self, at: u64) -> io::Result<bool> {
        Ok(begins_log(self.source.probe(at, MAGIC.len() + 1)?))
    }

    /// The log that begins at `start`; before it, the loss that the previous log has no end, where it has none.
    pub(super) const fn next_log(&mut self, start: u64) -> Piece {
        if self.log.end.is_some() {
            return Piece::Log { start };
        }
        self.log.end = Some(start);
        lost(start, start, Loss::NoDataEnd)
    }

    /// Notes the mark, from `start` to `end`, that data ends here, and continues after it.
    pub(super) fn end_data(&mut self, start: u64, end: u64) -> io::Result<Option<Piece>> {
        let body = self.source.probe(start + FRAME_HEADER, 4)?;
        let crc = body.first_chunk::<4>().map(|crc| u32::from_le_bytes(*crc));
        self.log.data_crc = crc.filter(|&crc| crc != 0).map(|crc| (start, crc));
        self.log.data_end = Some(end);
        match self.behind(end)? {
            Behind::End(at) => self.end_log(at),
            Behind::Data => {
                self.log.went_on = true;
                Ok(Some(lost(start, end, Loss::EarlyEnd(start))))
            }
        }
    }

    /// Continues after the log's footer, or where its summary ends early.
    pub(super) fn end_log(&mut self, at: u64) -> io::Result<Option<Piece>> {
        let is_closed = self.has_magic(at)? && !self.begins_log(at)?;
        let end = at + if is_closed { MARK } else { 0 };
        self.at = end;
        if end >= self.source.length() || self.begins_log(end)? {
            self.log.end = Some(end);
            self.ended = end >= self.source.length();
            return Ok(None);
        }
        if matches!(self.judge(end)?, Judged::Sound { opcode, .. } if is_data(opcode)) {
            self.log.went_on = true;
            return Ok(Some(lost(end, end, Loss::EarlyEnd(end))));
        }
        let Some(found) = self.resynchronise(end, Among::Summary)? else {
            self.log.end = Some(if is_closed { end } else { self.source.length() });
            self.ended = true;
            return Ok(None);
        };
        self.at = found;
        if self.begins_log(found)? {
            self.log.end = Some(end);
        } else {
            self.log.went_on = true;
        }
        Ok(Some(Piece::Lost(Lost { start: end, end: found, why: Loss::Framing(end), times: None })))
    }

    /// Skips a summary, up to the first byte that is none.
    fn behind(&mut self, from: u64) -> io::Result<Behind> {
        let is_damaged = self.is_damaged_summary(from)?;
        let mut at = from;
        loop {
            if at >= self.source.length() || self.has_magic(at)? {
                return Ok(Behind::End(at));
            }
            let length = self.source.length();
            let Some((opcode, end)) = next_frame(self.source, at, length)? else { break };
            if opcode == op::FOOTER && self.footer_fits(end, end - at - FRAME_HEADER)? {
                return Ok(Behind::End(end));
            }
            let follows = self.could_follow(end)?;
            let is_data = match self.judge(at)? {
                // One wrong bit turns a definition into data: in a damaged summary only certain records count.
                Judged::Sound { opcode, .. } if is_data(opcode) => {
                    !is_damaged || self.is_anchor(at)?
                }
                _ => false,
            };
            let is_summary = summary::of_summary(opcode) || is_damaged;
            match (is_data, is_summary && follows) {
                (true, _) => return Ok(Behind::Data),
                (false, true) => at = end,
                (false, false) => break,
            }
        }
        Ok(match self.resynchronise(at + 1, Among::Summary)? {
            Some(_) => Behind::Data,
            None => Behind::End(self.source.length()),
        })
    }

    /// Whether the file's footer states that a summary begins here, and its checksum shows that it is damaged.
    fn is_damaged_summary(&mut self, from: u64) -> io::Result<bool> {
        let (start, end) = (self.log.start, self.source.length());
        let begins = summary::begin(self.source, start..end)?;
        Ok(begins == Some(from) && summary::ending(self.source, start..end)?.0 == Ending::Damaged)
    }
}

/// Whether a record belongs to the data of a log, not to its summary.
const fn is_data(opcode: u8) -> bool {
    matches!(
        opcode,
        op::MESSAGE | op::CHUNK | op::MESSAGE_INDEX | op::ATTACHMENT | op::METADATA | op::DATA_END
    )
}
