//! What integration tests share: the real recordings and their truth.

#![allow(dead_code, reason = "each test binary uses its own part")]

pub mod mapping;
pub mod pool;
pub mod trained;

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;
use std::sync::LazyLock;

use nalgebra::{Isometry3, Point3, Quaternion, UnitQuaternion, Vector3};
use posegrid::fit::commanded::{CommandFrames, commanded};
use posegrid::fit::full::FullSettings;
use posegrid::fit::{FitSettings, Noise, Observation, Source, TrackerUncertainty, Uncertainty};
use posegrid::grid::{self, GridSettings, Interpolation, Reach, Tolerance};
use posegrid::ingest::{
    AngleUnit, CommandedSettings, ControllerSettings, JointFields, LengthUnit, Mapping, PoseFields,
    Recording, TimeSource, TrackerSettings,
};
use posegrid::io::log::{Limits, SessionLogs, SessionRead, read_session};
use posegrid::io::log_writer::{TrackerLog, write_controller_log};
use posegrid::join::{
    Command, JoinSettings, MeanOrientation, MeanPoint, Pairing, Reading, ReadingKind, SourceId,
    Station, TargetId, Value, join,
};
use posegrid::judgement::{JoinedSession, StageSettings};
use posegrid::kinematics::{Arm, RobotFile};
use posegrid::progress::Quiet;
use posegrid::report::locate::Locate;
use posegrid::similarity::SimilaritySettings;
use posegrid::units::Stamp;

/// A laser tracker by its data sheet, and an arm that repeats to 0.03 mm.
pub static NOISE: LazyLock<Noise> = LazyLock::new(|| {
    Noise::of_one(
        Source {
            reads: ReadingKind::Point,
            uncertainty: TrackerUncertainty {
                range_um: 10.0,
                range_um_per_m: 0.3,
                transverse_um: 15.0,
                transverse_um_per_m: 6.0,
                divisor: 2.0,
                orientation_rad: None,
            }
            .into(),
        },
        0.03,
    )
});

/// States the standard uncertainty of a tracker's orientations, rad.
pub fn state_orientation(noise: &mut Noise, sd_rad: f64) {
    if let Uncertainty::Tracker(tracker) = &mut noise.sources[0].uncertainty {
        tracker.orientation_rad = Some(sd_rad);
    }
}

/// Where the target was measured, mm in the source's frame.
pub fn position(observation: &Observation) -> Point3<f64> {
    let point = observation.point().expect("the tracker reads positions");
    point.position
}

/// Grids of one step, of the error model's values, for targets in any orientation.
pub fn one_step(step_mm: f64) -> GridSettings {
    GridSettings {
        steps_mm: vec![step_mm],
        orientation_tolerance_deg: 180.0,
        interpolations: vec![Interpolation::Trilinear],
        sources: vec![grid::Source::Model],
        ..GridSettings::default()
    }
}

/// Settings of the stages as a test changes them: an arm on the floor, a fitted base, no commands, grids of one coarse step.
pub fn stage_settings(noise: Noise) -> StageSettings {
    StageSettings {
        noise,
        fit: FitSettings::default(),
        full: FullSettings::default(),
        up: Some(Vector3::z_axis()),
        flange_from_tool: None,
        base_from_command: Isometry3::identity(),
        base: None,
        target_is_tool: None,
        similarity: SimilaritySettings::default(),
        grid: one_step(250.0),
        tolerance: Tolerance { mm: 1.0, share: 0.95, confidence: 0.95 },
        locate: Locate::default(),
        leave_sessions_out: false,
        tool_tip: None,
    }
}

/// A file of the recordings that stand beside the project; `None`, said loudly, where they are absent.
///
/// On a CI machine their absence is a failure.
pub fn recording(path: &str) -> Option<PathBuf> {
    let file = PathBuf::from("../shared/recordings").join(path);
    if file.exists() {
        return Some(file);
    }
    assert!(
        std::env::var_os("CI").is_none(),
        "{} is absent: CI must have the recordings",
        file.display()
    );
    eprintln!("SKIPPED: {} is absent, so this test has shown nothing", file.display());
    None
}

/// A simulated recording as a session whose commands are of this tool, in the base frame.
pub fn joined(
    name: &str,
    arm: &Arm,
    recording: &Recording,
    flange_from_tool: Isometry3<f64>,
) -> JoinedSession {
    let read = read_back(arm, recording);
    let joined = join(&read.input, arm, &JoinSettings::default()).expect("a sound recording");
    let frames = CommandFrames {
        base_from_command: Isometry3::identity(),
        flange_from_tool: Some(flange_from_tool),
    };
    JoinedSession {
        name: name.to_owned(),
        log_rejects: read.rejects,
        counts: read.counts,
        commanded: commanded(&joined.stations, arm, &frames),
        sampling_plan: None,
        set_up: None,
        stated_sizes: Vec::new(),
        driven_by: None,
        joined,
    }
}

