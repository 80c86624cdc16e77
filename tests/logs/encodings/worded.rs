//! A row that has read messages like this one reads it as a new one does: what is kept of the message before is never
//! mistaken for what this one says.

use posegrid::files::message::{FieldPath, FieldReader, MessageFault, MessageSchema, Row};

use super::messages::reader;
use super::sample::{
    JSON_PATHS, Noise, elements, json_message, protobuf_message, protobuf_schema, word,
};

/// How often messages were read without a walk over them, and refused.
#[derive(Debug, Default)]
pub struct Seen {
    pub as_before: usize,
    pub refused: usize,
}

/// What a row says of a message, down to the bits; and in words, which tell integers from numbers.
fn said(row: &Row, message: &[u8], count: usize) -> Vec<(Vec<serde_json::Value>, String)> {
    let values = (0..count).map(|slot| row.value(message, slot));
    values.map(|value| (elements(&value), word(&value))).collect()
}

/// Reads a message and `changes` that differ from it in a few bytes, in a row and in new ones.
pub fn compare(
    (reader, count): (&FieldReader, usize),
    (message, changes): (&[u8], usize),
    noise: &mut Noise,
    seen: &mut Seen,
) {
    let mut row = Row::default();
    let mut changed = message.to_vec();
    for _ in 0..=changes {
        let filled = row.filled();
        let mut fresh = Row::default();
        let expected: Result<_, MessageFault> =
            reader.read(&changed, &mut fresh).map(|()| said(&fresh, &changed, count));
        let found = reader.read(&changed, &mut row).map(|()| said(&row, &changed, count));
        let shown = changed.escape_ascii();
        assert_eq!(found, expected, "{shown} after {reader:?}");
        seen.as_before += usize::from(filled > 0 && row.filled() == filled);
        seen.refused += usize::from(found.is_err());
        if found.is_err() {
            changed = message.to_vec();
        } else if noise.below(4) == 0 {
            damage(&mut changed, noise);
        } else {
            change_number(&mut changed, noise);
        }
    }
}

/// Writes another digit where one is, or other bits.
fn change_number(message: &mut [u8], noise: &mut Noise) {
    if message.is_empty() {
        return;
    }
    let at = noise.place(message.len() as u64);
    match message.get_mut(at) {
        Some(digit @ b'1'..=b'9') => *digit = b"123456789"[noise.place(9)],
        Some(byte @ 0x80..) => *byte ^= 1,
        _ => {}
    }
}

/// Changes, takes out or puts in a byte or two.
fn damage(message: &mut Vec<u8>, noise: &mut Noise) {
    const SIGNS: &[u8] = b"0123456789.-+eE,:\"\\[]{} tfnNI\x00\x08\x80\xFF";
    for _ in 0..=noise.below(2) {
        if message.is_empty() {
            return;
        }
        let at = noise.place(message.len() as u64);
        let sign = SIGNS[noise.place(SIGNS.len() as u64)];
        match noise.below(4) {
            0 => drop(message.remove(at)),
            1 => message.insert(at, sign),
            _ => message[at] = sign,
        }
    }
}

/// Compares with all fields wanted at once, and with each alone.
fn compare_all(schema: &MessageSchema, paths: &[String], messages: &[Vec<u8>]) -> Seen {
    let (mut noise, mut seen) = (Noise(7), Seen::default());
    let parsed: Vec<_> = paths.iter().map(|path| FieldPath::parse(path).expect("a path")).collect();
    let alone = parsed.iter().map(std::slice::from_ref);
    let together = schema.reader(&parsed).ok();
    let mut readers: Vec<_> = together.map(|reader| (reader, paths.len())).into_iter().collect();
    readers.extend(alone.map(|path| (schema.reader(path).expect("a field that is there"), 1)));
    for message in messages {
        for (reader, count) in &readers {
            compare((reader, *count), (message, 60), &mut noise, &mut seen);
        }
    }
    seen
}

#[test]
fn json_in_known_words_says_what_it_does_in_new_ones() {
    let schema = MessageSchema::read("json", "", "", b"").expect("an encoding that is read");
    let mut noise = Noise(3);
    let messages: Vec<_> = (0..40).map(|_| json_message(&mut noise)).collect();
    let paths = JSON_PATHS.map(str::to_owned);
    let seen = compare_all(&schema.expect("none is needed"), &paths, &messages);
    assert!(seen.as_before > 2_000 && seen.refused > 1_000, "{seen:?}");
}

#[test]
fn protobuf_in_known_words_says_what_it_does_in_new_ones() {
    let (descriptors, paths) = protobuf_schema();
    let schema = MessageSchema::read("protobuf", "samples.All", "protobuf", &descriptors)
        .expect("an encoding that is read");
    let mut noise = Noise(3);
    let messages: Vec<_> = (0..40).map(|_| protobuf_message(&mut noise)).collect();
    let seen = compare_all(&schema.expect("a sound schema"), &paths, &messages);
    assert!(seen.as_before > 2_000 && seen.refused > 1_000, "{seen:?}");
}

