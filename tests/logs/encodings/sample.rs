//! A sample of every type in every encoding, for an independent reader: `tests/readers/compare_decoders.py` reads the
//! log and compares it, bit for bit, with what is written down here beside it.

use std::fmt::Write as _;
use std::path::Path;

use mcap::Compression;
use posegrid::files::message::{FieldPath, MessageSchema, Row, Value};

use super::proto::{Field, Proto, describe, file, set};
use crate::build::Log;

/// A number's bits, or the one word for all that are none.
fn bits(number: f64) -> String {
    if number.is_nan() { "nan".to_owned() } else { format!("{:016x}", number.to_bits()) }
}

/// A value for people.
pub fn word(value: &Value<'_>) -> String {
    let text = |text: &str| format!("\"{text}\"");
    match value {
        Value::Absent => "absent".to_owned(),
        Value::Integer(integer) => integer.to_string(),
        Value::Number(number) => number.to_string(),
        Value::Text(found) => text(&found.to_text()),
        Value::Numbers(_) | Value::Texts(_) | Value::List(_) => {
            let numbers = value.numbers();
            let texts: Vec<_> = value.texts().map(|all| all.iter().collect()).unwrap_or_default();
            let count = numbers.map_or(texts.len(), |numbers| numbers.len());
            let one = |index| {
                let number = numbers.and_then(|numbers| numbers.get(index)).map(|x| x.to_string());
                let word = texts.get(index).copied().flatten().map(|found| text(&found.to_text()));
                number.or(word).unwrap_or_else(|| "absent".to_owned())
            };
            format!("[{}]", (0..count).map(one).collect::<Vec<_>>().join(", "))
        }
    }
}

/// A value's elements for the other reader: bits of numbers, texts, null.
pub fn elements(value: &Value<'_>) -> Vec<serde_json::Value> {
    let number = |number: f64| serde_json::json!({ "bits": bits(number) });
    match value {
        Value::Absent => vec![serde_json::Value::Null],
        Value::Text(text) => vec![text.to_text().into()],
        Value::Integer(_) | Value::Number(_) => value.number().map(number).into_iter().collect(),
        Value::Texts(texts) => {
            texts.iter().map(|text| text.map(|text| text.to_text()).into()).collect()
        }
        Value::Numbers(_) | Value::List(_) => {
            let numbers = value.numbers().expect("an array");
            let texts: Vec<_> = value.texts().map(|all| all.iter().collect()).unwrap_or_default();
            let one = |index| match numbers.get(index) {
                Some(found) => number(found),
                None => texts.get(index).copied().flatten().map(|text| text.to_text()).into(),
            };
            (0..numbers.len()).map(one).collect()
        }
    }
}

/// Numbers without a pattern; the same in every run.
pub struct Noise(pub u64);

impl Noise {
    fn next(&mut self) -> u64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        // The upper bits of such a generator are the better ones.
        self.0.rotate_left(32)
    }

    pub fn below(&mut self, limit: u64) -> u64 {
        self.next() % limit
    }

    /// Any double: also tiny, huge, infinite and none.
    fn double(&mut self) -> f64 {
        match self.below(8) {
            0 => [0.0, -0.0, f64::INFINITY, f64::NAN, f64::MIN_POSITIVE / 4.0, 1.0][self.place(6)],
            1 => f64::from_bits(self.next()),
            _ => self.next() as f64 * 1e-19 - 0.5,
        }
    }

    pub fn place(&mut self, count: u64) -> usize {
        usize::try_from(self.below(count)).expect("small")
    }

    fn text(&mut self) -> String {
        let letters = ["a", "_", "ü", "9", "joint", "\"", "\\", "€"];
        (0..self.below(5)).map(|_| letters[self.place(8)]).collect()
    }
}

/// Names of types in `.msg` and IDL, and bytes.
const PRIMITIVES: [(&str, &str, usize); 12] = [
    ("bool", "boolean", 1),
    ("byte", "octet", 1),
    ("int8", "int8", 1),
    ("uint8", "uint8", 1),
    ("int16", "short", 2),
    ("uint16", "unsigned short", 2),
    ("int32", "long", 4),
    ("uint32", "unsigned long", 4),
    ("int64", "long long", 8),
    ("uint64", "unsigned long long", 8),
    ("float32", "float", 4),
    ("float64", "double", 8),
];

