use nalgebra::Point3;

use super::settings::{Cell, GeometryErrors, JointErrors, TrackerErrors};
use super::*;
use crate::join::Station;
use crate::kinematics::RobotFile;

fn kr210() -> Arm {
    let text = include_str!("../../../pipelines/robots/kr210-r2700-extra.toml");
    let file: RobotFile = toml::from_str(text).expect("a robot file");
    file.arm().expect("a valid arm")
}

fn home() -> Vec<f64> {
    [0.0, -75.0, 100.0, 25.0, 55.0, -15.0_f64].map(f64::to_radians).to_vec()
}

fn small_grid() -> Poses {
    Poses::Grid {
        lower_mm: [1400.0, -200.0, 800.0],
        upper_mm: [1600.0, 200.0, 1000.0],
        step_mm: 100.0,
        orientation_rpy: [3.0, 0.3, 0.1],
    }
}

fn realistic() -> SimulateSettings {
    SimulateSettings::realistic(42, home(), small_grid())
}

/// Where the target was measured at a station, mm in the tracker's frame.
fn position(station: &Station) -> Point3<f64> {
    let reading = station.one_reading().expect("no beam is lost");
    reading.position().expect("the tracker reads positions")
}

#[test]
fn without_errors_the_tracker_sees_the_commands() {
    let settings = SimulateSettings::exact(1, home(), small_grid());
    let simulated = simulate(&kr210(), &settings).expect("in reach");
    // 3 × 5 × 3 nodes.
    assert_eq!(simulated.truth.stations.len(), 45);
    assert!(simulated.truth.raw_error_mm.max < 1e-3, "{:?}", simulated.truth.raw_error_mm);
    let cell = Cell::default();
    let tracker_from_base =
        crate::geometry::isometry_from_rpy(cell.tracker_from_base_mm, cell.tracker_from_base_rpy);
    for station in simulated.stations() {
        let attained = position(&station);
        let command = station.command.expect("every stop is commanded").position;
        // Angles are logged to 1e-7 rad: 0.3 µm at 3 m per joint; positions to 0.1 µm.
        assert!((tracker_from_base.inverse() * attained - command).norm() < 1.5e-3);
    }
}

#[test]
fn each_ingredient_alone_moves_the_target_and_zero_switches_it_off() {
    type Change = fn(&mut SimulateSettings);
    let exact = || SimulateSettings::exact(5, home(), small_grid());
    let cases: [(&str, Change, f64); 8] = [
        ("lengths", |s| s.geometry = GeometryErrors { length_sd_mm: 0.3, angle_sd_rad: 0.0 }, 0.1),
        ("angles", |s| s.geometry = GeometryErrors { length_sd_mm: 0.0, angle_sd_rad: 2e-4 }, 0.1),
        (
            "curves",
            |s| s.joints = JointErrors { slow_curve_rad: 1e-4, ..JointErrors::default() },
            0.05,
        ),
        (
            "fast curves",
            |s| s.joints = JointErrors { fast_curve_rad: 1e-4, ..JointErrors::default() },
            0.05,
        ),
        (
            "gear lines",
            |s| s.joints = JointErrors { gear_line_rad: 1e-4, ..JointErrors::default() },
            0.05,
        ),
        (
            "backlash",
            |s| s.joints = JointErrors { backlash_rad: 1e-4, ..JointErrors::default() },
            0.03,
        ),
        (
            "stops short",
            |s| s.joints = JointErrors { stops_short_rad: 1e-4, ..JointErrors::default() },
            0.05,
        ),
        ("sag", |s| s.gravity.sag_rad = 3e-4, 0.1),
    ];
    for (name, switch_on, at_least_mm) in cases {
        let mut settings = exact();
        switch_on(&mut settings);
        let simulated = simulate(&kr210(), &settings).expect("in reach");
        let error = simulated.truth.raw_error_mm;
        assert!(error.mean > at_least_mm && error.mean < 2.0, "{name}: {error:?}");
    }
}

#[test]
fn the_arm_is_at_its_command_when_beta_is_one() {
    // Reported angles are 1e-3 rad short, but the arm is exactly at the command: β = 1 in method::error_model.
    let mut settings = SimulateSettings::exact(5, home(), small_grid());
    settings.joints.stops_short_rad = 1e-3;
    settings.joints.nearer_command = 1.0;
    let simulated = simulate(&kr210(), &settings).expect("in reach");
    assert!(simulated.truth.raw_error_mm.max < 1e-6);
    let station = &simulated.truth.stations[7];
    let short = (station.commanded[1] - station.reported[1]).abs();
    assert!((5e-4..1.5e-3).contains(&short), "{short}");
}

#[test]
fn the_clocks_are_as_set_and_readings_fall_into_their_dwells() {
    let simulated = simulate(&kr210(), &realistic()).expect("in reach");
    let clock = simulated.truth.clock_model();
    let stations = simulated.stations();
    for station in &stations {
        let Some(reading) = station.one_reading() else { continue };
        assert!(clock.to_controller(reading.first) >= station.start);
        assert!(clock.to_controller(reading.last) <= station.end);
        // At least 0.9 s of 20 Hz.
        assert!(reading.kept >= 17, "{}", reading.kept);
    }
    let first = simulated.recording.readings.stamps[0];
    let ahead = first.ns() - simulated.recording.joints.stamps[0].ns();
    // 21.703 s of offset and a third of a reading.
    assert!((ahead - 21_703_000_000).abs() < 50_000_000, "{ahead}");
}

