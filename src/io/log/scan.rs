//! Scan: one log file → every sound message given to a visitor, every lost byte range recorded. A batch of blocks
//! (chunks, and runs of records outside chunks), bounded in bytes, is decompressed and decoded in parallel, and merged
//! in the order of the file, so the result does not depend on the number of threads. A block that defines channels is
//! worked on when its turn comes; the visitor does the long part of its work while the next batch is opened.

mod blocks;
mod counts;
mod end;
mod missing;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use mcap::MAGIC;
use rayon::prelude::*;

use super::block::{Block, BlockFault, Extent, Metadata, Outcome};
use super::frames::{Frames, Loss, Lost, Piece, indexed_behind};
use super::read_summary::ReadSummary;
use super::record::{FRAME_HEADER, HeaderRecord, MessageRecord, frame_header, op};
use super::registry::{Channel, Refused, Registry, Schema};
use super::source::Source;
use super::summary::Definitions;
use super::{FileError, FileFault, Limits};
use crate::ingest::{LogReject, LossKind};
use crate::progress::Progress;
use blocks::{Run, settle};
use counts::Counts;

/// Most bytes of a run of records outside chunks.
const RUN_BYTES: u64 = 1024 * 1024;
/// Most blocks of one batch: each keeps a decompressor.
const MOST_BLOCKS: usize = 64;
const MOST_PLACES: usize = 100;

const ANOTHER_LOG: &str = "another log begins here, after the one before: both were read, each with its own channels; other \
     readers read one of them only, so split or merge them (`mcap merge`)";

/// A receiver of a log's messages. `message` is called from many threads, all other methods from one.
pub trait Visitor: Sync {
    type Decoder: Send + Sync;
    type Part: Default + Send;
    type Error;