/// The schemas of `samples/All` in both languages, and the fields.
fn ros_schemas() -> (String, String, Vec<String>) {
    let (mut message, mut typedefs, mut members) = (String::new(), String::new(), String::new());
    let mut paths = Vec::new();
    writeln!(message, "uint8 CONSTANT=7\nstring<=8 word \"default\" # bounded").expect("a string");
    members.push_str("@default (value=\"x\") string<8> word;\n");
    for (name, idl, _) in PRIMITIVES {
        writeln!(message, "{name} one_{name}\n{name}[3] three_{name}\n{name}[] some_{name}")
            .expect("a string");
        writeln!(message, "{name}[<=5] few_{name}\nsamples/Inner inner_{name}").expect("a string");
        writeln!(typedefs, "typedef {idl} {name}__3[3];").expect("a string");
        writeln!(
            members,
            "@verbatim (language=\"comment\", text=\"a;\" \"b\")\n{idl} one_{name}; {name}__3 three_{name}; \
             sequence<{idl}> some_{name}; sequence<{idl}, 5> few_{name}; samples::msg::Inner inner_{name};"
        )
        .expect("a string");
        paths.extend(["one", "three", "some", "few"].map(|shape| format!("{shape}_{name}")));
        paths.extend([format!("inner_{name}.y"), format!("three_{name}[2]")]);
    }
    message
        .push_str("string[] words\nstring[2] pair\nInner[] list\nInner[2] both\nint32 last -5\n");
    members.push_str(
        "sequence<string> words; string pair[2]; sequence<Inner> list; Inner both[2]; long last;\n",
    );
    paths.extend(
        [
            "word",
            "words",
            "pair",
            "list[].y",
            "list[1].x",
            "list[].s",
            "both[].x",
            "both[1].y",
            "last",
        ]
        .map(str::to_owned),
    );
    // An element and the whole of an array of numbers cannot both be wanted of one reader: the test makes two.
    let inner = "================\nMSG: samples/Inner\nuint8 x\nfloat64 y\nstring s\n";
    let line = "=".repeat(80);
    let idl = format!(
        "{line}\nIDL: samples/msg/All\nmodule samples {{ module msg {{\n{typedefs}\
         module All_Constants {{ const uint8 CONSTANT = 7; }};\nstruct All {{\n{members}}};\n}}; }};\n\
         {line}\nIDL: samples/msg/Inner\nmodule samples {{ module msg {{ struct Inner {{ uint8 x; double y; string s; }}; }}; }};\n"
    );
    (format!("{message}{inner}"), idl, paths)
}

/// The schema of `samples/All` in ROS 1, which has neither bounds nor defaults, with types of ROS 1 before the others.
fn ros_1_schema(message: &str, paths: &[String]) -> (String, Vec<String>) {
    let plain = ["<=8", "<=5", " \"default\"", " -5"]
        .into_iter()
        .fold(message.to_owned(), |text, without| text.replace(without, ""));
    let text = format!(
        "Header header\nduration left\nchar letter\nEmpty[] nothing\n{plain}================\nMSG: samples/Empty\n\n\
         ================\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
    );
    // Its own tools part the texts by lines of that length only.
    let text = text.replace(&"=".repeat(16), &"=".repeat(80));
    let first = ["header.seq", "header.stamp.secs", "header.stamp.nsecs", "header.frame_id"];
    let second = ["left.secs", "left.nsecs", "letter"];
    let first = first.into_iter().chain(second).map(str::to_owned);
    (text, first.chain(paths.iter().cloned()).collect())
}

/// How a message of CDR or ROS 1 is laid out.
#[derive(Clone, Copy)]
struct Layout {
    encapsulation: u8,
    version_2: bool,
    delimited: bool,
    ros_1: bool,
}

/// A message of CDR or ROS 1 with any types in it.
struct Cdr {
    bytes: Vec<u8>,
    layout: Layout,
}

impl Cdr {
    fn raw(&mut self, little: &[u8]) {
        let widest = if self.layout.version_2 { 4 } else { 8 };
        let size = little.len().min(widest);
        if !self.layout.ros_1 {
            self.bytes.resize((self.bytes.len() - 4).next_multiple_of(size) + 4, 0);
        }
        let mut bytes = little.to_vec();
        if self.layout.encapsulation.is_multiple_of(2) {
            bytes.reverse();
        }
        self.bytes.extend(bytes);
    }

    fn count(&mut self, count: usize) {
        self.raw(&u32::try_from(count).expect("small").to_le_bytes());
    }

    fn text(&mut self, text: &str) {
        let end: &[u8] = if self.layout.ros_1 { &[] } else { &[0] };
        self.count(text.len() + end.len());
        self.bytes.extend(text.as_bytes());
        self.bytes.extend(end);
    }

