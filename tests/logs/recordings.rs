//! Real recordings, against values that `mcap` 1.6.0 + `mcap-ros2-support` 0.6.0 (Python) read from them.

use std::path::{Path, PathBuf};

use posegrid::ingest::{
    AngleUnit, CommandedSettings, ControllerSettings, JointFields, LengthUnit, Mapping, PoseFields,
    TimeSource, TrackerSettings,
};
use posegrid::io::log::{Limits, SessionLogs};
use posegrid::progress::Quiet;

use crate::build::{WholeSession, read_whole};

/// The folder of a recording; `None` where it is not there, which must not happen in CI.
pub fn recording(name: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/recordings").join(name);
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("NOT TESTED: the recording {} is not there", folder.display());
    assert!(std::env::var_os("CI").is_none(), "recordings must be there in CI");
    None
}

pub fn mapping(time: TimeSource) -> Mapping {
    let joints = ["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"];
    Mapping {
        controller: ControllerSettings {
            topic: "/joint_states".to_owned(),
            time,
            unit: AngleUnit::Rad,
            length_unit: None,
            fields: JointFields::default(),
        },
        commanded: Some(CommandedSettings {
            topic: "/commanded_pose".to_owned(),
            time,
            unit: LengthUnit::M,
            fields: PoseFields::default(),
            frame: None,
        }),
        tracker: TrackerSettings {
            temperature: Some("/tracker/temperature".to_owned()),
            ..crate::made::tracker("/tracker/pose", time, LengthUnit::M)
        },
        slides: Vec::new(),
        joints: joints.map(|joint| format!("{joint}_joint")).to_vec(),
    }
}

fn read(folder: &Path, time: TimeSource) -> WholeSession {
    let (controller, tracker) = (folder.join("controller.mcap"), folder.join("tracker.mcap"));
    let logs = SessionLogs::of_two(&controller, &tracker);
    read_whole(&logs, &mapping(time), Limits::default(), &Quiet).expect("a sound recording")
}

fn near(found: f64, expected: f64) -> bool {
    (found - expected).abs() <= 1e-12 * expected.abs()
}

#[test]
fn random_a_agrees_with_an_independent_reader() {
    let Some(folder) = recording("ur10-random-a") else {
        return;
    };
    let found = read(&folder, TimeSource::Header);
    assert_eq!(found.rejects, []);
    assert_eq!(found.joints.stamps.len(), 63_050);
    assert_eq!(found.commands.stamps.len(), 700);
    assert_eq!(found.readings.stamps.len(), 25_184);
    assert_eq!(found.temperatures.stamps.len(), 700);
    // The 500th message of each topic.
    let i = 499;
    assert_eq!(found.joints.stamps[i].ns(), 1_605_000_009_980_000_000);
    let angles = [
        -4.220_319_928_150_027,
        -2.801_169_983_546_423_7,
        1.720_540_112_719_339_2,
        -2.022_470_054_632_999_2,
        0.567_164_259_621_911_9,
        -0.025_525_970_381_697_845,
    ];
    for (found, angle) in found.joints.angles.row(i).iter().zip(angles) {
        assert!(near(*found, angle), "{found} {angle}");
    }
    assert_eq!(found.commands.stamps[i].ns(), 1_605_000_899_000_000_000);
    // m → mm
    for (found, expected) in found.commands.positions[i].iter().zip([-259.057, -424.643, 863.592]) {
        assert!(near(*found, expected));
    }
    assert_eq!(found.readings.stamps[i].ns(), 1_605_000_063_232_309_000);
    let expected = [196.103_424_403_792_8, -2_917.283_114_714_932, -123.786_717_360_878_05];
    for (found, expected) in found.readings.positions[i].iter().zip(expected) {
        assert!(near(*found, expected));
    }
    let orientations = found.readings.orientations.as_ref().expect("a 6-DoF target");
    let expected =
        [-0.467_883_963_210_061_8, -0.559_413_924_875_536, -0.432_511_066_966_864, 0.530_165_4];
    for (found, expected) in orientations[i].iter().zip(expected) {
        assert!((found - expected).abs() < 1e-6);
    }
    assert_eq!(found.temperatures.stamps[i].ns(), 1_605_000_937_442_799_400);
    assert!((found.temperatures.celsius[i] - 21.680_000_31).abs() < 1e-12);
    assert_eq!(found.metadata["session.robot"], "ur10-ipa");
    assert_eq!(found.metadata["session.session"], "2020-11-random-a");
    assert_eq!(found.counts["joints.messages"], 63_050);
    assert_eq!(found.counts["joints.kept"], 63_050);
}

#[test]
fn the_time_source_is_the_one_named() {
    let Some(folder) = recording("ur10-random-a") else {
        return;
    };
    // First joint state: log time is 0.2 ms after header and publish time.
    let first = |time| read(&folder, time).joints.stamps[0].ns();
    assert_eq!(first(TimeSource::Header), 1_605_000_000_000_000_000);
    assert_eq!(first(TimeSource::Publish), 1_605_000_000_000_000_000);
    assert_eq!(first(TimeSource::Log), 1_605_000_000_000_200_000);
}

#[test]
fn every_recording_is_read_whole() {
    for (name, commands) in [("ur10-grid", 615), ("ur10-random-b", 700), ("ur10-joint", 1495)] {
        let Some(folder) = recording(name) else {
            return;
        };
        let found = read(&folder, TimeSource::Header);
        assert_eq!(found.rejects, [], "{name}");
        assert_eq!(found.commands.stamps.len(), commands, "{name}");
        assert!(found.joints.stamps.is_sorted() && found.readings.stamps.is_sorted());
    }
}
