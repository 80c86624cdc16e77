//! Messages of no common type, read by the field paths of a pipeline file.

use posegrid::ingest::{ControllerSettings, Mapping, TrackerSettings};
use posegrid::io::log::LogError;

use super::proto::{Field, Proto, describe, file, set};
use crate::build::{Cdr, Log, WholeSession, mapping, read_as};

/// The mapping of a pipeline file with these sections.
fn mapped(controller: &str, tracker: &str) -> Mapping {
    let controller: ControllerSettings = toml::from_str(controller).expect("sound TOML");
    let tracker: TrackerSettings = toml::from_str(tracker).expect("sound TOML");
    Mapping { controller, tracker, commanded: None, ..mapping() }
}

const CONTROLLER: &str = "topic = \"/arm\"\nunit = \"rad\"\ntime = \"header\"\n\
    fields = { stamp = { field = \"t_us\", unit = \"us\" }, angles = [\"q[1]\", \"axes[0].angle\"] }";
const TRACKER: &str = "topic = \"/laser\"\nunit = \"mm\"\ntime = \"header\"\n\
    fields = { stamp = \"taken\", x = \"p.e\", y = \"p.n\", z = \"p.u\", covariance = \"cov\" }";

/// Ten joint states in JSON, ten readings in protobuf.
fn log(joint_state: impl Fn(u64) -> String) -> Vec<u8> {
    let mut log = Log::new(None);
    let arm = log.channel_of("/arm", "", "", b"", "json");
    let types = [
        describe("Enu", &[Field::one("e", 1, 1), Field::one("n", 2, 2), Field::one("u", 3, 17)]),
        describe("When", &[Field::one("secs", 1, 4), Field::one("nsecs", 2, 13)]),
        describe(
            "Shot",
            &[
                Field::of("taken", 7, "lab.When"),
                Field::of("p", 300, "lab.Enu"),
                Field::one("cov", 5, 1).many(),
            ],
        ),
    ];
    let types = set(&[file("lab.proto", "lab", &[], "proto2", &types)]);
    let laser = log.channel_of("/laser", "lab.Shot", "protobuf", &types, "protobuf");
    for i in 0..10_u64 {
        log.write(arm, i, joint_state(i).as_bytes());
        let when = Proto::default().varint(1, 5).varint(2, i);
        // sint32 -3 is stored as 5; float 0.5; rows of a covariance of 3 × 3, packed but for the last.
        let bits = 0.5_f32.to_bits();
        let place = Proto::default().double(1, i as f64).fixed_32(2, bits).varint(3, 5);
        let packed = COVARIANCE[..8].iter().flat_map(|own| own.to_le_bytes());
        let packed: Vec<u8> = packed.collect();
        let shot = Proto::default()
            .message(7, &when)
            .message(300, &place)
            .bytes(5, &packed)
            .double(5, COVARIANCE[8]);
        log.write(laser, i, &shot.0);
    }
    log.done()
}

/// Row by row.
const COVARIANCE: [f64; 9] = [9.0, 1.0, 2.0, 1.0, 8.0, 3.0, 2.0, 3.0, 7.0];

fn joint_state(i: u64) -> String {
    let axes = format!("[{{\"angle\": {i}e-1}}, {{}}]");
    format!("{{\"t_us\": {}, \"q\": [null, -{i}.25, 8], \"axes\": {axes}}}", 5_000_000 + i)
}

fn read(log: &[u8], controller: &str, tracker: &str) -> Result<WholeSession, LogError> {
    read_as(log, &mapped(controller, tracker))
}

#[test]
fn any_message_is_read_by_field_paths() {
    let found = read(&log(joint_state), CONTROLLER, TRACKER).expect("sound");
    assert_eq!(found.rejects, []);
    assert_eq!(found.joints.stamps[3].ns(), 5_000_003_000);
    // The arm's joints in its order: the second of `q`, the first of `axes`.
    assert_eq!(found.joints.angles.row(3), [-3.25, 0.3]);
    assert_eq!(found.readings.stamps[3].ns(), 5_000_000_003);
    assert_eq!(found.readings.positions[3], [3.0, 0.5, -3.0]);
    // xx xy xz yy yz zz of nine row by row.
    let covariances = found.readings.covariances.expect("named");
    let expected = [9.0, 1.0, 2.0, 8.0, 3.0, 7.0];
    assert_eq!(covariances[3].position, Some(expected));
    assert_eq!(covariances[3].turn, None);
}

#[test]
fn a_stamp_in_json_may_be_a_date_time_with_its_zone() {
    let controller = CONTROLLER.replace("{ field = \"t_us\", unit = \"us\" }", "\"at\"");
    let dated = |i: u64| {
        let at = match i {
            7 => "1970-01-01T00:00:05.000007".to_owned(),
            8 => "a minute ago".to_owned(),
            9 => "2300-01-01T00:00:00Z".to_owned(),
            i => format!("1969-12-31T23:00:05.00000{i}-01:00"),
        };
        let number = format!("\"t_us\": {}", 5_000_000 + i);
        joint_state(i).replace(&number, &format!("\"at\": \"{at}\""))
    };
    let found = read(&log(dated), &controller, TRACKER).expect("sound");
    assert_eq!(found.joints.stamps.len(), 7);
    assert_eq!(found.joints.stamps[3].ns(), 5_000_003_000);
    assert_eq!(found.joints.angles.row(3)[1], 0.3);
    let reasons: Vec<_> = found.rejects.iter().map(|reject| &reject.reason).collect();
    assert_eq!(found.counts["joints.rejected"], 3);
    assert!(reasons.iter().all(|why| why.contains("stamp is no time")), "{reasons:?}");
}

