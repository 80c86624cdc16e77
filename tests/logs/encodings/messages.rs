//! Protobuf and JSON, down to the rules for what is missing, doubled or unknown.

use posegrid::files::message::{FieldPath, FieldReader, MessageFault, MessageSchema, Row};

use super::proto::{Field, Proto, describe, file, set};

/// The reader for these fields of messages of a channel.
pub fn reader(
    encoding: &str,
    name: &str,
    language: &str,
    text: &[u8],
    wanted: &[&str],
) -> FieldReader {
    let schema =
        MessageSchema::read(encoding, name, language, text).expect("an encoding that is read");
    let paths = wanted.iter().map(|path| FieldPath::parse(path).expect("a sound path"));
    schema.expect("a sound schema").reader(&paths.collect::<Vec<_>>()).expect("fields exist")
}

/// Each value in words.
fn words(reader: &FieldReader, message: &[u8], count: usize) -> Result<Vec<String>, MessageFault> {
    let mut row = Row::default();
    reader.read(message, &mut row)?;
    Ok((0..count).map(|slot| super::sample::word(&row.value(message, slot))).collect())
}

fn types(syntax: &str) -> Vec<u8> {
    let inner =
        describe("Inner", &[Field::one("a", 1, 1), Field::one("b", 2, 5), Field::one("s", 3, 9)]);
    let outer = describe(
        "Outer",
        &[
            Field::of("inner", 1, ".t.Inner"),
            Field::of("many", 2, ".t.Inner").many(),
            Field::one("left", 3, 1).in_oneof(0),
            Field::of("right", 4, ".t.Inner").in_oneof(0),
            Field::one("n", 5, 17).many(),
            Field::one("flag", 6, 8),
            Field::one("big", 7, 4),
        ],
    );
    set(&[file("t.proto", "t", &[], syntax, &[outer, inner])])
}

const WANTED: [&str; 10] =
    ["inner.a", "inner.b", "many[].a", "many[1].s", "left", "right.a", "n", "n[1]", "flag", "big"];

fn outer(syntax: &str, message: &Proto) -> Vec<String> {
    // `n` and an element of it cannot both be wanted of one reader.
    let whole: Vec<_> = WANTED.into_iter().filter(|path| *path != "n[1]").collect();
    let reader = reader("protobuf", "t.Outer", "protobuf", &types(syntax), &whole);
    words(&reader, &message.0, whole.len()).expect("sound")
}

#[test]
fn what_is_missing_is_zero_without_presence_and_absent_with_it() {
    let nothing = Proto::default();
    let absent = "absent";
    assert_eq!(
        outer("proto3", &nothing),
        [absent, absent, "[]", absent, absent, absent, "[]", "0", "0"]
    );
    assert_eq!(
        outer("proto2", &nothing),
        [absent, absent, "[]", absent, absent, absent, "[]", absent, absent]
    );
    // An empty message is there, and so are its numbers.
    let empty = nothing.clone().message(1, &nothing).message(2, &nothing).message(4, &nothing);
    assert_eq!(outer("proto3", &empty), ["0", "0", "[0]", absent, absent, "0", "[]", "0", "0"]);
}

