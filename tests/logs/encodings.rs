//! Messages in every encoding: the same values come out, whatever they were stored in.

#![expect(
    clippy::float_cmp,
    reason = "what was written must come back exactly, scaled by powers of ten that are exact here"
)]

mod hostile;
mod mapping;
mod messages;
mod proto;
pub mod sample;
pub mod worded;

use crate::build::{Cdr, Log, POSE, WholeSession, read, schema, stamp};
use proto::Proto;

/// How the messages of one stream are stored.
struct Form {
    type_name: &'static str,
    language: &'static str,
    definition: Vec<u8>,
    encoding: &'static str,
    /// Message `i`, stamped `ns`: joints a and b at i and -i, or a reading at 3, i, 4.
    message: fn(ns: i64, i: f64) -> Vec<u8>,
}

const TIME: &str = "================\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";
const POINT: &str = "================\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n";

/// A message of every form, with all that is said of it.
pub fn samples() -> Vec<Sample> {
    let forms = joint_forms().into_iter().chain(reading_forms());
    let sample = |form: Form| Sample {
        form: (form.encoding, form.language),
        type_name: form.type_name,
        message: (form.message)(stamp(7), 0.25),
        definition: form.definition,
    };
    forms.map(sample).collect()
}

/// A message with its encoding, its schema's language, its type and its schema.
pub struct Sample {
    pub form: (&'static str, &'static str),
    pub type_name: &'static str,
    pub definition: Vec<u8>,
    pub message: Vec<u8>,
}

fn of_ros(type_name: &'static str, text: &str, message: fn(i64, f64) -> Vec<u8>) -> Form {
    Form {
        type_name,
        language: "ros2msg",
        definition: format!("{text}{TIME}{POINT}").into_bytes(),
        encoding: "cdr",
        message,
    }
}

/// As `mcap convert` writes the messages of a ROS 1 bag.
fn of_ros_1(type_name: &'static str, fields: &str, message: fn(i64, f64) -> Vec<u8>) -> Form {
    let header =
        "================\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n";
    Form {
        type_name,
        language: "ros1msg",
        definition: format!("{fields}{header}{POSE}").into_bytes(),
        encoding: "ros1",
        message,
    }
}

fn of_json(type_name: &'static str, message: fn(i64, f64) -> Vec<u8>) -> Form {
    Form {
        type_name,
        language: "jsonschema",
        definition: b"{\"type\": \"object\"}".to_vec(),
        encoding: "json",
        message,
    }
}

fn of_protobuf(type_name: &'static str, message: fn(i64, f64) -> Vec<u8>) -> Form {
    Form {
        type_name,
        language: "protobuf",
        definition: proto::foxglove(),
        encoding: "protobuf",
        message,
    }
}

const HEADER: &str =
    "================\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n";
const IDL: &str = "
================================================================================
IDL: sensor_msgs/msg/JointState
module sensor_msgs { module msg {
  struct JointState {
    std_msgs::msg::Header header;
    sequence<string> name;
    sequence<double> position;
    sequence<double, 10> velocity;
    sequence<double> effort;
  };
}; };
================================================================================
IDL: std_msgs/msg/Header
module std_msgs { module msg { struct Header { builtin_interfaces::msg::Time stamp; string frame_id; }; }; };
================================================================================
IDL: builtin_interfaces/msg/Time
module builtin_interfaces { module msg { struct Time { long sec; unsigned long nanosec; }; }; };
";

fn seconds_and_nanoseconds(ns: i64) -> (i64, i64) {
    (ns / 1_000_000_000, ns % 1_000_000_000)
}

fn joint_state(ns: i64, i: f64) -> Vec<u8> {
    Cdr::stamped(ns).joints(&["b", "a"], &[-i, i]).done()
}

/// Plain CDR 2: doubles aligned to 4, the names behind their length in bytes.
fn joint_state_2(ns: i64, i: f64) -> Vec<u8> {
    let (sec, nanosec) = seconds_and_nanoseconds(ns);
    let word = |n: i64| u32::try_from(n).expect("small").to_le_bytes();
    let words: Vec<u8> = [sec, nanosec, 1, 0].into_iter().flat_map(word).collect();
    let names: Vec<u8> = [20, 2].into_iter().flat_map(word).collect();
    let names = [&names[..], &word(2), b"b\0\0\0", &word(2), b"a\0\0\0"].concat();
    let numbers =
        [&word(2)[..], &(-i).to_le_bytes(), &i.to_le_bytes(), &word(0), &word(0)].concat();
    [&[0, 7, 0, 0][..], &words, &names, &numbers].concat()
}

