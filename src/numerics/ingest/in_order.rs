//! One stream's decoded rows, block by block in order of the files → its samples in order of time, while logs are read.
//!
//! 1. The rows of a block are judged and those kept are buffered, in the crate's units ([`Buffer`]).
//! 2. The earliest samples are emitted, a piece at a time; the latest stay buffered, so that a stamp that goes back can
//!    still be put in its place among them.
//! 3. At the end the others are emitted, and the [`StreamSummary`] counts every message. It also reports when a stamp
//!    belonged before a sample already emitted: the logs must then be read a second time with all samples
//!    buffered. Every buffer that is large enough gives the same output.
//!
//! Equal stamps stay in the order of the file; of several files the one with the earliest stamp comes first.

mod joints;
mod poses;
mod temperatures;

use std::ops::Range;

pub use joints::JointBuffer;
pub use poses::PoseBuffer;
pub use temperatures::TemperatureBuffer;

use super::clock_steps::Runs;
use super::held::Held;
use super::publishers::Publishers;
use super::rows::{Place, Rows};
use super::summary::{StreamCounts, StreamSummary};
use super::{Amendments, LogReject, SpanClock};

/// Samples of one stream that are not emitted yet, in the crate's units.
pub trait Buffer {
    /// The columns that the rows of a block are decoded into.
    type Block;
    /// A content that leaves that of the samples around it by more than this, and comes back, is another publisher's.
    const JUMP: f64 = f64::INFINITY;
    /// The stamps of a block's rows, to be changed, and the recorder's time of each row, ns.
    fn times_of(block: &mut Self::Block) -> (&mut [i64], &[i64]);
    fn clock(&self) -> SpanClock;
    /// Works on the first samples, which are in order of time, before they are emitted.
    fn settle(&mut self, _count: usize) {}
    /// Joints that are reported in half a turn to both sides, and went further.
    fn wrapped(&self) -> Vec<usize> {
        Vec::new()
    }
    /// Makes readings that are not numbers missing ones.
    fn zero_lost(&self, _: &mut Self::Block) {}
    fn judge(&self, block: &Self::Block, place: &Place<'_>) -> Rows;
    /// Adds the kept rows of a block; returns `false` and adds none when its columns differ from the earlier blocks'.
    fn take(&mut self, rows: &Rows, block: &Self::Block) -> bool;
    fn stamps(&self) -> &[i64];
    /// The numbers that distinguish a sample from others with its stamp.
    fn content(&self, row: usize) -> &[f64];
    /// Keeps the samples with these numbers, in this order.
    fn reorder(&mut self, order: &[usize]);
    fn evict(&mut self, count: usize);
    /// Further counts of the whole stream, as (name, number).
    fn further_counts(&self) -> Vec<(&'static str, u64)> {
        Vec::new()
    }
}

/// Samples that stay buffered: half a minute at 500 Hz, more than chunks in recorders' logs overlap.
pub const BUFFERED: usize = 16_384;

/// The samples of one stream, being put in order of time.
#[derive(Debug)]
pub struct InOrder<B> {
    topic: String,
    buffer: B,
    /// Samples that are emitted together.
    piece: usize,
    /// Samples that stay buffered until the end.
    buffered: usize,
    /// Whether samples in the buffer are out of order.
    unsorted: bool,
    /// The number of samples emitted, and the last one's stamp, ns.
    emitted: (usize, Option<i64>),
    last_content: Vec<f64>,
    /// Changes of the stamps that a first reading of the logs found; none in that first reading.
    amendments: Amendments,
    publishers: Publishers,
    held: Held,
    /// Whether a sample belonged before one already emitted.
    late: bool,
    alike: bool,
    counts: StreamCounts,
    rejects: Vec<LogReject>,
    files: Vec<FileRows>,
}

#[derive(Debug)]
struct FileRows {
    name: String,
    /// The places of its kept rows among all kept rows of the stream.
    kept: Range<usize>,
    /// Stamps of its rows; `None` without rows.
    span: Option<Span>,
    runs: Runs,
}

/// Stamps of decoded rows, ns; spans are compared by the earliest stamp, then by the latest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Span {
    earliest: i64,
    latest: i64,
    first: i64,
    last: i64,
}

impl<B: Buffer> InOrder<B> {
    /// The state before anything of the topic is read, with an empty `buffer`. Samples are emitted `piece` at a time, the last
    /// piece excepted; `buffered` samples stay in the buffer until the end.
    pub fn new(buffer: B, topic: &str, piece: usize, buffered: usize) -> Self {
        Self {
            topic: topic.to_owned(),
            buffer,
            piece,
            buffered,
            unsorted: false,
            emitted: (0, None),
            last_content: Vec::new(),
            amendments: Amendments::default(),
            publishers: Publishers::default(),
            held: Held::default(),
            late: false,
            alike: true,
            counts: StreamCounts::default(),
            rejects: Vec::new(),
            files: Vec::new(),
        }
    }

