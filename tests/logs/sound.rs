//! Sound logs of every kind: what is decoded is what was written, and what is left out has a reason.

#![expect(
    clippy::float_cmp,
    reason = "what was written must come back exactly, scaled by powers of ten that are exact here"
)]

use mcap::{Compression, WriteOptions};
use posegrid::ingest::{IngestError, TimeSource};
use posegrid::io::log::{Limits, LogError, SessionLogs};
use posegrid::progress::Quiet;

use crate::build::{
    Cdr, Folder, Log, mapping, read, read_as, read_whole, schema, session, session_log, stamp,
};

#[test]
fn every_storage_gives_the_same_recording() {
    let expected = read(&session_log(Some(Compression::Zstd), 100)).expect("sound");
    assert_eq!(expected.rejects, []);
    assert_eq!(expected.joints.angles.row(7)[1].to_bits(), (-7.0_f64).to_bits());
    assert_eq!(expected.commands.positions[3], [30_000.0, 1000.0, 2000.0]); // m → mm
    assert_eq!(expected.commands.orientations.as_ref().expect("poses")[0], [0.0, 0.0, 0.0, 1.0]); // norm 2 → 1
    assert_eq!(expected.counts["commands.quaternions_not_unit"], 10);
    assert_eq!(expected.readings.positions[3], [3.0, 30.0, 4.0]); // mm stay mm
    assert_eq!(expected.readings.orientations, None);
    let options = [
        ("lz4", WriteOptions::new().compression(Some(Compression::Lz4)).chunk_size(Some(900))),
        ("uncompressed", WriteOptions::new().compression(None).chunk_size(Some(3000))),
        ("unchunked", WriteOptions::new().use_chunks(false)),
        (
            "no checksums",
            WriteOptions::new().calculate_chunk_crcs(false).calculate_data_section_crc(false),
        ),
        ("no summary", WriteOptions::new().emit_summary_records(false).emit_message_indexes(false)),
    ];
    for (name, options) in options {
        let mut log = Log::with(options);
        session(&mut log, 100);
        let found = read(&log.done()).expect("sound");
        assert_eq!(found.rejects, [], "{name}");
        assert_eq!(found.joints, expected.joints, "{name}");
        assert_eq!(found.commands, expected.commands, "{name}");
        assert_eq!(found.readings, expected.readings, "{name}");
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let log = session_log(Some(Compression::Lz4), 400);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        format!("{:?}", pool.install(|| read(&log).expect("sound")).joints)
    };
    assert_eq!(with(1), with(7));
}

#[test]
fn an_unknown_topic_lists_the_topics() {
    let mut mapping = mapping();
    mapping.controller.topic = "/joint_states".to_owned();
    let error = read_as(&session_log(None, 20), &mapping).expect_err("refused");
    assert!(matches!(error, LogError::UnknownTopic { .. }));
    let text = error.to_string();
    assert!(text.contains("\"/joints\", \"/command\", \"/reading\""), "{text}");
}

