//! The full error model of joints that slide: the offset from the command after an approach; and of any arm in a session that took no
//! part: the base as it was fitted.

use crate::common;

use common::{NOISE, position};
use nalgebra::{Isometry3, Vector3};
use posegrid::fit::commanded::{CommandFrames, SettlingError, commanded};
use posegrid::fit::full::layout::Block;
use posegrid::fit::full::{FullModel, FullSettings, Known, Purpose, Query};
use posegrid::fit::{self, FitSettings, Freedom, Observation};
use posegrid::geometry::isometry_from_rpy;
use posegrid::kinematics::{Arm, RobotFile};
use posegrid::simulate::{
    ArmErrors, Commanded, Ingredient, Poses, SimulateSettings, Stream, visits,
};

/// The spindle of the SCARA, from 0.
const SPINDLE: usize = 2;

fn arm(text: &str) -> Arm {
    let file: RobotFile = toml::from_str(text).expect("a robot file");
    file.arm().expect("a valid arm")
}

/// Stations of a session at random joints within `ranges`, rad or mm, with their settling errors.
fn observations(
    arm: &Arm,
    ranges: &[[f64; 2]],
    (settings, errors): (&SimulateSettings, &ArmErrors),
) -> Vec<Observation> {
    let target = isometry_from_rpy(settings.cell.flange_from_target_mm, [0.0; 3]);
    let mut poses = Stream::new(settings.seed, Ingredient::Poses);
    let sent: Vec<Commanded> = (0..150)
        .map(|_| {
            let joints: Vec<f64> =
                ranges.iter().map(|[low, high]| poses.between(*low, *high)).collect();
            Commanded { base_from_target: arm.chain().nominal(&arm.axes(&joints)) * target, joints }
        })
        .collect();
    let visits = visits(arm, settings, errors, &sent);
    let stations: Vec<_> = visits.into_iter().map(|visit| visit.station).collect();
    let frames =
        CommandFrames { base_from_command: Isometry3::identity(), flange_from_tool: Some(target) };
    let commands = commanded(&stations, arm, &frames);
    let mut seen = fit::observations(0, &stations, arm, &NOISE);
    fit::add_commands(&mut seen, &stations, &commands);
    seen
}

fn trained(arm: &Arm, seen: &[Observation], settings: &FullSettings) -> FullModel {
    let of_fit = FitSettings::default();
    let start = fit::identify(arm, seen, 1, Freedom::Geometry, &of_fit).expect("a fit");
    let up = Some(Vector3::z_axis());
    let (frames, geometry) = (&start.frames, &start.geometry);
    FullModel::train(
        arm,
        seen,
        (&frames[..], &geometry[..]),
        &of_fit.prior(),
        settings,
        Purpose::Published,
        up,
    )
    .expect("a model")
}

fn quick() -> FullSettings {
    FullSettings { harmonics: 12, gear_lines: false, ..FullSettings::default() }
}

/// Mean distance of measured and predicted positions, mm, by the base of the training.
fn mean_off(model: &FullModel, seen: &[Observation]) -> f64 {
    let off = |o: &Observation| {
        let query = Query { own: false, ..Query::of(o) };
        (model.predict(&query).position - position(o)).norm()
    };
    seen.iter().map(off).sum::<f64>() / seen.len() as f64
}

/// A SCARA that is exact but for the slack of its spindle, some 0.2 mm: two sessions and half the slack, mm.
fn slack() -> (Arm, [Vec<Observation>; 2], f64) {
    let arm = arm(include_str!("../robots/scara.toml"));
    let ranges = [[-1.2, 1.2], [0.4, 2.0], [50.0, 350.0], [-2.0, 2.0]];
    let settings = |seed| {
        let listed = Poses::Listed { joints: Vec::new() };
        let mut settings = SimulateSettings::exact(seed, vec![0.0, 1.0, 200.0, 0.0], listed);
        settings.joints.backlash_rad = 200e-6;
        settings.joints.stops_short_rad = 150e-6;
        settings
    };
    let mut errors = ArmErrors::draw(&arm, &settings(1));
    for (joint, slack) in errors.backlash_rad.iter_mut().enumerate() {
        *slack *= f64::from(u8::from(joint == SPINDLE));
    }
    let session = |seed| observations(&arm, &ranges, (&settings(seed), &errors));
    let half_mm = errors.backlash_rad[SPINDLE] / 2.0;
    let sessions = [session(1), session(2)];
    (arm, sessions, half_mm)
}