    /// This state, which changes the stamps as a first reading of the logs found.
    #[must_use]
    pub fn amended(self, amendments: &Amendments) -> Self {
        Self { amendments: amendments.clone(), ..self }
    }

    /// Begins a file: the blocks that follow are of it.
    pub fn begin_file(&mut self, name: &str) {
        if self.files.last().is_none_or(|file| file.name != name) {
            let kept = self.emitted.0 + self.buffer.stamps().len();
            self.files.push(FileRows {
                name: name.to_owned(),
                kept: kept..kept,
                span: None,
                runs: Runs::default(),
            });
        }
    }

    /// Takes the rows of one block of the current file, stored at `bytes` (first, one past the last), and calls `emit` with
    /// the rows of the buffer that are due.
    /// Panics when no file was begun.
    pub fn push(
        &mut self,
        block: &mut B::Block,
        bytes: (u64, u64),
        mut emit: impl FnMut(&B, Range<usize>),
    ) {
        self.buffer.zero_lost(block);
        let file = self.files.last_mut().expect("begun before its blocks");
        let (stamps, logged) = B::times_of(block);
        let of = (&*file.name, &*self.topic, self.buffer.clock());
        self.amendments.amend(of, (file.runs.rows, bytes.0), stamps, logged);
        file.runs.push(bytes.0, stamps, logged);
        let span = Span::of(stamps);
        let place = Place { file: &file.name, topic: &self.topic, bytes };
        let rows = self.buffer.judge(block, &place);
        let before = self.buffer.stamps().len();
        self.alike &= self.buffer.take(&rows, block);
        for (row, &stamp) in self.buffer.stamps().iter().enumerate().skip(before) {
            file.runs.see(stamp, self.buffer.content(row));
        }
        let edge = self.buffer.stamps().get(before.saturating_sub(1)..=before);
        self.unsorted |= edge.is_some_and(|edge| edge[0] > edge[edge.len() - 1]);
        file.kept.end += self.buffer.stamps().len() - before;
        let backward = span.is_some_and(|span| file.add(span));
        self.counts.kept += rows.kept as u64;
        self.counts.rejected += rows.rejected as u64;
        self.counts.backward_stamps += rows.backward_stamps as u64 + u64::from(backward);
        self.rejects.extend(rows.rejects);
        if self.due() > 0 {
            self.emit(Self::due, &mut emit);
        }
    }

    /// Number of samples that are emitted now.
    fn due(&self) -> usize {
        self.buffer.stamps().len().saturating_sub(self.buffered) / self.piece * self.piece
    }

    pub fn finish(mut self, mut emit: impl FnMut(&B, Range<usize>)) -> StreamSummary {
        let all_buffered = self.emitted.0 == 0;
        let spans: Vec<Span> = self.files.iter().filter_map(|file| file.span).collect();
        let files_in_order = spans.is_sorted_by(|a, b| a.earliest < b.earliest);
        self.unsorted |= !files_in_order;
        self.emit(|own| own.buffer.stamps().len(), &mut emit);
        let mut amendments = Amendments { wrapped: self.buffer.wrapped(), ..Amendments::default() };
        for file in &self.files {
            amendments.extend(file.runs.found(&file.name, &self.topic, self.buffer.clock()));
        }
        let silent = self.publishers.silent().cloned();
        amendments.silent.extend(silent.map(|content| (self.topic.clone(), content)));
        amendments.held.extend(self.held.for_ns().map(|for_ns| (self.topic.clone(), for_ns)));
        let files = self.files_by_time();
        let by_time: Vec<Span> = files.iter().filter_map(|file| file.span).collect();
        let backward = by_time.windows(2).filter(|pair| pair[1].first < pair[0].last).count();
        StreamSummary {
            files: files.iter().map(|file| file.name.clone()).collect(),
            counts: StreamCounts {
                backward_stamps: self.counts.backward_stamps + backward as u64,
                ..self.counts
            },
            further: self.buffer.further_counts(),
            amendments,
            publishers: self.publishers.words(),
            in_order: all_buffered || (files_in_order && !self.late),
            topic: self.topic,
            rejects: self.rejects,
            stamped: spans.iter().any(|span| (span.earliest, span.latest) != (0, 0)),
            alike: self.alike,
        }
    }

