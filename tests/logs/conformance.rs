//! The 416 files of the MCAP conformance set, built here from its description and read with the expected records.
//!
//! The set is six contents times every subset of the features that apply to the content, where chunk and message indexes
//! need chunks, and summary offsets need a summary to point into. Checksums that the set publishes show that the files
//! built here are the same to the byte.

use std::collections::BTreeSet;
use std::sync::Arc;

use posegrid::ingest::LogReject;
use posegrid::io::log::{
    Channel, Ending, Extent, FileError, Limits, MessageRecord, ReadSummary, Schema, Visitor, scan,
};
use posegrid::progress::Quiet;

use crate::build::Folder;
use crate::raw::{self, Body, Packing, op};

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Content {
    NoData,
    OneAttachment,
    OneMessage,
    OneMetadata,
    OneSchemalessMessage,
    TenMessages,
}

/// In the alphabetical order of their short names, in which a file's name lists them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Feature {
    AttachmentIndex,
    Chunks,
    ChunkIndex,
    MetadataIndex,
    MessageIndex,
    Padding,
    RepeatedChannels,
    RepeatedSchemas,
    Statistics,
    SummaryOffsets,
}

use Feature::{
    AttachmentIndex, ChunkIndex, Chunks, MessageIndex, MetadataIndex, Padding, RepeatedChannels,
    RepeatedSchemas, Statistics, SummaryOffsets,
};

const CONTENTS: [Content; 6] = [
    Content::NoData,
    Content::OneAttachment,
    Content::OneMessage,
    Content::OneMetadata,
    Content::OneSchemalessMessage,
    Content::TenMessages,
];

impl Feature {
    const fn short(self) -> &'static str {
        match self {
            AttachmentIndex => "ax",
            Chunks => "ch",
            ChunkIndex => "chx",
            MetadataIndex => "mdx",
            MessageIndex => "mx",
            Padding => "pad",
            RepeatedChannels => "rch",
            RepeatedSchemas => "rsh",
            Statistics => "st",
            SummaryOffsets => "sum",
        }
    }
}

impl Content {
    fn features(self) -> Vec<Feature> {
        let mut all = vec![Padding, Statistics, SummaryOffsets];
        all.extend(match self {
            Self::NoData => vec![],
            Self::OneAttachment => vec![AttachmentIndex],
            Self::OneMetadata => vec![MetadataIndex],
            Self::OneSchemalessMessage => {
                vec![Chunks, ChunkIndex, MessageIndex, RepeatedChannels]
            }
            Self::OneMessage | Self::TenMessages => {
                vec![Chunks, ChunkIndex, MessageIndex, RepeatedChannels, RepeatedSchemas]
            }
        });
        all
    }

    /// Sequence, log time and publish time of each message.
    fn messages(self) -> Vec<(u32, u64, u64)> {
        match self {
            Self::NoData | Self::OneAttachment | Self::OneMetadata => vec![],
            Self::OneMessage | Self::OneSchemalessMessage => vec![(10, 2, 1)],
            // Two are out of order, two share their time.
            Self::TenMessages => (0..)
                .zip([0, 2, 1, 3, 3, 5, 4, 7, 8, 9])
                .map(|(sequence, time)| (sequence, time, time))
                .collect(),
        }
    }

    fn schema(self) -> Option<Body> {
        let has = matches!(self, Self::OneMessage | Self::TenMessages);
        has.then(|| raw::schema(1, "Example", "c", &[4, 5, 6]))
    }

    fn channel(self) -> Option<Body> {
        match self {
            Self::OneMessage | Self::TenMessages => {
                Some(raw::channel(1, 1, "example", "a", &[("foo", "bar")]))
            }
            Self::OneSchemalessMessage => Some(raw::channel(1, 0, "example", "text", &[])),
            _ => None,
        }
    }
}

/// One file of the set.
struct Variant {
    content: Content,
    features: BTreeSet<Feature>,
}

impl Variant {
    fn has(&self, feature: Feature) -> bool {
        self.features.contains(&feature)
    }

    fn is_in_the_set(&self) -> bool {
        let points_somewhere = self
            .features
            .iter()
            .any(|f| !matches!(f, Chunks | MessageIndex | Padding | SummaryOffsets));
        (self.has(Chunks) || !(self.has(ChunkIndex) || self.has(MessageIndex)))
            && (points_somewhere || !self.has(SummaryOffsets))
    }