#[test]
fn joints_are_found_by_name_in_each_message() {
    let mut log = Log::new(None);
    session(&mut log, 1);
    let joints = 1;
    let mut write = |i: u32, names: &[&str], positions: &[f64]| {
        let at = stamp(i);
        log.write(
            joints,
            u64::try_from(at).expect("positive"),
            &Cdr::stamped(at).joints(names, positions).done(),
        );
    };
    write(1, &["b", "gripper", "a"], &[20.0, 99.0, 10.0]);
    write(2, &["a", "b"], &[1.0, 2.0]);
    write(3, &["a", "gripper"], &[1.0, 2.0]);
    write(4, &["a", "b"], &[1.0]);
    write(5, &["a", "b"], &[f64::NAN, 2.0]);
    write(6, &["a", "b", "a"], &[1.0, 2.0, 3.0]);
    write(7, &["a", "b", "gripper"], &[5.0, 6.0, f64::NAN]);
    write(8, &[], &[]);
    let found = read(&log.done()).expect("sound");
    let of_joint =
        |joint: usize| -> Vec<f64> { found.joints.angles.rows().map(|row| row[joint]).collect() };
    assert_eq!(of_joint(0), [0.0, 10.0, 1.0, 5.0]);
    assert_eq!(of_joint(1), [0.0, 20.0, 2.0, 6.0]);
    let mut reasons: Vec<_> =
        found.rejects.iter().map(|r| (r.messages, r.reason.as_str())).collect();
    reasons.sort_unstable();
    assert_eq!(
        reasons,
        [
            (Some(1), "a joint angle is not a finite number"),
            (Some(1), "joint \"a\" is twice in the message"),
            (Some(1), "joint \"b\" is missing from the message"),
            (Some(1), "the message has another number of positions than of joint names"),
            (
                Some(1),
                "the message states no position of the arm's joints: another device's, or velocities alone"
            ),
        ]
    );
    assert_eq!(found.counts["joints.messages"], 9);
    assert_eq!((found.counts["joints.kept"], found.counts["joints.rejected"]), (4, 4));
    assert_eq!(found.counts["joints.not_of_arm"], 1);
}

#[test]
fn a_topic_whose_messages_are_all_rejected_is_an_error_with_the_reason() {
    let mut mapping = mapping();
    mapping.joints.push("c".to_owned());
    let error = read_as(&session_log(None, 20), &mapping).expect_err("refused");
    assert!(matches!(error, LogError::Ingest(IngestError::NoSamples { .. })), "{error}");
    let text = error.to_string();
    assert!(text.contains("/joints") && text.contains("joint \"c\" is missing"), "{text}");
}

#[test]
fn samples_are_in_the_order_of_the_time_source() {
    let mut log = Log::new(Some(Compression::Zstd));
    session(&mut log, 1);
    // Logged in this order; stamped 3, 1, 2, 2.
    for (i, header) in [3, 1, 2, 2].into_iter().enumerate() {
        let logged = 200_000_000_000 + i as u64;
        let x = i as f64;
        log.write(1, logged, &Cdr::stamped(stamp(header)).joints(&["a", "b"], &[x, x]).done());
    }
    let log = log.done();
    let by_header = read(&log).expect("sound");
    assert_eq!(crate::of_joint(&by_header.joints.angles, 0), [0.0, 1.0, 2.0, 3.0, 0.0]);
    assert_eq!(by_header.counts["joints.backward_stamps"], 1);
    assert_eq!(by_header.counts["joints.duplicate_stamps"], 1);
    let mut mapping = mapping();
    mapping.controller.time = TimeSource::Log;
    let by_log = read_as(&log, &mapping).expect("sound");
    assert_eq!(by_log.rejects, []);
    assert_eq!(crate::of_joint(&by_log.joints.angles, 0), [0.0, 0.0, 1.0, 2.0, 3.0]);
    assert_eq!(by_log.joints.stamps[4].ns(), 200_000_000_003);
}

#[test]
fn times_beyond_the_clock_are_rejected() {
    let mut log = Log::new(None);
    session(&mut log, 1);
    // One below the writer's own limit, far above what 63 bits of nanoseconds hold.
    let message = Cdr::stamped(stamp(1)).joints(&["a", "b"], &[1.0, 1.0]);
    log.write(1, u64::MAX - 1, &message.done());
    let mut mapping = mapping();
    mapping.controller.time = TimeSource::Log;
    let found = read_as(&log.done(), &mapping).expect("sound");
    assert_eq!(crate::of_joint(&found.joints.angles, 0), [0.0]);
    assert!(found.rejects[0].reason.contains("2262"));
}

