//! Bytes from anywhere: no decoder and no reader of schemas panics, whatever it is given.

use posegrid::files::message::{FieldReader, MessageSchema, Row};
use proptest::prelude::*;

use super::messages::reader;
use super::{IDL, joint_forms, reading_forms};
use crate::build::stamp;

const JOINTS: [&str; 6] = [
    "header|timestamp.stamp|sec|seconds.sec",
    "name",
    "position",
    "position[1]",
    "joints[].position",
    "joints[1].name",
];

/// Plans of every encoding, each with a sound message.
fn readers() -> Vec<(FieldReader, Vec<u8>, usize)> {
    let forms = joint_forms().into_iter().chain(reading_forms());
    let planned = forms.map(|form| {
        let read =
            MessageSchema::read(form.encoding, form.type_name, form.language, &form.definition);
        let schema = read.expect("an encoding that is read").expect("a sound schema");
        let there: Vec<_> = JOINTS
            .into_iter()
            .chain(["point.x", "point.y", "joint_names", "actual.positions", "feedback.positions"])
            .filter(|path| form.encoding == "json" || schema_has(&schema, path))
            // The whole and an element of it cannot both be wanted.
            .filter(|path| form.encoding == "json" || *path != "position[1]")
            .collect();
        let reader = reader(form.encoding, form.type_name, form.language, &form.definition, &there);
        (reader, (form.message)(stamp(7), 0.25), there.len())
    });
    planned.collect()
}

fn schema_has(schema: &MessageSchema, path: &str) -> bool {
    schema.has(&posegrid::files::message::FieldPath::parse(path).expect("a sound path"))
}

/// Reads a message and looks at everything that is lent out of it.
fn look(reader: &FieldReader, message: &[u8], values: usize, row: &mut Row) -> bool {
    let read = reader.read(message, row).is_ok();
    for slot in 0..values {
        let value = row.value(message, slot);
        let _ = super::sample::word(&value);
        let mut key = Vec::new();
        if let Some(texts) = value.texts() {
            texts.remember(&mut key);
            assert!(texts.are(&key), "a list knows itself");
        }
    }
    read
}

#[test]
fn a_message_cut_anywhere_is_no_message() {
    for (reader, message, values) in readers() {
        let mut row = Row::default();
        assert!(look(&reader, &message, values, &mut row));
        for length in 0..message.len() {
            let read = look(&reader, &message[..length], values, &mut row);
            // Protobuf may be cut between two fields; a JSON text and a CDR message have an end. What is behind JSON's
            // last brace is blank.
            let whole = message[length..].iter().all(u8::is_ascii_whitespace);
            assert!(
                !read || whole || matches!(reader, FieldReader::Protobuf(_)),
                "cut to {length}: {reader:?}"
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let mut row = Row::default();
        for (reader, _, values) in readers() {
            look(&reader, &bytes, values, &mut row);
            // With the first bytes of a message that is read, so that more than those are met.
            look(&reader, &[&[0, 1, 0, 0][..], &bytes].concat(), values, &mut row);
            look(&reader, &[&[0, 9, 0, 0][..], &bytes].concat(), values, &mut row);
        }
    }

    #[test]
    fn messages_with_changed_bytes_are_read_or_refused(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let mut row = Row::default();
        for (reader, mut message, values) in readers() {
            for (place, byte) in &changes {
                let place = place.index(message.len());
                message[place] = *byte;
            }
            look(&reader, &message, values, &mut row);
        }
    }

    #[test]
    fn schemas_with_changed_bytes_are_read_or_refused(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        noise in prop::collection::vec(any::<u8>(), 0..200),
    ) {
        let protobuf = super::proto::foxglove();
        let ros = crate::build::schema("PoseWithCovarianceStamped").1;
        for (encoding, name, language, text) in [
            ("cdr", "sensor_msgs/msg/JointState", "ros2idl", IDL.as_bytes()),
            ("cdr", "geometry_msgs/msg/PoseWithCovarianceStamped", "ros2msg", ros.as_bytes()),
            ("ros1", "geometry_msgs/PoseWithCovarianceStamped", "ros1msg", ros.as_bytes()),
            ("protobuf", "foxglove.JointStates", "protobuf", &protobuf),
            ("json", "", "jsonschema", br#"{"properties":{"a":{"items":{"properties":{}}}}}"#),
        ] {
            let mut changed = text.to_vec();
            for (place, byte) in &changes {
                let place = place.index(changed.len());
                changed[place] = *byte;
            }
            for text in [&changed, &noise] {
                let schema = MessageSchema::read(encoding, name, language, text).expect("read");
                if let Ok(schema) = schema {
                    schema.leaves();
                }
            }
        }
    }
}