    fn name(&self) -> String {
        let mut short: Vec<_> = self.features.iter().map(|f| f.short()).collect();
        short.sort_unstable();
        short.iter().fold(format!("{:?}", self.content), |name, f| name + "-" + f)
    }

    /// A record with what a later version might add to it.
    fn record(&self, body: Body, opcode: u8) -> Vec<u8> {
        if self.has(Padding) {
            body.raw(&[1, 255, 255]).record(opcode)
        } else {
            body.record(opcode)
        }
    }

    fn build(&self) -> Vec<u8> {
        let mut file = mcap::MAGIC.to_vec();
        file.extend(self.record(raw::header("", ""), op::HEADER));
        let (data, indexes) = self.data(file.len() as u64);
        file.extend(data);
        let crc = crc32fast::hash(&file);
        file.extend(self.record(raw::data_end(crc), op::DATA_END));
        let start = file.len() as u64;
        let groups = self.summary(indexes);
        file.extend(groups.iter().flat_map(|(_, bytes)| bytes));
        let offsets = self.offsets(start, &groups);
        let [summary_start, offset_start] = [
            if groups.is_empty() { 0 } else { start },
            if offsets.is_empty() { 0 } else { file.len() as u64 },
        ];
        file.extend(offsets);
        // The checksum reaches over the footer, up to itself.
        let footer = |crc| raw::footer(summary_start, offset_start, crc).record(op::FOOTER);
        let from = usize::try_from(start).expect("a small file");
        let covered = [&file[from..], &footer(0)[..9 + 16]].concat();
        file.extend(footer(crc32fast::hash(&covered)));
        [&file, mcap::MAGIC].concat()
    }

    /// The data section that begins at byte `start`, and the indexes that the summary has of it.
    fn data(&self, start: u64) -> (Vec<u8>, Vec<(u8, Vec<u8>)>) {
        let placed = |data: Vec<u8>, feature, opcode, index: &dyn Fn(u64) -> Body| {
            let length = data.len() as u64;
            let index = self.has(feature).then(|| (opcode, self.record(index(length), opcode)));
            (data, index.into_iter().collect())
        };
        match self.content {
            Content::NoData => (vec![], vec![]),
            Content::OneAttachment => {
                let name = |body: Body| body.text("myFile").text("application/octet-stream");
                let body = name(Body::default().u64(2).u64(1)).u64(3).raw(&[1, 2, 3]);
                let crc = crc32fast::hash(&body.0);
                let attachment = self.record(body.u32(crc), op::ATTACHMENT);
                placed(attachment, AttachmentIndex, op::ATTACHMENT_INDEX, &|length| {
                    name(Body::default().u64(start).u64(length).u64(2).u64(1).u64(3))
                })
            }
            Content::OneMetadata => {
                let body = Body::default().text("myMetadata").map(&[("foo", "bar")]);
                let metadata = self.record(body, op::METADATA);
                placed(metadata, MetadataIndex, op::METADATA_INDEX, &|length| {
                    Body::default().u64(start).u64(length).text("myMetadata")
                })
            }
            _ if self.has(Chunks) => self.chunk(start),
            _ => {
                let schema = self.content.schema();
                let schema = schema.map(|body| self.record(body, op::SCHEMA));
                let channel = self.content.channel();
                let channel = channel.map(|body| self.record(body, op::CHANNEL));
                let head = [schema, channel].into_iter().flatten();
                (head.chain(self.messages()).flatten().collect(), vec![])
            }
        }
    }

    /// A message's payload reaches to the end of its record, so nothing can be added to it.
    fn messages(&self) -> impl Iterator<Item = Vec<u8>> {
        let messages = self.content.messages().into_iter();
        messages.map(|(sequence, log, publish)| {
            raw::message(1, sequence, log, publish, &[1, 2, 3]).record(op::MESSAGE)
        })
    }

    fn chunk(&self, start: u64) -> (Vec<u8>, Vec<(u8, Vec<u8>)>) {
        let schema = self.content.schema().map(|body| body.record(op::SCHEMA));
        let channel = self.content.channel().map(|body| body.record(op::CHANNEL));
        let mut records = [schema, channel].into_iter().flatten().collect::<Vec<_>>().concat();
        let mut entries = Vec::new();
        for (message, (_, log, _)) in self.messages().zip(self.content.messages()) {
            entries.push((log, records.len() as u64));
            records.extend(message);
        }
        let times = entries.iter().map(|(log, _)| *log);
        let times = (times.clone().min().expect("messages"), times.max().expect("messages"));
        let mut data = raw::chunk(times, &records, Packing::None).record(op::CHUNK);
        let chunk_length = data.len() as u64;
        let mut offsets = Body::default();
        if self.has(MessageIndex) {
            data.extend(self.record(raw::message_index(1, &entries), op::MESSAGE_INDEX));
            offsets = offsets.u16(1).u64(start + chunk_length);
        }
        let index = Body::default()
            .u64(times.0)
            .u64(times.1)
            .u64(start)
            .u64(chunk_length)
            .bytes(&offsets.0)
            .u64(data.len() as u64 - chunk_length)
            .text("")
            .u64(records.len() as u64)
            .u64(records.len() as u64);
        let index = (op::CHUNK_INDEX, self.record(index, op::CHUNK_INDEX));
        (data, self.has(ChunkIndex).then_some(index).into_iter().collect())
    }