/// Delimited CDR 2: the same, each message and nested message behind its length in bytes.
fn joint_state_delimited(ns: i64, i: f64) -> Vec<u8> {
    let plain = joint_state_2(ns, i);
    let word = |n: usize| u32::try_from(n).expect("small").to_le_bytes();
    // Behind the encapsulation: the header (time of 8, text of 4 + 1, padding), then the rest.
    let (time, text, rest) = (&plain[4..12], &plain[12..17], &plain[20..]);
    let header = [&word(8)[..], time, text].concat();
    let body = [&word(header.len())[..], &header, &[0; 3], rest].concat();
    [&[0, 9, 0, 0][..], &word(body.len()), &body].concat()
}

fn controller_state(ns: i64, i: f64) -> Vec<u8> {
    let names = Cdr::stamped(ns).word(2).text("a").text("b");
    // The desired point comes first and says something else.
    let desired = names.sequence(&[9.0, 9.0]).sequence(&[]).word(5).word(6);
    let actual = desired.sequence(&[i, -i]).sequence(&[1.0, 1.0]).word(5).word(6);
    actual.done()
}

const POINT_OF_TRAJECTORY: &str = "================\nMSG: trajectory_msgs/JointTrajectoryPoint\nfloat64[] positions\n\
    float64[] velocities\nbuiltin_interfaces/Duration time_from_start\n";

fn foxglove_joints(ns: i64, i: f64) -> Vec<u8> {
    let (sec, nanosec) = seconds_and_nanoseconds(ns);
    let word = |n| u32::try_from(n).expect("small");
    let head = Cdr::new(true).word(word(sec)).word(word(nanosec)).word(2);
    head.text("a").number(i).number(0.5).text("b").number(-i).number(0.5).done()
}

fn joint_states_protobuf(ns: i64, i: f64) -> Vec<u8> {
    let joint = |name: &str, position| {
        Proto::default().bytes(1, name.as_bytes()).double(2, position).double(3, 0.5)
    };
    // Fields in another order than they are defined in, and a field that the schema does not have.
    Proto::default()
        .message(2, &joint("b", -i))
        .group(99, &Proto::default().varint(1, 7).group(2, &Proto::default()))
        .message(1, &proto::timestamp(ns))
        .message(2, &joint("a", i))
        .0
}

fn joint_states_json(ns: i64, i: f64) -> Vec<u8> {
    let (sec, nsec) = seconds_and_nanoseconds(ns);
    let text = format!(
        r#"{{"joints": [{{"position": {i:?}, "name": "a", "effort": null}}, {{"name": "\u0062", "position": {:?}}}],
        "extra": {{"deep": [1, {{"x": "}}"}}, [2.5e-3, true]]}}, "timestamp": {{"sec": {sec}, "nsec": {nsec}}}}}"#,
        -i
    );
    text.into_bytes()
}

/// As a bridge from ROS 2 writes it.
fn joint_state_json(ns: i64, i: f64) -> Vec<u8> {
    let (sec, nanosec) = seconds_and_nanoseconds(ns);
    let text = format!(
        r#"{{"header":{{"stamp":{{"sec":{sec},"nanosec":{nanosec}}},"frame_id":""}},"name":["a","b"],
        "position":[{i:?},{:?}],"velocity":[NaN,Infinity],"effort":[]}}"#,
        -i
    );
    text.into_bytes()
}

/// Where stamps are texts: in any zone, with as many digits as it takes.
fn joint_state_json_in_text(ns: i64, i: f64) -> Vec<u8> {
    let since = ns - 100_000_000_000;
    let text = format!(
        r#"{{"header":{{"stamp":"1970-01-01T02:01:40.{:03}+02:00"}},"name":["a","b"],"position":[{i},{}]}}"#,
        since / 1_000_000,
        -i
    );
    text.into_bytes()
}

