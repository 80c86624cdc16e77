//! A camera as the instrument: its noise as a model, flipped views of a planar target, and a camera on the flange.
//!
//! Views are made independently of the model: corners of a board are seen with pixel noise, and a pose is fitted to them by numerical
//! derivatives.

use crate::common;

use std::fmt::Write as _;
use std::fs;
use std::process::Command;

use nalgebra::{DMatrix, DVector, Isometry3, Point3, Rotation3, UnitQuaternion, Vector3, Vector6};
use posegrid::fit::full::FullSettings;
use posegrid::fit::problem::{Prior, Problem};
use posegrid::fit::{
    self, Calibration, CameraUncertainty, ErrorBase, FitSettings, Freedom, Mounted, Noise, Source,
    TrackerUncertainty,
};
use posegrid::join::{
    JoinReject, MeanOrientation, MeanPoint, Pairing, ReadingKind, Station, Unmeasured, Value,
};
use posegrid::judgement::{JoinedSession, Outcome, StageSettings};
use posegrid::kinematics::Arm;
use posegrid::simulate::settings::{GeometryErrors, JointErrors, TrackerErrors};
use posegrid::simulate::{Poses, SimulateSettings, Simulated, simulate};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const HOME_DEG: [f64; 6] = [0.0, -75.0, 100.0, 25.0, 55.0, -15.0];
const TOOL_MM: [f64; 3] = [25.0, -40.0, 100.0];
/// The camera and the board as they are; the noise is stated smaller than it is.
const FOCAL_PX: f64 = 1500.0;
const TRUE_NOISE_PX: f64 = 0.3;
const STATED_NOISE_PX: f64 = 0.2;
const BOARD_MM: f64 = 240.0;

const CAMERA: CameraUncertainty = CameraUncertainty {
    focal_px: FOCAL_PX,
    noise_px: STATED_NOISE_PX,
    target_mm: BOARD_MM,
    corners: 2,
    looks_along: Some([0.0, 0.0, 1.0]),
    mounted: Mounted::Fixed,
    size: 1.0,
};

fn tool() -> Isometry3<f64> {
    posegrid::geometry::isometry_from_rpy(TOOL_MM, [0.0; 3])
}

/// A session of an arm with wrong lengths and angles, which an exact 6-DoF target watches; `seed` draws its poses.
fn exact(arm: &Arm, seed: u64, count: usize) -> (Simulated, JoinedSession) {
    let home: Vec<f64> = HOME_DEG.map(f64::to_radians).to_vec();
    let poses = Poses::Joints {
        count,
        lower: home.iter().map(|q| q - 0.6).collect(),
        upper: home.iter().map(|q| q + 0.6).collect(),
    };
    let mut settings = SimulateSettings::realistic(seed, home, poses);
    settings.arm_seed = Some(7);
    settings.cell.six_dof = true;
    settings.cell.target_sd_mm = 0.0;
    settings.cell.base_drift_mm = 0.0;
    settings.tracker = TrackerErrors::none();
    settings.joints = JointErrors::default();
    settings.gravity.sag_rad = 0.0;
    settings.geometry = GeometryErrors { length_sd_mm: 0.4, angle_sd_rad: 3e-4 };
    let simulated = simulate(arm, &settings).expect("in reach");
    let session = common::joined("monday", arm, &simulated.recording, tool());
    (simulated, session)
}

fn pose(station: &Station) -> Option<Isometry3<f64>> {
    let own = station.one_reading()?;
    let position = own.position()?.coords;
    Some(Isometry3::from_parts(position.into(), own.orientation()?))
}

/// A camera that looks at the middle of the session's targets along their mean normal, at this distance: its frame from the tracker's.
fn camera_from_tracker(session: &JoinedSession, distance_mm: f64) -> Isometry3<f64> {
    let poses: Vec<_> = session.joined.stations.iter().filter_map(pose).collect();
    let count = poses.len() as f64;
    let middle = poses.iter().map(|own| own.translation.vector).sum::<Vector3<f64>>() / count;
    let normal = poses.iter().map(|own| own.rotation * Vector3::z()).sum::<Vector3<f64>>();
    let ahead = -normal.normalize();
    let turn = UnitQuaternion::face_towards(&ahead, &Vector3::z());
    Isometry3::from_parts((middle - ahead * distance_mm).into(), turn).inverse()
}