#[test]
fn every_common_type_is_read_in_both_byte_orders() {
    for little in [true, false] {
        let mut log = Log::new(Some(Compression::Lz4));
        session(&mut log, 1);
        let pose = log.channel("/pose_with_covariance", "PoseWithCovarianceStamped");
        let temperature = log.channel("/temperature", "Temperature");
        let mut covariance = [0.0; 36];
        for (row, column) in (0..6).flat_map(|row| (0..6).map(move |column| (row, column))) {
            // Every entry different, the diagonal large.
            let entry = 0.01 * (row.min(column) * 6 + row.max(column)) as f64;
            covariance[6 * row + column] = entry + if row == column { 3.0 } else { 0.0 };
        }
        let message = Cdr::new(little)
            .stamp(-1)
            .numbers(&[1.0, 2.0, 3.0, 0.0, 0.6, 0.0, 0.8])
            .numbers(&covariance);
        log.write(pose, 5, &message.done());
        log.write(temperature, 6, &Cdr::new(little).stamp(7).numbers(&[21.5, 0.0]).done());
        let mut mapping = mapping();
        mapping.tracker.topic = "/pose_with_covariance".to_owned();
        mapping.tracker.temperature = Some("/temperature".to_owned());
        mapping.tracker.unit = posegrid::ingest::LengthUnit::M;
        let found = read_as(&log.done(), &mapping).expect("sound");
        assert_eq!(found.readings.stamps[0].ns(), -1);
        assert_eq!(found.readings.positions[0], [1000.0, 2000.0, 3000.0]);
        assert_eq!(found.readings.orientations.expect("poses")[0], [0.0, 0.6, 0.0, 0.8]);
        // xx xy xz yy yz zz of the row-major 6 × 6 matrix, m² → mm²; rows x y z, columns of rotations, m·rad → mm·rad; rad².
        let at = |places: &[usize], unit: f64| -> Vec<f64> {
            places.iter().map(|place| covariance[*place] * unit).collect()
        };
        let own = found.readings.covariances.expect("stated")[0];
        let turn = own.turn.expect("stated");
        let near = |found: &[f64], expected: &[f64]| {
            let pairs = found.iter().zip(expected);
            found.len() == expected.len()
                && pairs.into_iter().all(|(a, b)| (a / b - 1.0).abs() < 1e-12)
        };
        assert!(near(&own.position.expect("stated"), &at(&[0, 1, 2, 7, 8, 14], 1e6)));
        assert!(near(&turn.with_position, &at(&[3, 4, 5, 9, 10, 11, 15, 16, 17], 1e3)));
        assert!(near(&turn.own, &at(&[21, 22, 23, 28, 29, 35], 1.0)));
        assert_eq!(found.counts["readings.orientation_covariances"], 1);
        assert_eq!(found.temperatures.celsius, [21.5]);
        assert_eq!(found.temperatures.stamps[0].ns(), 7);
    }
}

