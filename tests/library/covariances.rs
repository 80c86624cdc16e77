//! Readings that state their own covariances: points of a structured light scanner and poses with all 36 numbers, from logs and tables to
//! the fit, and the size of what they state.
//!
//! The picture is a stationary camera with a laser line or fringe projector that sees the tool: what is measured is points in the camera's
//! frame, with a noise that is long along the line of sight and grows with the square of the distance.

use crate::common;

use std::fmt::Write as _;
use std::fs;
use std::process::Command;

use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix3, Matrix6, Quaternion, UnitQuaternion, Vector3,
};
use posegrid::fit::full::FullSettings;
use posegrid::fit::{
    self, CameraUncertainty, ErrorBase, FitSettings, Measured, Mounted, Noise, Source,
    TrackerUncertainty,
};
use posegrid::geometry::PoseCovariance;
use posegrid::ingest::{Recording, TargetReadings};
use posegrid::io::tables::readings;
use posegrid::join::{ReadingKind, Station};
use posegrid::judgement::{JoinedSession, Outcome, StageSettings};
use posegrid::kinematics::Arm;
use posegrid::report::{Angles, Model, Split};
use posegrid::simulate::settings::TrackerErrors;
use posegrid::simulate::{Poses, SimulateSettings, simulate};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const HOME_DEG: [f64; 6] = [0.0, -75.0, 100.0, 25.0, 55.0, -15.0];
const TOOL_MM: [f64; 3] = [25.0, -40.0, 100.0];
/// Readings closer than this to the one before are of one dwell, mm.
const STILL_MM: f64 = 0.02;
/// Share of dwells that the scanner misses.
const MISSED: f64 = 0.04;
/// Noise of one sample beside that of its dwell, mm.
const JITTER_MM: f64 = 0.003;

fn tool() -> Isometry3<f64> {
    posegrid::geometry::isometry_from_rpy(TOOL_MM, [0.0; 3])
}

fn arm() -> Arm {
    common::arm("kr210-r2700-extra")
}

/// A session of the arm that `arm_seed` draws, with every error that arms have, read without noise.
fn exact(arm: &Arm, seed: u64, count: usize, six_dof: bool) -> Recording {
    let home: Vec<f64> = HOME_DEG.map(f64::to_radians).to_vec();
    let poses = Poses::Joints {
        count,
        lower: home.iter().map(|q| q - 0.6).collect(),
        upper: home.iter().map(|q| q + 0.6).collect(),
    };
    let mut settings = SimulateSettings::realistic(seed, home, poses);
    settings.arm_seed = Some(7);
    settings.cell.six_dof = six_dof;
    settings.cell.target_sd_mm = 0.0;
    settings.cell.base_drift_mm = 0.0;
    settings.tracker = TrackerErrors::none();
    simulate(arm, &settings).expect("in reach").recording
}

/// Standard normal numbers.
struct Draw(ChaCha8Rng);

impl Draw {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn normal(&mut self) -> f64 {
        let (u, v): (f64, f64) = (self.0.random_range(1e-12..1.0), self.0.random_range(0.0..1.0));
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }

    /// A vector with this covariance.
    fn of(&mut self, covariance: &DMatrix<f64>) -> DVector<f64> {
        let root = covariance.clone().cholesky().expect("positive").l();
        root * DVector::from_fn(covariance.nrows(), |_, _| self.normal())
    }
}

/// The covariance of a scanned point in the scanner's frame, mm²: 0.02 mm across the line of sight at one metre, in proportion to the
/// distance, and 0.1 mm along it, with its square.
fn of_scan(point: &Vector3<f64>) -> Matrix3<f64> {
    let (ray, far) = (point.normalize(), point.norm() / 1000.0);
    let along = ray * ray.transpose();
    along * (0.1 * far * far).powi(2) + (Matrix3::identity() - along) * (0.02 * far).powi(2)
}

/// What an instrument states of a pose, and how it is wrong: factors on the standard deviations of positions and of orientations.
struct Instrument<'i> {
    states: &'i dyn Fn(&Isometry3<f64>) -> Matrix6<f64>,
    wrong_by: [f64; 2],
    seed: u64,
}