/// Views of a board: corners with noise, and the pose that fits them best.
struct Views {
    rng: ChaCha8Rng,
    noise_px: f64,
    /// Every so many views the second solution is taken; 0 for none.
    flip_every: usize,
    seen: usize,
}

impl Views {
    fn new(seed: u64, noise_px: f64) -> Self {
        Self { rng: ChaCha8Rng::seed_from_u64(seed), noise_px, flip_every: 0, seen: 0 }
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.rng.random_range(-0.5..0.5)).sum()
    }

    /// The pose of the board in the camera's frame as the camera measures it, and whether it is the second solution; `None` where the
    /// board is behind the camera or at grazing view.
    fn of(&mut self, truth: &Isometry3<f64>) -> Option<(Isometry3<f64>, bool)> {
        let ray = truth.translation.vector.normalize();
        let cosine = (truth.rotation * Vector3::z()).dot(&ray).abs();
        if cosine < 0.2 || truth.translation.vector.z < 300.0 {
            return None;
        }
        let noise_px = self.noise_px / cosine;
        let image: Vec<f64> = image(truth);
        let seen: Vec<f64> = image.iter().map(|own| own + noise_px * self.normal()).collect();
        self.seen += 1;
        let is_flipped = self.flip_every > 0 && self.seen.is_multiple_of(self.flip_every);
        let start = if is_flipped { second(truth) } else { *truth };
        let found = fitted(&seen, start);
        // A large board near the camera has no second solution: perspective shows which it is.
        let is_flipped = found.rotation.angle_to(&truth.rotation) > 0.2;
        if is_flipped {
            println!(
                "flipped: {:.3} rad from the truth, {:.3} from its mirror image",
                found.rotation.angle_to(&truth.rotation),
                found.rotation.angle_to(&second(truth).rotation)
            );
        }
        Some((found, is_flipped))
    }
}

/// Image points of the board's corners, pixels.
fn image(pose: &Isometry3<f64>) -> Vec<f64> {
    let half = BOARD_MM / 2.0;
    let corners = [(-half, -half), (-half, half), (half, -half), (half, half)];
    let seen = corners.map(|(x, y)| pose * Point3::new(x, y, 0.0));
    let points = seen.iter().flat_map(|p| [FOCAL_PX * p.x / p.z, FOCAL_PX * p.y / p.z]);
    points.collect()
}

/// The pose that fits image points best, from a start: Gauss and Newton with numerical derivatives.
fn fitted(seen: &[f64], start: Isometry3<f64>) -> Isometry3<f64> {
    let moved = |by: &Vector6<f64>, from: &Isometry3<f64>| {
        let turn = UnitQuaternion::from_scaled_axis(by.fixed_rows::<3>(3).into_owned());
        let shift = from.translation.vector + by.fixed_rows::<3>(0);
        Isometry3::from_parts(shift.into(), turn * from.rotation)
    };
    let mut found = start;
    for _ in 0..12 {
        let at = image(&found);
        let column = |k: usize| {
            let step = if k < 3 { 1e-2 } else { 1e-5 };
            let ahead = image(&moved(
                &Vector6::from_fn(|row, _| if row == k { step } else { 0.0 }),
                &found,
            ));
            ahead.iter().zip(&at).map(|(a, b)| (a - b) / step).collect::<Vec<f64>>()
        };
        let columns: Vec<Vec<f64>> = (0..6).map(column).collect();
        let jacobian = DMatrix::from_fn(8, 6, |row, k| columns[k][row]);
        let off = DVector::from_fn(8, |row, _| seen[row] - at[row]);
        let step = jacobian.svd(true, true).solve(&off, 1e-12).expect("singular values");
        let step = Vector6::from_iterator(step.iter().copied());
        // A turn of more than a quarter radian in one step would leave the solution near which it began.
        let turn = step.fixed_rows::<3>(3).norm();
        found = moved(&(step * (0.25 / turn).min(1.0)), &found);
    }
    found
}

