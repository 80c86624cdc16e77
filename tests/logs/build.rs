//! Builds small MCAP logs with the `mcap` crate's writer: an arm of two joints, commands, a tracker.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions, Writer};
use posegrid::files::table::ROW_GROUP_ROWS;
use posegrid::ingest::{
    AngleUnit, CommandSamples, CommandedSettings, ControllerSettings, JointAngles, JointFields,
    JointSamples, LengthUnit, LogReject, Mapping, PoseFields, TargetReadings, TemperatureSamples,
    TimeSource,
};
use posegrid::io::log::{JointSink, Limits, LogError, SessionLogs, SessionRead, read_session};
use posegrid::join::stationary::Stationary;
use posegrid::join::{JoinInput, JoinSettings};
use posegrid::progress::{Progress, Quiet};
use posegrid::units::Stamp;

pub const HEADER: &str = "================\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
    ================\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";
pub const POSE: &str = "================\nMSG: geometry_msgs/Pose\nPoint position\nQuaternion orientation\n\
    ================\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n\
    ================\nMSG: geometry_msgs/Quaternion\nfloat64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n";

/// Name and text of the schemas in use.
pub fn schema(short: &str) -> (String, String) {
    let fields = match short {
        "JointState" => {
            "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
        }
        "PoseStamped" => "std_msgs/Header header\nPose pose\n",
        "PointStamped" => "std_msgs/Header header\nPoint point\n",
        "PoseWithCovarianceStamped" => "std_msgs/Header header\nPoseWithCovariance pose\n",
        "Temperature" => "std_msgs/Header header\nfloat64 temperature\nfloat64 variance\n",
        other => panic!("no schema for {other}"),
    };
    let package =
        if matches!(short, "JointState" | "Temperature") { "sensor_msgs" } else { "geometry_msgs" };
    let covariance = "================\nMSG: geometry_msgs/PoseWithCovariance\nPose pose\nfloat64[36] covariance\n";
    (format!("{package}/msg/{short}"), format!("{fields}{HEADER}{covariance}{POSE}"))
}

/// A message being serialised as CDR.
pub struct Cdr {
    bytes: Vec<u8>,
    little: bool,
}

impl Cdr {
    /// With header stamp and frame.
    pub fn stamped(stamp_ns: i64) -> Self {
        Self::new(true).stamp(stamp_ns)
    }

    pub fn new(little: bool) -> Self {
        Self { bytes: vec![0, u8::from(little), 0, 0], little }
    }

    pub fn stamp(self, stamp_ns: i64) -> Self {
        let sec = i32::try_from(stamp_ns.div_euclid(1_000_000_000)).expect("small");
        let nanosec = u32::try_from(stamp_ns.rem_euclid(1_000_000_000)).expect("below a second");
        self.word(u32::from_ne_bytes(sec.to_ne_bytes())).word(nanosec).text("base")
    }

    fn align(mut self, size: usize) -> Self {
        self.bytes.resize((self.bytes.len() - 4).next_multiple_of(size) + 4, 0);
        self
    }

    pub fn word(self, word: u32) -> Self {
        let mut cdr = self.align(4);
        cdr.bytes.extend(if cdr.little { word.to_le_bytes() } else { word.to_be_bytes() });
        cdr
    }

    pub fn number(self, number: f64) -> Self {
        let mut cdr = self.align(8);
        cdr.bytes.extend(if cdr.little { number.to_le_bytes() } else { number.to_be_bytes() });
        cdr
    }

    pub fn numbers(self, numbers: &[f64]) -> Self {
        numbers.iter().fold(self, |cdr, &x| cdr.number(x))
    }

    pub fn sequence(self, numbers: &[f64]) -> Self {
        self.word(u32::try_from(numbers.len()).expect("few")).numbers(numbers)
    }

