//! Scan: one log file → every sound message given to a visitor, every lost byte range to the account.
//!
//! 1. Check the magic bytes and read the header.
//! 2. Walk the frames and gather blocks: chunks, and runs of records outside chunks.
//! 3. A batch of blocks, bounded in bytes, is decompressed, checked and decoded in parallel, each block into a part
//!    of its own.
//! 4. The parts are merged in the order of the file, so the result does not depend on the number of threads. A block
//!    that defines channels is worked on when its turn comes. What takes long of that the visitor does while the next
//!    batch is opened.
//! 5. Judge what is known only at the end: the checksum of all records, how the file ends.

mod blocks;
mod end;

use std::path::Path;

use mcap::MAGIC;
use rayon::prelude::*;

use super::account::Account;
use super::block::{Block, BlockFault, Extent, Metadata, Outcome};
use super::frames::{Frames, Loss, Lost, Piece};
use super::record::{FRAME_HEADER, HeaderRecord, MessageRecord, op};
use super::registry::{Channel, Refused, Registry, Schema};
use super::source::Source;
use super::summary::Definitions;
use super::{FileError, Limits};
use crate::ingest::{LogReject, SpanClock};
use crate::progress::Progress;
use blocks::{Run, settle};

/// Bytes of a run of records outside chunks.
const RUN_BYTES: u64 = 1024 * 1024;
/// Blocks of one batch: each keeps a decompressor.
const MOST_BLOCKS: usize = 64;

/// What wants a log's messages. `message` is called from many threads, everything else from one.
pub trait Visitor: Sync {
    /// What it keeps for each channel.
    type Decoder: Send + Sync;
    /// What it makes of one block.
    type Part: Default + Send;
    /// Why it may give up.
    type Error;

    /// A channel was met for the first time.
    fn channel(
        &mut self,
        channel: &Channel,
        schema: Option<&Schema>,
    ) -> Result<Self::Decoder, Self::Error>;
    /// A message of a channel that was met.
    fn message(&self, decoder: &Self::Decoder, message: &MessageRecord<'_>, part: &mut Self::Part);
    /// Empties a part for the next block; its buffers should stay.
    fn clear(&self, part: &mut Self::Part);
    /// Works on what was merged, while the next blocks are opened; called from one thread at a time.
    fn meanwhile(&self) {}
    /// Takes over what was made of a block, and adds what it left out of it.
    fn merge(&mut self, extent: &Extent, part: &mut Self::Part, rejects: &mut Vec<LogReject>);
}

/// Reads a whole log.
pub fn scan<V, E>(
    path: &Path,
    name: &str,
    limits: Limits,
    visitor: &mut V,
    progress: &dyn Progress,
) -> Result<Account, E>
where
    V: Visitor<Error = E>,
    V::Part: Send,
    E: From<FileError>,
{
    let (mut source, packed) = Source::open(path, name, limits, progress)?;
    let mut account = Account {
        file: name.to_owned(),
        bytes: source.length(),
        packed,
        ..Account::default()
    };
    let start = read_header(&mut source, &mut account)?;
    progress.begin(name, source.length());
    let mut scan = Scan {
        frames: Frames::new(&mut source, start, limits),
        registry: Registry::default(),
        batch: Vec::new(),
        filled: 0,
        // The first blocks define the channels: a batch full of them would wait for the first one.
        blocks_at_once: 1,
        limits,
        visitor,
        account,
        progress,
        told: 0,
        summary: None,
        metadata: Metadata::default(),
    };
    scan.run()?;
    scan.judge_end()?;
    let channels = scan.registry.channels().cloned().collect();
    let metadata = scan.metadata.entries;
    let mut account = scan.account;
    account.channels = channels;
    account.metadata = metadata;
    progress.end();
    Ok(account)
}

/// Checks the magic bytes; returns where the data section begins.
fn read_header(source: &mut Source, account: &mut Account) -> Result<u64, FileError> {
    let name = account.file.clone();
    let at_fault = |source| FileError::Io {
        file: name.clone(),
        source,
    };
    if source.length() == 0 {
        return Err(FileError::Empty { file: name });
    }
    let start = source.peek(0, 8).map_err(at_fault)?.to_vec();
    if start != MAGIC {
        return Err(FileError::NotMcap { file: name, start });
    }
    let frame = source.peek(8, 9).map_err(at_fault)?.to_vec();
    let (Some(&op::HEADER), Some(length)) = (
        frame.first(),
        frame.get(1..).and_then(|l| l.first_chunk::<8>()),
    ) else {
        return Ok(8);
    };
    let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
    let body = source.peek(8 + FRAME_HEADER, length).map_err(at_fault)?;
    if body.len() < length {
        return Ok(8);
    }
    if let Some(header) = HeaderRecord::read(body) {
        header.profile.clone_into(&mut account.profile);
        header.library.clone_into(&mut account.library);
        return Ok(8 + FRAME_HEADER + length as u64);
    }
    Ok(8)
}

struct Scan<'a, V: Visitor> {
    frames: Frames<'a>,
    registry: Registry<V::Decoder>,
    batch: Vec<Block<V::Part>>,
    /// Blocks of the batch that are in use; the others keep their buffers.
    filled: usize,
    blocks_at_once: usize,
    limits: Limits,
    visitor: &'a mut V,
    account: Account,
    progress: &'a dyn Progress,
    /// Bytes told to the progress.
    told: u64,
    /// What the summary defines, once it was needed.
    summary: Option<Definitions>,
    metadata: Metadata,
}