/// The board with its normal mirrored about the ray: a start for the second solution.
fn second(truth: &Isometry3<f64>) -> Isometry3<f64> {
    let ray = truth.translation.vector.normalize();
    let (x, y) = (truth.rotation * Vector3::x(), truth.rotation * Vector3::y());
    let mirrored = |v: Vector3<f64>| v - ray * (2.0 * v.dot(&ray));
    let (x, y) = (mirrored(x), mirrored(y));
    let turn = Rotation3::from_matrix(&nalgebra::Matrix3::from_columns(&[x, y, x.cross(&y)]));
    Isometry3::from_parts(truth.translation, turn.into())
}

/// The session as the camera sees it, and the numbers of stations that are flipped.
fn viewed(
    session: &JoinedSession,
    views: &mut Views,
    camera_from_board: impl Fn(&Station) -> Option<Isometry3<f64>>,
    stated: impl Fn(Isometry3<f64>) -> Isometry3<f64>,
) -> (JoinedSession, Vec<usize>) {
    let mut session = session.clone();
    let mut flipped = Vec::new();
    for station in &mut session.joined.stations {
        let seen = camera_from_board(station).and_then(|truth| views.of(&truth));
        let Some((measured, is_flipped)) = seen else {
            station.readings.clear();
            station.pairing = Pairing::Unmeasured(Unmeasured::NoReadings);
            continue;
        };
        if is_flipped {
            flipped.push(station.number);
        }
        let own = &mut station.readings[0];
        own.value = value(&stated(measured));
        own.kept = 1;
    }
    let kept = session.joined.stations.iter().filter(|own| own.one_reading().is_some());
    session.joined.counts.kept = kept.count() as u64;
    session.joined.counts.unpaired = 0;
    (session, flipped)
}

fn value(pose: &Isometry3<f64>) -> Value {
    let point = MeanPoint {
        position: pose.translation.vector.into(),
        scatter_mm: [0.0; 3],
        motion_covariance: None,
        stated_covariance: None,
    };
    let turn =
        MeanOrientation { orientation: pose.rotation, scatter_rad: 0.0, stated_covariance: None };
    Value::Pose(point, turn)
}

fn by_camera(camera: CameraUncertainty) -> Noise {
    let source = Source { reads: ReadingKind::Pose, uncertainty: fit::Uncertainty::Camera(camera) };
    Noise::of_one(source, 0.005)
}

/// One number for all positions and one for all orientations.
fn constant(mm: f64, rad: f64) -> Noise {
    let tracker = TrackerUncertainty {
        range_um: 1e3 * mm,
        range_um_per_m: 0.0,
        transverse_um: 1e3 * mm,
        transverse_um_per_m: 0.0,
        divisor: 1.0,
        orientation_rad: Some(rad),
    };
    let source = Source { reads: ReadingKind::Pose, uncertainty: tracker.into() };
    Noise::of_one(source, 0.005)
}

fn settings(noise: Noise) -> StageSettings {
    StageSettings {
        fit: FitSettings { orientations: true, ..FitSettings::default() },
        full: FullSettings { harmonics: 8, ..FullSettings::default() },
        flange_from_tool: Some(tool()),
        base: Some(ErrorBase::Fitted),
        target_is_tool: Some(true),
        ..common::stage_settings(noise)
    }
}

fn outcome<'a>(arm: &'a Arm, session: &JoinedSession, settings: &StageSettings) -> Outcome<'a> {
    crate::judged(arm, vec![session.clone()], vec![], settings).expect("a sound session")
}

fn identified(arm: &Arm, session: &JoinedSession, noise: &Noise) -> Calibration {
    let observed = fit::observations(0, &session.joined.stations, arm, noise);
    fit::identify(arm, &observed, 1, Freedom::Geometry, &FitSettings::default()).expect("a fit")
}