/// The recording as an instrument reads it: its noise is that of the dwell, hardly that of a sample, and some dwells are missed.
fn read_by(exact: &Recording, instrument: &Instrument<'_>) -> Recording {
    let mut draw = Draw::new(instrument.seed);
    let mut recording = exact.clone();
    let seen = &exact.readings;
    let own = &mut recording.readings;
    let mut stated = Vec::new();
    let (mut off, mut is_missed) = (DVector::zeros(6), false);
    for row in 0..seen.stamps.len() {
        let at = Vector3::from(seen.positions[row]);
        let before = row.checked_sub(1).map(|row| Vector3::from(seen.positions[row]));
        let turn = seen.orientations.as_ref().map_or_else(UnitQuaternion::identity, |all| {
            let [x, y, z, w] = all[row];
            UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
        });
        let covariance = (instrument.states)(&Isometry3::from_parts(at.into(), turn));
        if before.is_none_or(|before| (at - before).norm() > STILL_MM) {
            let of = |place: usize| instrument.wrong_by[place / 3];
            let covariance = DMatrix::from_fn(6, 6, |i, j| of(i) * of(j) * covariance[(i, j)]);
            off = draw.of(&covariance);
            is_missed = draw.0.random_range(0.0..1.0) < MISSED;
        }
        let jitter = Vector3::from_fn(|_, _| JITTER_MM * draw.normal());
        let shift = Vector3::new(off[0], off[1], off[2]) + jitter;
        own.positions[row] = if is_missed { [0.0; 3] } else { (at + shift).into() };
        if let Some(all) = &mut own.orientations {
            let by = UnitQuaternion::from_scaled_axis(Vector3::new(off[3], off[4], off[5]));
            all[row] = (by * turn).coords.into();
        }
        let has_turn = own.orientations.is_some();
        let whole = PoseCovariance::of(&covariance);
        stated.push(PoseCovariance { turn: whole.turn.filter(|_| has_turn), ..whole });
    }
    own.covariances = Some(stated);
    recording
}

fn scanned(exact: &Recording, wrong_by: f64, seed: u64) -> Recording {
    let states = |pose: &Isometry3<f64>| {
        let mut whole = Matrix6::identity() * 1e-8;
        let position = of_scan(&pose.translation.vector);
        whole.fixed_view_mut::<3, 3>(0, 0).copy_from(&position);
        whole
    };
    let instrument = Instrument { states: &states, wrong_by: [wrong_by; 2], seed };
    read_by(exact, &instrument)
}

/// What a camera states of a board that it sees: position and tilt are correlated.
fn of_board(pose: &Isometry3<f64>) -> Matrix6<f64> {
    let camera = CameraUncertainty {
        focal_px: 4000.0,
        noise_px: 0.05,
        target_mm: 240.0,
        corners: 4,
        looks_along: None,
        mounted: Mounted::Fixed,
        size: 1.0,
    };
    camera.of_pose(pose)
}

/// An instrument whose own statement is a poor one, for readings without a covariance.
fn noise(reads: ReadingKind) -> Noise {
    let uncertainty = TrackerUncertainty {
        range_um: 500.0,
        range_um_per_m: 0.0,
        transverse_um: 500.0,
        transverse_um_per_m: 0.0,
        divisor: 1.0,
        orientation_rad: Some(2e-3),
    };
    Noise::of_one(Source { reads, uncertainty: uncertainty.into() }, 0.02)
}

fn settings(reads: ReadingKind, full: bool) -> StageSettings {
    StageSettings {
        fit: FitSettings { orientations: reads == ReadingKind::Pose, ..FitSettings::default() },
        full: FullSettings {
            harmonics: 4,
            gear_lines: false,
            enabled: full,
            ..FullSettings::default()
        },
        flange_from_tool: Some(tool()),
        base: Some(ErrorBase::Fitted),
        target_is_tool: Some(true),
        ..common::stage_settings(noise(reads))
    }
}

fn outcome<'a>(
    arm: &'a Arm,
    training: &JoinedSession,
    test: Option<&JoinedSession>,
    settings: &StageSettings,
) -> Outcome<'a> {
    let test = test.into_iter().cloned().collect();
    crate::judged(arm, vec![training.clone()], test, settings).expect("a sound session")
}

fn joined(arm: &Arm, recording: &Recording) -> JoinedSession {
    common::joined("monday", arm, recording, tool())
}