    fn files_by_time(&self) -> Vec<&FileRows> {
        let mut files: Vec<&FileRows> = self.files.iter().collect();
        files.sort_by_key(|file| file.span.map(|span| (span.earliest, span.latest)));
        files
    }

    /// Emits the earliest samples of the buffer, as many as `count` says once they are in order.
    fn emit(&mut self, count: impl Fn(&Self) -> usize, emit: &mut impl FnMut(&B, Range<usize>)) {
        self.sort();
        self.drop_repeated();
        let count = count(self);
        if count == 0 {
            return;
        }
        self.buffer.settle(count);
        let stamps = &self.buffer.stamps()[..count];
        self.publishers.push(stamps, |row| self.buffer.content(row), B::JUMP);
        if self.buffer.clock() == SpanClock::Tracker && B::JUMP.is_infinite() {
            self.held.push(stamps, |row| self.buffer.content(row));
        }
        let (first, last) = (stamps[0], stamps[count - 1]);
        let (emitted, before) = self.emitted;
        self.late |= before.is_some_and(|before| first < before);
        let equal = stamps.windows(2).filter(|pair| pair[0] == pair[1]).count();
        self.counts.duplicate_stamps += equal as u64 + u64::from(before == Some(first));
        // Once the logs have to be read a second time, further samples are of no use.
        if self.alike && !self.late {
            for from in (0..count).step_by(self.piece) {
                emit(&self.buffer, from..(from + self.piece).min(count));
            }
        }
        self.emitted = (emitted + count, Some(last));
        self.last_content = self.buffer.content(count - 1).to_vec();
        self.buffer.evict(count);
    }

    /// Leaves out samples that were logged before with equal stamp and content, those of a publisher that always states the same beside
    /// another, and readings that are held.
    fn drop_repeated(&mut self) {
        let (buffer, stamps) = (&self.buffer, self.buffer.stamps());
        let is_repeated = stamps.windows(2).any(|pair| pair[0] == pair[1]);
        let held_ns = self.amendments.held.get(&self.topic);
        if !is_repeated && self.emitted.1 != stamps.first().copied() && held_ns.is_none() {
            return;
        }
        let silent = self.amendments.silent.iter().find(|own| own.0 == self.topic);
        let (mut kept, mut repeated) = (Vec::<usize>::with_capacity(stamps.len()), 0);
        for (row, &stamp) in stamps.iter().enumerate() {
            let content = buffer.content(row);
            let earlier = kept.iter().rev().take_while(|&&own: &&usize| stamps[own] == stamp);
            let is_again = self.emitted.1 == Some(stamp) && self.last_content == content
                || earlier.clone().any(|&own| buffer.content(own) == content);
            let others = || earlier.count() > 0 || stamps.get(row + 1) == Some(&stamp);
            let is_silent = silent.is_some_and(|own| own.1 == content) && others();
            let before = kept.last().map(|&own| (stamps[own], buffer.content(own)));
            let before = before.or(self.emitted.1.map(|first| (first, &self.last_content[..])));
            let is_held = before.zip(held_ns).is_some_and(|((first, own), held_ns)| {
                own == content && stamp.saturating_sub(first) < *held_ns
            });
            match (is_again, is_silent, is_held) {
                (true, ..) => repeated += 1,
                (_, true, _) => self.counts.second_publisher += 1,
                (_, _, true) => self.counts.held += 1,
                (false, false, false) => kept.push(row),
            }
        }
        self.counts.repeated += repeated;
        let dropped = stamps.len() - kept.len();
        if dropped > 0 {
            self.counts.kept -= dropped as u64;
            self.buffer.reorder(&kept);
            let end = self.emitted.0 + kept.len();
            for file in &mut self.files {
                file.kept = file.kept.start.min(end)..file.kept.end.min(end);
            }
        }
    }

    /// Sorts the buffer by stamp; equal stamps stay in the order of the files.
    fn sort(&mut self) {
        if !std::mem::take(&mut self.unsorted) {
            return;
        }
        let emitted = self.emitted.0;
        let files = self.files_by_time().into_iter();
        let in_buffer = |file: &FileRows| {
            file.kept.start.saturating_sub(emitted)..file.kept.end.saturating_sub(emitted)
        };
        let mut order: Vec<usize> = files.flat_map(in_buffer).collect();
        let stamps = self.buffer.stamps();
        order.sort_by_key(|&row| stamps[row]);
        self.buffer.reorder(&order);
    }
}

