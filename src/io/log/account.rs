//! The account of one log: what was found in it besides its messages, and what was left out.

use std::collections::BTreeMap;

use super::packed::Packed;
use super::record::ChunkRecord;
use super::registry::Channel;
use super::summary::Ending;
use crate::ingest::LogReject;

/// Rejects of one log that are listed one by one; the rest is told together.
const MOST_REJECTS: usize = 10_000;

/// What was found in a log besides its messages.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Account {
    /// The file, as it was named.
    pub file: String,
    /// Its size, decompressed if it was stored in zstd as a whole: all places in it are places in that.
    pub bytes: u64,
    /// How it is stored in zstd, if it is.
    pub packed: Option<Packed>,
    /// How it ends.
    pub ending: Ending,
    /// Conventions of the log, such as `ros2`.
    pub profile: String,
    /// What wrote it.
    pub library: String,
    /// Sound chunks, by compression.
    pub chunks: BTreeMap<String, u64>,
    /// Sound chunks without a checksum.
    pub chunks_unchecked: u64,
    /// Messages outside chunks: no checksum covers them one by one.
    pub messages_outside_chunks: u64,
    /// Messages in sound blocks.
    pub messages: u64,
    /// Channels, by id.
    pub channels: Vec<Channel>,
    /// Metadata records: name, key, value.
    pub metadata: Vec<(String, String, String)>,
    /// What was left out.
    pub rejects: Vec<LogReject>,
}

impl Account {
    /// Counts a sound block.
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

    /// Bytes that cannot be read, each counted once; not those of sound messages that a stream cannot use.
    pub fn bytes_lost(&self) -> u64 {
        let mut ranges: Vec<_> = self
            .rejects
            .iter()
            .filter(|reject| reject.is_damage())
            .map(|reject| (reject.byte_start, reject.byte_end))
            .collect();
        ranges.sort_unstable();
        let mut reached = 0;
        let mut lost = 0;
        for (start, end) in ranges {
            lost += end.saturating_sub(start.max(reached));
            reached = reached.max(end);
        }
        lost
    }

    /// Adds a reject; neighbours of one reason become one, and past a limit all the rest.
    pub(super) fn reject(&mut self, reject: LogReject) {
        let full = self.rejects.len() >= MOST_REJECTS;
        match self.rejects.last_mut() {
            Some(last) if full => {
                last.join(&reject);
                "many more losses, told together; see the first ones".clone_into(&mut last.reason);
            }
            Some(last)
                if last.byte_end == reject.byte_start
                    && last.byte_start != last.byte_end
                    && last.reason == reject.reason
                    && last.topic == reject.topic
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
    use crate::ingest::SpanClock;

    #[test]
    fn lost_bytes_are_counted_once_and_notes_are_not_losses() {
        let reject = |range: std::ops::Range<u64>, topic: Option<&str>, messages| LogReject {
            file: "f".to_owned(),
            topic: topic.map(str::to_owned),
            byte_start: range.start,
            byte_end: range.end,
            time_span_ns: None,
            clock: SpanClock::Log,
            messages,
            reason: String::new(),
        };
        let account = Account {
            rejects: vec![
                reject(100..300, None, None),
                // Twice the same chunk, and one that reaches into it: 50 bytes more.
                reject(100..300, None, Some(7)),
                reject(50..150, None, None),
                // A summary that is damaged, and messages that a stream cannot use.
                reject(400..900, None, Some(0)),
                reject(400..900, Some("/joints"), Some(3)),
            ],
            ..Account::default()
        };
        assert_eq!(account.bytes_lost(), 250);
    }
}
