//! The geometric rows of the recordings' reference table, reproduced on stations that took no part in the fit.

use crate::common;

use common::NOISE;
use posegrid::figures::Figures;
use posegrid::fit::{self, FitSettings, Freedom, KnownTarget, Observation};
use posegrid::join::Station;
use posegrid::kinematics::Arm;

/// Mean norm of measured minus predicted on `test`, from a fit on `train` alone.
fn held_out(arm: &Arm, train: &[Observation], test: &[Observation], freedom: Freedom) -> Figures {
    let calibration =
        fit::identify(arm, train, 1, freedom, &FitSettings::default()).expect("a fit");
    let chain = &calibration.chain;
    let frames = calibration.frames[0].one().expect("one source and target");
    println!("{frames:?} {:?} {:?}", calibration.solution.cost, calibration.solution.convergence);
    let error = |observation: &Observation| {
        let flange = chain.nominal(&observation.axes);
        let target = flange * frames.flange_from_target.origin().point();
        (common::position(observation) - frames.tracker_from_base.isometry() * target).norm()
    };
    Figures::of(&test.iter().map(error).collect::<Vec<_>>()).expect("stations to judge by")
}

/// Whether a grid station is held out: the rule of the recordings' reference table, on commands rounded to mm.
fn is_in_held_out_block(station: &Station) -> bool {
    let command = station.command.as_ref().expect("a command").position.map(f64::round);
    let odd = |value: f64, origin: f64, size: f64| {
        ((value - origin) / size).floor().rem_euclid(2.0) >= 1.0
    };
    odd(command.x, 625.0, 100.0) && odd(command.y, -650.0, 200.0) && !odd(command.z, 350.0, 200.0)
}

#[test]
fn random_a_predicts_random_b_as_the_reference_does() {
    let arm = common::arm("ur10");
    let (Some(a), Some(b)) =
        (common::truth_stations("ur10-random-a"), common::truth_stations("ur10-random-b"))
    else {
        return;
    };
    let (train, test) =
        (fit::observations(0, &a, &arm, &NOISE), fit::observations(0, &b, &arm, &NOISE));
    assert_eq!((train.len(), test.len()), (700, 700)); // the truth has also what five stations lost in the log
    let before = held_out(&arm, &train, &test, Freedom::BaseAndTarget);
    let after = held_out(&arm, &train, &test, Freedom::Geometry);
    println!("before {before:?}\nafter {after:?}");
    assert!((before.mean - 0.9025).abs() < 0.01, "base + target only: {before:?}");
    assert!((after.mean - 0.4424).abs() < 0.01, "geometric: {after:?}");
}

#[test]
fn grid_blocks_are_predicted_as_the_reference_does() {
    let arm = common::arm("ur10");
    let Some(stations) = common::truth_stations("ur10-grid") else {
        return;
    };
    let (test, train): (Vec<Station>, Vec<Station>) =
        stations.into_iter().partition(is_in_held_out_block);
    assert_eq!((train.len(), test.len()), (519, 96));
    let (train, test) =
        (fit::observations(0, &train, &arm, &NOISE), fit::observations(0, &test, &arm, &NOISE));
    let before = held_out(&arm, &train, &test, Freedom::BaseAndTarget);
    let after = held_out(&arm, &train, &test, Freedom::Geometry);
    println!("before {before:?}\nafter {after:?}");
    assert!((before.mean - 0.7365).abs() < 0.01, "base + target only: {before:?}");
    assert!((after.mean - 0.4088).abs() < 0.01, "geometric: {after:?}");
}

#[test]
fn poses_of_one_orientation_do_not_tell_the_target_from_the_base_and_others_do() {
    let arm = common::arm("ur10");
    let known = KnownTarget { xyz_mm: [-0.2, 0.2, 92.8], sd_mm: 1.0 };
    let open_mm = |session: &str, target: Option<KnownTarget>| {
        let stations = common::truth_stations(session)?;
        let seen = fit::observations(0, &stations, &arm, &NOISE);
        let settings = FitSettings { target, ..FitSettings::default() };
        let found = fit::identify(&arm, &seen, 1, Freedom::BaseAndTarget, &settings);
        Some(found.expect("a fit").open_target_mm(0))
    };
    let Some(grid) = open_mm("ur10-grid", None) else {
        return;
    };
    // The nominal flange turns by 1 mrad from station to station: 0.5 mm of errors over 1 mrad and the root of 615 stations.
    assert!(grid.is_some_and(|mm| (5.0..100.0).contains(&mm)), "{grid:?}");
    assert_eq!(open_mm("ur10-grid", Some(known)), Some(None));
    assert_eq!(open_mm("ur10-random-a", None), Some(None));
}

#[test]
fn the_ur10_has_27_parameters_to_find() {
    let arm = common::arm("ur10");
    assert_eq!(arm.parallel_joints(), [2, 3]);
    let Some(a) = common::truth_stations("ur10-random-a") else {
        return;
    };
    let observations = fit::observations(0, &a, &arm, &NOISE);
    let calibration =
        fit::identify(&arm, &observations, 1, Freedom::Geometry, &FitSettings::default())
            .expect("a fit");
    println!("{:?}", calibration.structure.singular_values);
    for (place, unknown) in calibration.unknowns.iter().enumerate() {
        let others: Vec<_> = calibration
            .confounded_with(place)
            .iter()
            .map(|&o| calibration.unknowns[o].parameter.to_string())
            .collect();
        println!(
            "{} {:.4} {:.4} {others:?}",
            unknown.parameter,
            calibration.solution.offsets[place],
            calibration.standard_error(place)
        );
    }
    assert_eq!(calibration.nominal_structure.rank, 27);
    println!(
        "condition {} s2 {} {:?} {} steps",
        calibration.structure.condition(),
        calibration.solution.variance_factor,
        calibration.solution.convergence,
        calibration.solution.iterations
    );
}