/// Root mean square distance of predicted from true places of the target, mm, of the stations whose place is within `near_mm` of the
/// camera, and of all.
fn errors(
    arm: &Arm,
    found: &Calibration,
    truth: &[(Vec<f64>, Vector3<f64>)],
    near_mm: f64,
) -> [f64; 2] {
    let frames = &found.frames[0];
    let base = frames.sources()[0].isometry();
    let target = frames.targets()[0].isometry();
    let squares = truth.iter().map(|(joints, place)| {
        let flange = base * found.chain.nominal(&arm.axes(joints));
        (place.norm(), ((flange * target).translation.vector - place).norm_squared())
    });
    let squares: Vec<(f64, f64)> = squares.collect();
    let rms = |within_mm: f64| {
        let own = squares.iter().filter(|own| own.0 < within_mm);
        let (sum, count) = own.fold((0.0, 0.0), |(sum, n), own| (sum + own.1, n + 1.0));
        (sum / f64::max(count, 1.0)).sqrt()
    };
    [rms(near_mm), rms(f64::INFINITY)]
}

#[test]
fn the_size_of_a_cameras_noise_is_found_and_its_model_judges_near_poses_better_than_one_number() {
    let arm = common::arm("kr210-r2700-extra");
    let (_, session) = exact(&arm, 11, 220);
    let place = camera_from_tracker(&session, 1500.0);
    let of = |station: &Station| Some(place * pose(station)?);
    let (_, tuesday) = exact(&arm, 12, 120);
    let truth = tuesday.joined.stations.iter();
    let truth: Vec<(Vec<f64>, Vector3<f64>)> = truth
        .filter_map(|own| Some((own.joints.clone(), of(own)?.translation.vector)))
        .filter(|(_, place)| place.z > 300.0)
        .collect();
    let (mut sums, mut shares) = ([[0.0; 2]; 2], Vec::new());
    let seeds = 1..=6;
    for seed in seeds.clone() {
        let (seen, _) = viewed(&session, &mut Views::new(seed, TRUE_NOISE_PX), of, |own| own);
        let found = outcome(&arm, &seen, &settings(by_camera(CAMERA)));
        let size = found.camera_size.expect("a camera");
        let true_size = TRUE_NOISE_PX / STATED_NOISE_PX;
        shares.push((size.size - true_size) / size.size_se);
        println!("size {:.3} ± {:.3}, beside {:.3} mm", size.size, size.size_se, size.beside_mm);
        let modelled = identified(&arm, &seen, &by_camera(CAMERA));
        // One number: the root mean square over the session of what the model states.
        let camera = CameraUncertainty { size: true_size, ..CAMERA };
        let stated = seen.joined.stations.iter().filter_map(pose).map(|own| camera.of_pose(&own));
        let stated: Vec<_> = stated.collect();
        let mean = |from: usize| {
            let sum: f64 =
                stated.iter().map(|own| own.fixed_view::<3, 3>(from, from).trace() / 3.0).sum();
            (sum / stated.len() as f64).sqrt()
        };
        let constant = identified(&arm, &seen, &constant(mean(0), mean(3)));
        for (sums, own) in sums.iter_mut().zip([&modelled, &constant]) {
            for (sum, rms) in sums.iter_mut().zip(errors(&arm, own, &truth, 1500.0)) {
                *sum += rms * rms;
            }
        }
    }
    let count = seeds.count() as f64;
    let [[near, all], [near_constant, all_constant]] =
        sums.map(|own| own.map(|sum| (sum / count).sqrt()));
    println!(
        "true error of predicted places: {near:.3} mm near ({all:.3} all) by the model, {near_constant:.3} ({all_constant:.3}) by one number"
    );
    assert!(shares.iter().all(|share| share.abs() < 3.0), "{shares:?}");
    let squares: f64 = shares.iter().map(|share| share * share).sum();
    assert!(squares / count < 3.0, "{shares:?}");
    assert!(near < 0.8 * near_constant && all < all_constant);
}

fn flip_rejects(session: &JoinedSession) -> Vec<&JoinReject> {
    let rejects = session.joined.rejects.iter();
    rejects.filter(|own| own.reason.starts_with("flipped view of a planar target")).collect()
}