/// Share of held-out stations inside their 95 % ellipsoids by the full error model and their number, and the mean error, mm.
fn held_out(outcome: &Outcome<'_>) -> (f64, usize, f64) {
    let own = outcome.accuracy.iter().find(|own| {
        let subject = &own.subject;
        (subject.model, subject.split, subject.angles)
            == (Model::Full, Split::Blocks, Angles::Weighted)
    });
    let own = own.expect("held-out blocks");
    let inside = own.coverage.expect("a covariance").inside;
    let figures = own.figures.as_ref().expect("stations");
    (inside, own.counted.visits, figures.mean)
}

#[test]
fn the_size_of_what_a_scanner_states_is_found_from_its_log() {
    let arm = arm();
    let mut off = Vec::new();
    for seed in 1..=5 {
        let exact = exact(&arm, 20 + seed, 120, false);
        let session = joined(&arm, &scanned(&exact, 3.0, seed));
        let found = outcome(&arm, &session, None, &settings(ReadingKind::Point, false));
        let [own] = &found.stated_sizes[..] else { panic!("{:?}", found.stated_sizes) };
        println!(
            "{} readings: size {:.3} ± {:.3}, beside {:.3} mm",
            own.readings, own.size.position, own.standard_error.position, own.beside_mm
        );
        off.push((own.size.position - 3.0) / own.standard_error.position);
        // Missed dwells are stations without a measurement, and their readings are counted.
        assert!(own.readings < 120 && own.readings > 100);
        assert!(session.joined.counts.missing > 0);
        let read = session.counts["readings.position_covariances"];
        assert_eq!(session.counts["readings.kept"], read);
        assert_eq!(found.training[0].stated_sizes, [own.size]);
    }
    assert!(off.iter().all(|own: &f64| own.abs() < 3.5), "{off:?}");
    let squares: f64 = off.iter().map(|own| own * own).sum();
    assert!(squares / (off.len() as f64) < 2.5, "{off:?}");
}

#[test]
fn intervals_hold_where_what_is_stated_is_wrong_by_three_either_way() {
    let arm = arm();
    let of_full = settings(ReadingKind::Point, true);
    for wrong_by in [1.0_f64, 3.0, 1.0 / 3.0] {
        let (mut inside, mut all, mut means) = (0.0, 0, Vec::new());
        for seed in 1..=2 {
            // The noise is the same in all: what is stated of it differs.
            let exact = exact(&arm, 30 + seed, 120, false);
            let mut recording = scanned(&exact, 2.0, seed);
            let stated = recording.readings.covariances.as_mut().expect("stated");
            let by = (2.0 / wrong_by).powi(2);
            for own in stated {
                own.position = own.position.map(|own| own.map(|entry| by * entry));
            }
            let found = outcome(&arm, &joined(&arm, &recording), None, &of_full);
            let (share, count, mean) = held_out(&found);
            inside += share * count as f64;
            all += count;
            means.push(mean);
        }
        let share = inside / f64::from(u32::try_from(all).expect("few"));
        println!(
            "wrong by {wrong_by:.2}: {:.1} % of {all} inside, means {means:.4?} mm",
            100.0 * share
        );
        // 0.95 within three standard deviations of a share of 230.
        assert!((0.905..=0.993).contains(&share), "{wrong_by}: {share}");
    }
}

#[test]
fn a_session_that_judges_has_the_size_of_those_that_train() {
    let arm = arm();
    let monday = joined(&arm, &scanned(&exact(&arm, 41, 120, false), 3.0, 1));
    let tuesday = JoinedSession {
        name: "tuesday".to_owned(),
        ..joined(&arm, &scanned(&exact(&arm, 42, 60, false), 3.0, 2))
    };
    let settings = settings(ReadingKind::Point, false);
    let found = outcome(&arm, &monday, Some(&tuesday), &settings);
    let [own, judge] = [&found.training[0], &found.test[0]].map(|own| own.stated_sizes[0].position);
    assert!((judge / own - 1.0).abs() < 1e-12, "{own} {judge}");
    assert!((judge - 3.0).abs() < 0.6, "{judge}");
}