    pub fn text(self, text: &str) -> Self {
        let mut cdr = self.word(u32::try_from(text.len() + 1).expect("short"));
        cdr.bytes.extend(text.as_bytes());
        cdr.bytes.push(0);
        cdr
    }

    pub fn joints(self, names: &[&str], positions: &[f64]) -> Self {
        let cdr = self.word(u32::try_from(names.len()).expect("few"));
        let cdr = names.iter().fold(cdr, |cdr, name| cdr.text(name));
        cdr.sequence(positions).sequence(&[]).sequence(&[0.5])
    }

    pub fn done(self) -> Vec<u8> {
        self.bytes
    }
}

/// A log being written.
pub struct Log {
    writer: Writer<Cursor<Vec<u8>>>,
}

impl Log {
    /// Small chunks, so that a log of a hundred messages has several.
    pub fn new(compression: Option<Compression>) -> Self {
        Self::with(WriteOptions::new().compression(compression).chunk_size(Some(1500)))
    }

    pub fn with(options: WriteOptions) -> Self {
        let writer = options
            .profile("ros2")
            .library("tests")
            .create(Cursor::new(Vec::new()))
            .expect("in memory");
        Self { writer }
    }

    pub fn channel(&mut self, topic: &str, short: &str) -> u16 {
        let (name, text) = schema(short);
        self.channel_of(topic, &name, "ros2msg", text.as_bytes(), "cdr")
    }

    pub fn channel_of(
        &mut self,
        topic: &str,
        name: &str,
        language: &str,
        text: &[u8],
        encoding: &str,
    ) -> u16 {
        let schema = self.writer.add_schema(name, language, text).expect("in memory");
        self.writer.add_channel(schema, topic, encoding, &BTreeMap::new()).expect("in memory")
    }

    pub fn write(&mut self, channel_id: u16, log_time: u64, message: &[u8]) {
        let header =
            MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time + 1 };
        self.writer.write_to_known_channel(&header, message).expect("in memory");
    }

    pub fn metadata(&mut self, name: &str, key: &str, value: &str) {
        let metadata = [(key.to_owned(), value.to_owned())].into();
        let record = mcap::records::Metadata { name: name.to_owned(), metadata };
        self.writer.write_metadata(&record).expect("in memory");
    }

    pub fn done(mut self) -> Vec<u8> {
        self.writer.finish().expect("in memory");
        self.writer.into_inner().into_inner()
    }
}

/// When message `i` was taken: 10 ms apart from 100 s on.
pub const fn stamp(i: u32) -> i64 {
    100_000_000_000 + (i as i64) * 10_000_000
}

/// `count` joint states, a command and a reading for every tenth; log time is 1 s later than the header.
pub fn session(log: &mut Log, count: u32) {
    let joints = log.channel("/joints", "JointState");
    let command = log.channel("/command", "PoseStamped");
    let reading = log.channel("/reading", "PointStamped");
    for i in 0..count {
        let (ns, x) = (stamp(i), f64::from(i));
        let log_time = u64::try_from(ns).expect("positive") + 1_000_000_000;
        log.write(joints, log_time, &Cdr::stamped(ns).joints(&["a", "b"], &[x, -x]).done());
        if i % 10 == 0 {
            let pose = Cdr::stamped(ns).numbers(&[x, 1.0, 2.0, 0.0, 0.0, 0.0, 2.0]);
            log.write(command, log_time, &pose.done());
            log.write(reading, log_time, &Cdr::stamped(ns).numbers(&[3.0, x, 4.0]).done());
        }
    }
}

/// A whole log of [`session`].
pub fn session_log(compression: Option<Compression>, count: u32) -> Vec<u8> {
    let mut log = Log::new(compression);
    session(&mut log, count);
    log.done()
}

