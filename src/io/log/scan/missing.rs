//! Messages that the log's own summary counts and that were not read: a chunk cut out cleanly, or a message whose
//! length covers the records after it. Statistics that count fewer messages than there are, or none, are a writer's
//! mistake and no loss.

use std::collections::BTreeMap;
use std::ops::Range;

use super::super::record::Statistics;
use super::super::summary::statistics;
use super::{FileError, LogReject, LossKind, Scan, Visitor};

/// More messages than any recorder can have written: a count above it is not trusted.
const MOST_MESSAGES: u64 = 1 << 48;
const MOST_LISTED: usize = 100;

/// The difference between a sound summary and the messages read, by channel.
#[derive(Debug, Default, PartialEq, Eq)]
struct Missing {
    /// Number of lost messages of each channel, including those in damaged chunks.
    lost: BTreeMap<u16, u64>,
    /// The part of them that is not in a damaged chunk.
    unexplained: BTreeMap<u16, u64>,
    /// Number of lost messages, not in a damaged chunk, whose channel is not known.
    elsewhere: u64,
    all: u64,
}

impl Missing {
    fn new(
        stated: Option<&Statistics>,
        read: &BTreeMap<u16, u64>,
        indexed: &BTreeMap<u16, u64>,
    ) -> Self {
        let sum = |of: &BTreeMap<u16, u64>| of.values().copied().fold(0, u64::saturating_add);
        let count = |of: &BTreeMap<u16, u64>, id: u16| of.get(&id).copied().unwrap_or(0);
        let believed = |count: u64| count <= MOST_MESSAGES;
        let mut found = Self { lost: indexed.clone(), ..Self::default() };
        let of_channels = stated.iter().flat_map(|stated| &stated.of_channels);
        let mut beyond = 0_u64;
        for (&id, &stated) in of_channels.filter(|(_, stated)| believed(**stated)) {
            let less = stated.saturating_sub(count(read, id));
            beyond = beyond.saturating_add(less);
            let explained = count(indexed, id);
            if less > explained {
                found.unexplained.insert(id, less - explained);
                found.lost.insert(id, less);
            }
        }
        let all = stated.map_or(0, |stated| stated.messages);
        let less = if believed(all) { all.saturating_sub(sum(read)) } else { 0 };
        let accounted = sum(&found.lost);
        found.elsewhere = less.max(beyond).saturating_sub(accounted);
        found.all = accounted.saturating_add(found.elsewhere);
        found
    }
}