#[test]
fn doubled_and_unknown_fields_are_read_as_official_readers_do() {
    let inner = |a: f64| Proto::default().double(1, a);
    let message = Proto::default()
        // Merged: the second has no a, so the first one's stays.
        .message(1, &inner(1.5).varint(2, 7))
        .message(1, &Proto::default().varint(2, u64::MAX))
        // Of another wire type than it is defined with: unknown.
        .varint(6, 1)
        .bytes(6, b"x")
        .group(77, &Proto::default().group(78, &inner(1.0)).bytes(2, &[0xFF; 3]))
        .double(3, 2.5)
        .message(4, &inner(3.5))
        .message(2, &inner(1.0))
        .message(2, &inner(2.0).bytes(3, "ü".as_bytes()))
        // sint32, packed and not: 1, -1, 1.
        .bytes(5, &[2, 1])
        .varint(5, 2)
        .varint(7, u64::MAX);
    assert_eq!(
        outer("proto3", &message),
        [
            "1.5",
            "-1",
            "[1, 2]",
            "\"ü\"",
            "absent",
            "3.5",
            "[1, -1, 1]",
            "1",
            "18446744073709552000"
        ]
    );
    // The other way round, the double ousts the message.
    let other = Proto::default().message(4, &inner(3.5)).double(3, 2.5);
    assert_eq!(outer("proto3", &other)[4..6], ["2.5", "absent"]);
    let picked = reader("protobuf", "t.Outer", "protobuf", &types("proto3"), &["n[1]", "n[3]"]);
    assert_eq!(words(&picked, &message.0, 2), Ok(vec!["-1".to_owned(), "absent".to_owned()]));
}

#[test]
fn bytes_that_are_no_protobuf_are_refused() {
    let reader = reader("protobuf", "t.Outer", "protobuf", &types("proto3"), &["inner.a", "n"]);
    let fault = |bytes: &[u8]| words(&reader, bytes, 2).expect_err("refused");
    for (bytes, expected) in [
        (&[0x00][..], MessageFault::Wire),          // field number 0
        (&[0x0F], MessageFault::Wire),              // wire type 7
        (&[0x0C], MessageFault::Wire),              // the end of a group that never began
        (&[0x38], MessageFault::Short),             // a varint without a byte
        (&[0x0A, 0x05, 0x09], MessageFault::Short), // longer than what is left
        (&[0x0B, 0x08, 0x01], MessageFault::Short), // a group without an end
        (&[0x13, 0x1C], MessageFault::Wire),        // a group that ends as another one
    ] {
        assert_eq!(fault(bytes), expected, "{bytes:02x?}");
    }
    // A varint of eleven bytes; a length of 2^63; an inner message that runs past the outer one.
    assert_eq!(fault(&[&[0x38][..], &[0xFF; 10], &[0]].concat()), MessageFault::Wire);
    assert_eq!(fault(&[&[0x0A][..], &[0x80; 9], &[1]].concat()), MessageFault::Short);
    assert_eq!(fault(&[0x0A, 0x02, 0x1A, 0x05, 0, 0, 0, 0, 0]), MessageFault::Short);
    let deep = (0..100_000).fold(Vec::new(), |mut bytes, _| {
        bytes.push(0x53);
        bytes
    });
    assert_eq!(fault(&deep), MessageFault::Deep);
    let long = Proto::default().bytes(5, &vec![0; 100_001]);
    assert_eq!(fault(&long.0), MessageFault::LongArray);
}

#[test]
fn descriptor_sets_that_cannot_be_are_refused() {
    let read = |bytes: &[u8]| {
        let schema = MessageSchema::read("protobuf", "t.Outer", "protobuf", bytes).expect("read");
        schema.expect_err("refused").to_string()
    };
    assert!(read(&[0x0F]).contains("no descriptor set"));
    assert!(read(b"").contains("\"t.Outer\""));
    let lost = describe("Outer", &[Field::of("x", 1, ".t.Lost")]);
    assert!(read(&set(&[file("t.proto", "t", &[], "proto3", &[lost])])).contains(".t.Lost"));
    // A type that contains itself is no trouble: only what is wanted is unfolded.
    let own = describe("Outer", &[Field::of("own", 1, ".t.Outer"), Field::one("x", 2, 1)]);
    let own = set(&[file("t.proto", "t", &[], "proto3", &[own])]);
    let reader = reader("protobuf", "t.Outer", "protobuf", &own, &["own.own.x"]);
    let message = Proto::default().double(2, 1.5);
    let message = Proto::default().message(1, &Proto::default().message(1, &message));
    assert_eq!(words(&reader, &message.0, 1), Ok(vec!["1.5".to_owned()]));
}

