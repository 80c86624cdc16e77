//! Search, where framing is lost, for the next frame that cannot be there by chance.

use std::io;

use super::behind::begins_log;
use super::judge::Judged;
use super::{Frames, Loss, Lost, Piece};
use crate::log::record::{ChunkRecord, FRAME_HEADER, op};

/// Number of sound records in a row that cannot be there by chance.
const CHAIN: usize = 3;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Among {
    Data,
    /// After the data, where definitions are those of a summary and the mark that data ends was found.
    Summary,
}

impl Frames<'_> {
    pub(super) fn lose_framing(&mut self, start: u64, why: Loss) -> io::Result<Piece> {
        if let Some(cut) = self.before.take()
            && let Some(log) = self.log_within(cut + FRAME_HEADER, start)?
        {
            self.at = log;
            let why = Loss::Framing(cut);
            return Ok(Piece::Lost(Lost { start: cut, end: log, why, times: None }));
        }
        let chunk = self.chunk(start, op::CHUNK)?.filter(ChunkRecord::has_known_compression);
        let times = chunk.as_ref().map(|chunk| (chunk.start_time, chunk.end_time));
        self.log.chunked |= chunk.is_some();
        let found = self.resynchronise(start + 1, Among::Data)?;
        let end = found.unwrap_or(self.source.length());
        self.at = end;
        self.ended = found.is_none();
        let why = if found.is_some() { Loss::Framing(start) } else { why };
        Ok(Piece::Lost(Lost { start, end, why, times }))
    }

    /// The next byte from `from` on where a frame begins that cannot be there by chance; `None` where there is none.
    pub(super) fn resynchronise(&mut self, from: u64, among: Among) -> io::Result<Option<u64>> {
        let (chunked, in_data) = (self.log.chunked, among == Among::Data);
        let mut at = from;
        while at < self.source.length() && self.probes_left > 0 {
            let window = self.source.peek(at, usize::MAX)?;
            let candidate = window.windows(9).position(|header| {
                let opcode = match header[0] {
                    op::CHUNK => true,
                    op::DATA_END => in_data,
                    // Records inside an uncompressed chunk look like records of the file, but no checksum covers them.
                    op::MESSAGE => !chunked,
                    op::SCHEMA | op::CHANNEL | op::METADATA => in_data && !chunked,
                    _ => return begins_log(header),
                };
                opcode && header[6..9] == [0; 3]
            });
            // The last eight bytes of a window are searched again at the start of the next one.
            let step = candidate.unwrap_or(window.len().saturating_sub(8).max(1));
            at += step as u64;
            if candidate.is_some() {
                self.probes_left -= 1;
                if self.is_anchor(at)? {
                    return Ok(Some(at));
                }
                at += 1;
            }
        }
        Ok(None)
    }

    /// The record that seems to contain the log was cut, and its length reaches into it.
    fn log_within(&mut self, from: u64, to: u64) -> io::Result<Option<u64>> {
        let mut at = from;
        while at < to {
            let window = self.source.peek(at, usize::MAX)?;
            if let Some(place) = window.windows(9).position(begins_log) {
                return Ok(Some(at + place as u64).filter(|&log| log < to));
            }
            at += window.len().saturating_sub(8).max(1) as u64;
        }
        Ok(None)
    }

    pub(super) fn is_anchor(&mut self, at: u64) -> io::Result<bool> {
        if self.begins_log(at)? {
            return Ok(true);
        }
        let Judged::Sound { end, opcode } = self.judge(at)? else { return Ok(false) };
        match opcode {
            op::CHUNK => {
                let chunk = self.chunk(at, op::CHUNK)?;
                Ok(chunk.is_some_and(|chunk| chunk.is_certain(end - at - FRAME_HEADER)))
            }
            op::DATA_END => self.summary_follows(end),
            _ => self.is_chain(end),
        }
    }

    fn is_chain(&mut self, mut at: u64) -> io::Result<bool> {
        for _ in 1..CHAIN {
            if at == self.source.length() {
                return Ok(true);
            }
            match self.judge(at)? {
                Judged::Sound { opcode: op::DATA_END, .. } => return Ok(true),
                Judged::Sound { end, opcode: op::SCHEMA..=op::CHUNK | op::METADATA } => at = end,
                _ => return Ok(false),
            }
        }
        Ok(true)
    }
}
