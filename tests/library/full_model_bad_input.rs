//! The full error model on input that tells too little, or of two arms: a sound answer or a clear refusal.

use crate::common;

use std::f64::consts::{FRAC_PI_2, PI};

use common::NOISE;
use nalgebra::{Isometry3, Point3, Vector3};
use posegrid::figures::Figures;
use posegrid::fit::commanded::{CommandFrames, commanded};
use posegrid::fit::full::layout::Block;
use posegrid::fit::full::{FullModel, FullSettings, Query};
use posegrid::fit::models::{Models, train};
use posegrid::fit::same_arm::{self, NotOneArm};
use posegrid::fit::{self, FitError, FitSettings, Observation, Purpose, TrainingSettings};
use posegrid::geometry::isometry_from_rpy;
use posegrid::join::Station;
use posegrid::kinematics::Arm;
use posegrid::simulate::{Poses, SimulateSettings, simulate};

/// The UR10 away from its singularities, degrees.
const HOME_DEG: [f64; 6] = [0.0, -70.0, 90.0, -110.0, -90.0, 0.0];

fn home() -> Vec<f64> {
    HOME_DEG.map(f64::to_radians).to_vec()
}

/// Random configurations `spread_deg` about home.
fn about_home(count: usize, spread_deg: [f64; 6]) -> Poses {
    let bound = |side: f64| -> Vec<f64> {
        let angles = HOME_DEG.iter().zip(spread_deg);
        angles.map(|(home, spread)| (home + side * spread).to_radians()).collect()
    };
    Poses::Joints { count, lower: bound(-1.0), upper: bound(1.0) }
}

/// A session of the arm that `seed` stands for, as session `session` of a pool.
fn simulated(arm: &Arm, seed: u64, session: usize, poses: Poses) -> Vec<Observation> {
    let mut settings = SimulateSettings::realistic(seed, home(), poses);
    // Every session has its tracker elsewhere.
    settings.cell.tracker_from_base_mm[1] += 500.0 * session as f64;
    let tool = isometry_from_rpy(
        settings.cell.flange_from_target_mm,
        settings.cell.flange_from_target_rpy,
    );
    let simulated = simulate(arm, &settings).expect("poses in reach");
    let frames =
        CommandFrames { base_from_command: Isometry3::identity(), flange_from_tool: Some(tool) };
    observed(arm, session, &simulated.stations(), &frames)
}

fn observed(
    arm: &Arm,
    session: usize,
    stations: &[Station],
    frames: &CommandFrames,
) -> Vec<Observation> {
    let mut observations = fit::observations(session, stations, arm, &NOISE);
    let commanded = commanded(stations, arm, frames);
    fit::add_commands(&mut observations, stations, &commanded);
    observations
}

fn trained(arm: &Arm, observations: &[Observation], sessions: usize) -> Result<Models, FitError> {
    let settings = TrainingSettings {
        fit: &FitSettings::default(),
        full: &FullSettings::default(),
        up: Some(Vector3::z_axis()),
        purpose: Purpose::Published,
    };
    train(arm, observations, sessions, &settings)
}

/// Mean distances on `test` that the full error model, geometry, and base + target leave, mm.
fn left(arm: &Arm, models: &Models, test: &[Observation]) -> [f64; 3] {
    let full = models.full.as_ref().expect("a positive definite model");
    let mean = |distance: &dyn Fn(&Observation) -> f64| {
        let distances: Vec<f64> = test.iter().map(distance).collect();
        Figures::of(&distances).expect("stations").mean
    };
    let by = |calibration: &fit::Calibration, o: &Observation| {
        let frames = calibration.frames[o.session].pair(o.source, o.target);
        let flange = arm.chain().forward(&o.axes, &calibration.geometry);
        let target = flange * frames.flange_from_target.origin().point();
        (common::position(o) - frames.tracker_from_base.isometry() * target).norm()
    };
    [
        mean(&|o| (common::position(o) - full.position(&Query::of(o))).norm()),
        mean(&|o| by(&models.geometric, o)),
        mean(&|o| by(&models.base_target, o)),
    ]
}

/// Every fourth station apart.
fn split(observations: Vec<Observation>) -> (Vec<Observation>, Vec<Observation>) {
    observations.into_iter().partition(|o| o.station % 4 != 3)
}

/// Standard deviation that the model expected of a joint's curve before any station.
fn expected_sd(full: &FullModel, joint: usize) -> f64 {
    let columns = full.trained.layout.columns(Block::Curve(joint)).expect("a curve");
    // cos² and sin² of a pair, each of the pair's variance, give it once.
    let variance: f64 = columns.step_by(2).map(|place| full.posterior.scale[place].powi(2)).sum();
    variance.sqrt()
}

