//! The judgement of a frame by its opcode, its length and the lengths that its body repeats.

use std::io;

use super::{Frames, Loss};
use crate::log::record::{
    ChunkRecord, FRAME_HEADER, MessageRecord, extends, frame_header, indexed_messages, op,
};

/// Of a broken frame the place or the length cannot be right.
pub(super) enum Judged {
    Sound { end: u64, opcode: u8 },
    Unsound { end: u64, why: Loss },
    Broken(Loss),
}

impl Frames<'_> {
    pub(super) fn judge(&mut self, start: u64) -> io::Result<Judged> {
        let length_of_file = self.source.length();
        let Some((opcode, length)) = frame_header(self.source.probe(start, 9)?) else {
            return Ok(Judged::Broken(Loss::Truncated));
        };
        if opcode == 0 {
            return Ok(Judged::Broken(Loss::Framing(start)));
        }
        let end = start.checked_add(FRAME_HEADER).and_then(|body| body.checked_add(length));
        let Some(end) = end.filter(|&end| end <= length_of_file) else {
            let known = opcode <= op::DATA_END;
            return Ok(Judged::Broken(if known { Loss::Truncated } else { Loss::Framing(start) }));
        };
        let of_summary = belongs_to_summary(opcode) && self.log.went_on;
        let is_private = opcode >= op::FIRST_PRIVATE;
        if (is_private && !self.was_a_chunk(start, length)?) || of_summary {
            // The record itself cannot be checked, but the one after it can.
            return Ok(if self.could_follow(end)? {
                Judged::Sound { end, opcode }
            } else {
                Judged::Broken(Loss::Framing(start))
            });
        }
        let why = if opcode > op::DATA_END || belongs_to_summary(opcode) {
            Loss::Opcode(opcode)
        } else if opcode != op::ATTACHMENT && length > self.limits.record_bytes {
            Loss::TooLong(self.limits.record_bytes)
        } else if !self.body_fits(opcode, start, length)? {
            Loss::Malformed(opcode)
        } else {
            return Ok(Judged::Sound { end, opcode });
        };
        Ok(if self.could_follow(end)? {
            Judged::Unsound { end, why }
        } else {
            Judged::Broken(Loss::Framing(start))
        })
    }

    /// Whether the start of the body agrees with the length, for the records where it states one.
    fn body_fits(&mut self, opcode: u8, start: u64, length: u64) -> io::Result<bool> {
        let body = self.source.probe(start + FRAME_HEADER, ChunkRecord::MOST_HEADER)?;
        Ok(match opcode {
            // A header is at the start of the file only.
            op::HEADER => false,
            op::MESSAGE => length >= MessageRecord::HEADER,
            op::CHUNK => ChunkRecord::read(body).is_some_and(|chunk| chunk.fits(length)),
            op::MESSAGE_INDEX => indexed_messages(body, length).is_some(),
            op::DATA_END => {
                extends(4, length) && self.could_follow(start + FRAME_HEADER + length)?
            }
            op::FOOTER => self.footer_fits(start + FRAME_HEADER + length, length)?,
            _ => self.adds_up(Part::of(opcode), start + FRAME_HEADER, length)?,
        })
    }

    /// Whether the parts of a body, with the counts in it, are as long as the body.
    fn adds_up(&mut self, parts: &[Part], body: u64, length: u64) -> io::Result<bool> {
        let mut fields = 0_u64;
        for part in parts {
            let (width, counted) = match *part {
                Part::Fixed(width) => (width, false),
                Part::Counted(width) => (width, true),
            };
            let mut count = [0; 8];
            if counted {
                let bytes = self.source.probe(body + fields, usize::from(width))?;
                count[..bytes.len()].copy_from_slice(bytes);
            }
            let more = u64::from_le_bytes(count).checked_add(u64::from(width));
            match more.and_then(|more| fields.checked_add(more)) {
                Some(sum) if sum <= length => fields = sum,
                _ => return Ok(false),
            }
        }
        Ok(extends(fields, length))
    }

    /// Whether an application-specific record is a chunk with one bit wrong.
    fn was_a_chunk(&mut self, start: u64, length: u64) -> io::Result<bool> {
        let chunk = self.chunk(start, op::CHUNK | op::FIRST_PRIVATE)?;
        Ok(chunk.is_some_and(|chunk| chunk.is_certain(length)))
    }

    /// Whether a footer of `length` bytes may end at `end`: only magic bytes follow a footer.
    pub(super) fn footer_fits(&mut self, end: u64, length: u64) -> io::Result<bool> {
        let near_end = self.source.length().saturating_sub(end) <= 8;
        Ok(extends(20, length) && (near_end || self.has_magic(end)?))
    }

    /// A quick test: the end of the file or of a log, or an opcode in use and a plausible length.
    pub(super) fn could_follow(&mut self, start: u64) -> io::Result<bool> {
        if start == self.source.length() || self.has_magic(start)? {
            return Ok(true);
        }
        let most = self.limits.record_bytes.max(self.source.length());
        let header = self.source.probe(start, 9)?;
        Ok(match (header.first(), frame_header(header)) {
            (Some(1..=op::DATA_END | op::FIRST_PRIVATE..), Some((_, length))) => length <= most,
            (Some(1..=op::DATA_END), None) => true,
            _ => false,
        })
    }

    /// Whether the file or the log ends at `start`, or continues with a record of a summary.
    pub(super) fn summary_follows(&mut self, start: u64) -> io::Result<bool> {
        if self.has_magic(start)? {
            return Ok(true);
        }
        let opcode = self.source.probe(start, 1)?.first().copied();
        Ok(match opcode {
            None => true,
            Some(opcode) => {
                matches!(opcode, op::SCHEMA | op::CHANNEL | op::FOOTER)
                    || belongs_to_summary(opcode)
            }
        })
    }
}

/// Records that only a summary has; in the data section they are other records with a damaged opcode.
pub(in crate::log) const fn belongs_to_summary(opcode: u8) -> bool {
    matches!(
        opcode,
        op::CHUNK_INDEX
            | op::ATTACHMENT_INDEX
            | op::STATISTICS
            | op::METADATA_INDEX
            | op::SUMMARY_OFFSET
    )
}

#[derive(Debug, Clone, Copy)]
enum Part {
    Fixed(u8),
    Counted(u8),
}

impl Part {
    /// The parts of the records whose length they determine, by the specification.
    const fn of(opcode: u8) -> &'static [Self] {
        use Part::{Counted, Fixed};
        match opcode {
            op::SCHEMA => &[Fixed(2), Counted(4), Counted(4), Counted(4)],
            op::CHANNEL => &[Fixed(4), Counted(4), Counted(4), Counted(4)],
            op::ATTACHMENT => &[Fixed(16), Counted(4), Counted(4), Counted(8), Fixed(4)],
            op::METADATA => &[Counted(4), Counted(4)],
            _ => &[],
        }
    }
}