#[test]
fn noise_is_as_large_as_the_instrument_is_uncertain() {
    let mut settings = SimulateSettings::exact(9, home(), small_grid());
    settings.tracker = TrackerErrors::adm();
    let simulated = simulate(&kr210(), &settings).expect("in reach");
    let mut squares = 0.0;
    for (station, truth) in simulated.stations().iter().zip(&simulated.truth.stations) {
        let off = position(station).coords - truth.tracker_from_target.translation.vector;
        squares += off.norm_squared();
    }
    let rms_mm = (squares / 45.0).sqrt();
    // At 3 to 4 m across: (15 + 6 · 3.5) / 2 = 18 µm per axis, two axes, half of the variance is left in a mean of 20:
    // 18 · √2 · √(1/2 + 1/40) = 18.4 µm; 15 % for 90 draws.
    assert!((rms_mm - 0.0184).abs() < 0.0035, "{rms_mm}");
}

#[test]
fn lost_beams_and_outliers_are_counted() {
    let mut settings = realistic();
    settings.tracker.lost_share = 0.2;
    settings.tracker.outlier_share = 0.05;
    let silent = simulate(&kr210(), &settings).expect("in reach");
    settings.tracker.lost_as_zeros = true;
    let zeros = simulate(&kr210(), &settings).expect("in reach");
    let truth = &silent.truth;
    assert!(truth.stations_lost > 0 && truth.readings.outliers > 0);
    let unmeasured = silent.stations().iter().filter(|s| s.measured().is_empty()).count();
    assert_eq!(unmeasured, truth.stations_lost);
    assert_eq!(silent.recording.readings.stamps.len() as u64, truth.readings.seen);
    assert_eq!(
        zeros.recording.readings.stamps.len() as u64,
        truth.readings.seen + truth.readings.lost
    );
}

#[test]
fn the_same_seed_gives_the_same_session_and_another_seed_does_not() {
    let arm = kr210();
    let first = simulate(&arm, &realistic()).expect("in reach");
    let again = simulate(&arm, &realistic()).expect("in reach");
    assert_eq!(first.recording.joints, again.recording.joints);
    assert_eq!(first.recording.readings, again.recording.readings);
    assert_eq!(first.truth.json().expect("JSON"), again.truth.json().expect("JSON"));
    let other = simulate(&arm, &SimulateSettings { seed: 43, ..realistic() }).expect("in reach");
    assert_ne!(first.recording.readings, other.recording.readings);
}

#[test]
fn random_poses_lie_in_the_box_and_random_joints_between_their_bounds() {
    let boxed = Poses::Box {
        count: 30,
        lower_mm: [1300.0, -300.0, 700.0],
        upper_mm: [1700.0, 300.0, 1100.0],
        orientation_rpy: [3.0, 0.3, 0.1],
        cone_rad: 0.4,
    };
    let simulated =
        simulate(&kr210(), &SimulateSettings::exact(2, home(), boxed)).expect("in reach");
    for station in &simulated.truth.stations {
        let place = station.command.translation;
        assert!((1300.0..1700.0).contains(&place.x) && (700.0..1100.0).contains(&place.z));
    }
    let lower: Vec<f64> = home().iter().map(|q| q - 0.3).collect();
    let upper: Vec<f64> = home().iter().map(|q| q + 0.3).collect();
    let joints = Poses::Joints { count: 30, lower: lower.clone(), upper };
    let simulated =
        simulate(&kr210(), &SimulateSettings::exact(2, home(), joints)).expect("in reach");
    assert_eq!(simulated.truth.stations.len(), 30);
    for station in &simulated.truth.stations {
        for (q, lower) in station.commanded.iter().zip(&lower) {
            assert!((*lower..lower + 0.6).contains(q));
        }
    }
}

#[test]
fn bad_settings_are_named() {
    let arm = kr210();
    let refused = |change: fn(&mut SimulateSettings)| {
        let mut settings = realistic();
        change(&mut settings);
        simulate(&arm, &settings).expect_err("bad settings").to_string()
    };
    assert!(refused(|s| s.home = vec![0.0; 4]).contains("4 angles, but the arm has 6"));
    assert!(refused(|s| s.motion.joint_rate_hz = 0.0).contains("joint_rate_hz = 0"));
    assert!(refused(|s| s.tracker.outlier_share = f64::NAN).contains("outlier_share"));
    let far = refused(|s| {
        s.poses = Poses::Grid {
            lower_mm: [3500.0, 0.0, 800.0],
            upper_mm: [3600.0, 100.0, 900.0],
            step_mm: 100.0,
            orientation_rpy: [3.0, 0.3, 0.1],
        };
    });
    assert!(far.contains("grid node [3500.0, 0.0, 800.0]") && far.contains("not reached"), "{far}");
}

#[test]
fn a_six_dof_target_gives_orientations_as_uncertain_as_set() {
    let mut settings = SimulateSettings::exact(9, home(), small_grid());
    settings.cell.six_dof = true;
    settings.tracker.orientation_rad = 130e-6;
    let simulated = simulate(&kr210(), &settings).expect("in reach");
    let stations = simulated.stations();
    let mut squares = 0.0;
    let mut scatter = 0.0;
    for (station, truth) in stations.iter().zip(&simulated.truth.stations) {
        let reading = station.one_reading().expect("no beam is lost");
        let turn = reading.value.turn().expect("a 6-DoF target");
        squares += turn.orientation.angle_to(&truth.tracker_from_target.rotation).powi(2);
        scatter += turn.scatter_rad / 45.0;
    }
    // Half of the variance is new in every reading: 130 / √2 = 92 µrad per axis.
    assert!((scatter - 92e-6).abs() < 4e-6, "{scatter}");
    // The shared half stays in the mean: √(3 · (1/2 + 1/40)) · 130 = 163 µrad for three axes; 12 % for 135 draws.
    let rms = (squares / 45.0).sqrt();
    assert!((rms - 163e-6).abs() < 25e-6, "{rms}");
}