#[test]
fn flipped_views_are_named_and_not_fitted() {
    let arm = common::arm("kr210-r2700-extra");
    let (_, session) = exact(&arm, 11, 220);
    let place = camera_from_tracker(&session, 1500.0);
    let of = |station: &Station| Some(place * pose(station)?);
    let mut views = Views::new(3, TRUE_NOISE_PX);
    views.flip_every = 10;
    let (seen, flipped) = viewed(&session, &mut views, of, |own| own);
    println!("{flipped:?}");
    let settings = settings(by_camera(CAMERA));
    let found = outcome(&arm, &seen, &settings);
    let own = &found.training[0];
    let named: Vec<usize> = own
        .joined
        .stations
        .iter()
        .filter(|own| own.pairing == Pairing::Unmeasured(Unmeasured::FlippedView))
        .map(|own| own.number)
        .collect();
    println!("{}", flip_rejects(own)[0].reason);
    assert_eq!(named, flipped);
    assert_eq!(flip_rejects(own).len(), flipped.len());
    let counts = &own.joined.counts;
    assert_eq!(counts.kept + counts.unpaired, seen.joined.counts.kept);
    assert_eq!(counts.unpaired, flipped.len() as u64);

    // As without the flipped stations.
    let mut without = seen.clone();
    for station in &mut without.joined.stations {
        if flipped.contains(&station.number) {
            station.readings.clear();
            station.pairing = Pairing::Unmeasured(Unmeasured::NoReadings);
        }
    }
    let without = outcome(&arm, &without, &settings);
    let misfits = |outcome: &Outcome<'_>| {
        outcome.calibrations.iter().map(|own| own.1.misfit_mm).collect::<Vec<f64>>()
    };
    assert_eq!(misfits(&found), misfits(&without));
    // Without flips nothing is named.
    let (sound, _) = viewed(&session, &mut Views::new(4, TRUE_NOISE_PX), of, |own| own);
    assert!(flip_rejects(&outcome(&arm, &sound, &settings).training[0]).is_empty());
}

/// The board's pose in the base frame: where most stations look from a camera at the flange, along its z.
fn board_of(simulated: &Simulated, session: &JoinedSession) -> Isometry3<f64> {
    let base = base_of(simulated);
    let cameras = session.joined.stations.iter().filter_map(pose);
    let cameras: Vec<Isometry3<f64>> = cameras.map(|own| base.inverse() * own).collect();
    let ahead = cameras.iter().map(|own| (own * Point3::new(0.0, 0.0, 900.0)).coords);
    let middle = ahead.sum::<Vector3<f64>>() / cameras.len() as f64;
    let normal = cameras.iter().map(|own| own.rotation * Vector3::z());
    let normal = normal.sum::<Vector3<f64>>();
    let turn = UnitQuaternion::face_towards(&-normal, &Vector3::x());
    Isometry3::from_parts(middle.into(), turn)
}

fn base_of(simulated: &Simulated) -> Isometry3<f64> {
    let cell = &simulated.truth.settings.cell;
    posegrid::geometry::isometry_from_rpy(cell.tracker_from_base_mm, cell.tracker_from_base_rpy)
}

/// The session as a camera in the place of the tool sees the board: its own pose in the board's frame.
fn on_the_flange(simulated: &Simulated, session: &JoinedSession) -> JoinedSession {
    let (base, board) = (base_of(simulated), board_of(simulated, session));
    let of = |station: &Station| Some((base.inverse() * pose(station)?).inverse() * board);
    viewed(session, &mut Views::new(5, TRUE_NOISE_PX), of, |own| own.inverse()).0
}