impl<V: Visitor<Error = E>, E: From<FileError>> Scan<'_, V> {
    /// Adds rejects for those that no damage explains; `summary` is the place of a sound summary.
    pub(super) fn compare(&mut self, end: u64, summary: Option<Range<u64>>) -> Result<(), E> {
        let source = &mut *self.frames.source;
        let stated = summary.map(|range| statistics(source, range));
        let stated = stated.transpose().map_err(|source| self.io(source))?.flatten();
        let missing =
            Missing::new(stated.as_ref(), &self.read.by_channel(), &self.lost.by_channel());
        self.note_undercount(stated.as_ref());
        self.read_summary.messages_lost =
            self.read_summary.messages_lost.saturating_add(missing.all);
        if missing.all == 0 {
            return Ok(());
        }
        let mut topics = BTreeMap::new();
        for &id in missing.lost.keys() {
            topics.insert(id, self.topic(id, end)?);
        }
        for (id, &messages) in &missing.lost {
            if let Some(topic) = &topics[id] {
                self.read_summary.lose(topic, messages);
            }
        }
        let mut rest = missing.elsewhere;
        for (place, (id, &messages)) in missing.unexplained.iter().enumerate() {
            if place < MOST_LISTED {
                let stated = stated.as_ref().map_or(0, |stated| stated.of_channels[id]);
                let reason = self.reason(*id, messages, stated);
                self.miss(topics[id].as_deref(), messages, end, reason);
            } else {
                rest = rest.saturating_add(messages);
            }
        }
        if rest > 0 {
            let reason = format!(
                "the summary, whose checksum is right, counts {rest} messages more than that: they are not in the log, or \
                 hidden in other records"
            );
            self.miss(None, rest, end, reason);
        }
        Ok(())
    }

    fn reason(&self, id: u16, messages: u64, stated: u64) -> String {
        let read = self.read.of(id);
        format!(
            "the summary, whose checksum is right, counts {stated} messages of channel {id}, {read} were read, and no \
             damage explains {messages}: they were cut out, or another record's length hides them"
        )
    }

    fn miss(&mut self, topic: Option<&str>, messages: u64, end: u64, reason: String) {
        let place = (self.frames.log.start, end);
        let reject = self.read_summary.of_bytes(place, LossKind::Missing, reason);
        let topic = topic.map(str::to_owned);
        self.read_summary.reject(LogReject { topic, messages: Some(messages), ..reject });
    }

    /// Fewer messages are counted than there are: nothing is lost, but the summary is wrong.
    fn note_undercount(&mut self, stated: Option<&Statistics>) {
        let Some(stated) = stated else { return };
        let read = self.read.all();
        if stated.messages < read {
            let (of_logs, read_of_logs) = self.read_summary.undercounted.unwrap_or_default();
            let of_logs = of_logs.saturating_add(stated.messages);
            self.read_summary.undercounted = Some((of_logs, read_of_logs.saturating_add(read)));
        }
    }

    /// The topic of a channel; `None` where nothing defines it.
    fn topic(&mut self, id: u16, end: u64) -> Result<Option<String>, E> {
        if let Some(channel) = self.registry.channel(id) {
            return Ok(Some(channel.topic.clone()));
        }
        if self.summary.is_none() {
            self.summary = Some(self.definitions(end)?);
        }
        let summary = self.summary.as_ref();
        let channel = summary.and_then(|summary| summary.of(id));
        Ok(channel.map(|(channel, _)| channel.topic.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn missing(stated: u64, of_channels: &[(u16, u64)], indexed: &[(u16, u64)]) -> Missing {
        let stated =
            Statistics { messages: stated, of_channels: of_channels.iter().copied().collect() };
        // Messages read: 60 of channel 1, 10 of channel 2.
        let read = BTreeMap::from([(1, 60), (2, 10)]);
        Missing::new(Some(&stated), &read, &indexed.iter().copied().collect())
    }

    #[test]
    fn messages_in_damaged_chunks_are_not_counted_twice() {
        // 40 and 5 are lost, of which 25 and 5 lay in damaged chunks.
        let found = missing(115, &[(1, 100), (2, 15)], &[(1, 25), (2, 5)]);
        assert_eq!(found.lost, BTreeMap::from([(1, 40), (2, 5)]));
        assert_eq!(found.unexplained, BTreeMap::from([(1, 15)]));
        assert_eq!((found.elsewhere, found.all), (0, 45));
        // In all 45 are lost, 40 of them of a channel that is counted; where the sum states nothing, 40.
        let found = missing(115, &[(1, 100)], &[]);
        assert_eq!((found.elsewhere, found.all), (5, 45));
        let found = missing(0, &[(1, 100), (2, 0)], &[]);
        assert_eq!((found.elsewhere, found.all), (0, 40));
    }

    #[test]
    fn fewer_than_there_are_or_more_than_can_be_is_no_loss() {
        for (stated, of_channels) in [
            (70, &[(1, 60), (2, 10)][..]),
            (0, &[]),
            (70, &[(1, 0), (2, 0)]),
            (10, &[(1, 5)]),
            (u64::MAX, &[(1, u64::MAX), (3, u64::MAX)]),
        ] {
            assert_eq!(missing(stated, of_channels, &[]), Missing::default());
        }
    }
}