    /// Writes what begins with its length in bytes, where it does.
    fn delimited(&mut self, is: bool, write: impl FnOnce(&mut Self)) {
        if !is {
            return write(self);
        }
        self.count(0);
        let start = self.bytes.len();
        write(self);
        let length = u32::try_from(self.bytes.len() - start).expect("small");
        let mut length = length.to_le_bytes();
        if self.layout.encapsulation.is_multiple_of(2) {
            length.reverse();
        }
        self.bytes[start - 4..start].copy_from_slice(&length);
    }

    fn primitive(&mut self, name: &str, size: usize, noise: &mut Noise) {
        let bits = match name {
            "bool" => noise.below(2),
            "float64" => noise.double().to_bits(),
            #[expect(clippy::cast_possible_truncation, reason = "any single will do")]
            "float32" => (noise.double() as f32).to_bits().into(),
            _ => noise.next(),
        };
        self.raw(&bits.to_le_bytes()[..size]);
    }

    fn inner(&mut self, noise: &mut Noise) {
        self.delimited(self.layout.delimited, |cdr| {
            cdr.primitive("uint8", 1, noise);
            cdr.primitive("float64", 8, noise);
            cdr.text(&noise.text());
        });
    }

    fn all(layout: Layout, noise: &mut Noise) -> Vec<u8> {
        let bytes = vec![0, layout.encapsulation, 0, 0];
        let mut cdr = Self { bytes, layout };
        cdr.delimited(layout.delimited, |cdr| cdr.members(noise));
        cdr.bytes
    }

    /// Little-endian and packed, after a header, a duration and an array of messages without fields.
    fn all_of_ros_1(noise: &mut Noise) -> Vec<u8> {
        let layout = Layout { encapsulation: 1, version_2: false, delimited: false, ros_1: true };
        let mut ros_1 = Self { bytes: Vec::new(), layout };
        (0..3).for_each(|_| ros_1.primitive("uint32", 4, noise));
        ros_1.text(&noise.text());
        ros_1.primitive("int32", 4, noise);
        // `genpy` carries more nanoseconds than a second has into the seconds.
        ros_1.count(noise.place(1_000_000_000));
        ros_1.primitive("uint8", 1, noise);
        ros_1.count(noise.place(4));
        ros_1.members(noise);
        ros_1.bytes
    }

    fn members(&mut self, noise: &mut Noise) {
        self.text(&noise.text());
        for (name, _, size) in PRIMITIVES {
            self.primitive(name, size, noise);
            for count in [3, noise.place(6), noise.place(6)].into_iter().enumerate() {
                if count.0 > 0 {
                    self.count(count.1);
                }
                for _ in 0..count.1 {
                    self.primitive(name, size, noise);
                }
            }
            self.inner(noise);
        }
        let version_2 = self.layout.version_2;
        for (is_sequence, count) in [(true, noise.place(4)), (false, 2)] {
            self.delimited(version_2, |cdr| {
                if is_sequence {
                    cdr.count(count);
                }
                (0..count).for_each(|_| cdr.text(&noise.text()));
            });
        }
        for (is_sequence, count) in [(true, noise.place(4)), (false, 2)] {
            self.delimited(version_2, |cdr| {
                if is_sequence {
                    cdr.count(count);
                }
                (0..count).for_each(|_| cdr.inner(noise));
            });
        }
        self.primitive("int32", 4, noise);
    }
}

/// The scalar kinds of protobuf by their numbers in `descriptor.proto`, without enums.
const KINDS: [(&str, u64, u8); 15] = [
    ("double", 1, 1),
    ("float", 2, 5),
    ("int64", 3, 0),
    ("uint64", 4, 0),
    ("int32", 5, 0),
    ("fixed64", 6, 1),
    ("fixed32", 7, 5),
    ("bool", 8, 0),
    ("string", 9, 2),
    ("bytes", 12, 2),
    ("uint32", 13, 0),
    ("sfixed32", 15, 5),
    ("sfixed64", 16, 1),
    ("sint32", 17, 0),
    ("sint64", 18, 0),
];

