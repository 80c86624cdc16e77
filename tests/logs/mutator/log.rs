//! A sound log with every kind of record, where each of its fields lies, and where each of its messages.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::build::{Cdr, schema, stamp};
use crate::raw::{self, Body, Packing, op};

/// A number in a record.
#[derive(Debug, Clone)]
pub struct Field {
    pub name: String,
    pub at: usize,
    pub width: usize,
}

impl Field {
    pub fn value(&self, bytes: &[u8]) -> u64 {
        let mut value = [0; 8];
        value[..self.width].copy_from_slice(&bytes[self.at..self.at + self.width]);
        u64::from_le_bytes(value)
    }

    pub fn set(&self, bytes: &[u8], value: u64) -> Vec<u8> {
        let mut changed = bytes.to_vec();
        changed[self.at..self.at + self.width].copy_from_slice(&value.to_le_bytes()[..self.width]);
        changed
    }
}

/// What a record is made of, by the specification.
#[derive(Debug, Clone, Copy)]
enum Part {
    Number(&'static str, usize),
    /// Four bytes of length, then as much.
    Text(&'static str),
    /// Eight bytes of length, then as much.
    Long(&'static str),
    /// Four bytes of length, then entries of numbers.
    Entries(&'static str, &'static [usize]),
}

fn layout(opcode: u8) -> &'static [Part] {
    use Part::{Entries, Long, Number, Text};
    match opcode {
        op::HEADER => &[Text("profile"), Text("library")],
        op::FOOTER => &[
            Number("summary_start", 8),
            Number("summary_offset_start", 8),
            Number("summary_crc", 4),
        ],
        op::SCHEMA => &[Number("id", 2), Text("name"), Text("encoding"), Text("data")],
        op::CHANNEL => &[
            Number("id", 2),
            Number("schema_id", 2),
            Text("topic"),
            Text("message_encoding"),
            Text("metadata"),
        ],
        op::MESSAGE => &[
            Number("channel_id", 2),
            Number("sequence", 4),
            Number("log_time", 8),
            Number("publish_time", 8),
            // Of the payload: encapsulation, header stamp, length of the frame's name.
            Number("encapsulation", 4),
            Number("stamp.sec", 4),
            Number("stamp.nanosec", 4),
            Number("frame_id length", 4),
        ],
        op::CHUNK => &[
            Number("start_time", 8),
            Number("end_time", 8),
            Number("uncompressed_size", 8),
            Number("uncompressed_crc", 4),
            Text("compression"),
            Long("records"),
        ],
        op::MESSAGE_INDEX => &[Number("channel_id", 2), Entries("records", &[8, 8])],
        op::CHUNK_INDEX => &[
            Number("start_time", 8),
            Number("end_time", 8),
            Number("chunk_start_offset", 8),
            Number("chunk_length", 8),
            Entries("message_index_offsets", &[2, 8]),
            Number("message_index_length", 8),
            Text("compression"),
            Number("compressed_size", 8),
            Number("uncompressed_size", 8),
        ],
        op::ATTACHMENT => &[
            Number("log_time", 8),
            Number("create_time", 8),
            Text("name"),
            Text("media_type"),
            Long("data"),
            Number("crc", 4),
        ],
        op::STATISTICS => &[
            Number("message_count", 8),
            Number("schema_count", 2),
            Number("channel_count", 4),
            Number("attachment_count", 4),
            Number("metadata_count", 4),
            Number("chunk_count", 4),
            Number("start_time", 8),
            Number("end_time", 8),
            Entries("channel_message_counts", &[2, 8]),
        ],
        op::METADATA => &[Text("name"), Text("metadata")],
        op::METADATA_INDEX => &[Number("offset", 8), Number("length", 8), Text("name")],
        op::SUMMARY_OFFSET => {
            &[Number("group_opcode", 1), Number("group_start", 8), Number("group_length", 8)]
        }
        op::DATA_END => &[Number("data_section_crc", 4)],
        _ => &[],
    }
}

/// Fields of the records in a range of bytes.
pub fn fields(bytes: &[u8], range: Range<usize>) -> Vec<Field> {
    let mut found = Vec::new();
    let mut at = range.start;
    while at < range.end {
        let opcode = bytes[at];
        let mut add = |name: String, at, width| {
            let field = Field { name: format!("record {opcode:#04x} {name}"), at, width };
            let value = field.value(bytes);
            found.push(field);
            usize::try_from(value).expect("a sound log")
        };
        add("opcode".to_owned(), at, 1);
        let length = add("record length".to_owned(), at + 1, 8);
        let mut place = at + 9;
        for part in layout(opcode) {
            match *part {
                Part::Number(name, width) => {
                    add(name.to_owned(), place, width);
                    place += width;
                }
                Part::Text(name) => place += 4 + add(format!("{name} length"), place, 4),
                Part::Long(name) => place += 8 + add(format!("{name} length"), place, 8),
                Part::Entries(name, widths) => {
                    let end = place + 4 + add(format!("{name} length"), place, 4);
                    place += 4;
                    // The first entry is as good as the others.
                    let mut entry = place;
                    for &width in widths.iter().filter(|_| end > place) {
                        add(format!("{name} entry"), entry, width);
                        entry += width;
                    }
                    place = end;
                }
            }
        }
        at += 9 + length;
    }
    found
}

/// A chunk of the log.
pub struct Chunk {
    pub packing: Packing,
    pub records: Vec<u8>,
    /// The chunk's record.
    pub place: Range<usize>,
    /// The compressed bytes.
    pub packed: Range<usize>,
}

/// A sound log.
pub struct Log {
    pub bytes: Vec<u8>,
    pub chunks: Vec<Chunk>,
    /// Where each joint state lies: its record, or its chunk.
    pub homes: BTreeMap<u32, Range<usize>>,
    pub has_data_crc: bool,
}

/// Joint state `i`.
fn joints(i: u32) -> Vec<u8> {
    let (x, ns) = (f64::from(i), u64::try_from(stamp(i)).expect("positive"));
    let payload = Cdr::stamped(stamp(i)).joints(&["a", "b"], &[x, -x]).done();
    raw::message(1, i, ns, ns, &payload).record(op::MESSAGE)
}

fn definitions() -> Vec<Vec<u8>> {
    let topics =
        [("/joints", "JointState"), ("/command", "PoseStamped"), ("/reading", "PointStamped")];
    let definition = |(id, (topic, short)): (u16, (&str, &str))| {
        let (name, text) = schema(short);
        [
            raw::schema(id, &name, "ros2msg", text.as_bytes()).record(op::SCHEMA),
            raw::channel(id, id, topic, "cdr", &[("offered", "qos")]).record(op::CHANNEL),
        ]
    };
    (1..).zip(topics).flat_map(definition).collect()
}

fn others(i: u32) -> [Vec<u8>; 2] {
    let ns = u64::try_from(stamp(i)).expect("positive");
    let pose = Cdr::stamped(stamp(i)).numbers(&[0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 1.0]);
    let point = Cdr::stamped(stamp(i)).numbers(&[3.0, 0.0, 4.0]);
    [(2, pose), (3, point)]
        .map(|(channel, cdr)| raw::message(channel, 0, ns, ns, &cdr.done()).record(op::MESSAGE))
}

impl Log {
    /// With the checksum of the data section or without; chunks have theirs.
    pub fn new(has_data_crc: bool) -> Self {
        let head = raw::header("ros2", "tests").record(op::HEADER);
        let mut log = Self {
            bytes: [mcap::MAGIC, &head].concat(),
            chunks: Vec::new(),
            homes: BTreeMap::new(),
            has_data_crc,
        };
        log.bytes.extend(definitions().concat());
        log.bytes.extend(others(0).concat());
        for i in 0..3 {
            log.message(i);
        }
        let mut indexes = Vec::new();
        for (first, packing) in [(10, Packing::None), (20, Packing::Zstd), (30, Packing::Lz4)] {
            indexes.push(log.chunk(first, packing));
        }
        let metadata = Body::default().text("session").map(&[("robot", "r")]);
        let metadata_at = log.bytes.len() as u64;
        log.bytes.extend(metadata.record(op::METADATA));
        let attachment = Body::default().u64(1).u64(2).text("photo").text("image/png");
        let attachment = attachment.u64(3).raw(&[1, 2, 3]);
        let crc = crc32fast::hash(&attachment.0);
        log.bytes.extend(attachment.u32(crc).record(op::ATTACHMENT));
        for i in 40..43 {
            log.message(i);
        }
        log.bytes.extend(others(40).concat());
        log.finish(&indexes, metadata_at);
        log
    }

    fn message(&mut self, i: u32) {
        let start = self.bytes.len();
        self.bytes.extend(joints(i));
        self.homes.insert(i, start..self.bytes.len());
    }

    /// Four joint states in a chunk, with their index; returns the chunk's index.
    fn chunk(&mut self, first: u32, packing: Packing) -> Vec<u8> {
        let start = self.bytes.len();
        // Repeated in one chunk, as recorders do, which has to contradict nothing.
        let repeated = if packing == Packing::None { definitions() } else { Vec::new() };
        let mut records = repeated.concat();
        let mut entries = Vec::new();
        for i in first..first + 4 {
            entries.push((u64::try_from(stamp(i)).expect("positive"), records.len() as u64));
            records.extend(joints(i));
        }
        let chunk = raw::chunk((entries[0].0, entries[3].0), &records, packing);
        self.bytes.extend(chunk.record(op::CHUNK));
        let place = start..self.bytes.len();
        self.bytes.extend(raw::message_index(1, &entries).record(op::MESSAGE_INDEX));
        self.homes.extend((first..first + 4).map(|i| (i, place.clone())));
        let packed = packing.pack(&records).len();
        let index = Body::default()
            .u64(entries[0].0)
            .u64(entries[3].0)
            .u64(start as u64)
            .u64(place.len() as u64)
            .bytes(&Body::default().u16(1).u64(place.end as u64).0)
            .u64((self.bytes.len() - place.end) as u64)
            .text("")
            .u64(packed as u64)
            .u64(records.len() as u64);
        self.chunks.push(Chunk { packing, records, packed: place.end - packed..place.end, place });
        index.record(op::CHUNK_INDEX)
    }

    fn finish(&mut self, indexes: &[Vec<u8>], metadata_at: u64) {
        let crc = if self.has_data_crc { crc32fast::hash(&self.bytes) } else { 0 };
        self.bytes.extend(raw::data_end(crc).record(op::DATA_END));
        let start = self.bytes.len();
        let of_channels = [(1, 18), (2, 2), (3, 2)].into_iter();
        let of_channels =
            of_channels.fold(Body::default(), |body, (id, count)| body.u16(id).u64(count));
        let statistics = Body::default().u64(22).u16(3).u32(3).u32(1).u32(1).u32(3);
        let statistics = statistics.u64(0).u64(1).bytes(&of_channels.0);
        let metadata = Body::default().u64(metadata_at).u64(40).text("session");
        self.bytes.extend(definitions().concat());
        self.bytes.extend(statistics.record(op::STATISTICS));
        self.bytes.extend(indexes.concat());
        self.bytes.extend(metadata.record(op::METADATA_INDEX));
        let offsets = self.bytes.len() as u64;
        let offset = Body::default().raw(&[op::SCHEMA]).u64(start as u64).u64(9);
        self.bytes.extend(offset.record(op::SUMMARY_OFFSET));
        let footer = |crc| raw::footer(start as u64, offsets, crc).record(op::FOOTER);
        let covered = [&self.bytes[start..], &footer(0)[..9 + 16]].concat();
        self.bytes.extend(footer(crc32fast::hash(&covered)));
        self.bytes.extend(mcap::MAGIC);
    }

    /// The log with other records in one of its chunks; the chunk's checksum is kept as it was, or made to fit.
    pub fn with_chunk(&self, chunk: &Chunk, records: &[u8], keep_crc: bool) -> Vec<u8> {
        let mut body = raw::chunk((0, u64::MAX), records, chunk.packing);
        if keep_crc {
            body.0[24..28].copy_from_slice(&crc32fast::hash(&chunk.records).to_le_bytes());
        }
        self.replaced(chunk, &body.record(op::CHUNK))
    }

    /// The log with other compressed bytes in one of its chunks, which states this size.
    pub fn with_packed(&self, chunk: &Chunk, packed: &[u8], stated: u64) -> Vec<u8> {
        let name = if chunk.packing == Packing::Zstd { "zstd" } else { "lz4" };
        let body = Body::default().u64(0).u64(u64::MAX).u64(stated).u32(0);
        let body = body.text(name).u64(packed.len() as u64).raw(packed);
        self.replaced(chunk, &body.record(op::CHUNK))
    }

    fn replaced(&self, chunk: &Chunk, record: &[u8]) -> Vec<u8> {
        let (before, after) = (&self.bytes[..chunk.place.start], &self.bytes[chunk.place.end..]);
        [before, record, after].concat()
    }
}

/// Logs that are large by themselves, or ask for much in many ways at once.
pub fn large(log: &Log) -> Vec<(&'static str, Vec<u8>)> {
    let message = |channel| raw::message(channel, 0, 0, 0, &[]).record(op::MESSAGE);
    let insert = |records: Vec<u8>| {
        let (before, after) = log.bytes.split_at(log.chunks[0].place.start);
        [before, &records, after].concat()
    };
    let schemas =
        (10..500).map(|id| raw::schema(id, "t", "ros2msg", &vec![b'#'; 65_536]).record(op::SCHEMA));
    let unknown = (1000..u16::MAX).map(message);
    let name = "n".repeat(1 << 20);
    let pairs = vec![("", ""); 100_000];
    let metadata = Body::default().text(&name).map(&pairs).record(op::METADATA);
    let channel =
        raw::channel(9, 1, "/joints", "cdr", &vec![("", ""); 900_000]).record(op::CHANNEL);
    let long = raw::schema(10, "t", "ros2msg", &vec![b'#'; 1 << 20]).record(op::SCHEMA);
    let sharing = |topic: fn(u16) -> String| {
        (10..u16::MAX)
            .map(move |id| raw::channel(id, 10, &topic(id), "cdr", &[]).record(op::CHANNEL))
    };
    let shared = std::iter::once(long.clone()).chain(sharing(|id| format!("/{id}")));
    let on_one_topic = std::iter::once(long).chain(sharing(|_| "/joints".to_owned()));
    let each = sharing(|id| format!("/{id}")).chain((10..u16::MAX).map(message));
    let each = [each.collect::<Vec<_>>().concat(), (10..u16::MAX).flat_map(message).collect()];
    let tiny = raw::chunk((0, 0), &message(2), Packing::Zstd).record(op::CHUNK);
    vec![
        ("thirty-megabytes-of-schemas", insert(schemas.flatten().collect())),
        ("every-channel-unknown", insert(unknown.flatten().collect())),
        ("a-name-for-each-pair", insert(metadata)),
        ("a-million-pairs", insert(channel)),
        ("a-million-empty-messages", insert(message(2).repeat(1_000_000))),
        ("many-tiny-chunks", insert(tiny.repeat(20_000))),
        ("channels-that-share-a-long-schema", insert(shared.flatten().collect())),
        ("channels-of-one-topic", insert(on_one_topic.flatten().collect())),
        ("a-message-of-every-channel-twice", insert(each.concat())),
        ("many-logs-in-one-file", log.bytes.repeat(300)),
        ("many-ends", insert(raw::data_end(0).record(op::DATA_END).repeat(100_000))),
    ]
}