fn joint_forms() -> Vec<Form> {
    let idl = |message| Form {
        type_name: "sensor_msgs/msg/JointState",
        language: "ros2idl",
        definition: IDL.as_bytes().to_vec(),
        encoding: "cdr",
        message,
    };
    let state = |old: &str| {
        format!(
            "std_msgs/Header header\nstring[] joint_names\ntrajectory_msgs/JointTrajectoryPoint {old}\n{HEADER}{POINT_OF_TRAJECTORY}"
        )
    };
    let humble = state("desired\ntrajectory_msgs/JointTrajectoryPoint actual");
    let jazzy = state("reference\ntrajectory_msgs/JointTrajectoryPoint feedback");
    let state_name = "control_msgs/msg/JointTrajectoryControllerState";
    let foxglove = "builtin_interfaces/Time timestamp\nfoxglove_msgs/JointState[] joints\n\
        ================\nMSG: foxglove_msgs/JointState\nstring name\nfloat64 position\nfloat64 velocity\n";
    vec![
        idl(joint_state),
        idl(joint_state_2),
        idl(joint_state_delimited),
        of_ros("sensor_msgs/JointState", &schema("JointState").1, joint_state_2),
        of_ros(state_name, &humble, controller_state),
        of_ros(state_name, &jazzy, controller_state),
        of_ros("foxglove_msgs/msg/JointStates", foxglove, foxglove_joints),
        of_ros_1(
            "sensor_msgs/JointState",
            "Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
            joint_state_ros_1,
        ),
        of_protobuf("foxglove.JointStates", joint_states_protobuf),
        of_json("foxglove.JointStates", joint_states_json),
        of_json("sensor_msgs/msg/JointState", joint_state_json),
        of_json("sensor_msgs/msg/JointState", joint_state_json_in_text),
    ]
}

fn joint_state_ros_1(ns: i64, i: f64) -> Vec<u8> {
    let numbers = |numbers: &[f64]| [&[2, 0, 0, 0][..], &packed(numbers)].concat();
    let names = b"\x02\0\0\0\x01\0\0\0b\x01\0\0\0a";
    let head = [&header_ros_1(ns)[..], names].concat();
    [head, numbers(&[-i, i]), numbers(&[0.5, 0.5]), vec![0; 4]].concat()
}

/// A sequence number that counts up, the stamp, and a frame of 7 bytes that nothing pads.
fn header_ros_1(ns: i64) -> Vec<u8> {
    let (secs, nsecs) = seconds_and_nanoseconds(ns);
    let words = [nsecs / 10_000_000, secs, nsecs, 7].map(|n| u32::try_from(n).expect("small"));
    let words = words.map(u32::to_le_bytes).concat();
    [&words[..], b"tracker"].concat()
}