#[test]
fn a_slides_offset_after_an_approach_is_found_in_mm() {
    let (arm, [first, second], half_mm) = slack();
    let model = trained(&arm, &first, &quick());
    let offsets = model.coefficients(Block::ApproachOffset);
    let offsets = offsets.expect("commands as sent");
    // With the command–feedback weight alone.
    let weight = FullSettings { approach_offset_sd_rad: 1e-9, ..quick() };
    let without = trained(&arm, &first, &weight);
    let (mean, plain) = (mean_off(&model, &second), mean_off(&without, &second));
    println!(
        "spindle {:.4} mm for {:.4}; another session {mean:.4} mm, without {plain:.4} mm",
        offsets[SPINDLE], -half_mm
    );
    assert!(
        (offsets[SPINDLE] + half_mm).abs() < 0.15 * half_mm,
        "{} mm for {}",
        offsets[SPINDLE],
        -half_mm
    );
    assert!(mean < 0.6 * plain, "{mean} mm, without {plain} mm");
}

#[test]
fn the_column_of_a_slides_offset_is_the_motion_of_the_target() {
    let (arm, [first, _], _) = slack();
    let model = trained(&arm, &first, &quick());
    let columns = model.trained.layout.columns(Block::ApproachOffset);
    let column = columns.expect("commands as sent").start + SPINDLE;
    // Half of the 0.06 mm at which it is complete, all of it, and beyond, towards either side.
    for (settling_mm, share) in
        [(0.03, 0.5), (0.06, 1.0), (0.2, 1.0), (-0.015, -0.25), (-1.0, -1.0)]
    {
        for o in &first[..10] {
            let at = |moved_mm: f64| {
                let mut axes = o.axes.clone();
                axes[SPINDLE] += moved_mm;
                model.position(&Query { axes: &axes, ..Query::of(o) })
            };
            let numerical = (at(0.5) - at(-0.5)) * share;
            let mut settling_error = vec![0.0; 4];
            settling_error[SPINDLE] = settling_mm;
            let settling_error = SettlingError::Sent(settling_error);
            let known = Known::Both(&settling_error);
            let rows = model.predict(&Query { known, ..Query::of(o) }).rows;
            let off = (rows.column(column) - numerical).norm();
            assert!(off < 2e-3 * share.abs(), "{settling_mm} mm: {off}");
        }
    }
}

#[test]
fn another_session_is_predicted_by_the_base_as_fitted() {
    let arm = arm(include_str!("../../pipelines/robots/wam.toml"));
    let ranges =
        [[-1.0, 1.0], [-1.2, 1.2], [-1.2, 1.2], [0.2, 2.0], [-1.5, 1.5], [-1.0, 1.0], [-1.0, 1.0]];
    let settings = |seed| {
        let listed = Poses::Listed { joints: Vec::new() };
        let mut settings = SimulateSettings::realistic(seed, vec![0.0; 7], listed);
        settings.geometry.length_sd_mm = 1.5;
        settings.geometry.angle_sd_rad = 8e-3;
        settings.joints.repeatability_rad = 1e-3;
        settings.gravity.sag_rad = 10e-3;
        settings.cell.base_drift_mm = 0.0;
        settings
    };
    let errors = ArmErrors::draw(&arm, &settings(5));
    let session = |seed| observations(&arm, &ranges, (&settings(seed), &errors));
    let (first, second) = (session(5), session(6));
    // Without parts of its own, a session is predicted alike whether it took part or not.
    let shared = FullSettings { drift: false, session_scale_ppm: 0.0, ..quick() };
    let model = trained(&arm, &first, &shared);
    let far = |o: &Observation| {
        let query = Query::of(o);
        let other = Query { own: false, ..query };
        (model.predict(&query).position - model.predict(&other).position).norm()
    };
    let farthest = first.iter().map(far).fold(0.0, f64::max);
    println!("own base and carried base: {farthest:.2e} mm apart");
    assert!(farthest < 1e-9, "{farthest} mm");
    // With them, the base carried over serves a session in the same cell.
    let model = trained(&arm, &first, &quick());
    let own = |o: &Observation| (model.predict(&Query::of(o)).position - position(o)).norm();
    let training = first.iter().map(own).sum::<f64>() / first.len() as f64;
    let carried = mean_off(&model, &second);
    println!("training {training:.3} mm, the next session without a refit {carried:.3} mm");
    assert!(carried < 1.5 * training, "{carried} mm for {training} mm");
}
