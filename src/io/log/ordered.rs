//! The streams of a session while its logs are read: blocks of decoded rows → samples in order of time. The rows of a
//! block wait until the next blocks are being opened; meanwhile they are put in order ([`InOrder`]). Joint samples go
//! to their receiver ([`JointSink`]), commanded poses and readings are spilled to disk ([`SpillingPoses`]), because the
//! join reads them again.

use std::ops::Range;

use super::LogError;
use super::block::Extent;
use super::replay::JointSink;
use super::spilled::{SpilledPoses, SpillingPoses};
use super::streams::{Part, Stream};
use crate::ingest::{
    Amendments, Buffer, InOrder, JointBuffer, Mapping, PoseBuffer, StreamSummary,
    TemperatureBuffer, TemperatureSamples,
};
use crate::table::ROW_GROUP_ROWS;
use crate::units::{Controller, Stamp, Tracker};

/// Number of joint samples that are emitted together: those of a row group, so that a table needs no copy of its own.
const JOINTS_TOGETHER: usize = ROW_GROUP_ROWS;
/// Number of poses that are spilled together, and of temperatures that are kept together.
const TOGETHER: usize = 4096;

/// Receives the samples of a stream, in order of time.
pub trait Emit<B> {
    /// Takes some samples of the buffer; they follow those given before.
    fn emit(&mut self, buffer: &B, rows: Range<usize>);
}

pub struct OrderedStream<B: Buffer, T> {
    in_order: InOrder<B>,
    to: T,
    /// Rows of blocks and the bytes that they come from, in the order of the file.
    waiting: Vec<(B::Block, (u64, u64))>,
    spare: Vec<B::Block>,
}

impl<B: Buffer<Block: Default>, T: Emit<B>> OrderedStream<B, T> {
    const fn new(in_order: InOrder<B>, to: T) -> Self {
        Self { in_order, to, waiting: Vec::new(), spare: Vec::new() }
    }

    fn begin_file(&mut self, file: &str) {
        self.work();
        self.in_order.begin_file(file);
    }

    /// Takes the rows of a block, if there are any, and leaves a buffer for those of another.
    fn take(&mut self, rows: &mut B::Block, extent: &Extent) {
        if !B::times_of(rows).0.is_empty() {
            let spare = self.spare.pop().unwrap_or_default();
            let rows = std::mem::replace(rows, spare);
            self.waiting.push((rows, (extent.start, extent.end)));
        }
    }

    fn work(&mut self) {
        for (mut rows, bytes) in self.waiting.drain(..) {
            let emit = |buffer: &B, rows| self.to.emit(buffer, rows);
            self.in_order.push(&mut rows, bytes, emit);
            self.spare.push(rows);
        }
    }

    fn finish(mut self) -> (StreamSummary, T) {
        self.work();
        let to = &mut self.to;
        let summary = self.in_order.finish(|buffer, rows| to.emit(buffer, rows));
        (summary, self.to)
    }
}

/// The streams of a session; a stream whose topic the pipeline file does not name is `None`.
pub struct SessionStreams<'s> {
    joints: OrderedStream<JointBuffer, &'s mut dyn JointSink>,
    commands: Option<OrderedStream<PoseBuffer, SpillingPoses<Controller>>>,
    /// Those of each target and reference.
    readings: Vec<OrderedStream<PoseBuffer, SpillingPoses<Tracker>>>,
    temperatures: Option<OrderedStream<TemperatureBuffer, TemperatureSamples>>,
    /// Those of each instrument of one length.
    lengths: Vec<OrderedStream<PoseBuffer, SpillingPoses<Tracker>>>,
}

pub struct Ordered {
    /// Read, kept and rejected messages of each stream, in the order of [`Stream::ALL`].
    pub summaries: Vec<(Stream, StreamSummary)>,
    pub commands: SpilledPoses<Controller>,
    /// Those of each target, the main one's first, then those of each reference.
    pub readings: Vec<SpilledPoses<Tracker>>,
    pub temperatures: TemperatureSamples,
    /// Those of each instrument of one length: the length as x, without y and z.
    pub lengths: Vec<SpilledPoses<Tracker>>,
}

