//! A small reader of the real recordings for tests of the join alone; a missing recording fails in CI.

use std::path::{Path, PathBuf};

use posegrid::ingest::Recording;
use posegrid::kinematics::{Arm, RobotFile};
use posegrid::units::Stamp;

/// The nominal UR10 of the project.
pub fn ur10() -> Arm {
    toml::from_str::<RobotFile>(include_str!("../../pipelines/robots/ur10.toml"))
        .expect("a robot file of the project")
        .arm()
        .expect("an arm")
}

/// The folder of a recording, or nothing (said loudly) where the recordings are not there.
pub fn folder(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../shared/recordings")
        .join(name);
    if path.is_dir() {
        return Some(path);
    }
    assert!(
        std::env::var_os("CI").is_none(),
        "{} is missing in CI",
        path.display()
    );
    eprintln!("SKIPPED: {} is missing; nothing was tested", path.display());
    None
}

/// Both logs of a recording.
pub fn recording(folder: &Path) -> Recording {
    let mut recording = Recording::default();
    recording.joints.angles = vec![Vec::new(); 6];
    recording.commands.orientations = Some(Vec::new());
    recording.readings.orientations = Some(Vec::new());
    for file in ["controller.mcap", "tracker.mcap"] {
        let bytes = std::fs::read(folder.join(file)).expect("readable");
        for message in mcap::MessageStream::new(&bytes).expect("an MCAP file") {
            let message = message.expect("a whole message");
            take(&mut recording, &message.channel.topic, &message.data);
        }
    }
    recording
}

fn take(recording: &mut Recording, topic: &str, data: &[u8]) {
    let mut cdr = Cdr {
        data: &data[4..],
        at: 0,
    };
    let stamp_ns = cdr.stamp_ns();
    match topic {
        "/joint_states" => {
            let names = cdr.u32();
            (0..names).for_each(|_| cdr.skip_string());
            let angles = cdr.u32();
            assert_eq!((names, angles), (6, 6));
            recording.joints.stamps.push(Stamp::from_ns(stamp_ns));
            recording
                .joints
                .angles
                .iter_mut()
                .for_each(|column| column.push(cdr.f64()));
        }
        "/commanded_pose" => {
            let (position, orientation) = cdr.pose();
            recording.commands.stamps.push(Stamp::from_ns(stamp_ns));
            recording.commands.positions.push(position);
            recording
                .commands
                .orientations
                .get_or_insert_default()
                .push(orientation);
        }
        "/tracker/pose" => {
            let (position, orientation) = cdr.pose();
            recording.readings.stamps.push(Stamp::from_ns(stamp_ns));
            recording.readings.positions.push(position);
            recording
                .readings
                .orientations
                .get_or_insert_default()
                .push(orientation);
        }
        "/tracker/temperature" => {
            recording.temperatures.stamps.push(Stamp::from_ns(stamp_ns));
            recording.temperatures.celsius.push(cdr.f64());
        }
        other => panic!("unexpected topic {other}"),
    }
}

struct Cdr<'a> {
    data: &'a [u8],
    at: usize,
}

impl Cdr<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        self.at = self.at.next_multiple_of(N);
        self.at += N;
        self.data[self.at - N..self.at].try_into().expect("N bytes")
    }

    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.bytes())
    }

    fn f64(&mut self) -> f64 {
        f64::from_le_bytes(self.bytes())
    }

    fn skip_string(&mut self) {
        let length = self.u32();
        self.at += length as usize;
    }

    fn stamp_ns(&mut self) -> i64 {
        let stamp_ns = i64::from(self.u32()) * 1_000_000_000 + i64::from(self.u32());
        self.skip_string();
        stamp_ns
    }

    fn pose(&mut self) -> ([f64; 3], [f64; 4]) {
        let position = std::array::from_fn(|_| self.f64() * 1000.0);
        (position, std::array::from_fn(|_| self.f64()))
    }
}
