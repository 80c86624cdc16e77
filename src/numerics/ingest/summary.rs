//! The read summary of one stream: the counts of its messages by outcome.

use std::collections::BTreeMap;

use thiserror::Error;

use super::{Amendments, LogReject};

/// Numbers of rows of a stream: kept, rejected, and with irregular stamps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct StreamCounts {
    pub kept: u64,
    pub rejected: u64,
    pub backward_stamps: u64,
    pub duplicate_stamps: u64,
    /// Left out, because a row with equal stamp and content came before.
    pub repeated: u64,
    /// Left out, because they are of a publisher that always states the same beside another.
    pub second_publisher: u64,
    /// Left out, because they state the reading before them again, which the instrument had not renewed.
    pub held: u64,
}

/// The outcome of all messages of one stream, once they are read.
#[derive(Debug, Clone, PartialEq)]
pub struct StreamSummary {
    pub(super) topic: String,
    /// The files that have the topic, earliest first.
    pub(super) files: Vec<String>,
    pub(super) counts: StreamCounts,
    pub(super) further: Vec<(&'static str, u64)>,
    pub(super) rejects: Vec<LogReject>,
    /// Whether any stamp differs from 0.
    pub(super) stamped: bool,
    /// Whether all rows have the same columns.
    pub(super) alike: bool,
    /// Whether the samples were emitted in order: none was further out of order than the buffer reaches.
    pub in_order: bool,
    /// What the logs have to be read with.
    pub amendments: Amendments,
    /// What distinguishes two publishers of the topic; `None` of one.
    pub(super) publishers: Option<String>,
}

#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum IngestError {
    #[error(
        "{file}: topic {topic:?} has no usable message: {decoded} decoded, all rejected{first_reason}; \
         see `posegrid inspect`"
    )]
    NoSamples { file: String, topic: String, decoded: u64, first_reason: String },
    #[error(
        "{file}: all {messages} messages of topic {topic:?} have the header stamp 0: the publisher does not set it; \
         try time = \"publish\" or time = \"log\""
    )]
    StampsUnset { file: String, topic: String, messages: u64 },
    #[error(
        "{file}: topic {topic:?} carries messages with and without orientation or covariance; name one publisher's topic, or set \
         ignore_orientation = true for [tracker]"
    )]
    Mixed { file: String, topic: String },
    #[error(
        "{file}: topic {topic:?} carries the messages of two publishers: {what}; stop one of them, or let it publish on a topic of its own"
    )]
    TwoPublishers { file: String, topic: String, what: String },
}

impl StreamSummary {
    /// Checks that there are samples, that stamps are set and that all have the same columns; `undecoded` are the rejects of
    /// messages that could not be decoded.
    pub fn check(&self, undecoded: &[LogReject]) -> Result<(), IngestError> {
        let (file, topic) = (self.files.join(", "), self.topic.clone());
        if !self.alike {
            return Err(IngestError::Mixed { file, topic });
        }
        let decoded = self.counts.kept + self.counts.rejected;
        if decoded > 1 && !self.stamped {
            return Err(IngestError::StampsUnset { file, topic, messages: decoded });
        }
        if let Some(what) = self.publishers.clone() {
            return Err(IngestError::TwoPublishers { file, topic, what });
        }
        if self.counts.kept > 0 {
            return Ok(());
        }
        let of_stream = |reject: &&LogReject| {
            let of_topic = reject.topic.as_ref().is_none_or(|of| *of == topic);
            of_topic && self.files.contains(&reject.file)
        };
        let first = self.rejects.iter().chain(undecoded.iter().filter(of_stream)).next();
        Err(IngestError::NoSamples {
            file,
            topic,
            decoded,
            first_reason: first.map(|reject| format!(": {}", reject.reason)).unwrap_or_default(),
        })
    }

    /// Adds the stream's numbers to the counts of a session, under `stream`, and moves its rejects to the session's.
    pub fn add_to(
        self,
        stream: &str,
        counts: &mut BTreeMap<String, u64>,
        rejects: &mut Vec<LogReject>,
    ) {
        let mut add = |name: &str, count: u64| {
            *counts.entry(format!("{stream}.{name}")).or_default() += count;
        };
        add("kept", self.counts.kept);
        add("rejected", self.counts.rejected);
        add("repeated", self.counts.repeated);
        add("second_publisher", self.counts.second_publisher);
        add("held", self.counts.held);
        add("duplicate_stamps", self.counts.duplicate_stamps);
        add("backward_stamps", self.counts.backward_stamps);
        for (name, count) in self.further {
            add(name, count);
        }
        rejects.extend(self.rejects);
    }
}