#[test]
fn a_message_without_a_wanted_value_is_rejected_by_the_name_of_the_field() {
    let hurt = |i| match i {
        2 => "{\"t_us\": 1, \"q\": [0, 1]}".to_owned(),
        3 => "{\"t_us\": 1, \"q\": [0], \"axes\": [{\"angle\": 1}]}".to_owned(),
        4 => joint_state(4).replace("-4.25", "\"4.25\""),
        5 => joint_state(5).replace("5000005", "null"),
        6 => joint_state(6).replace("5000006", "1e99"),
        7 => joint_state(7).replace("]}", "]"),
        8 => joint_state(8).replace("]}", "]};"),
        9 => joint_state(9).replace("-9.25", "-09.25"),
        i => joint_state(i),
    };
    let found = read(&log(hurt), CONTROLLER, TRACKER).expect("two are sound");
    assert_eq!(found.joints.stamps.len(), 2);
    assert_eq!(found.counts["joints.rejected"], 8);
    let reasons: Vec<_> = found.rejects.iter().map(|reject| reject.reason.as_str()).collect();
    for reason in [
        "no value at \"axes[0].angle\"",
        "no value at \"q[1]\"",
        "value at \"q[1]\" is no number",
        "no value at \"t_us\"",
        "stamp is no time",
        "ends before its last field",
        "continues after its last field",
        "no JSON",
    ] {
        assert!(reasons.iter().any(|found| found.contains(reason)), "{reason}: {reasons:?}");
    }
}

#[test]
fn only_messages_in_the_frame_asked_for_are_read() {
    let frames = |frame: &str| {
        let mut log = Log::new(None);
        let arm = log.channel("/arm", "JointState");
        let laser = log.channel("/laser", "PointStamped");
        for i in 0..4 {
            log.write(arm, i, &Cdr::stamped(1).joints(&["a", "b"], &[1.0, 2.0]).done());
            let text = if i == 3 { "other" } else { "laser" };
            let head = Cdr::new(true).word(1).word(2 + u32::try_from(i).expect("few")).text(text);
            log.write(laser, i, &head.numbers(&[1.0, 2.0, 3.0]).done());
        }
        let controller = "topic = \"/arm\"\nunit = \"rad\"\ntime = \"header\"";
        let tracker =
            format!("topic = \"/laser\"\nunit = \"mm\"\ntime = \"header\"\nframe = {frame:?}");
        read(&log.done(), controller, &tracker)
    };
    let found = frames("laser").expect("three are");
    assert_eq!(found.readings.stamps.len(), 3);
    assert!(found.rejects[0].reason.contains("another frame than \"laser\""));
    let error = frames("Laser").expect_err("none is").to_string();
    assert!(error.contains("another frame"), "{error}");
}

#[test]
fn what_is_not_there_is_reported_with_what_is() {
    let said = |tracker: &str| {
        read(&log(joint_state), CONTROLLER, tracker).expect_err("refused").to_string()
    };
    let missing = said(&TRACKER.replace("p.n", "p.north"));
    for part in ["/laser", "\"p.north\"", "cov, p.e, p.n, p.u, taken.nsecs, taken.secs"] {
        assert!(missing.contains(part), "{missing}");
    }
    let message = said(&TRACKER.replace("p.n", "p"));
    assert!(message.contains("\"p\" is a message"), "{message}");
    let unnamed = said("topic = \"/laser\"\nunit = \"mm\"\ntime = \"log\"");
    for part in ["lab.Shot", "fields = {", "p.e, p.n, p.u"] {
        assert!(unnamed.contains(part), "{unnamed}");
    }
    let stamp = said(&TRACKER.replace("stamp = \"taken\", ", ""));
    assert!(stamp.contains("header.stamp"), "{stamp}");
}

#[test]
fn conventions_of_fields_are_checked_as_they_are_read() {
    let refused = |fields: &str| {
        let text =
            format!("topic = \"/t\"\ntime = \"header\"\nunit = \"mm\"\nfields = {{ {fields} }}");
        toml::from_str::<TrackerSettings>(&text).expect_err("refused").to_string()
    };
    assert!(refused("a = \"x\"").contains("unknown field"));
    assert!(refused("stamp = { field = \"t\" }").contains("unit \"s\", \"ms\", \"us\" or \"ns\""));
    let tracker = |fields: &str| -> TrackerSettings {
        let text =
            format!("topic = \"/t\"\ntime = \"header\"\nunit = \"mm\"\nfields = {{ {fields} }}");
        toml::from_str(&text).expect("sound TOML")
    };
    for (fields, wanted) in [
        ("x = \"a\"", "all of x, y and z"),
        ("x = \"a\", y = \"b\", z = \"c\", qx = \"d\"", "all of qx, qy, qz and qw"),
        ("covariance = \"c\"", "x, y and z where"),
        ("x = \"a\", y = \"a\", z = \"c\"", "a field of its own"),
    ] {
        let wrong = tracker(fields).fields.check().expect_err("refused");
        assert!(wrong.wanted.contains(wanted), "{wrong:?}");
    }
    let controller = |fields: &str| -> ControllerSettings {
        let text =
            format!("topic = \"/t\"\ntime = \"log\"\nunit = \"deg\"\nfields = {{ {fields} }}");
        toml::from_str(&text).expect("sound TOML")
    };
    for (fields, wanted) in [
        ("names = \"n\"", "the array that goes with names"),
        ("angles = \"q\"", "or `names` in addition"),
        ("names = \"n\", angles = [\"q\"]", "left out"),
        ("angles = [\"q\"]", "the arm's 2 joints"),
    ] {
        let wrong = controller(fields).fields.check(2).expect_err("refused");
        assert!(wrong.wanted.contains(wanted), "{wrong:?}");
    }
    assert_eq!(controller("angles = [\"q\", \"r\"]").fields.check(2), Ok(()));
}