impl FileRows {
    /// Adds the rows of a further block; returns whether its first stamp is before the last one so far.
    fn add(&mut self, block: Span) -> bool {
        let Some(span) = &mut self.span else {
            self.span = Some(block);
            return false;
        };
        let backward = block.first < span.last;
        *span = Span {
            earliest: span.earliest.min(block.earliest),
            latest: span.latest.max(block.latest),
            first: span.first,
            last: block.last,
        };
        backward
    }
}

impl Span {
    fn of(stamps: &[i64]) -> Option<Self> {
        let times = || stamps.iter().copied().filter(|&stamp| stamp != i64::MIN);
        Some(Self {
            earliest: times().min()?,
            latest: times().max()?,
            first: times().next()?,
            last: times().next_back()?,
        })
    }
}

fn reordered<T: Copy>(column: &[T], order: &[usize]) -> Vec<T> {
    order.iter().map(|&row| column[row]).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::super::DecodedTemperatures;
    use super::*;

    /// The rows of a file: stamps and temperatures; NaN is rejected.
    type File = Vec<(i64, f64)>;

    /// The rows of all files, one file after the other.
    fn whole(files: &[File]) -> impl Iterator<Item = (i64, f64)> {
        let mut files: Vec<&File> = files.iter().collect();
        files.sort_by_key(|file| {
            let stamps = || file.iter().map(|row| row.0);
            (stamps().min(), stamps().max())
        });
        files.into_iter().flatten().copied()
    }

    /// The expected samples and counts, computed directly from the definition.
    fn expected(files: &[File]) -> (File, StreamCounts) {
        let rows: File = whole(files).collect();
        let mut kept = rows.clone();
        kept.retain(|row| row.1.is_finite());
        kept.sort_by_key(|row| row.0);
        let count = |rows: &File, is: fn(i64, i64) -> bool| {
            rows.windows(2).filter(|w| is(w[0].0, w[1].0)).count() as u64
        };
        let counts = StreamCounts {
            kept: kept.len() as u64,
            rejected: (rows.len() - kept.len()) as u64,
            backward_stamps: count(&rows, |a, b| b < a),
            duplicate_stamps: count(&kept, |a, b| a == b),
            ..StreamCounts::default()
        };
        (kept, counts)
    }

    /// Samples and summary of `files`, read in blocks of up to `block` rows with `buffered` samples in the buffer.
    fn emitted(files: &[File], buffered: usize, block: usize) -> (File, StreamSummary) {
        const PIECE: usize = 5;
        let mut in_order = InOrder::new(TemperatureBuffer::default(), "/t", PIECE, buffered);
        let (mut found, mut pieces) = (File::new(), Vec::new());
        let mut emit = |buffer: &TemperatureBuffer, rows: Range<usize>| {
            pieces.push(rows.len());
            let (stamps, celsius) = buffer.rows(rows);
            found.extend(stamps.iter().copied().zip(celsius.iter().copied()));
        };
        for (file, number) in files.iter().zip(0..) {
            in_order.begin_file(&format!("{number}"));
            for (rows, at) in file.chunks(block).zip(0..) {
                let (stamps, celsius) = rows.iter().copied().unzip();
                let logged = vec![0; rows.len()];
                let mut block = DecodedTemperatures { stamps, celsius, logged };
                in_order.push(&mut block, (at, at + 1), &mut emit);
            }
        }
        let summary = in_order.finish(&mut emit);
        let last = pieces.pop().unwrap_or(PIECE);
        assert!(last <= PIECE && pieces.iter().all(|&piece| piece == PIECE));
        (found, summary)
    }

    #[test]
    fn samples_and_counts_are_those_of_the_whole_stream_with_any_buffer() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut outcomes = BTreeMap::new();
        for _ in 0..2000 {
            let disorder = [0, 3, 60][rng.random_range(0..3)];
            let (mut number, mut stamp) = (0.0, 0);
            let mut row = || {
                number += 1.0;
                stamp += rng.random_range(0..4);
                let wrong = rng.random_range(0..20) == 0;
                let late = rng.random_range(0..=disorder);
                (stamp - late, if wrong { f64::NAN } else { 0.1 * number })
            };
            let mut file = |rows| (0..rows).map(|_| row()).collect::<File>();
            let mut files = [file(40), file(0), file(30), file(30)];
            if rng.random() {
                files.swap(2, 3);
            }
            let (samples, counts) = expected(&files);
            let block = rng.random_range(1..20);
            for buffered in [0, 20, 60, usize::MAX] {
                let (found, summary) = emitted(&files, buffered, block);
                *outcomes.entry((buffered, summary.in_order)).or_insert(0) += 1;
                if !summary.in_order {
                    continue;
                }
                assert_eq!(found, samples);
                assert_eq!(summary.counts, counts);
                let rejected = summary.rejects.iter().filter_map(|reject| reject.messages);
                assert_eq!(rejected.sum::<u64>(), counts.rejected);
            }
        }
        // A stream that is buffered whole can be put in order; with a smaller buffer both outcomes occur.
        let often = |buffered, in_order| outcomes.get(&(buffered, in_order)).copied().unwrap_or(0);
        assert_eq!(often(usize::MAX, true), 2000);
        for buffered in [0, 20, 60] {
            let both = (often(buffered, true), often(buffered, false));
            assert!(both.0 > 100 && both.1 > 100, "{buffered}: {both:?}");
        }
    }

    #[test]
    fn what_was_logged_twice_is_one_sample() {
        let twice: File = (0..60).flat_map(|k| [(k, k as f64); 2]).collect();
        let once: File = (0..60).map(|k| (k, k as f64)).collect();
        for buffered in [0, 7, usize::MAX] {
            let (found, summary) = emitted(std::slice::from_ref(&twice), buffered, 11);
            assert!(found == once && summary.in_order);
            assert_eq!((summary.counts.kept, summary.counts.repeated), (60, 60));
            assert_eq!(summary.publishers, None);
        }
    }

    #[test]
    fn two_publishers_are_distinguished() {
        let own = |k: i64| 0.1 * (k as f64 * 0.01).sin();
        let of = |rows: &dyn Fn(i64) -> [(i64, f64); 2]| {
            emitted(&[(0..400).flat_map(rows).collect()], usize::MAX, 50).1
        };
        let silent = of(&|k| [(20 * k, own(k)), (20 * k, 7.0)]);
        assert_eq!(silent.amendments.silent, [("/t".to_owned(), vec![7.0])]);
        let other = of(&|k| [(20 * k, own(k)), (20 * k, own(k + 3))]);
        assert!(other.amendments.silent.is_empty());
        assert!(other.publishers.is_some_and(|what| what.contains("the stamp of another")));
        // Stamps of a tenth of the rate.
        let coarse = of(&|k| [(k / 5, own(2 * k)), (k / 5, own(2 * k + 1))]);
        assert_eq!((coarse.publishers, coarse.amendments.silent.len()), (None, 0));
        let copy = of(&|k| [(20 * k, own(k)), (20 * k + 3, own(k))]);
        assert!(copy.publishers.is_some_and(|what| what.contains("repeat the one before")));
        // Two samples at a time, as some drivers send them.
        let bursts = of(&|k| [(20 * k, own(2 * k)), (20 * k + 3, own(2 * k + 1))]);
        assert_eq!(bursts.publishers, None);
        // Twenty messages at each place: another publisher's are a little off, or an encoder flickers.
        let still = |k: i64| 0.1 * (k / 20) as f64;
        let off = of(&|k| [(20 * k, still(k)), (20 * k + 3, still(k) + 1.0)]);
        assert!(off.publishers.is_some_and(|what| what.contains("before and after them")));
        let rare = of(&|k| match k % 5 {
            0 => [(20 * k, still(k)), (20 * k + 2, still(k) + 1.0)],
            _ => [(20 * k, still(k)), (20 * k + 10, still(k))],
        });
        assert!(rare.publishers.is_some_and(|what| what.contains("before and after them")));
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let flicker: Vec<f64> = (0..800).map(|_| f64::from(rng.random::<bool>())).collect();
        let [first, second] = [0, 400].map(|from| move |k: i64| from + usize::try_from(k).unwrap());
        let own = |k: i64, of: usize| still(k) + flicker[of];
        let flickers = of(&|k| [(20 * k, own(k, first(k))), (20 * k + 3, own(k, second(k)))]);
        assert_eq!(flickers.publishers, None);
        let steps = of(&|k| [(20 * k, still(k)), (20 * k + 10, still(k) + 0.3)]);
        assert_eq!(steps.publishers, None, "an encoder reported on both sides of a step");
    }

    #[test]
    fn equal_stamps_stay_in_the_order_of_the_files_by_time() {
        // The later file has the earliest row, although a rejected one: its samples come first.
        let files = [vec![(10, 1.0), (20, 2.0)], vec![(5, f64::NAN), (20, 3.0)]];
        let (found, summary) = emitted(&files, usize::MAX, 100);
        assert_eq!(found, [(10, 1.0), (20, 3.0), (20, 2.0)]);
        assert_eq!(summary.files, ["1", "0"]);
        // From the 20 of the first file to the 10 of the second.
        assert_eq!(summary.counts.backward_stamps, 1);
        assert_eq!(summary.counts.duplicate_stamps, 1);
    }
}