#[test]
fn a_camera_on_the_flange_finds_the_arm_as_one_in_the_cell_does() {
    let arm = common::arm("kr210-r2700-extra");
    let (simulated, session) = exact(&arm, 11, 220);
    let seen = on_the_flange(&simulated, &session);
    let board = board_of(&simulated, &session);
    let camera = CameraUncertainty { mounted: Mounted::Flange, ..CAMERA };
    let found = outcome(&arm, &seen, &settings(by_camera(camera)));
    let size = found.camera_size.expect("a camera");
    println!("{} stations, size {:.3} ± {:.3}", size.readings, size.size, size.size_se);
    assert!(size.readings > 100);
    assert!((size.size - 1.5).abs() < 3.0 * size.size_se, "{size:?}");
    // Frames: the base in the board's frame, and the camera at the flange.
    let frames = &found.calibrations[1].1.frames[0];
    let off = frames.sources()[0].isometry() * board;
    println!(
        "board {:.3} mm and {:.3} mrad off",
        off.translation.vector.norm(),
        1e3 * off.rotation.angle()
    );
    assert!(off.translation.vector.norm() < 3.0 && off.rotation.angle() < 3e-3, "{off}");
    let camera = frames.targets()[0].isometry();
    let away = camera.translation.vector - Vector3::from(TOOL_MM);
    assert!(away.norm() < 3.0, "{away}");
}

/// A session of the camera on the flange as a table: joints, and the board's pose in the camera's frame.
fn table(session: &JoinedSession) -> String {
    let mut text = "q1,q2,q3,q4,q5,q6,x,y,z,qx,qy,qz,qw\n".to_owned();
    for station in &session.joined.stations {
        let Some(own) = pose(station) else { continue };
        let seen = own.inverse();
        let joints = station.joints.iter().copied();
        let numbers = joints
            .chain(seen.translation.vector.iter().copied())
            .chain(seen.rotation.coords.iter().copied());
        let numbers: Vec<String> = numbers.map(|number| format!("{number:.9}")).collect();
        writeln!(text, "{}", numbers.join(",")).expect("a string");
    }
    text
}

/// Runs the table with the camera mounted as stated; its exit code, results and messages.
fn run_mounted(text: &str, mounted: &str) -> (i32, String, String) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = |name: &str| folder.path().join(name);
    fs::copy("pipelines/robots/kr210-r2700-extra.toml", path("robot.toml")).expect("copied");
    fs::create_dir_all(path("sessions/monday")).expect("writable");
    fs::write(path("sessions/monday/measured.csv"), text).expect("writable");
    let pipeline = format!(
        r#"[robot]
file = "robot.toml"
name = "eye"
[input]
folder = "sessions"
stations = "measured.csv"
[stations]
joints = ["q1", "q2", "q3", "q4", "q5", "q6"]
joint_unit = "rad"
[stations.measured]
position = ["x", "y", "z"]
unit = "mm"
orientation = {{ quaternion_xyzw = ["qx", "qy", "qz", "qw"] }}
[tracker]
camera = {{ focal_px = 1500, noise_px = 0.2, target_mm = 240, looks_along = [0, 0, 1], mounted = "{mounted}" }}
[fit]
orientations = true
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
"#
    );
    fs::write(path("eye.toml"), pipeline).expect("writable");
    let mut command = Command::new(env!("CARGO_BIN_EXE_posegrid"));
    let output = command.args(["run", "eye.toml", "--verbose"]).current_dir(folder.path()).output();
    let output = output.expect("it runs");
    let words = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().expect("it ended"), words(&output.stdout), words(&output.stderr))
}

#[test]
fn a_table_of_a_camera_on_the_flange_runs_and_a_wrong_mounting_is_named() {
    let arm = common::arm("kr210-r2700-extra");
    let (simulated, session) = exact(&arm, 11, 220);
    let seen = on_the_flange(&simulated, &session);
    let text = table(&seen);
    let (code, results, messages) = run_mounted(&text, "flange");
    println!("{results}{messages}");
    assert!(matches!(code, 0 | 3), "{code}: {messages}");
    assert!(
        results.contains("camera: noise 1.4") || results.contains("camera: noise 1.5"),
        "{results}"
    );
    let (code, _, messages) = run_mounted(&text, "fixed");
    println!("{messages}");
    assert_eq!(code, 1);
    assert!(messages.contains("set [tracker] camera.mounted = \"flange\""), "{messages}");
}