/// What the pipeline file of [`session`] says: rad, commands in m, readings in mm, header stamps.
pub fn mapping() -> Mapping {
    let time = TimeSource::Header;
    Mapping {
        controller: ControllerSettings {
            topic: "/joints".to_owned(),
            time,
            unit: AngleUnit::Rad,
            length_unit: None,
            fields: JointFields::default(),
        },
        commanded: Some(CommandedSettings {
            topic: "/command".to_owned(),
            time,
            unit: LengthUnit::M,
            fields: PoseFields::default(),
            frame: None,
        }),
        tracker: crate::made::tracker("/reading", time, LengthUnit::Mm),
        slides: Vec::new(),
        joints: vec!["a".to_owned(), "b".to_owned()],
    }
}

/// A folder of its own for one test.
pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    pub fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).expect("room in the temporary folder");
        path
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }
}

/// A session as it is read, with every sample in memory.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct WholeSession {
    pub joints: JointSamples,
    pub dwells: Stationary,
    pub commands: CommandSamples,
    pub readings: TargetReadings,
    pub others: Vec<TargetReadings>,
    /// Those of instruments of one length, each length as x.
    pub lengths: Vec<TargetReadings>,
    pub temperatures: TemperatureSamples,
    pub rejects: Vec<LogReject>,
    pub metadata: BTreeMap<String, String>,
    pub counts: BTreeMap<String, u64>,
}

/// Keeps the joint samples that it is given.
#[derive(Default)]
struct Collected {
    stamps_ns: Vec<i64>,
    angles: Vec<f64>,
}

impl JointSink for Collected {
    fn restart(&mut self) {
        *self = Self::default();
    }

    fn take(&mut self, stamps_ns: &[i64], angles: &[f64]) {
        let before = self.stamps_ns.len();
        assert!(before.is_multiple_of(ROW_GROUP_ROWS) && stamps_ns.len() <= ROW_GROUP_ROWS);
        self.stamps_ns.extend(stamps_ns);
        self.angles.extend(angles);
    }
}

/// Reads a session and collects what it is made of.
pub fn read_whole(
    logs: &SessionLogs,
    mapping: &Mapping,
    limits: Limits,
    progress: &dyn Progress,
) -> Result<WholeSession, LogError> {
    let (rule, mut collected) = (JoinSettings::default().arm_rule(), Collected::default());
    let read = read_session(logs, mapping, limits, &rule, &mut collected, progress)?;
    let SessionRead { input, rejects, metadata, counts } = read;
    let JoinInput {
        joints: dwells,
        commands,
        readings,
        temperatures,
        others,
        references: _,
        lengths,
    } = input;
    let mut angles = JointAngles::of(mapping.joints.len());
    angles.append(&collected.angles);
    let stamps = collected.stamps_ns.into_iter().map(Stamp::from_ns);
    Ok(WholeSession {
        joints: JointSamples { stamps: stamps.collect(), angles },
        dwells,
        commands: commands.read(0..commands.count()).expect("spilled before"),
        readings: readings.read(0..readings.count()).expect("spilled before"),
        others: others
            .iter()
            .map(|own| own.read(0..own.count()).expect("spilled before"))
            .collect(),
        lengths: lengths
            .iter()
            .map(|own| &own.readings)
            .map(|own| own.read(0..own.count()).expect("spilled before"))
            .collect(),
        temperatures,
        rejects,
        metadata,
        counts,
    })
}

/// Reads one log that holds both controller and tracker.
pub fn read(bytes: &[u8]) -> Result<WholeSession, LogError> {
    read_as(bytes, &mapping())
}

pub fn read_as(bytes: &[u8], mapping: &Mapping) -> Result<WholeSession, LogError> {
    let folder = Folder::new();
    let path = folder.file("log.mcap", bytes);
    let logs = SessionLogs::of_two(&path, &path);
    read_whole(&logs, mapping, Limits::default(), &Quiet)
}

pub fn read_file(path: &Path, limits: Limits) -> Result<WholeSession, LogError> {
    read_whole(&SessionLogs::of_two(path, path), &mapping(), limits, &Quiet)
}