pub fn protobuf_schema() -> (Vec<u8>, Vec<String>) {
    let (mut fields, mut paths) = (Vec::new(), Vec::new());
    let names: Vec<_> =
        KINDS.iter().map(|(name, ..)| [format!("one_{name}"), format!("many_{name}")]).collect();
    for ([one, many], (number, (name, kind, _))) in names.iter().zip((1..).zip(KINDS)) {
        fields.push(Field::one(one, number, kind));
        fields.push(Field::one(many, number + 20, kind).many());
        // Bytes are no text for the other reader.
        if name != "bytes" {
            paths.extend([one.clone(), many.clone()]);
        }
    }
    fields.extend([
        Field::of("inner", 50, ".samples.Inner"),
        Field::of("list", 51, ".samples.Inner").many(),
        Field::one("left", 52, 1).in_oneof(0),
        Field::one("right", 53, 5).in_oneof(0),
    ]);
    paths.extend(
        ["inner.x", "inner.inner.x", "list[].x", "list[].s", "list[1].x", "left", "right"]
            .map(str::to_owned),
    );
    let inner = describe(
        "Inner",
        &[Field::one("x", 1, 1), Field::one("s", 2, 9), Field::of("inner", 3, ".samples.Inner")],
    );
    let types = [describe("All", &fields), inner];
    (set(&[file("samples.proto", "samples", &[], "proto3", &types)]), paths)
}

fn protobuf_value(of: Proto, number: u32, kind: (&str, u64, u8), noise: &mut Noise) -> Proto {
    #[expect(clippy::cast_possible_truncation, reason = "any single will do")]
    match kind {
        ("double", ..) => of.double(number, noise.double()),
        ("float", ..) => of.fixed_32(number, (noise.double() as f32).to_bits()),
        ("int64" | "uint64" | "sint64", ..) => {
            let shift = noise.below(64);
            of.varint(number, noise.next() >> shift)
        }
        // A negative int32 is stored in ten bytes.
        ("int32", ..) => of.varint(number, i64::from(noise.next() as i32).cast_unsigned()),
        ("bool", ..) => of.varint(number, noise.below(2)),
        ("string" | "bytes", ..) => of.bytes(number, noise.text().as_bytes()),
        (_, _, 0) => of.varint(number, noise.next() & 0xFFFF_FFFF),
        (_, _, 5) => of.fixed_32(number, noise.next() as u32),
        _ => of.fixed_64(number, noise.next()),
    }
}

fn protobuf_inner(noise: &mut Noise) -> Proto {
    let mut inner = Proto::default();
    if noise.below(3) > 0 {
        inner = inner.double(1, noise.double());
    }
    if noise.below(3) > 0 {
        inner = inner.bytes(2, noise.text().as_bytes());
    }
    inner
}

pub fn protobuf_message(noise: &mut Noise) -> Vec<u8> {
    let mut message = Proto::default();
    for (number, kind) in (1..).zip(KINDS) {
        // Now and then twice, or not at all.
        for _ in 0..noise.below(3) {
            message = protobuf_value(message, number, kind, noise);
        }
        for _ in 0..noise.below(4) {
            message = protobuf_value(message, number + 20, kind, noise);
        }
        message = message.group(90, &Proto::default().varint(number, 1));
    }
    let packed = (0..noise.below(4)).fold(Proto::default(), |mut of, _| {
        of.raw_varint(noise.next() & 0xFFFF);
        of
    });
    message = message.bytes(24, &packed.0);
    for _ in 0..=noise.below(2) {
        // Nested in a nested one, merged with the next.
        message = message.message(50, &protobuf_inner(noise).message(3, &protobuf_inner(noise)));
    }
    for _ in 0..noise.below(4) {
        message = message.message(51, &protobuf_inner(noise));
    }
    match noise.below(3) {
        0 => message = message.double(52, 0.5).varint(53, 7),
        1 => message = message.varint(53, 7).double(52, 0.5),
        _ => {}
    }
    message.0
}

pub const JSON_PATHS: [&str; 9] =
    ["x", "a.x", "a.b[1].x", "list", "list[].x", "names", "a.b[].s", "\"", "tall"];

fn json_value(noise: &mut Noise, levels: u64) -> serde_json::Value {
    match noise.below(if levels == 0 { 5 } else { 8 }) {
        0 => serde_json::Value::Null,
        1 => noise.next().cast_signed().into(),
        2 => noise.text().into(),
        3 => (noise.below(2) == 1).into(),
        4 => {
            let number = noise.double();
            serde_json::Number::from_f64(number).map_or(serde_json::Value::Null, Into::into)
        }
        5 => (0..noise.below(5)).map(|_| json_value(noise, levels - 1)).collect(),
        _ => {
            let names = ["x", "a", "b", "list", "names", "s", "\"", "tall"];
            let members = (0..noise.below(8))
                .map(|_| (names[noise.place(8)].to_owned(), json_value(noise, levels - 1)));
            serde_json::Value::Object(members.collect())
        }
    }
}

