//! The frames of a log's data section: where each record lies, and which bytes are lost.
//!
//! Only the data section is walked; the summary after it is a hint that can be missing or lie. Each record is an
//! opcode, a length and a body. A frame is believed when its opcode belongs here and its length fits the file and,
//! where the body says so again, the body.
//!
//! A record that is unsound but well framed is lost alone. Where framing itself is lost, the next frame that cannot
//! be there by chance is looked for: a chunk whose lengths add up, the end of the data section or, in logs
//! without chunks, three sound records in a row.

use std::io;

use thiserror::Error;

use super::Limits;
use super::record::{ChunkRecord, FRAME_HEADER, MessageRecord, extends, indexed_messages, op};
use super::source::Source;

/// Candidates for a new frame that are looked at in one log; keeps a hostile one from taking forever.
const MOST_PROBES: u32 = 1_000_000;
/// Sound records in a row that cannot be there by chance.
const CHAIN: usize = 3;

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

/// Bytes that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lost {
    pub start: u64,
    pub end: u64,
    pub why: Loss,
    /// What a chunk's header says of its log times, ns.
    pub times: Option<(u64, u64)>,
}

/// Why bytes are lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Loss {
    /// No record begins here.
    #[error(
        "no sound record begins at byte {0}; reading went on at the next one that can be trusted"
    )]
    Framing(u64),
    /// The file ends inside a record.
    #[error("the file ends inside a record: it was cut, or its recorder was stopped hard")]
    Truncated,
    /// The file ends between two records, without the mark that data is complete.
    #[error(
        "the file ends without a data end record: it was cut or its recorder was stopped hard, and what is missing \
         cannot be known"
    )]
    NoDataEnd,
    /// A record whose opcode is not known or does not belong into the data section.
    #[error(
        "a record with opcode 0x{0:02x} does not belong here: its opcode is damaged, or another format wrote it"
    )]
    Opcode(u8),
    /// A record whose own fields do not fit its length.
    #[error("the fields of a record with opcode 0x{0:02x} do not fit its length")]
    Malformed(u8),
    /// Longer than the limit.
    #[error(
        "a record is longer than the limit of {0} bytes; if that is right, raise record_bytes in [limits]"
    )]
    TooLong(u64),
}

/// What a frame is found to be.
enum Judged {
    Sound {
        end: u64,
        opcode: u8,
    },
    /// Its place is right, its body is not.
    Unsound {
        end: u64,
        why: Loss,
    },
    /// Its place or length cannot be right.
    Broken(Loss),
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

