//! The read summary of one log: everything found in it except the messages, and everything left out.

use std::collections::BTreeMap;

use super::packed::Packed;
use super::record::ChunkRecord;
use super::registry::Channel;
use super::summary::Ending;
use crate::ingest::{LogReject, LossKind, SpanClock};

/// Most rejects of one log that are listed one by one; the rest become one reject.
const MOST_REJECTS: usize = 10_000;

#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ReadSummary {
    pub file: String,
    /// Its size, bytes, after decompression if it is stored in zstd as a whole: all places are in the decompressed log.
    pub bytes: u64,
    /// Size of the compressed file and the fault in it; `None` where the log is not stored in zstd as a whole.
    pub packed: Option<Packed>,
    pub ending: Ending,
    /// Conventions of the log, such as `ros2`.
    pub profile: String,
    pub library: String,
    pub chunks: BTreeMap<String, u64>,
    pub chunks_unchecked: u64,
    /// Number of messages outside chunks: no checksum covers them one by one.
    pub messages_outside_chunks: u64,
    pub messages: u64,
    /// Number of messages lost in damaged bytes or missing, as far as indexes and sound summaries count them.
    pub messages_lost: u64,
    /// Number of lost messages by topic, where a channel's definition is known.
    pub lost_of: BTreeMap<String, u64>,
    /// Messages that sound summaries count, and messages read of these logs; `None` unless more were read than counted.
    pub undercounted: Option<(u64, u64)>,
    /// Number of logs in the file, one after another.
    pub logs: u64,
    pub private_records: BTreeMap<u8, u64>,
    /// Channels: those of each log by id.
    pub channels: Vec<Channel>,
    /// Metadata records: name, key, value.
    pub metadata: Vec<(String, String, String)>,
    pub rejects: Vec<LogReject>,
}

impl ReadSummary {
    pub(super) fn count(&mut self, chunk: Option<&ChunkRecord>, messages: u64) {
        self.messages += messages;
        match chunk {
            None => self.messages_outside_chunks += messages,
            Some(chunk) => {
                *self.chunks.entry(chunk.compression.clone()).or_default() += 1;
                self.chunks_unchecked += u64::from(chunk.crc == 0);
            }
        }
    }

    pub(super) fn lose(&mut self, topic: &str, messages: u64) {
        if messages > 0 {
            let lost = self.lost_of.entry(topic.to_owned()).or_default();
            *lost = lost.saturating_add(messages);
        }
    }

    /// Bytes that cannot be read, each counted once; not those of sound messages that a stream cannot use.
    pub fn bytes_lost(&self) -> u64 {
        let damage = self.rejects.iter().filter(|reject| reject.is_damage());
        let mut ranges: Vec<_> = damage.map(|own| (own.byte_start, own.byte_end)).collect();
        ranges.sort_unstable();
        let mut reached = 0;
        let mut lost = 0;
        for (start, end) in ranges {
            lost += end.saturating_sub(start.max(reached));
            reached = reached.max(end);
        }
        lost
    }

    /// A reject of these bytes, without a topic, times and a number of messages.
    pub(super) fn of_bytes(
        &self,
        (byte_start, byte_end): (u64, u64),
        loss: LossKind,
        reason: String,
    ) -> LogReject {
        LogReject {
            file: self.file.clone(),
            topic: None,
            byte_start,
            byte_end,
            time_span_ns: None,
            clock: SpanClock::Log,
            messages: None,
            loss,
            reason,
        }
    }

    /// Adds a reject; neighbours with the same reason become one, and past a limit all further ones do.
    pub(super) fn reject(&mut self, reject: LogReject) {
        let full = self.rejects.len() >= MOST_REJECTS;
        match self.rejects.last_mut() {
            Some(last) if full => {
                last.absorb(reject);
                "many more losses, listed as one; see the first ones".clone_into(&mut last.reason);
            }
            Some(last)
                if last.byte_end == reject.byte_start
                    && last.byte_start != last.byte_end
                    && last.reason == reject.reason
                    && last.topic == reject.topic
                    && last.loss == reject.loss
                    && last.messages.is_none()
                    && reject.messages.is_none() =>
            {
                last.join(&reject);
            }
            _ => self.rejects.push(reject),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lost_bytes_are_counted_once_and_notes_are_not_losses() {
        let reject = |range: std::ops::Range<u64>, loss, messages| LogReject {
            file: "f".to_owned(),
            topic: None,
            loss,
            byte_start: range.start,
            byte_end: range.end,
            time_span_ns: None,
            clock: SpanClock::Log,
            messages,
            reason: String::new(),
        };
        let read_summary = ReadSummary {
            rejects: vec![
                reject(100..300, LossKind::Bytes, None),
                // Twice the same chunk, and one that reaches into it: 50 bytes more.
                reject(100..300, LossKind::Bytes, Some(7)),
                reject(50..150, LossKind::Bytes, None),
                // A summary that is damaged, messages that a stream cannot use, messages that are not there.
                reject(400..900, LossKind::Nothing, Some(0)),
                reject(400..900, LossKind::Unusable, Some(3)),
                reject(0..900, LossKind::Missing, Some(3)),
            ],
            ..ReadSummary::default()
        };
        assert_eq!(read_summary.bytes_lost(), 250);
    }
}