pub fn json_message(noise: &mut Noise) -> Vec<u8> {
    let mut message = serde_json::json!({
        "x": json_value(noise, 0),
        "a": { "x": json_value(noise, 0), "b": [json_value(noise, 3), { "x": noise.double(), "s": noise.text() }] },
        "list": json_value(noise, 4),
        "names": [noise.text(), noise.text()],
        "tall": json_value(noise, 6),
    });
    if noise.below(2) == 0 {
        message["\""] = noise.text().into();
    }
    serde_json::to_vec(&message).expect("a value")
}

/// A log and, line by line, what is decoded of it.
struct Sample {
    log: Log,
    lines: String,
}

impl Sample {
    /// Writes messages on a topic, and what each wanted field of them is.
    fn add(
        &mut self,
        (topic, name, language, text, encoding): (&str, &str, &str, &[u8], &str),
        paths: &[String],
        messages: &[Vec<u8>],
    ) {
        let channel = self.log.channel_of(topic, name, language, text, encoding);
        let read = MessageSchema::read(encoding, name, language, text);
        let schema = read.expect("an encoding that is read").expect("a sound schema");
        let parsed: Vec<_> =
            paths.iter().map(|path| FieldPath::parse(path).expect("a path")).collect();
        // One path a reader: whole arrays and elements of them are both compared.
        let alone: Vec<_> =
            parsed.iter().map(|path| schema.reader(std::slice::from_ref(path))).collect();
        let mut row = Row::default();
        for (index, message) in messages.iter().enumerate() {
            self.log.write(channel, index as u64, message);
            for (path, reader) in paths.iter().zip(&alone) {
                let reader = reader.as_ref().expect("a field that is there");
                reader
                    .read(message, &mut row)
                    .unwrap_or_else(|fault| panic!("{topic} {index} {path}: {fault}"));
                let values = elements(&row.value(message, 0));
                let line = serde_json::json!({ "topic": topic, "index": index, "path": path, "values": values });
                writeln!(self.lines, "{line}").expect("a string");
            }
        }
    }
}

#[test]
fn a_sample_of_every_type_is_written_for_an_independent_reader() {
    let mut sample = Sample { log: Log::new(Some(Compression::Zstd)), lines: String::new() };
    let mut noise = Noise(1);
    let (msg, idl, paths) = ros_schemas();
    let layout = |encapsulation| Layout {
        encapsulation,
        version_2: encapsulation >= 6,
        delimited: encapsulation >= 8,
        ros_1: false,
    };
    let (ros_1, ros_1_paths) = ros_1_schema(&msg, &paths);
    for (topic, language, text, encapsulation) in [
        ("/msg/big", "ros2msg", &msg, 0),
        ("/msg/little", "ros2msg", &msg, 1),
        ("/idl/big", "ros2idl", &idl, 0),
        ("/idl/little", "ros2idl", &idl, 1),
        ("/idl/big-2", "ros2idl", &idl, 6),
        ("/idl/little-2", "ros2idl", &idl, 7),
        ("/idl/big-delimited", "ros2idl", &idl, 8),
        ("/idl/little-delimited", "ros2idl", &idl, 9),
    ] {
        let messages: Vec<_> =
            (0..20).map(|_| Cdr::all(layout(encapsulation), &mut noise)).collect();
        let channel = (topic, "samples/msg/All", language, text.as_bytes(), "cdr");
        sample.add(channel, &paths, &messages);
    }
    let (descriptors, paths) = protobuf_schema();
    let messages: Vec<_> = (0..100).map(|_| protobuf_message(&mut noise)).collect();
    sample.add(
        ("/protobuf", "samples.All", "protobuf", &descriptors, "protobuf"),
        &paths,
        &messages,
    );
    let messages: Vec<_> = (0..200).map(|_| json_message(&mut noise)).collect();
    sample.add(
        ("/json", "samples.All", "jsonschema", b"{}", "json"),
        &JSON_PATHS.map(str::to_owned),
        &messages,
    );
    let messages: Vec<_> = (0..20).map(|_| Cdr::all_of_ros_1(&mut noise)).collect();
    let channel = ("/ros1", "samples/All", "ros1msg", ros_1.as_bytes(), "ros1");
    sample.add(channel, &ros_1_paths, &messages);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("sample-messages");
    std::fs::create_dir_all(&folder).expect("room beside the build");
    std::fs::write(folder.join("messages.mcap"), sample.log.done()).expect("room beside the build");
    std::fs::write(folder.join("decoded.jsonl"), &sample.lines).expect("room beside the build");
    assert!(sample.lines.lines().count() > 10_000);
}