    fn judge(&mut self, start: u64) -> io::Result<Judged> {
        let length_of_file = self.source.length();
        let header = self.source.probe(start, 9)?;
        let Some((&[opcode], length)) = header.split_first_chunk::<1>() else {
            return Ok(Judged::Broken(Loss::Truncated));
        };
        let Some(length) = length.first_chunk::<8>().map(|l| u64::from_le_bytes(*l)) else {
            return Ok(Judged::Broken(Loss::Truncated));
        };
        if opcode == 0 {
            return Ok(Judged::Broken(Loss::Framing(start)));
        }
        let end = start
            .checked_add(FRAME_HEADER)
            .and_then(|body| body.checked_add(length));
        let Some(end) = end.filter(|&end| end <= length_of_file) else {
            let known = opcode <= op::DATA_END;
            return Ok(Judged::Broken(if known {
                Loss::Truncated
            } else {
                Loss::Framing(start)
            }));
        };
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

    /// Whether the start of the body agrees with the length, for the records where it can tell.
    fn body_fits(&mut self, opcode: u8, start: u64, length: u64) -> io::Result<bool> {
        let body = self
            .source
            .probe(start + FRAME_HEADER, ChunkRecord::MOST_HEADER)?;
        Ok(match opcode {
            // The header stands at the start of the file only.
            op::HEADER => false,
            op::MESSAGE => length >= MessageRecord::HEADER,
            op::CHUNK => ChunkRecord::read(body).is_some_and(|chunk| chunk.fits(length)),
            op::MESSAGE_INDEX => indexed_messages(body, length).is_some(),
            op::DATA_END => {
                extends(4, length) && self.summary_follows(start + FRAME_HEADER + length)?
            }
            // Only the closing magic bytes follow a footer.
            op::FOOTER => length >= 20 && self.source.length() - start - FRAME_HEADER - length <= 8,
            _ => self.adds_up(Part::of(opcode), start + FRAME_HEADER, length)?,
        })
    }

    /// Whether the parts of a body, by the counts in it, are as long as the body.
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

    /// Whether a frame at `start` looks like one at a glance: the end of the file, or a known opcode and a length
    /// that is not absurd.
    fn could_follow(&mut self, start: u64) -> io::Result<bool> {
        if start == self.source.length() {
            return Ok(true);
        }
        let most = self.limits.record_bytes.max(self.source.length());
        let header = self.source.probe(start, 9)?;
        Ok(
            match (
                header.first(),
                header.get(1..9).and_then(|l| l.first_chunk::<8>()),
            ) {
                (Some(1..=op::DATA_END), Some(length)) => u64::from_le_bytes(*length) <= most,
                (Some(1..=op::DATA_END), None) => true,
                _ => false,
            },
        )
    }

    /// Whether the file ends at `start` or goes on with a record of a summary.
    fn summary_follows(&mut self, start: u64) -> io::Result<bool> {
        let opcode = self.source.probe(start, 1)?.first().copied();
        Ok(match opcode {
            None => true,
            Some(opcode) => {
                matches!(opcode, op::SCHEMA | op::CHANNEL | op::FOOTER)
                    || belongs_to_summary(opcode)
            }
        })
    }

    fn lose_framing(&mut self, start: u64, why: Loss) -> io::Result<Piece> {
        let chunk = self
            .chunk(start)?
            .filter(ChunkRecord::has_known_compression);
        let times = chunk
            .as_ref()
            .map(|chunk| (chunk.start_time, chunk.end_time));
        self.chunked |= chunk.is_some();
        let found = self.resynchronise(start + 1)?;
        let end = found.unwrap_or(self.source.length());
        self.at = end;
        self.ended = found.is_none();
        let why = if found.is_some() {
            Loss::Framing(start)
        } else {
            why
        };
        Ok(Piece::Lost(Lost {
            start,
            end,
            why,
            times,
        }))
    }

    /// The header of the chunk whose frame begins at `start`, if one does.
    fn chunk(&mut self, start: u64) -> io::Result<Option<ChunkRecord>> {
        let bytes = self.source.probe(start, 9 + ChunkRecord::MOST_HEADER)?;
        let is_chunk = bytes.first() == Some(&op::CHUNK);
        let body = bytes.get(9..).filter(|_| is_chunk);
        Ok(body.and_then(ChunkRecord::read))
    }

    /// The next place from `from` on where a frame begins that cannot be there by chance.
    fn resynchronise(&mut self, from: u64) -> io::Result<Option<u64>> {
        let chunked = self.chunked;
        let mut at = from;
        while at < self.source.length() && self.probes_left > 0 {
            let window = self.source.peek(at, usize::MAX)?;
            let candidate = window.windows(9).position(|header| {
                let opcode = match header[0] {
                    op::CHUNK | op::DATA_END => true,
                    // Records inside an uncompressed chunk look like records of the file, but no checksum covers them.
                    op::SCHEMA..=op::MESSAGE | op::METADATA => !chunked,
                    _ => false,
                };
                opcode && header[6..9] == [0; 3]
            });
            // The last eight bytes of a window are looked at again at the head of the next one.
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

    fn is_anchor(&mut self, at: u64) -> io::Result<bool> {
        let Judged::Sound { end, opcode } = self.judge(at)? else {
            return Ok(false);
        };
        match opcode {
            op::CHUNK => Ok(self
                .chunk(at)?
                .is_some_and(|chunk| chunk.is_certain(end - at - FRAME_HEADER))),
            op::DATA_END => self.could_follow(end),
            _ => self.is_chain(end),
        }
    }

    fn is_chain(&mut self, mut at: u64) -> io::Result<bool> {
        for _ in 1..CHAIN {
            if at == self.source.length() {
                return Ok(true);
            }
            match self.judge(at)? {
                Judged::Sound {
                    opcode: op::DATA_END,
                    ..
                } => return Ok(true),
                Judged::Sound {
                    end,
                    opcode: op::SCHEMA..=op::CHUNK | op::METADATA,
                } => at = end,
                _ => return Ok(false),
            }
        }
        Ok(true)
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

/// Records that only a summary has; in the data section they are something else with a damaged opcode.
const fn belongs_to_summary(opcode: u8) -> bool {
    matches!(
        opcode,
        op::CHUNK_INDEX
            | op::ATTACHMENT_INDEX
            | op::STATISTICS
            | op::METADATA_INDEX
            | op::SUMMARY_OFFSET
    )
}

/// Parts of a record's body, as far as its length follows from them.
#[derive(Debug, Clone, Copy)]
enum Part {
    /// So many bytes.
    Fixed(u8),
    /// A count in so many bytes, and as many bytes as it says.
    Counted(u8),
}

impl Part {
    /// Of the records whose parts say how long they are, by the specification.
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

/// The body of each record in a sound run of frames, with its place.
pub struct Records<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Records<'a> {
    /// Starts at the first frame of `bytes`.
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
        // Whatever happens, an unsound frame is the last one.
        self.at = self.bytes.len();
        let body = rest.get(1..9).and_then(|length| {
            let length = usize::try_from(u64::from_le_bytes(*length.first_chunk()?)).ok()?;
            rest.get(9..length.checked_add(9)?)
        });
        let Some(body) = body else {
            return Some(Err(start));
        };
        self.at = start + 9 + body.len();
        Some(Ok((start, rest[0], body)))
    }
}