#[test]
fn missing_reflectors_are_kept_and_bad_orientations_rejected() {
    let mut log = Log::new(None);
    session(&mut log, 1);
    let pose = log.channel("/pose", "PoseStamped");
    let mut write = |i: u32, numbers: &[f64]| {
        log.write(pose, u64::from(i), &Cdr::stamped(stamp(i)).numbers(numbers).done());
    };
    write(1, &[0.0; 7]);
    write(2, &[1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
    write(3, &[1.0, f64::INFINITY, 1.0, 0.0, 0.0, 0.0, 1.0]);
    write(4, &[1.0, 1.0, 1.0, 0.0, f64::NAN, 0.0, 1.0]);
    write(5, &[1.0, 1.0, 1.0, 0.0, 0.0, 1e300, 0.0]);
    let log = log.done();
    let mut mapping = mapping();
    mapping.tracker.topic = "/pose".to_owned();
    let found = read_as(&log, &mapping).expect("sound");
    assert_eq!(found.readings.positions, [[0.0; 3], [1.0; 3]]);
    assert_eq!(
        found.readings.orientations.expect("poses"),
        [[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]]
    );
    assert_eq!(found.counts["readings.rejected"], 3);
    assert!(found.rejects.iter().any(|reject| reject.reason.contains("ignore_orientation")));
    mapping.tracker.ignore_orientation = true;
    let found = read_as(&log, &mapping).expect("sound");
    assert_eq!(found.readings.positions.len(), 4);
    assert_eq!(found.readings.orientations, None);
}

#[test]
fn messages_and_schemas_that_cannot_be_read_are_named() {
    let with = |name: &str, language: &str, text: &str, encoding: &str| {
        let mut log = Log::new(None);
        let joints = log.channel_of("/joints", name, language, text.as_bytes(), encoding);
        log.write(joints, 0, &Cdr::stamped(0).done());
        read(&log.done()).expect_err("refused").to_string()
    };
    let (name, text) = schema("JointState");
    assert!(with("sensor_msgs/msg/Imu", "ros2msg", &text, "cdr").contains("JointState"));
    assert!(with(&name, "ros2msg", &text, "cbor").contains("\"cbor\""));
    assert!(with(&name, "protobuf", &text, "cdr").contains("\"protobuf\""));
    assert!(with(&name, "ros2msg", "float64[] position", "cdr").contains("header.stamp.sec"));
    assert!(
        with(&name, "ros2msg", "Header header", "cdr").contains("std_msgs")
            || with(&name, "ros2msg", "Header header", "cdr").contains("Header")
    );
    assert!(with(&name, "ros2msg", "%%%", "cdr").contains("line 1"));
}

#[test]
fn header_stamps_that_nobody_sets_are_an_error() {
    let mut log = Log::new(None);
    let joints = log.channel("/joints", "JointState");
    let command = log.channel("/command", "PoseStamped");
    let reading = log.channel("/reading", "PointStamped");
    for i in 0..3 {
        let angle = if i == 1 { 1.0 } else { 0.0 };
        log.write(joints, i, &Cdr::stamped(0).joints(&["a", "b"], &[angle, 0.0]).done());
    }
    log.write(command, 3, &Cdr::stamped(1).numbers(&[0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 1.0]).done());
    log.write(reading, 4, &Cdr::stamped(1).numbers(&[3.0, 0.0, 4.0]).done());
    let error = read(&log.done()).expect_err("refused").to_string();
    assert!(error.contains("header stamp 0") && error.contains("time = \"log\""), "{error}");
}

#[test]
fn metadata_of_both_logs_is_kept() {
    let folder = Folder::new();
    let write = |name: &str, robot: &str| {
        let mut log = Log::new(None);
        session(&mut log, 20);
        log.metadata("session", "robot", robot);
        log.metadata("session", "site", "hall 3");
        folder.file(name, &log.done())
    };
    let (controller, tracker) = (write("c.mcap", "r1"), write("t.mcap", "r2"));
    let logs = SessionLogs::of_two(&controller, &tracker);
    let found = read_whole(&logs, &mapping(), Limits::default(), &Quiet).expect("sound");
    let metadata: Vec<_> = found.metadata.iter().map(|(k, v)| (k.as_str(), v.as_str())).collect();
    assert_eq!(
        metadata,
        [("session.robot", "r1"), ("session.robot (tracker)", "r2"), ("session.site", "hall 3")]
    );
}

#[test]
fn conventions_have_no_default() {
    use posegrid::ingest::{ControllerSettings, TrackerSettings};
    let refusal =
        |text| toml::from_str::<ControllerSettings>(text).expect_err("refused").to_string();
    let no_unit = refusal("topic = \"/j\"\ntime = \"header\"");
    assert!(no_unit.contains("`unit`"), "{no_unit}");
    let no_time = refusal("topic = \"/j\"\nunit = \"rad\"");
    assert!(no_time.contains("`time`"), "{no_time}");
    let wrong = refusal("topic = \"/j\"\nunit = \"grad\"\ntime = \"header\"");
    assert!(wrong.contains("rad") && wrong.contains("deg"), "{wrong}");
    assert!(
        refusal("topic = \"/j\"\nunit = \"rad\"\ntime = \"log\"\ntopics = 1").contains("topics")
    );
    assert!(
        toml::from_str::<TrackerSettings>("topic = \"/t\"\nunit = \"mm\"\ntime = \"log\"").is_ok()
    );
}