    /// Groups of the summary, each with its opcode.
    fn summary(&self, indexes: Vec<(u8, Vec<u8>)>) -> Vec<(u8, Vec<u8>)> {
        let mut groups = Vec::new();
        let mut add = |feature, opcode, body: Option<Body>| {
            if let Some(body) = body.filter(|_| self.has(feature)) {
                groups.push((opcode, self.record(body, opcode)));
            }
        };
        add(RepeatedSchemas, op::SCHEMA, self.content.schema());
        add(RepeatedChannels, op::CHANNEL, self.content.channel());
        add(Statistics, op::STATISTICS, Some(self.statistics()));
        groups.extend(indexes);
        groups
    }

    fn statistics(&self) -> Body {
        let messages = self.content.messages();
        let times = || messages.iter().map(|(_, log, _)| *log);
        let count = |has: bool| u32::from(has);
        let mut per_channel = Body::default();
        if !messages.is_empty() {
            per_channel = per_channel.u16(1).u64(messages.len() as u64);
        }
        Body::default()
            .u64(messages.len() as u64)
            .u16(u16::from(self.content.schema().is_some()))
            .u32(count(self.content.channel().is_some()))
            .u32(count(self.content == Content::OneAttachment))
            .u32(count(self.content == Content::OneMetadata))
            .u32(count(self.has(Chunks)))
            .u64(times().min().unwrap_or(0))
            .u64(times().max().unwrap_or(0))
            .bytes(&per_channel.0)
    }

    fn offsets(&self, start: u64, groups: &[(u8, Vec<u8>)]) -> Vec<u8> {
        let mut at = start;
        let mut offsets = Vec::new();
        for (opcode, bytes) in groups.iter().filter(|_| self.has(SummaryOffsets)) {
            let length = bytes.len() as u64;
            let body = Body::default().raw(&[*opcode]).u64(at).u64(length);
            offsets.extend(self.record(body, op::SUMMARY_OFFSET));
            at += length;
        }
        offsets
    }
}

/// Every file of the set.
fn variants() -> Vec<Variant> {
    let of = |content: Content| {
        let features = content.features();
        (0..1_u32 << features.len()).map(move |subset| Variant {
            content,
            features: (0..)
                .zip(&features)
                .filter(|(bit, _)| subset >> bit & 1 == 1)
                .map(|(_, feature)| *feature)
                .collect(),
        })
    };
    CONTENTS.into_iter().flat_map(of).filter(Variant::is_in_the_set).collect()
}

/// The smallest and the largest file of each content.
pub fn samples() -> Vec<Vec<u8>> {
    let most = |content: Content| content.features().len();
    let variants = variants();
    let ends =
        variants.iter().filter(|v| v.features.is_empty() || v.features.len() == most(v.content));
    ends.map(Variant::build).collect()
}

/// Everything that the reader lends, in the order of the file.
#[derive(Debug, Default, PartialEq)]
struct Everything {
    channels: Vec<(Channel, Option<Schema>)>,
    messages: Vec<(u16, u32, u64, u64, Vec<u8>)>,
}

impl Visitor for Everything {
    type Decoder = ();
    type Part = Vec<(u16, u32, u64, u64, Vec<u8>)>;
    type Error = FileError;

    fn channel(
        &mut self,
        channel: &Channel,
        schema: Option<&Arc<Schema>>,
    ) -> Result<(), FileError> {
        let schema = schema.map(|schema| Schema::clone(schema));
        self.channels.push((channel.clone(), schema));
        Ok(())
    }

    fn message(&self, (): &(), m: &MessageRecord<'_>, part: &mut Self::Part) {
        part.push((m.channel_id, m.sequence, m.log_time, m.publish_time, m.payload.to_vec()));
    }