#[test]
fn poses_of_a_log_state_all_their_numbers_whole() {
    let arm = arm();
    let exact = exact(&arm, 51, 110, true);
    let instrument = Instrument { states: &of_board, wrong_by: [3.0, 0.5], seed: 4 };
    let mut recording = read_by(&exact, &instrument);
    // A few messages do not know their covariance, or state none that is one.
    let all = recording.readings.covariances.as_mut().expect("stated");
    let known = all[40];
    for row in [10, 20, 30] {
        all[row] = PoseCovariance::default();
    }
    let mut wrong = known.turn.expect("stated");
    wrong.own[0] = -wrong.own[0];
    all[40].turn = Some(wrong);
    let session = joined(&arm, &recording);
    let counts = &session.counts;
    assert_eq!(counts["readings.position_covariances_all_zero"], 3);
    assert_eq!(counts["readings.orientation_covariances_all_zero"], 3);
    assert_eq!(counts["readings.orientation_covariances_not_positive"], 1);
    assert_eq!(counts["readings.orientation_covariances_minus_one"], 0);

    // Each station has the mean of what its readings state, and the fit has it whole, with the variance of the mean in its shape.
    let stations = &session.joined.stations;
    let seen = fit::observations(0, stations, &arm, &noise(ReadingKind::Pose));
    let mut checked = 0;
    for station in stations.iter().filter(|own| own.one_reading().is_some()) {
        let (expected, larger) = expected(station, &recording.readings);
        let own = seen.iter().find(|own| own.station == station.number);
        let own = own.expect("observed").measured.instrument();
        assert_eq!(own.nrows(), 6);
        for (row, column) in (0..6).flat_map(|row| (0..6).map(move |column| (row, column))) {
            let by = (larger[row / 3] * larger[column / 3]).sqrt();
            let size = (expected[(row, row)] * expected[(column, column)]).sqrt();
            let off = own[(row, column)] - by * expected[(row, column)];
            assert!(off.abs() < 1e-6 * size, "{row} {column} {off}");
        }
        checked += 1;
    }
    assert!(checked > 90, "{checked}");

    // What is stored of the readings is what they are, to the last bit.
    let restored = readings::stations(&readings::rows(stations)).expect("whole");
    assert_eq!(&restored, stations);

    // Positions and orientations are wrong by factors of their own.
    let found = outcome(&arm, &session, None, &settings(ReadingKind::Pose, false));
    let [own] = &found.stated_sizes[..] else { panic!("{:?}", found.stated_sizes) };
    println!("{own:?}");
    assert!(own.is_apart);
    let (size, error) = (own.size, own.standard_error);
    assert!((size.position - 3.0).abs() < 3.5 * error.position, "{own:?}");
    // The arm turns a little itself, which counts to the orientations.
    assert!((0.45..0.75).contains(&size.orientation), "{own:?}");
    let kinds = found.training[0].joined.stations.iter();
    let of_fit =
        fit::observations(0, &kinds.cloned().collect::<Vec<_>>(), &arm, &noise(ReadingKind::Pose));
    assert!(of_fit.iter().all(|own| matches!(own.measured, Measured::Pose(..))));
}

/// Mean covariance of the readings between a station's first and last one kept, and the factors on the variances of position and
/// orientation that add, over the three axes, the variance of their mean by their scatter.
fn expected(station: &Station, readings: &TargetReadings) -> (Matrix6<f64>, [f64; 2]) {
    let own = station.one_reading().expect("paired");
    let (point, turn) = (own.value.point().expect("a pose"), own.value.turn().expect("a pose"));
    let rows: Vec<usize> = (0..readings.stamps.len())
        .filter(|&row| (own.first..=own.last).contains(&readings.stamps[row]))
        .filter(|&row| readings.positions[row].iter().any(|x| *x != 0.0))
        .collect();
    let stated = readings.covariances.as_ref().expect("stated");
    // One that is none does not count.
    let whole = rows.iter().filter_map(|&row| stated[row].whole());
    let whole = whole.filter(|own| own.cholesky().is_some());
    let (sum, count) = whole.fold((Matrix6::zeros(), 0.0), |(sum, n), own| (sum + own, n + 1.0));
    let mean = sum / count;
    let kept = own.kept as f64;
    let variances = |from: usize| (from..from + 3).map(|axis| mean[(axis, axis)]).sum::<f64>();
    let moved = point.scatter_mm.iter().map(|own| own * own).sum::<f64>() / kept;
    let turned = 3.0 * turn.scatter_rad.powi(2) / kept;
    (mean, [1.0 + moved / variances(0), 1.0 + turned / variances(3)])
}