#[test]
fn points_of_a_laser_line_with_their_covariance_find_the_arm_better_than_without() {
    // A stationary camera and a line of laser light, as in Park's measurement: points are exact across the sheet of light and along
    // its normal, and five times worse along the line of sight, which differs from station to station.
    let arm = common::arm("kr210-r2700-extra");
    let (_, session) = exact(&arm, 11, 220);
    let place = camera_from_tracker(&session, 1500.0);
    let of = |station: &Station| Some(place * pose(station)?);
    let truth = session.joined.stations.iter();
    let truth: Vec<(Vec<f64>, Vector3<f64>)> =
        truth.filter_map(|own| Some((own.joints.clone(), of(own)?.translation.vector))).collect();
    let mut noise = Views::new(9, 0.0);
    let (mut with, mut without) = (session.clone(), session.clone());
    let stations = with.joined.stations.iter_mut().zip(&mut without.joined.stations);
    for (station, plain) in stations {
        let Some(seen) = of(station) else { continue };
        let ray = seen.translation.vector.normalize();
        let own = [noise.normal(), noise.normal(), noise.normal(), noise.normal()];
        let off = Vector3::new(own[0], own[1], own[2]) * 0.05 + ray * (0.5 * own[3]);
        let covariance = nalgebra::Matrix3::identity() * 0.05_f64.powi(2)
            + ray * ray.transpose() * 0.5_f64.powi(2);
        let places = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        let point = |stated| MeanPoint {
            position: (seen.translation.vector + off).into(),
            scatter_mm: [0.0; 3],
            motion_covariance: None,
            stated_covariance: stated,
        };
        for (station, stated) in [(station, Some(places.map(|at| covariance[at]))), (plain, None)] {
            let reading = &mut station.readings[0];
            (reading.value, reading.kept) = (Value::Point(point(stated)), 1);
        }
    }
    let noise = constant(0.3, 1e-3);
    let [by_covariance, all] = [&with, &without].map(|session| {
        let found = identified(&arm, session, &noise);
        println!("s² {:.3}", found.solution.variance_factor);
        errors(&arm, &found, &truth, f64::INFINITY)[1]
    });
    println!(
        "true error of predicted places: {by_covariance:.4} mm with covariances, {all:.4} mm with one number"
    );
    assert!(by_covariance < 0.6 * all && by_covariance < 0.06);
    let s2 = identified(&arm, &with, &noise).solution.variance_factor;
    assert!((s2 - 1.0).abs() < 0.2, "{s2}");
}

#[test]
fn the_gradient_of_correlated_rows_is_that_of_their_norms() {
    // Position and tilt of a camera's readings are whitened together: the rows' derivatives against differences of the cost.
    let arm = common::arm("kr210-r2700-extra");
    let (_, session) = exact(&arm, 11, 24);
    let place = camera_from_tracker(&session, 1500.0);
    let of = |station: &Station| Some(place * pose(station)?);
    let (seen, _) = viewed(&session, &mut Views::new(8, TRUE_NOISE_PX), of, |own| own);
    let observed = fit::observations(0, &seen.joined.stations, &arm, &by_camera(CAMERA));
    let found = fit::identify(&arm, &observed, 1, Freedom::BaseAndTarget, &FitSettings::default());
    let frames = found.expect("a fit").frames;
    let problem =
        Problem::new(&observed, arm.chain(), &frames, Freedom::Geometry, &Prior::default());
    let size = problem.unknowns.len();
    let at = DVector::from_fn(size, |place, _| 1e-5 * (place as f64 + 1.0).sin());
    let cost = |at: &DVector<f64>| problem.norms(at).iter().map(|norm| norm * norm).sum::<f64>();
    let normal = problem.normal(&at, &vec![1.0; observed.len()]);
    for place in 0..size {
        let step = 1e-5;
        let moved = |by: f64| {
            let mut at = at.clone();
            at[place] += by;
            cost(&at)
        };
        // The cost is the sum of squares of measured minus predicted.
        let numeric = -(moved(step) - moved(-step)) / (4.0 * step);
        let allowed = 1e-4 * (normal.information[(place, place)] * cost(&at)).sqrt();
        assert!(
            (normal.gradient[place] - numeric).abs() < allowed,
            "{:?}: {} and {numeric}",
            problem.unknowns[place],
            normal.gradient[place]
        );
    }
}