    fn clear(&self, part: &mut Self::Part) {
        part.clear();
    }

    fn merge(&mut self, _: &Extent, part: &mut Self::Part, _: &mut Vec<LogReject>) {
        self.messages.append(part);
    }
}

fn read(folder: &Folder, bytes: &[u8]) -> (Everything, ReadSummary) {
    let path = folder.file("log.mcap", bytes);
    let mut found = Everything::default();
    let read_summary = scan(&path, "log.mcap", Limits::default(), &mut found, &Quiet);
    (found, read_summary.expect("a log"))
}

/// What the set says is in a file, channels apart from messages.
fn expected(content: Content) -> Everything {
    let channel = |schema_id, encoding: &str| Channel {
        id: 1,
        schema_id,
        topic: "example".to_owned(),
        encoding: encoding.to_owned(),
    };
    let schema =
        Schema { name: "Example".to_owned(), encoding: "c".to_owned(), definition: vec![4, 5, 6] };
    let messages = content.messages().into_iter();
    Everything {
        channels: match content {
            Content::OneMessage | Content::TenMessages => vec![(channel(1, "a"), Some(schema))],
            Content::OneSchemalessMessage => vec![(channel(0, "text"), None)],
            _ => vec![],
        },
        messages: messages
            .map(|(sequence, log, publish)| (1, sequence, log, publish, vec![1, 2, 3]))
            .collect(),
    }
}

#[test]
fn every_file_of_the_set_is_read_with_its_records() {
    let folder = Folder::new();
    let variants = variants();
    let names: BTreeSet<_> = variants.iter().map(Variant::name).collect();
    assert_eq!((variants.len(), names.len()), (416, 416));
    for variant in variants {
        let name = variant.name();
        let (found, read_summary) = read(&folder, &variant.build());
        assert_eq!(found, expected(variant.content), "{name}");
        assert_eq!(read_summary.rejects, [], "{name}");
        let has_summary =
            variant.features.iter().any(|f| !matches!(f, Chunks | MessageIndex | Padding));
        let ending = if has_summary { Ending::Sound } else { Ending::NoSummary };
        assert_eq!(read_summary.ending, ending, "{name}");
        let chunks: u64 = read_summary.chunks.values().sum();
        assert_eq!(chunks, u64::from(variant.has(Chunks)), "{name}");
        let metadata = [("myMetadata".to_owned(), "foo".to_owned(), "bar".to_owned())];
        let has_metadata = variant.content == Content::OneMetadata;
        assert_eq!(read_summary.metadata, metadata[..usize::from(has_metadata)], "{name}");
    }
}

#[test]
fn the_files_are_those_of_the_set() {
    // Checksums of data section and summary, as the set's expected records state them.
    for (name, data_crc, summary_crc) in [
        ("TenMessages-ch-chx-mx-pad-rch-rsh-st-sum", Some(3_282_868_494), 829_723_996),
        ("OneSchemalessMessage-ch-chx-mx-pad-rch-st-sum", Some(3_715_123_221), 239_768_738),
        ("OneMetadata-mdx-pad-st-sum", None, 1_149_090_039),
        ("OneMessage-pad", None, 1_875_167_664),
    ] {
        let variants = variants();
        let variant = variants.iter().find(|v| v.name() == name).expect("in the set");
        let file = variant.build();
        let tail = &file[file.len() - 12..file.len() - 8];
        assert_eq!(u32::from_le_bytes(tail.try_into().expect("four")), summary_crc, "{name}");
        let (data, _) = variant.data(0);
        // Magic and header, 28 bytes with their padding, stand before the data.
        let found = crc32fast::hash(&file[..28 + data.len()]);
        assert!(data_crc.is_none_or(|crc| crc == found), "{name}: {found}");
    }
}

#[test]
fn a_file_of_the_set_cut_anywhere_loses_nothing_in_silence() {
    let folder = Folder::new();
    let variants = variants();
    let full = |v: &&Variant| v.content == Content::TenMessages && v.features.len() == 8;
    let variant = variants.iter().find(full).expect("in the set");
    let file = variant.build();
    let all = expected(Content::TenMessages).messages;
    for length in 8..file.len() {
        let (found, read_summary) = read(&folder, &file[..length]);
        assert!(all.starts_with(&found.messages), "cut to {length}");
        let whole = found.messages.len() == all.len();
        assert!(whole || !read_summary.rejects.is_empty(), "cut to {length}");
        // A file without its last byte is not whole, and that is told.
        assert!(!read_summary.rejects.is_empty(), "cut to {length}");
    }
}