/// A simulated recording, written into logs and read from them.
pub fn read_back(arm: &Arm, recording: &Recording) -> SessionRead {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [controller, tracker] =
        ["controller.mcap", "tracker.mcap"].map(|log| folder.path().join(log));
    let create = |path| BufWriter::new(File::create(path).expect("a temporary folder"));
    let joints: Vec<&str> = arm.joints().iter().map(|joint| joint.name.as_str()).collect();
    let nothing = BTreeMap::new();
    write_controller_log(create(&controller), recording, &joints, &nothing).expect("room");
    let (readings, temperatures) = (&recording.readings, &recording.temperatures);
    let log = TrackerLog { readings, targets: &[], references: &[], temperatures, lengths: &[] };
    log.write(create(&tracker), &nothing).expect("room");
    let mut mapping = mapping(arm);
    if recording.readings.orientations.is_none() {
        "/tracker/point".clone_into(&mut mapping.tracker.topic);
    }
    if recording.readings.covariances.is_some() {
        "/tracker/pose_with_covariance".clone_into(&mut mapping.tracker.topic);
        mapping.tracker.ignore_orientation = recording.readings.orientations.is_none();
    }
    read(&SessionLogs::of_two(&controller, &tracker), &mapping)
}

/// The nominal arm of a robot file.
pub fn arm(name: &str) -> Arm {
    let path = format!("pipelines/robots/{name}.toml");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
    toml::from_str::<RobotFile>(&text)
        .unwrap_or_else(|e| panic!("{path}: {e}"))
        .arm()
        .expect("a valid arm")
}

/// The measured values that a recording was made from, as stations: the truth of its join.
pub fn truth_stations(session: &str) -> Option<Vec<Station>> {
    let path = recording(&format!("{session}/stations.csv"))?;
    let mut reader = csv::Reader::from_path(path).expect("a readable CSV file");
    let rows = reader.records().map(|row| row.expect("a row"));
    Some(rows.map(|row| truth_station(&row)).collect())
}

fn truth_station(row: &csv::StringRecord) -> Station {
    let number = |column: usize| row[column].parse::<f64>().ok().filter(|value| value.is_finite());
    let need = |column: usize| number(column).expect("a number");
    let reading = number(7).map(|x| Reading {
        source: SourceId::ONLY,
        target: TargetId::ONLY,
        value: Value::Pose(
            MeanPoint {
                position: Point3::new(x, need(8), need(9)),
                scatter_mm: [0.0; 3],
                stated_covariance: None,
                motion_covariance: None,
            },
            MeanOrientation {
                orientation: UnitQuaternion::from_quaternion(Quaternion::new(
                    need(13),
                    need(10),
                    need(11),
                    need(12),
                )),
                scatter_rad: 0.0,
                stated_covariance: None,
            },
        ),
        kept: 20,
        taken: 20,
        first: Stamp::from_ns(0),
        last: Stamp::from_ns(0),
        temperature_c: number(17),
    });
    Station {
        number: row[0].parse().expect("a station number"),
        start: Stamp::from_ns(0),
        end: Stamp::from_ns(0),
        joints: (1..7).map(need).collect(),
        joint_samples: 50,
        command: Some(Command {
            position: Point3::new(need(14), need(15), need(16)),
            orientation: None,
        }),
        pairing: if reading.is_some() {
            Pairing::Paired
        } else {
            Pairing::Unmeasured(posegrid::join::Unmeasured::NoReadings)
        },
        readings: reading.into_iter().collect(),
    }
}

/// The arm configurations that stations are in, in order.
pub fn configurations(
    arm: &Arm,
    flange_from_tool: Isometry3<f64>,
    stations: &[Station],
) -> Vec<String> {
    let reach = Reach::new(arm, flange_from_tool);
    let own = stations.iter().filter_map(|s| reach.configuration(&s.joints));
    let all: BTreeSet<_> = own.collect();
    all.iter().map(ToString::to_string).collect()
}

/// A recording read from its two logs; `None`, said loudly, where it is absent.
pub fn session(name: &str, arm: &Arm) -> Option<SessionRead> {
    Some(read(&logs(name)?, &mapping(arm)))
}

pub fn read(logs: &SessionLogs, mapping: &Mapping) -> SessionRead {
    let (rule, limits) = (JoinSettings::default().arm_rule(), Limits::default());
    let read = read_session(logs, mapping, limits, &rule, &mut (), &Quiet);
    read.expect("a sound recording")
}

/// The two logs of a recording; `None`, said loudly, where they are absent.
pub fn logs(name: &str) -> Option<SessionLogs> {
    let log = |side: &str| recording(&format!("{name}/{side}.mcap"));
    Some(SessionLogs::of_two(&log("controller")?, &log("tracker")?))
}

/// How the recordings are read.
pub fn mapping(arm: &Arm) -> Mapping {
    Mapping {
        controller: ControllerSettings {
            topic: "/joint_states".to_owned(),
            time: TimeSource::Header,
            unit: AngleUnit::Rad,
            length_unit: None,
            fields: JointFields::default(),
        },
        commanded: Some(CommandedSettings {
            topic: "/commanded_pose".to_owned(),
            time: TimeSource::Header,
            unit: LengthUnit::M,
            fields: PoseFields::default(),
            frame: None,
        }),
        tracker: TrackerSettings {
            temperature: Some("/tracker/temperature".to_owned()),
            ..mapping::tracker("/tracker/pose", TimeSource::Header, LengthUnit::M)
        },
        slides: Vec::new(),
        joints: arm.joints().iter().map(|joint| joint.name.clone()).collect(),
    }
}