    /// Called when a channel is found for the first time.
    fn channel(
        &mut self,
        channel: &Channel,
        schema: Option<&Arc<Schema>>,
    ) -> Result<Self::Decoder, Self::Error>;
    /// Bytes that a part may take in addition, for a block of this many bytes.
    fn part_bytes(&self, _block: u64) -> u64 {
        0
    }
    /// Called for a message of a channel that was found.
    fn message(&self, decoder: &Self::Decoder, message: &MessageRecord<'_>, part: &mut Self::Part);
    /// Empties a part for the next block; its buffers should be kept.
    fn clear(&self, part: &mut Self::Part);
    /// Works on what was merged, while the next blocks are opened; called from one thread at a time.
    fn meanwhile(&self) {}
    /// Takes the result of a block, and adds the messages that it left out to the rejects.
    fn merge(&mut self, extent: &Extent, part: &mut Self::Part, rejects: &mut Vec<LogReject>);
}

pub fn scan<V: Visitor<Error = E>, E: From<FileError>>(
    path: &Path,
    name: &str,
    limits: Limits,
    visitor: &mut V,
    progress: &dyn Progress,
) -> Result<ReadSummary, E> {
    let (mut source, packed) = Source::open(path, name, limits, progress)?;
    let mut read_summary = ReadSummary {
        file: name.to_owned(),
        bytes: source.length(),
        packed,
        ..ReadSummary::default()
    };
    let start = read_start(&mut source, &mut read_summary)?;
    progress.begin(name, source.length());
    let mut scan = Scan {
        frames: Frames::new(&mut source, start, limits),
        registry: Registry::default(),
        batch: Vec::new(),
        filled: 0,
        // The first blocks define the channels: the other blocks of a full batch would wait for the first one.
        blocks_at_once: 1,
        limits,
        visitor,
        read_summary,
        progress,
        reported: 0,
        summary: None,
        metadata: Metadata::default(),
        read: Counts::default(),
        lost: Counts::default(),
        private: Vec::new(),
        outside_chunks: 0,
        rejects: 0,
    };
    scan.run()?;
    scan.reject_undecompressed();
    let metadata = scan.metadata.entries;
    let mut read_summary = scan.read_summary;
    read_summary.metadata = metadata;
    progress.end();
    Ok(read_summary)
}

/// Checks the magic bytes of the file; returns where its first data section begins.
fn read_start(source: &mut Source, read_summary: &mut ReadSummary) -> Result<u64, FileError> {
    let name = read_summary.file.clone();
    let at_fault = |source: std::io::Error| FileError::new(&name, source);
    if source.length() == 0 {
        return Err(FileError::new(&name, FileFault::Empty));
    }
    let start = source.peek(0, 8).map_err(at_fault)?.to_vec();
    if start != MAGIC {
        return Err(FileError::new(&name, FileFault::NotMcap(start)));
    }
    read_header(source, 0, read_summary).map_err(at_fault)
}

/// First byte of the data section of the log that begins at byte `log`; the first header is kept.
fn read_header(
    source: &mut Source,
    log: u64,
    read_summary: &mut ReadSummary,
) -> std::io::Result<u64> {
    read_summary.logs += 1;
    let at = log + MAGIC.len() as u64;
    let Some((op::HEADER, length)) = frame_header(source.peek(at, 9)?) else { return Ok(at) };
    let length = usize::try_from(length).unwrap_or(usize::MAX);
    let body = source.peek(at + FRAME_HEADER, length)?;
    if body.len() < length {
        return Ok(at);
    }
    let Some(header) = HeaderRecord::read(body) else { return Ok(at) };
    if read_summary.logs == 1 {
        header.profile.clone_into(&mut read_summary.profile);
        header.library.clone_into(&mut read_summary.library);
    }
    Ok(at + FRAME_HEADER + length as u64)
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
    read_summary: ReadSummary,
    progress: &'a dyn Progress,
    reported: u64,
    /// The definitions in the log's summary; `None` until they are needed.
    summary: Option<Definitions>,
    metadata: Metadata,
    read: Counts,
    /// Number of messages in chunks of the log that cannot be read, by channel, from their message indexes.
    lost: Counts,
    /// Places of private records of the log, outside chunks; the last place may cover many.
    private: Vec<(u64, u64)>,
    /// Messages outside chunks, and rejects, of the logs before this one.
    outside_chunks: u64,
    rejects: usize,
}

impl<V: Visitor<Error = E>, E: From<FileError>> Scan<'_, V> {
    fn run(&mut self) -> Result<(), E> {
        let mut run: Option<Run> = None;
        loop {
            let piece = self.frames.next().map_err(|source| self.io(source))?;
            run = match (piece, run.take()) {
                (Some(Piece::Record { start, end, is_message }), run) => {
                    // An attachment or an index between two records is skipped, and ends a run.
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
                        Some(Piece::Log { start }) => self.next_log(start)?,
                        Some(piece) => self.take(piece)?,
                    }
                    None
                }
            };
        }
        let end = self.frames.log.end;
        self.end_log(end.unwrap_or(self.read_summary.bytes))?;
        self.note_what_follows(end);
        Ok(())
    }

    fn next_log(&mut self, start: u64) -> Result<(), E> {
        self.end_log(self.frames.log.end.unwrap_or(start).min(start))?;
        self.note((start, start), ANOTHER_LOG.to_owned());
        let at = read_header(self.frames.source, start, &mut self.read_summary);
        let at = at.map_err(|source| self.io(source))?;
        self.frames.begin(start, at);
        self.summary = None;
        self.read.clear();
        self.lost.clear();
        self.private.clear();
        self.outside_chunks = self.read_summary.messages_outside_chunks;
        self.rejects = self.read_summary.rejects.len();
        Ok(())
    }

    fn take(&mut self, piece: Piece) -> Result<(), E> {
        match piece {
            Piece::Chunk { start, end, chunk } => {
                let extent = Extent { start, end, chunk: Some(chunk) };
                self.add(extent)
            }
            Piece::Private { start, end, opcode } => {
                *self.read_summary.private_records.entry(opcode).or_default() += 1;
                let full = self.private.len() >= MOST_PLACES;
                match self.private.last_mut() {
                    Some(last) if full || last.1 == start => last.1 = end,
                    _ => self.private.push((start, end)),
                }
                Ok(())
            }
            Piece::Lost(lost) => {
                let last = self.batch[..self.filled].last();
                if last.is_some_and(|block| block.extent.start == lost.start) {
                    // It was taken for a chunk, but is none.
                    self.filled -= 1;
                }
                self.lose(&lost);
                Ok(())
            }
            Piece::Record { .. } | Piece::Log { .. } => Ok(()),
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
        self.add(Extent { start: run.start, end: run.end, chunk: None })
    }

    fn add(&mut self, extent: Extent) -> Result<(), E> {
        let weight = |extent: &Extent| {
            let bytes = weight(extent, self.limits);
            bytes.saturating_add(self.visitor.part_bytes(bytes))
        };
        let bytes = weight(&extent);
        let held: u64 = self.batch[..self.filled].iter().map(|block| weight(&block.extent)).sum();
        if self.filled > 0
            && (self.filled >= self.blocks_at_once
                || held.saturating_add(bytes) > self.limits.batch_bytes)
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
        let (source, limit) = (&*self.frames.source, self.limits.chunk_bytes);
        let open = |block: &mut Block<V::Part>| {
            block.read(source, limit)?;
            block.open(visitor, registry, limit);
            Ok(())
        };
        let (opened, ()) =
            rayon::join(|| blocks.par_iter_mut().try_for_each(open), || visitor.meanwhile());
        opened.map_err(|error| self.io(error))?;
        for place in 0..self.filled {
            // Taken out of the batch, so that the scan can be borrowed as a whole.
            let mut block = std::mem::take(&mut self.batch[place]);
            if block.outcome == Outcome::Defines {
                self.define(&mut block)?;
            }
            self.count(&mut block)?;
            settle(&mut block, self.visitor, &mut self.read_summary);
            self.keep(&mut block);
            self.batch[place] = block;
        }
        // The walk goes back where a record turns out to have been cut.
        let reached = self.frames.at.max(self.reported);
        self.progress.advance(reached - self.reported);
        self.reported = reached;
        self.filled = 0;
        self.blocks_at_once = (self.blocks_at_once * 2).min(MOST_BLOCKS);
        self.let_go();
        Ok(())
    }

    /// Frees buffers where all blocks together keep more than a batch may hold.
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

    /// Records the definitions of the block and, where one was lost, those of its channels that the summary repeats.
    fn define(&mut self, block: &mut Block<V::Part>) -> Result<(), E> {
        block.define(self.visitor, &mut self.registry)?;
        let unknown: Vec<_> = block.unknown_channels().collect();
        if unknown.is_empty() {
            return Ok(());
        }
        let summary = match self.summary.take() {
            Some(summary) => summary,
            None => self.definitions(self.read_summary.bytes)?,
        };
        // Many channels may share a schema, which takes long to compare.
        let mut schemas = BTreeMap::new();
        for (channel, schema) in unknown.iter().filter_map(|&id| summary.of(id)) {
            let known = schema.is_none_or(|schema| {
                let registry = &mut self.registry;
                let known = schemas.entry(schema.id);
                *known.or_insert_with(|| registry.add_schema(&schema).is_ok())
            });
            if !known {
                continue;
            }
            // Refused only where the limit is reached; the messages are then counted as of an unknown channel.
            let added = self
                .registry
                .add_channel(&channel, |channel, schema| self.visitor.channel(channel, schema))?;
            debug_assert!(added != Err(Refused::Redefined), "unknown until now");
        }
        self.summary = Some(summary);
        block.define(self.visitor, &mut self.registry)
    }

    /// The definitions in the summary of the log that is read, if the log ends at byte `end`.
    fn definitions(&mut self, end: u64) -> Result<Definitions, E> {
        let log = self.frames.log.start..end;
        let found = Definitions::read(self.frames.source, log);
        found.map_err(|source| self.io(source))
    }

    /// Counts the block's messages by channel; for a chunk that cannot be read, its message indexes give the numbers.
    fn count(&mut self, block: &mut Block<V::Part>) -> Result<(), E> {
        let is_lost = matches!(block.outcome, Outcome::Rejected(_));
        if is_lost && block.extent.chunk.is_some() {
            let indexed = indexed_behind(self.frames.source, block.extent.end);
            let indexed = indexed.map_err(|source| self.io(source))?;
            block.indexed = indexed.as_ref().map(|of| of.values().sum());
            for (channel, messages) in indexed.into_iter().flatten() {
                self.lost.add(channel, messages);
            }
        }
        for (channel, messages) in block.of_channels.drain(..) {
            self.read.add(channel, u64::from(messages));
        }
        Ok(())
    }

    fn keep(&mut self, block: &mut Block<V::Part>) {
        let later = std::mem::take(&mut block.metadata);
        if !self.metadata.append(&later) {
            let fault = BlockFault::TooMuchMetadata.to_string();
            let place = (block.extent.start, block.extent.end);
            self.note(place, fault);
        }
    }

    fn note(&mut self, place: (u64, u64), reason: String) {
        let reject = self.read_summary.of_bytes(place, LossKind::Nothing, reason);
        self.read_summary.reject(LogReject { messages: Some(0), ..reject });
    }

    fn lose(&mut self, lost: &Lost) {
        let nothing = lost.why == Loss::NoDataEnd;
        let loss = if nothing { LossKind::Nothing } else { LossKind::Bytes };
        let place = (lost.start, lost.end);
        self.read_summary.reject(LogReject {
            time_span_ns: lost.times.map(|(first, last)| (ns(first), ns(last))),
            messages: nothing.then_some(0),
            ..self.read_summary.of_bytes(place, loss, lost.why.to_string())
        });
    }

    fn io(&self, source: std::io::Error) -> E {
        FileError::new(&self.read_summary.file, source).into()
    }
}

/// Bytes that a block may take while it is worked on.
fn weight(extent: &Extent, limits: Limits) -> u64 {
    match &extent.chunk {
        None => extent.end - extent.start,
        Some(chunk) => chunk.needs().min(limits.chunk_bytes),
    }
}

/// A log's time as a stamp; times after the year 2262 become its largest value.
pub fn ns(time: u64) -> i64 {
    i64::try_from(time).unwrap_or(i64::MAX)
}
