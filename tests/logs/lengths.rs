//! Instruments of one length in a log: one topic for each, one topic for several, and messages that give none.

use posegrid::ingest::{LoggedLength, Mapping, TargetReadings};

use crate::build::{Cdr, HEADER, Log, WholeSession, mapping, read_as, session, stamp};

/// A draw wire as `sensor_msgs/Range`, and two channels of one box in JSON.
const LENGTHS: &str = "[[lengths]]\nname = \"wire\"\nreads = \"distance\"\ntopic = \"/wire\"\nunit = \"m\"\nsd_mm = 0.1\n\
    [[lengths]]\nname = \"left\"\nreads = \"distance\"\ntopic = \"/box\"\nfield = \"c[0]\"\nstamp = \"taken\"\nunit = \"mm\"\nsd_mm = 0.1\n\
    [[lengths]]\nname = \"face\"\nreads = \"height\"\ntopic = \"/box\"\nfield = \"c[1]\"\nstamp = \"taken\"\nunit = \"mm\"\nsd_mm = 0.1\n";

#[derive(serde::Deserialize)]
struct Sections {
    lengths: Vec<LoggedLength>,
}

fn with_lengths(text: &str) -> Mapping {
    let mut mapping = mapping();
    let sections: Sections = toml::from_str(text).expect("sound TOML");
    mapping.tracker.lengths = sections.lengths;
    mapping
}

/// The session's log with these lengths of a wire, m, and these messages of a box.
fn log(wire: &[f32], messages: &[&str]) -> Vec<u8> {
    let mut log = Log::new(None);
    session(&mut log, 100);
    let text = format!(
        "std_msgs/Header header\nuint8 radiation_type\nfloat32 field_of_view\nfloat32 min_range\nfloat32 max_range\nfloat32 range\n{HEADER}"
    );
    let range = "sensor_msgs/msg/Range";
    let channel = log.channel_of("/wire", range, "ros2msg", text.as_bytes(), "cdr");
    for (i, length) in (0..).zip(wire) {
        let zero = 0.0_f32.to_bits();
        // The kind of radiation, zero, is where the first number is aligned.
        let cdr = Cdr::stamped(stamp(i)).word(zero).word(zero);
        let cdr = cdr.word(f32::MAX.to_bits()).word(length.to_bits());
        log.write(channel, 1, &cdr.done());
    }
    let channel = log.channel_of("/box", "", "", b"", "json");
    for message in messages {
        log.write(channel, 1, message.as_bytes());
    }
    log.done()
}

fn lengths(own: &TargetReadings) -> Vec<f64> {
    own.positions.iter().map(|own| own[0]).collect()
}

fn count(found: &WholeSession, name: &str) -> u64 {
    found.counts.get(name).copied().unwrap_or(0)
}

#[test]
fn topics_of_one_and_of_several_lengths_are_read_in_their_units() {
    let log = log(
        &[1.5, 0.25, f32::INFINITY],
        &[
            r#"{"taken": {"sec": 100, "nanosec": 5}, "c": [812.5, -3.25]}"#,
            r#"{"taken": {"sec": 100, "nanosec": 7}, "c": [0, 0.5, 9]}"#,
            r#"{"taken": {"sec": 100, "nanosec": 9}, "c": [811]}"#,
            r#"{"taken": {"sec": 100, "nanosec": 9}, "c": ["slack", 1]}"#,
        ],
    );
    let found = read_as(&log, &with_lengths(LENGTHS)).expect("sound");
    let [wire, left, face] = &found.lengths[..] else {
        panic!("three instruments");
    };
    assert_eq!(lengths(wire), [1500.0, 250.0]);
    // A zero stays: only the join knows whether it can be a reading.
    assert_eq!(lengths(left), [812.5, 0.0]);
    assert_eq!(lengths(face), [-3.25, 0.5]);
    assert_eq!(face.stamps[1].ns(), 100_000_000_007);
    // Three of the wire and two of each message of the box.
    assert_eq!(count(&found, "lengths.messages"), 3 + 8);
    assert_eq!(count(&found, "lengths.kept"), 2 + 4);
    assert_eq!(count(&found, "lengths.rejected"), 1 + 4);
    let told: Vec<(&str, &str)> = found
        .rejects
        .iter()
        .map(|own| (own.topic.as_deref().unwrap_or(""), own.reason.as_str()))
        .collect();
    let is_told = |topic: &str, words: &str| {
        let mut told = told.iter();
        told.any(|(own, reason)| *own == topic && reason.contains(words))
    };
    assert!(is_told("/wire", "not a finite number"), "{told:?}");
    assert!(is_told("/box", "no value at \"c[1]\""), "{told:?}");
    assert!(is_told("/box", "value at \"c[0]\" is no number"), "{told:?}");
}

#[test]
fn a_topic_that_is_missing_or_of_another_type_is_named() {
    let log = log(&[1.0], &[r#"{"taken": {"sec": 100, "nanosec": 5}, "c": [1, 2]}"#]);
    let told = |from: &str, to: &str| {
        let mapping = with_lengths(&LENGTHS.replace(from, to));
        read_as(&log, &mapping).expect_err("no such lengths").to_string()
    };
    let missing = told("/wire", "/rope");
    assert!(missing.contains("no topic \"/rope\""), "{missing}");
    let pose = told("/wire", "/command");
    assert!(pose.contains("is named for two streams"), "{pose}");
    let unlike = told("\nfield = \"c[0]\"", "");
    assert!(unlike.contains("sensor_msgs/msg/Range"), "{unlike}");
}