/// A session as a table: joints, the point and the six numbers of its covariance.
fn table(session: &JoinedSession) -> String {
    let mut text = "q1,q2,q3,q4,q5,q6,x,y,z,xx,xy,xz,yy,yz,zz\n".to_owned();
    let stations = session.joined.stations.iter();
    let read = stations.filter_map(|station| Some((station, station.one_reading()?)));
    for (place, (station, own)) in read.enumerate() {
        let point = own.value.point().expect("a position");
        let mut stated = point.stated_covariance.expect("stated");
        match place {
            3 => stated = [0.0; 6],
            5 => stated[0] = -1.0,
            7 => stated[3] = -stated[3],
            _ => {}
        }
        let joints = station.joints.iter().copied();
        let numbers = joints.chain(point.position.coords.iter().copied()).chain(stated);
        let numbers: Vec<String> = numbers.map(|number| format!("{number:.12}")).collect();
        writeln!(text, "{}", numbers.join(",")).expect("a string");
    }
    text
}

#[test]
fn a_table_of_scanned_points_runs_from_end_to_end() {
    let arm = arm();
    let session = joined(&arm, &scanned(&exact(&arm, 61, 130, false), 3.0, 3));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = |name: &str| folder.path().join(name);
    let robot = "pipelines/robots/kr210-r2700-extra.toml";
    fs::copy(robot, path("robot.toml")).expect("copied");
    fs::create_dir_all(path("sessions/monday")).expect("writable");
    fs::write(path("sessions/monday/scan.csv"), table(&session)).expect("writable");
    let pipeline = r#"[robot]
file = "robot.toml"
name = "scanned"
[input]
folder = "sessions"
stations = "scan.csv"
[stations]
joints = ["q1", "q2", "q3", "q4", "q5", "q6"]
joint_unit = "rad"
[stations.measured]
position = ["x", "y", "z"]
unit = "mm"
covariance = ["xx", "xy", "xz", "yy", "yz", "zz"]
[tracker]
# For readings whose own covariance is none: what the scanner really does at three metres.
uncertainty = { range_um = 2700, range_um_per_m = 0, transverse_um = 180, transverse_um_per_m = 0, divisor = 1 }
[fit.full]
enabled = false
[grid]
steps_mm = [300]
[tolerance]
mm = 2
share = 0.95
confidence = 0.95
[output]
lake = "lake"
"#;
    fs::write(path("scan.toml"), pipeline).expect("writable");
    let mut command = Command::new(env!("CARGO_BIN_EXE_posegrid"));
    let output = command
        .args(["run", "scan.toml", "--verbose"])
        .current_dir(folder.path())
        .output()
        .expect("it runs");
    let results = String::from_utf8_lossy(&output.stdout).into_owned();
    let messages = String::from_utf8_lossy(&output.stderr).into_owned();
    println!("{results}{messages}");
    assert!(matches!(output.status.code(), Some(0 | 3)), "{messages}");
    let line = results.lines().find(|line| line.contains("times what they state"));
    let line = line.expect("the size of what is stated");
    let size = line.split(" is ").nth(1).and_then(|rest| rest.split(' ').next());
    let size: f64 = size.and_then(|size| size.parse().ok()).expect("a number");
    assert!((size - 3.0).abs() < 0.7, "{line}");
    // Three covariances that are none are counted by their reason, and published.
    let mut runs = Vec::new();
    collect(&path("lake/runs"), &mut runs);
    let run = fs::File::open(&runs[0]).expect("a run");
    let reader = parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder::try_new(run);
    let batch = reader.expect("a table").build().expect("a table").next();
    let batch = batch.expect("a row").expect("a row");
    let counts = batch.column_by_name("counts").expect("counts");
    let counts = arrow::util::display::array_value_to_string(counts, 0).expect("text");
    println!("{counts}");
    for reason in ["all_zero", "first_entry_minus_one", "not_positive_semidefinite"] {
        assert!(counts.contains(reason), "{reason}: {counts}");
    }
}

fn collect(folder: &std::path::Path, files: &mut Vec<std::path::PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            collect(&path, files);
        } else {
            files.push(path);
        }
    }
}