#[test]
fn a_joint_that_never_moves_keeps_its_ignorance_and_costs_nothing() {
    const HELD: usize = 2;
    let arm = common::arm("ur10");
    let mut spread = [60.0, 40.0, 45.0, 60.0, 50.0, 120.0];
    spread[HELD] = 0.0;
    let (training, test) = split(simulated(&arm, 3, 0, about_home(160, spread)));
    let models = trained(&arm, &training, 1).expect("a fit");
    let [full, geometric, base_target] = left(&arm, &models, &test);
    println!("left: {full:.4} mm, geometry {geometric:.4}, base + target {base_target:.4}");
    assert!(full < geometric && geometric < base_target);
    let model = models.full.as_ref().expect("a model");
    let value = HOME_DEG[HELD].to_radians();
    let away: Vec<f64> =
        [30.0_f64, 60.0, 120.0, -45.0].map(|degrees| value + degrees.to_radians()).to_vec();
    let expected = expected_sd(model, HELD);
    for error in model.joint_curves().errors(HELD, &away) {
        println!("{error:?} of {expected:.2e}");
        assert!(error.error().is_finite() && error.error().abs() < expected);
        assert!(error.sd > 0.9 * expected, "{error:?} of {expected:.2e}");
    }
    // A pose with the joint elsewhere is as uncertain as the joint: lever times its deviation, and more.
    let mut elsewhere = test[0].clone();
    elsewhere.axes[HELD] += 60.0_f64.to_radians();
    let deviation =
        |o: &Observation| model.covariances(&model.predict(&Query::of(o)).rows)[0].trace().sqrt();
    assert!(deviation(&elsewhere) > 3.0 * deviation(&test[0]));
    // A joint that moved is known where it moved.
    let moved = model.joint_curves().errors(0, &[0.0])[0].sd;
    assert!(moved < 0.9 * expected_sd(model, 0), "{moved:.2e}");
}

#[test]
fn stations_on_one_line_are_refused_with_their_spread() {
    let arm = common::arm("ur10");
    let target =
        SimulateSettings::exact(0, home(), about_home(0, [0.0; 6])).cell.flange_from_target_mm;
    let at_home = arm.flange(&home()).isometry() * Point3::from(target);
    let along = Vector3::new(0.0, 200.0, 0.0);
    let (roll, pitch, yaw) = arm.flange(&home()).isometry().rotation.euler_angles();
    let (lower_mm, upper_mm) = ((at_home.coords - along).into(), (at_home.coords + along).into());
    for cone_deg in [0.0_f64, 20.0] {
        let poses = Poses::Box {
            count: 60,
            lower_mm,
            upper_mm,
            orientation_rpy: [roll, pitch, yaw],
            cone_rad: cone_deg.to_radians(),
        };
        let refused = trained(&arm, &simulated(&arm, 3, 0, poses), 1).expect_err("a line");
        let FitError::Degenerate { session, spread_mm } = refused else {
            panic!("{refused}");
        };
        assert_eq!(session, 0);
        assert!(spread_mm < 1.0, "{spread_mm}");
    }
}

/// Trains a pool and asks whether it is of one arm.
fn pooled(arm: &Arm, observations: &[Observation], names: &[&str]) -> Result<(), NotOneArm> {
    let models = trained(arm, observations, names.len()).expect("a fit");
    let full = models.full.as_ref().expect("a model");
    let change_rad = FullSettings::default().session_curve_sd_rad;
    for fit in same_arm::fits(arm, full, &models.base_target, observations, change_rad) {
        println!("{}: {fit:?}, ratio {:.3}", names[fit.session], fit.ratio());
    }
    same_arm::check(arm, full, &models.base_target, observations, names, change_rad)
}

const WIDE: [f64; 6] = [60.0, 40.0, 45.0, 60.0, 50.0, 120.0];
const NARROW: [f64; 6] = [30.0, 30.0, 60.0, 40.0, 30.0, 60.0];

#[test]
fn sessions_of_two_arms_are_refused_and_of_one_are_not() {
    let arm = common::arm("ur10");
    let session = |seed: u64, place: usize, spread: [f64; 6]| {
        simulated(&arm, seed, place, about_home(100, spread))
    };
    for seeds in [(11, 12), (15, 16)] {
        let one = [session(seeds.0, 0, WIDE), session(seeds.0, 1, NARROW)].concat();
        pooled(&arm, &one, &["mon", "tue"]).expect("one arm");
        let two = [session(seeds.0, 0, WIDE), session(seeds.1, 1, NARROW)].concat();
        let refused = pooled(&arm, &two, &["mon", "tue"]).expect_err("two arms");
        assert!(
            refused.shared_mm > refused.allowed_mm
                && refused.shared_mm > same_arm::LIMIT * refused.nominal_mm,
            "{refused}"
        );
    }
    // Among sessions of another arm the stranger is the one that is named.
    let three = [session(11, 0, WIDE), session(12, 1, NARROW), session(11, 2, NARROW)].concat();
    let refused = pooled(&arm, &three, &["mon", "tue", "wed"]).expect_err("two arms");
    assert_eq!(refused.session, "tue", "{refused}");
}

#[test]
fn recordings_of_one_arm_months_apart_are_never_refused() {
    let arm = common::arm("ur10");
    let names = ["ur10-grid", "ur10-random-a", "ur10-random-b", "ur10-joint"];
    let frames = CommandFrames {
        base_from_command: isometry_from_rpy([0.0; 3], [0.0, 0.0, PI]),
        flange_from_tool: Some(isometry_from_rpy([0.0, 0.0, 109.0], [0.0, 0.0, FRAC_PI_2])),
    };
    for pool in [&names[..], &names[2..]] {
        let mut all = Vec::new();
        for (place, name) in pool.iter().enumerate() {
            let Some(stations) = common::truth_stations(name) else {
                return;
            };
            let own = observed(&arm, place, &stations, &frames);
            all.extend(own.into_iter().filter(|o| o.station % 4 == 0));
        }
        pooled(&arm, &all, pool).expect("one arm");
    }
}