/// Each message is read after the one before it; the second tells what the last one of the two says, in words.
#[test]
fn a_value_given_twice_or_moved_is_not_taken_for_the_one_before() {
    for (path, before, message, expected) in [
        // The last of a name counts, whichever kinds both are of.
        ("x", r#"{"x":1,"x":true}"#, r#"{"x":2,"x":true}"#, "1"),
        ("x", r#"{"x":1,"x":null}"#, r#"{"x":2,"x":null}"#, "absent"),
        ("x", r#"{"x":1,"x":2}"#, r#"{"x":5,"x":3}"#, "3"),
        ("x|y", r#"{"x":1,"y":"s"}"#, r#"{"x":2,"y":"s"}"#, "\"s\""),
        ("a[].x", r#"{"a":[{"x":1,"x":null}]}"#, r#"{"a":[{"x":2,"x":null}]}"#, "[absent]"),
        ("a", r#"{"a":[1],"a":[2,3]}"#, r#"{"a":[7],"a":[8,9]}"#, "[8, 9]"),
        ("a", r#"{"a":[1],"a":2}"#, r#"{"a":[7],"a":8}"#, "8"),
        // A text moves with the length of what stands before it, wanted or not.
        ("s", r#"{"n":1,"s":"end"}"#, r#"{"n":-12.5e3,"s":"end"}"#, "\"end\""),
        ("s", r#"{"n":[1,"x"],"s":"end"}"#, r#"{"n":{"y":null},"s":"end"}"#, "\"end\""),
        (
            "a[].s",
            r#"{"a":[{"n":1,"s":"p"},{"s":"q"}]}"#,
            r#"{"a":[{"n":222,"s":"p"},{"s":"q"}]}"#,
            "[\"p\", \"q\"]",
        ),
        // A number may become whole, huge or longer than an integer.
        ("x", r#"{"x":0.5}"#, r#"{"x":7}"#, "7"),
        ("x", r#"{"x":7}"#, r#"{"x":1e400}"#, "inf"),
        ("x", r#"{"x":7}"#, r#"{"x":9223372036854775808}"#, "9223372036854776000"),
    ] {
        let reader = reader("json", "", "", b"", &[path]);
        let mut row = Row::default();
        reader.read(before.as_bytes(), &mut row).expect("sound");
        let read = reader.read(message.as_bytes(), &mut row);
        assert_eq!(read, Ok(()), "{message}");
        assert_eq!(word(&row.value(message.as_bytes(), 0)), expected, "{before} {message}");
    }
}

#[test]
fn what_may_not_be_is_refused_in_known_words_too() {
    let reader = reader("json", "", "", b"", &["x"]);
    let mut row = Row::default();
    for (message, expected) in [
        (r#"{"y":[1],"x":1}"#, Ok(())),
        (r#"{"y":[1],"x":2}"#, Ok(())),
        (r#"{"y":[1],"x":02}"#, Err(MessageFault::Json)),
        (r#"{"y":[1],"x":2}"#, Ok(())),
        (r#"{"y":[1],"x":2} x"#, Err(MessageFault::LeftOver)),
        (r#"{"y":[1],"x":2}"#, Ok(())),
        (r#"{"y":[1],"x":2"#, Err(MessageFault::Short)),
        (r#"{"y":[1],"x":2}"#, Ok(())),
        (r#"{"y":[1.],"x":2}"#, Err(MessageFault::Json)),
    ] {
        assert_eq!(reader.read(message.as_bytes(), &mut row), expected, "{message}");
    }
    // Deeper and deeper, where the one before was flat.
    let refused = (50..70).filter(|&levels| {
        let deep = format!("{{\"y\":{}{},\"x\":1}}", "[".repeat(levels), "]".repeat(levels));
        let (mut row, mut fresh) = (Row::default(), Row::default());
        assert_eq!(reader.read(br#"{"y":[],"x":1}"#, &mut row), Ok(()));
        let expected = reader.read(deep.as_bytes(), &mut fresh);
        assert_eq!(reader.read(deep.as_bytes(), &mut row), expected, "{levels}");
        expected == Err(MessageFault::Deep)
    });
    assert!((1..20).contains(&refused.count()));
}

#[test]
fn an_array_and_elements_of_it_are_wanted_at_once() {
    let wanted = ["a", "a[1]", "a[]", "a"];
    let reader = reader("json", "", "", b"", &wanted);
    let mut row = Row::default();
    for (message, expected) in [
        ("{\"a\":[1,2]}", ["[1, 2]", "2", "[1, 2]", "[1, 2]"]),
        ("{\"a\":[3,\"s\"]}", ["[3, \"s\"]", "\"s\"", "[3, \"s\"]", "[3, \"s\"]"]),
        ("{\"a\":[3,[4]]}", ["[3, absent]", "[4]", "[3, absent]", "[3, absent]"]),
    ] {
        reader.read(message.as_bytes(), &mut row).expect("sound");
        let found: Vec<_> =
            (0..wanted.len()).map(|slot| word(&row.value(message.as_bytes(), slot))).collect();
        assert_eq!(found, expected, "{message}");
    }
}