fn packed(numbers: &[f64]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

fn point_ros_1(ns: i64, i: f64) -> Vec<u8> {
    [header_ros_1(ns), packed(&[3.0, i, 4.0])].concat()
}

fn pose_ros_1(ns: i64, i: f64) -> Vec<u8> {
    [header_ros_1(ns), packed(&[3.0, i, 4.0, 0.0, 0.0, 0.0, 1.0])].concat()
}

fn point(ns: i64, i: f64) -> Vec<u8> {
    Cdr::stamped(ns).numbers(&[3.0, i, 4.0]).done()
}

fn foxglove_point(ns: i64, i: f64) -> Vec<u8> {
    let (sec, nanosec) = seconds_and_nanoseconds(ns);
    let word = |n| u32::try_from(n).expect("small");
    let head = Cdr::new(false).word(word(sec)).word(word(nanosec)).text("tracker");
    head.numbers(&[3.0, i, 4.0]).done()
}

fn point_protobuf(ns: i64, i: f64) -> Vec<u8> {
    let point = Proto::default().double(1, 3.0).double(3, 4.0);
    let message =
        Proto::default().message(1, &proto::timestamp(ns)).bytes(2, b"tracker").message(3, &point);
    // 0 is not written, and what is given twice is merged.
    if i == 0.0 { message.0 } else { message.message(3, &Proto::default().double(2, i)).0 }
}

fn point_json(ns: i64, i: f64) -> Vec<u8> {
    let (sec, nsec) = seconds_and_nanoseconds(ns);
    let text = format!(
        "\u{feff}{{\"point\":{{\"x\":9,\"y\":9}},\"timestamp\":{{\"sec\":{sec},\"nsec\":{nsec}}},\n\t\"frame_id\":\"t\",\
         \"point\":{{\"x\":3,\"y\":{i},\"z\":4e0}}}}\n"
    );
    text.into_bytes()
}

fn point_json_in_text(ns: i64, i: f64) -> Vec<u8> {
    let since = ns - 100_000_000_000;
    let text = format!(
        r#"{{"timestamp":"1970-01-01T00:01:40.{since:09}Z","point":{{"x":3,"y":{i},"z":4}}}}"#
    );
    text.into_bytes()
}

fn reading_forms() -> Vec<Form> {
    let (name, text) = schema("PointStamped");
    assert_eq!(name, "geometry_msgs/msg/PointStamped");
    let foxglove =
        "builtin_interfaces/Time timestamp\nstring frame_id\ngeometry_msgs/Point point\n";
    vec![
        of_ros("geometry_msgs/PointStamped", &text.replace('\n', "\r\n"), point),
        of_ros("foxglove_msgs/msg/Point3InFrame", foxglove, foxglove_point),
        of_ros_1("geometry_msgs/PointStamped", "Header header\nPoint point\n", point_ros_1),
        of_protobuf("foxglove.Point3InFrame", point_protobuf),
        of_json("foxglove.Point3InFrame", point_json),
        of_json("foxglove.Point3InFrame", point_json_in_text),
    ]
}

fn recording(joints: &Form, readings: &Form) -> WholeSession {
    let mut log = Log::new(None);
    let mut channel = |topic, form: &Form| {
        log.channel_of(topic, form.type_name, form.language, &form.definition, form.encoding)
    };
    let (joint_channel, reading_channel) =
        (channel("/joints", joints), channel("/reading", readings));
    let command = log.channel("/command", "PoseStamped");
    for i in 0..50 {
        let (ns, x) = (stamp(i), f64::from(i));
        let log_time = u64::try_from(ns).expect("positive");
        log.write(joint_channel, log_time, &(joints.message)(ns, x));
        log.write(reading_channel, log_time, &(readings.message)(ns, x));
        let pose = Cdr::stamped(ns).numbers(&[x, 1.0, 2.0, 0.0, 0.0, 0.0, 2.0]);
        log.write(command, log_time, &pose.done());
    }
    read(&log.done()).expect("sound")
}

#[test]
fn every_encoding_gives_the_same_recording() {
    let joint_forms = joint_forms();
    let reading_forms = reading_forms();
    for (place, joints) in joint_forms.iter().enumerate() {
        let readings = &reading_forms[place % reading_forms.len()];
        let found = recording(joints, readings);
        let what = format!("{place} {} {}", joints.type_name, readings.type_name);
        assert_eq!(found.rejects, [], "{what}");
        assert_eq!(found.joints.stamps.len(), 50, "{what}");
        for i in 0..50 {
            let (ns, x) = (stamp(i), f64::from(i));
            let row = usize::try_from(i).expect("small");
            assert_eq!(found.joints.stamps[row].ns(), ns, "{what}");
            assert_eq!(found.joints.angles.row(row), [x, -x], "{what}");
            assert_eq!(found.readings.stamps[row].ns(), ns, "{what}");
            assert_eq!(found.readings.positions[row], [3.0, x, 4.0], "{what}");
        }
    }
}

#[test]
fn poses_come_with_their_orientation_in_every_encoding() {
    let protobuf = |ns: i64, i: f64| {
        let position = Proto::default().double(1, 3.0).double(2, i).double(3, 4.0);
        let pose =
            Proto::default().message(1, &position).message(2, &Proto::default().double(4, 1.0));
        Proto::default().message(1, &proto::timestamp(ns)).message(3, &pose).0
    };
    let json = |ns: i64, i: f64| {
        let (sec, nsec) = seconds_and_nanoseconds(ns);
        let position = format!(r#"{{"x":3,"y":{i},"z":4}}"#);
        format!(
            r#"{{"timestamp":{{"sec":{sec},"nsec":{nsec}}},"pose":{{"orientation":{{"x":0,"y":0,"z":0,"w":1}},"position":{position}}}}}"#
        )
        .into_bytes()
    };
    let transform = |ns: i64, i: f64| {
        Cdr::stamped(ns).text("target").numbers(&[3.0, i, 4.0, 0.0, 0.0, 0.0, 1.0]).done()
    };
    let text = format!(
        "std_msgs/Header header\nstring child_frame_id\nTransform transform\n{HEADER}================\n\
         MSG: geometry_msgs/Transform\nPoint translation\nQuaternion rotation\n================\n\
         MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
    );
    for form in [
        of_protobuf("foxglove.PoseInFrame", protobuf),
        of_json("foxglove.PoseInFrame", json),
        of_ros("geometry_msgs/msg/TransformStamped", &text, transform),
        of_ros_1("geometry_msgs/PoseStamped", "Header header\nPose pose\n", pose_ros_1),
    ] {
        let found = recording(&joint_forms()[0], &form);
        assert_eq!(found.rejects, [], "{}", form.type_name);
        assert_eq!(found.readings.positions[7], [3.0, 7.0, 4.0]);
        let orientations = found.readings.orientations.expect("poses");
        assert_eq!(orientations[7], [0.0, 0.0, 0.0, 1.0]);
    }
}
