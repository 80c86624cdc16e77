//! Several targets in one log: told by topic, by a name in the message, and by the number of a marker in an array.

#![expect(
    clippy::float_cmp,
    reason = "what was written must come back exactly, scaled by powers of ten that are exact here"
)]

use posegrid::ingest::{LoggedTarget, Mapping, PoseFields, TargetName};

use crate::build::{Cdr, HEADER, Log, POSE, WholeSession, mapping, read_as, session, stamp};

const MARKER: &str = "================\nMSG: aruco_msgs/Marker\nstd_msgs/Header header\nuint32 id\ngeometry_msgs/PoseWithCovariance pose\nfloat64 confidence\n\
    ================\nMSG: geometry_msgs/PoseWithCovariance\nPose pose\nfloat64[36] covariance\n";

fn target(name: &str, topic: Option<&str>, is: Option<TargetName>) -> LoggedTarget {
    LoggedTarget { name: name.to_owned(), topic: topic.map(str::to_owned), is }
}

fn two_by_number() -> Vec<LoggedTarget> {
    vec![
        target("a", None, Some(TargetName::Number(3))),
        target("b", None, Some(TargetName::Number(7))),
    ]
}

/// The marker `id` at `x` metres, one tenth of it as variance along x.
fn marker(cdr: Cdr, ns: i64, id: u32, x: f64) -> Cdr {
    let mut covariance = [0.0; 36];
    covariance[0] = x / 10.0;
    covariance[7] = 0.25;
    covariance[14] = 0.5;
    cdr.stamp(ns)
        .word(id)
        .numbers(&[x, 1.0, 2.0, 0.0, 0.0, 0.0, 1.0])
        .numbers(&covariance)
        .number(0.9)
}

/// A log of markers, each message with these.
fn marker_log(messages: &[&[(u32, f64)]]) -> Vec<u8> {
    let mut log = Log::new(None);
    session(&mut log, 100);
    let text = format!("std_msgs/Header header\nMarker[] markers\n{HEADER}{MARKER}{POSE}");
    let channel =
        log.channel_of("/markers", "aruco_msgs/msg/MarkerArray", "ros2msg", text.as_bytes(), "cdr");
    for (i, markers) in messages.iter().enumerate() {
        let ns = stamp(u32::try_from(i).expect("few"));
        let cdr = Cdr::stamped(ns).word(u32::try_from(markers.len()).expect("few"));
        let cdr = markers.iter().fold(cdr, |cdr, (id, x)| marker(cdr, ns, *id, *x));
        log.write(channel, u64::try_from(ns).expect("positive"), &cdr.done());
    }
    log.done()
}

const SEEN: [&[(u32, f64)]; 5] = [
    &[(3, 1.0), (7, 2.0)],
    &[(9, 5.0), (7, 4.0), (3, 3.0)],
    &[(7, 6.0)],
    &[],
    &[(3, 7.0), (3, 8.0), (7, 9.0)],
];

fn of_markers(fields: PoseFields) -> Mapping {
    let mut mapping = mapping();
    "/markers".clone_into(&mut mapping.tracker.topic);
    mapping.tracker.unit = posegrid::ingest::LengthUnit::M;
    mapping.tracker.targets = two_by_number();
    mapping.tracker.fields = fields;
    mapping
}

fn by_path(covariance: bool) -> PoseFields {
    let path = |inner: &str| Some(format!("markers[].pose.{inner}"));
    PoseFields {
        target: Some("markers[].id".to_owned()),
        x: path("pose.position.x"),
        y: path("pose.position.y"),
        z: path("pose.position.z"),
        covariance: path("covariance").filter(|_| covariance),
        ..PoseFields::default()
    }
}

/// x of each reading, mm.
fn x(readings: &posegrid::ingest::TargetReadings) -> Vec<f64> {
    readings.positions.iter().map(|own| own[0]).collect()
}

/// Rows in = rows kept + rejected.
fn check_counts(found: &WholeSession) {
    let count = |name: &str| found.counts.get(name).copied().unwrap_or(0);
    let rows = found.readings.stamps.len()
        + found.others.iter().map(|own| own.stamps.len()).sum::<usize>();
    assert_eq!(count("readings.kept"), rows as u64);
    assert_eq!(count("readings.messages"), count("readings.kept") + count("readings.rejected"));
}