fn json(wanted: &[&str], message: &str) -> Result<Vec<String>, MessageFault> {
    words(&reader("json", "", "", b"", wanted), message.as_bytes(), wanted.len())
}

#[test]
fn json_is_read_by_path_whatever_stands_around_it() {
    let read = |wanted: &str, message: &str| json(&[wanted], message).expect("sound")[0].clone();
    assert_eq!(read("a.b", r#" { "c" : [ { } , [ ] ] , "a" : { "b" : -0.5E+1 } } "#), "-5");
    assert_eq!(read("a[1][0]", "{\"a\":[[1],[2,3]]}"), "2");
    assert_eq!(read("[1].x", "[{\"x\":1},{\"x\":2}]\0\0"), "2");
    assert_eq!(read("a", "{\"a\":1,\"a\":null}"), "absent"); // the last one counts
    assert_eq!(read("a.x", "{\"a\":{\"x\":1},\"a\":{\"y\":2}}"), "absent");
    assert_eq!(read("a", "{\"a\":[1,null,\"x\",[2],true]}"), "[1, absent, \"x\", absent, 1]");
    assert_eq!(read("a[]", "{\"a\":[1,2]}"), "[1, 2]");
    assert_eq!(
        read("a[].x", "{\"a\":[{\"x\":1,\"x\":2},{},3,{\"x\":\"s\"}]}"),
        "[2, absent, absent, \"s\"]"
    );
    assert_eq!(read("a[].x", "{\"a\":[{\"x\":1}],\"a\":[]}"), "[]");
    assert_eq!(read("ü", r#"{"\u00fc":"\"\\é"}"#), "\"\"\\é\"");
    assert_eq!(read("x", "{\"x\":9007199254740993}"), "9007199254740993");
    assert_eq!(read("x", "{\"x\":1e400}"), "inf");
    assert_eq!(read("x", "{\"x\":-Infinity}"), "-inf");
    assert_eq!(read("x", "{\"y\":{\"x\":1}}"), "absent");
    let both = json(&["a[].x", "a[1].x", "a[1].y"], "{\"a\":[{\"x\":1},{\"y\":3,\"x\":2}]}");
    assert_eq!(both, Ok(["[1, 2]", "2", "3"].map(str::to_owned).to_vec()));
}

#[test]
fn bytes_that_are_no_json_are_refused() {
    for (message, expected) in [
        ("", MessageFault::Short),
        ("{\"a\":1", MessageFault::Short),
        ("{\"a\":tr", MessageFault::Short),
        ("{\"a\":\"x\\", MessageFault::Short),
        ("{\"a\":1}x", MessageFault::LeftOver),
        ("{\"a\":1,}", MessageFault::Json),
        ("{\"a\" 1}", MessageFault::Json),
        ("{a:1}", MessageFault::Json),
        ("{\"a\":01}", MessageFault::Json),
        ("{\"b\":1.}", MessageFault::Json),
        ("{\"b\":.5}", MessageFault::Json),
        ("{\"b\":+5}", MessageFault::Json),
        ("{\"b\":-}", MessageFault::Json),
        ("{\"a\":[1 2]}", MessageFault::Json),
        ("{\"a\":[1,]}", MessageFault::Json),
        ("{\"a\":truE}", MessageFault::Json),
    ] {
        assert_eq!(json(&["a"], message), Err(expected), "{message}");
    }
    for open in ["[", "{\"a\":"] {
        assert_eq!(json(&["b"], &open.repeat(100_000)), Err(MessageFault::Deep));
        assert_eq!(json(&["a"], &open.repeat(100_000)), Err(MessageFault::Deep));
    }
    let long = format!("{{\"a\":[{}0]}}", "0,".repeat(100_000));
    assert_eq!(json(&["a"], &long), Err(MessageFault::LongArray));
}