impl<'s> SessionStreams<'s> {
    /// Streams before anything is read; joint samples will go to `joints`, and `buffered` samples of a stream are buffered. Stamps are
    /// amended by what an earlier reading found.
    pub fn new(
        mapping: &Mapping,
        buffered: usize,
        amendments: &Amendments,
        joints: &'s mut dyn JointSink,
    ) -> Self {
        let (controller, tracker) = (&mapping.controller, &mapping.tracker);
        let of_joints = JointBuffer::of(mapping).unwrapping(&amendments.wrapped);
        let of_joints = InOrder::new(of_joints, &controller.topic, JOINTS_TOGETHER, buffered);
        let of_joints = of_joints.amended(amendments);
        let of_poses =
            |buffer, topic| InOrder::new(buffer, topic, TOGETHER, buffered).amended(amendments);
        let commands = mapping.commanded.as_ref().map(|commanded| {
            let in_order = of_poses(PoseBuffer::commands(commanded), &commanded.topic);
            OrderedStream::new(in_order, SpillingPoses::default())
        });
        let readings = tracker.seen().into_iter().map(|own| {
            let in_order = of_poses(PoseBuffer::readings(tracker), own.topic);
            OrderedStream::new(in_order, SpillingPoses::default())
        });
        let temperatures = tracker.temperature.as_ref().map(|topic| {
            // All of them are buffered: they stay in memory in any case.
            let in_order = InOrder::new(TemperatureBuffer::default(), topic, TOGETHER, usize::MAX);
            OrderedStream::new(in_order.amended(amendments), TemperatureSamples::default())
        });
        let lengths = tracker.lengths.iter().map(|own| {
            let in_order = of_poses(PoseBuffer::lengths(own), &own.topic);
            OrderedStream::new(in_order, SpillingPoses::default())
        });
        let joints = OrderedStream::new(of_joints, joints);
        let (readings, lengths) = (readings.collect(), lengths.collect());
        Self { joints, commands, readings, temperatures, lengths }
    }

    /// The blocks of a stream that follow are from this file.
    pub fn begin_file(&mut self, stream: Stream, file: &str) {
        match stream {
            Stream::Joints => self.joints.begin_file(file),
            Stream::Commands => self.commands.iter_mut().for_each(|s| s.begin_file(file)),
            Stream::Readings => self.readings.iter_mut().for_each(|s| s.begin_file(file)),
            Stream::Temperatures => self.temperatures.iter_mut().for_each(|s| s.begin_file(file)),
            Stream::Lengths => self.lengths.iter_mut().for_each(|s| s.begin_file(file)),
        }
    }

    /// Takes the rows of a block, and leaves buffers for those of another.
    pub fn take(&mut self, part: &mut Part, extent: &Extent) {
        self.joints.take(&mut part.joints, extent);
        self.commands.iter_mut().for_each(|own| own.take(&mut part.commands, extent));
        for (stream, rows) in self.readings.iter_mut().zip(&mut part.readings) {
            stream.take(rows, extent);
        }
        self.temperatures.iter_mut().for_each(|own| own.take(&mut part.temperatures, extent));
        for (stream, rows) in self.lengths.iter_mut().zip(&mut part.lengths) {
            stream.take(rows, extent);
        }
    }

    pub fn work(&mut self) {
        self.joints.work();
        self.commands.iter_mut().for_each(OrderedStream::work);
        self.readings.iter_mut().for_each(OrderedStream::work);
        self.temperatures.iter_mut().for_each(OrderedStream::work);
        self.lengths.iter_mut().for_each(OrderedStream::work);
    }

    /// Emits the samples that are still buffered. Poses that found no room on the disk are an error.
    pub fn finish(self) -> Result<Ordered, LogError> {
        let (joints, _) = self.joints.finish();
        let mut summaries = vec![(Stream::Joints, joints)];
        let mut commands = SpilledPoses::default();
        if let Some((summary, poses)) = self.commands.map(OrderedStream::finish) {
            summaries.push((Stream::Commands, summary));
            commands = poses.finish()?;
        }
        let readings = finished(self.readings, Stream::Readings, &mut summaries)?;
        let mut temperatures = TemperatureSamples::default();
        if let Some((summary, samples)) = self.temperatures.map(OrderedStream::finish) {
            summaries.push((Stream::Temperatures, summary));
            temperatures = samples;
        }
        let lengths = finished(self.lengths, Stream::Lengths, &mut summaries)?;
        Ok(Ordered { summaries, commands, readings, temperatures, lengths })
    }
}

impl Emit<JointBuffer> for &mut dyn JointSink {
    fn emit(&mut self, buffer: &JointBuffer, rows: Range<usize>) {
        let (stamps_ns, angles) = buffer.rows(rows);
        self.take(stamps_ns, angles);
    }
}

impl<C: Copy> Emit<PoseBuffer> for SpillingPoses<C> {
    fn emit(&mut self, buffer: &PoseBuffer, rows: Range<usize>) {
        self.append(&buffer.rows(rows));
    }
}

impl Emit<TemperatureBuffer> for TemperatureSamples {
    fn emit(&mut self, buffer: &TemperatureBuffer, rows: Range<usize>) {
        let (stamps, celsius) = buffer.rows(rows);
        self.stamps.extend(stamps.iter().copied().map(Stamp::from_ns));
        self.celsius.extend_from_slice(celsius);
    }
}

fn finished(
    streams: Vec<OrderedStream<PoseBuffer, SpillingPoses<Tracker>>>,
    of: Stream,
    summaries: &mut Vec<(Stream, StreamSummary)>,
) -> Result<Vec<SpilledPoses<Tracker>>, LogError> {
    let finish = |stream: OrderedStream<_, SpillingPoses<Tracker>>| {
        let (summary, poses) = stream.finish();
        summaries.push((of, summary));
        poses.finish()
    };
    streams.into_iter().map(finish).collect()
}