#[test]
fn markers_are_told_by_number_and_what_is_not_seen_is_missing() {
    let log = marker_log(&SEEN);
    for fields in [PoseFields::default(), by_path(false)] {
        let with_turns = fields.is_empty();
        let found = read_as(&log, &of_markers(fields)).expect("sound");
        assert_eq!(x(&found.readings), [1000.0, 3000.0, 0.0, 0.0]);
        assert_eq!(x(&found.others[0]), [2000.0, 4000.0, 6000.0, 0.0]);
        assert_eq!(found.others[0].stamps[2].ns(), stamp(2));
        assert_eq!(found.readings.orientations.is_some(), with_turns);
        assert_eq!(found.counts["readings.messages"], 10);
        assert_eq!(found.counts["readings.rejected"], 2);
        check_counts(&found);
        let mut rejects = found.rejects.iter();
        assert!(
            rejects.any(|own| own.reason == "the target \"a\" is twice in the message"),
            "{:?}",
            found.rejects
        );
    }
}

#[test]
fn each_marker_has_its_own_covariance() {
    by_path(true).check().expect("sound paths");
    let log = marker_log(&SEEN);
    for fields in [PoseFields::default(), by_path(true)] {
        let found = read_as(&log, &of_markers(fields)).expect("sound");
        let position = |readings: &posegrid::ingest::TargetReadings| {
            let stated = readings.covariances.as_ref().expect("stated").iter();
            stated.map(|own| own.position).collect::<Vec<_>>()
        };
        let of = |x_m: f64| Some([x_m * 1e5, 0.0, 0.0, 0.25e6, 0.0, 0.5e6]);
        assert_eq!(position(&found.readings), [of(1.0), of(3.0), None, None]);
        let others = [of(2.0), of(4.0), of(6.0), None];
        assert_eq!(position(&found.others[0]), others);
        // What is not seen states nothing.
        assert_eq!(found.counts["readings.position_covariances"], 5);
        assert_eq!(found.counts["readings.position_covariances_all_zero"], 0);
        check_counts(&found);
    }
}