impl<V, E> Scan<'_, V>
where
    V: Visitor<Error = E>,
    E: From<FileError>,
{
    fn run(&mut self) -> Result<(), E> {
        let mut run: Option<Run> = None;
        loop {
            let piece = self.frames.next().map_err(|source| self.io(source))?;
            run = match (piece, run.take()) {
                (
                    Some(Piece::Record {
                        start,
                        end,
                        is_message,
                    }),
                    run,
                ) => {
                    // An attachment or an index between two records is stepped over, and ends a run.
                    let (own, before) = match run {
                        Some(run) if run.end == start => (Some(run), None),
                        run => (None, run),
                    };
                    before.map_or(Ok(()), |run| self.add_run(&run))?;
                    self.unless_full(Run::grown(own, start, end, is_message))?
                }
                (Some(Piece::Lost(mut lost)), Some(mut run)) => {
                    run.yield_to(&mut lost);
                    self.add_run(&run)?;
                    self.lose(&lost);
                    None
                }
                (piece, run) => {
                    if let Some(run) = run {
                        self.add_run(&run)?;
                    }
                    match piece {
                        None => break,
                        Some(piece) => self.take(piece)?,
                    }
                    None
                }
            };
        }
        self.flush()?;
        self.check_unchunked()
    }

    fn take(&mut self, piece: Piece) -> Result<(), E> {
        match piece {
            Piece::Chunk { start, end, chunk } => {
                let extent = Extent {
                    start,
                    end,
                    chunk: Some(chunk),
                    indexed: None,
                };
                self.add(extent)
            }
            Piece::Index { messages } => {
                if let Some(block) = self.batch[..self.filled].last_mut() {
                    let indexed = &mut block.extent.indexed;
                    *indexed = indexed.unwrap_or(0).checked_add(messages);
                }
                Ok(())
            }
            Piece::Lost(lost) => {
                self.lose(&lost);
                Ok(())
            }
            Piece::Record { .. } => Ok(()),
        }
    }

    fn unless_full(&mut self, run: Run) -> Result<Option<Run>, E> {
        if run.end - run.start < RUN_BYTES {
            return Ok(Some(run));
        }
        self.add_run(&run)?;
        Ok(None)
    }

    fn add_run(&mut self, run: &Run) -> Result<(), E> {
        if run.end == run.start {
            return Ok(());
        }
        self.add(Extent {
            start: run.start,
            end: run.end,
            chunk: None,
            indexed: None,
        })
    }

    /// Puts a block into the batch, after working on the batch if it is full.
    fn add(&mut self, extent: Extent) -> Result<(), E> {
        let bytes = weight(&extent, self.limits);
        let held: u64 = self.batch[..self.filled]
            .iter()
            .map(|block| weight(&block.extent, self.limits))
            .sum();
        if self.filled > 0
            && (self.filled >= self.blocks_at_once || held + bytes > self.limits.batch_bytes)
        {
            self.flush()?;
        }
        if self.filled == self.batch.len() {
            self.batch.push(Block::default());
        }
        self.batch[self.filled].extent = extent;
        self.filled += 1;
        Ok(())
    }

    fn flush(&mut self) -> Result<(), E> {
        let blocks = &mut self.batch[..self.filled];
        let (visitor, registry) = (&*self.visitor, &self.registry);
        let (source, limit) = (&*self.frames.source(), self.limits.chunk_bytes);
        let open = |block: &mut Block<V::Part>| {
            block.read(source, limit)?;
            block.open(visitor, registry, limit);
            Ok(())
        };
        let (opened, ()) = rayon::join(
            || blocks.par_iter_mut().try_for_each(open),
            || visitor.meanwhile(),
        );
        opened.map_err(|error| self.io(error))?;
        for place in 0..self.filled {
            // Taken out of the batch, to be worked on beside the rest of the scan.
            let mut block = std::mem::take(&mut self.batch[place]);
            if block.outcome == Outcome::Defines {
                self.define(&mut block)?;
            }
            settle(&mut block, self.visitor, &mut self.account);
            self.keep(&mut block);
            self.batch[place] = block;
        }
        self.progress.advance(self.frames.at() - self.told);
        self.told = self.frames.at();
        self.filled = 0;
        self.blocks_at_once = (self.blocks_at_once * 2).min(MOST_BLOCKS);
        self.let_go();
        Ok(())
    }

    /// Gives buffers back where all blocks together keep more than a batch may hold.
    fn let_go(&mut self) {
        let mut kept = 0;
        for block in &mut self.batch {
            kept += block.kept();
            if kept > self.limits.batch_bytes {
                kept -= block.kept();
                *block = Block::default();
            }
        }
    }

    /// Takes in what the block defines and, where that does not suffice because a definition was lost, what the
    /// summary says of its channels.
    fn define(&mut self, block: &mut Block<V::Part>) -> Result<(), E> {
        block.define(self.visitor, &mut self.registry)?;
        let unknown: Vec<_> = block.unknown_channels().collect();
        if unknown.is_empty() {
            return Ok(());
        }
        let summary = match self.summary.take() {
            Some(summary) => summary,
            None => Definitions::read(self.frames.source()).map_err(|source| self.io(source))?,
        };
        for (channel, schema) in unknown.iter().filter_map(|&id| summary.of(id)) {
            if schema.is_some_and(|schema| self.registry.add_schema(&schema).is_err()) {
                continue;
            }
            // Refused only where there is no room; the messages are then counted as of an unknown channel.
            let added = self.registry.add_channel(&channel, |channel, schema| {
                self.visitor.channel(channel, schema)
            })?;
            debug_assert!(added != Err(Refused::Redefined), "unknown until now");
        }
        self.summary = Some(summary);
        block.define(self.visitor, &mut self.registry)
    }

    /// Keeps the block's metadata records, if there is room for them.
    fn keep(&mut self, block: &mut Block<V::Part>) {
        let later = std::mem::take(&mut block.metadata);
        if !self.metadata.append(&later) {
            let fault = BlockFault::TooMuchMetadata.to_string();
            let place = (block.extent.start, block.extent.end);
            self.note(place, fault);
        }
    }

    /// Tells of bytes without messages.
    fn note(&mut self, (byte_start, byte_end): (u64, u64), reason: String) {
        let file = self.account.file.clone();
        self.account.reject(LogReject {
            file,
            topic: None,
            byte_start,
            byte_end,
            time_span_ns: None,
            clock: SpanClock::Log,
            messages: Some(0),
            reason,
        });
    }

    fn lose(&mut self, lost: &Lost) {
        let times = lost.times.map(|(first, last)| (ns(first), ns(last)));
        let messages = (lost.why == Loss::NoDataEnd).then_some(0);
        let reject = LogReject {
            file: self.account.file.clone(),
            topic: None,
            byte_start: lost.start,
            byte_end: lost.end,
            time_span_ns: times,
            clock: SpanClock::Log,
            messages,
            reason: lost.why.to_string(),
        };
        self.account.reject(reject);
    }

    fn io(&self, source: std::io::Error) -> E {
        let file = self.account.file.clone();
        FileError::Io { file, source }.into()
    }
}

/// Bytes that a block may occupy while it is worked on.
fn weight(extent: &Extent, limits: Limits) -> u64 {
    match &extent.chunk {
        None => extent.end - extent.start,
        Some(chunk) => chunk.needs().min(limits.chunk_bytes),
    }
}

/// A log's time as a stamp; times past the year 2262 are cut to it.
pub fn ns(time: u64) -> i64 {
    i64::try_from(time).unwrap_or(i64::MAX)
}