#[test]
fn covariances_of_markers_in_json_are_those_of_their_element() {
    let mut log = Log::new(None);
    session(&mut log, 100);
    let channel = log.channel_of("/markers", "", "", b"", "json");
    let marker = |id: u32, x: f64| {
        let mut entries = [0.0; 36];
        (entries[0], entries[7], entries[14]) = (x / 10.0, 0.25, 0.5);
        let pose = format!(r#""position": {{"x": {x}, "y": 1, "z": 2}}"#);
        format!(r#"{{"id": {id}, "pose": {{"pose": {{{pose}}}, "covariance": {entries:?}}}}}"#)
    };
    let message = format!(
        r#"{{"header": {{"stamp": {{"sec": 100, "nanosec": 0}}}}, "markers": [{}, {}]}}"#,
        marker(7, 2.0),
        marker(3, 1.0)
    );
    log.write(channel, 1, message.as_bytes());
    let found = read_as(&log.done(), &of_markers(by_path(true))).expect("sound");
    let of = |x_m: f64| Some([x_m * 1e5, 0.0, 0.0, 0.25e6, 0.0, 0.5e6]);
    let stated = [&found.readings, &found.others[0]].map(|own| own.covariances.as_ref());
    let first = stated.map(|own| own.expect("stated")[0].position);
    assert_eq!(first, [of(1.0), of(2.0)]);
}

#[test]
fn markers_without_a_number_to_look_for_are_refused() {
    let mut mapping = of_markers(PoseFields::default());
    mapping.tracker.targets.clear();
    let error = read_as(&marker_log(&SEEN), &mapping).expect_err("which one?");
    assert!(error.to_string().contains("[[tracker.targets]]"), "{error}");
}

#[test]
fn fields_that_are_no_markers_are_named() {
    let mut wrong = by_path(false);
    wrong.x = Some("markers[].pose.pose.position.w".to_owned());
    let error = read_as(&marker_log(&SEEN), &of_markers(wrong)).expect_err("no such field");
    assert!(error.to_string().contains("markers[].pose.pose.position.w"), "{error}");
}

/// Transforms that name their child frame.
fn transform_log(names: &[&str]) -> Vec<u8> {
    let mut log = Log::new(None);
    session(&mut log, 100);
    let transform = "================\nMSG: geometry_msgs/Transform\nVector3 translation\nQuaternion rotation\n\
        ================\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n";
    let text = format!(
        "std_msgs/Header header\nstring child_frame_id\nTransform transform\n{HEADER}{transform}{POSE}"
    );
    let channel = log.channel_of(
        "/tf",
        "geometry_msgs/msg/TransformStamped",
        "ros2msg",
        text.as_bytes(),
        "cdr",
    );
    for (i, name) in names.iter().enumerate() {
        let ns = stamp(u32::try_from(i).expect("few"));
        let x = i as f64 + 1.0;
        let message = Cdr::stamped(ns).text(name).numbers(&[x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        log.write(channel, u64::try_from(ns).expect("positive"), &message.done());
    }
    log.done()
}

#[test]
fn targets_are_told_by_a_name_in_the_message() {
    let mut mapping = of_markers(PoseFields {
        target: Some("child_frame_id".to_owned()),
        ..PoseFields::default()
    });
    "/tf".clone_into(&mut mapping.tracker.topic);
    let named = |name: &str| Some(TargetName::Text(name.to_owned()));
    mapping.tracker.targets =
        vec![target("a", None, named("SMR 1")), target("b", None, named("SMR 2"))];
    let log = transform_log(&["SMR 1", "SMR 2", "SMR 3", "SMR 1"]);
    let found = read_as(&log, &mapping).expect("sound");
    assert_eq!(x(&found.readings), [1000.0, 4000.0]);
    assert_eq!(x(&found.others[0]), [2000.0]);
    check_counts(&found);
    let mut rejects = found.rejects.iter();
    assert!(
        rejects.any(|own| own.reason.contains("none of [tracker] targets")),
        "{:?}",
        found.rejects
    );
}

#[test]
fn targets_are_told_by_topic() {
    let mut mapping = mapping();
    mapping.tracker.targets = vec![target("a", None, None), target("b", Some("/second"), None)];
    let mut log = Log::new(None);
    session(&mut log, 100);
    let second = log.channel("/second", "PointStamped");
    log.write(second, 1, &Cdr::stamped(stamp(4)).numbers(&[8.0, 9.0, 10.0]).done());
    let found = read_as(&log.done(), &mapping).expect("sound");
    assert_eq!((found.readings.positions.len(), found.others[0].positions.len()), (10, 1));
    assert_eq!(found.others[0].positions[0], [8.0, 9.0, 10.0]);
    check_counts(&found);
    // A topic that is not there is named.
    mapping.tracker.targets[1].topic = Some("/third".to_owned());
    let mut log = Log::new(None);
    session(&mut log, 100);
    let error = read_as(&log.done(), &mapping).expect_err("no such topic").to_string();
    assert!(error.contains("/third"), "{error}");
}

#[test]
fn damaged_arrays_of_markers_are_counted_and_never_trusted() {
    // The number of markers is at a fixed place behind the header: 4 bytes of CDR, stamp, "base".
    let seen: Vec<&[(u32, f64)]> = vec![&[(3, 1.0), (7, 2.0)]; 6];
    let sound = marker_log(&seen);
    let mut state = 11_u64;
    let mut next = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(state >> 33).expect("31 bits")
    };
    let mut read = 0;
    for _ in 0..300 {
        let mut log = sound.clone();
        for _ in 0..=next() % 4 {
            let place = next() % log.len();
            log[place] = u8::try_from(next() % 256).expect("a byte");
        }
        if let Ok(found) = read_as(&log, &of_markers(PoseFields::default())) {
            check_counts(&found);
            read += 1;
        }
    }
    assert!(read > 20, "{read}");
}

#[test]
fn arrays_without_names_are_refused_with_how_to_name_their_elements() {
    let mut log = Log::new(None);
    session(&mut log, 100);
    let text = format!("std_msgs/Header header\nPose[] poses\n{HEADER}{POSE}");
    let (array, definition) = ("geometry_msgs/msg/PoseArray", text.as_bytes());
    log.channel_of("/markers", array, "ros2msg", definition, "cdr");
    let mut mapping = of_markers(PoseFields::default());
    mapping.tracker.targets.clear();
    let error = read_as(&log.done(), &mapping).expect_err("which one?").to_string();
    for part in ["PoseArray of motion capture", "topic of its own", "[[tracker.targets]]"] {
        assert!(error.contains(part), "{error}");
    }
}
