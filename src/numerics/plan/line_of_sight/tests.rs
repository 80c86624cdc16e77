use std::f64::consts::FRAC_PI_2;

use nalgebra::Vector3;

use super::*;
use crate::kinematics::RobotFile;

fn kr210() -> Arm {
    let text = include_str!("../../../../pipelines/robots/kr210-r2700-extra.toml");
    let file: RobotFile = toml::from_str(text).expect("a robot file of this repository");
    file.arm().expect("a valid arm")
}

/// Arm 90° up, forearm level: axis 2 at (350, 0, 675), axis 3 at (350, 0, 1825), wrist at (1550, 0, 1866), flange and
/// target in front of it.
const LEVEL_DEG: [f64; 6] = [0.0, -90.0, 90.0, 0.0, 30.0, 0.0];

fn level() -> [f64; 6] {
    LEVEL_DEG.map(f64::to_radians)
}

fn free() -> Constraints {
    Constraints {
        configuration: None,
        least_singularity_factor: 0.0,
        limit_margin_rad: 0.0,
        flange_from_target: Isometry3::translation(0.0, 0.0, 100.0),
        keep_out: Vec::new(),
        keep_out_margin_mm: 100.0,
        tracker: None,
    }
}

/// A target that faces along its z axis towards a tracker straight in front of it, at a distance of `away` mm.
fn seen_from_before(arm: &Arm, away: f64) -> Constraints {
    let target = *arm.flange(&level()).isometry() * free().flange_from_target;
    let tracker = target * Point3::new(0.0, 0.0, away);
    Constraints {
        tracker: Some(LineOfSight {
            tracker,
            facing: Vector3::z_axis(),
            acceptance_rad: 30.0_f64.to_radians(),
            range_mm: [1000.0, 20_000.0],
            link_radius_mm: 150.0,
        }),
        ..free()
    }
}

fn line_of_sight(constraints: &mut Constraints) -> &mut LineOfSight {
    constraints.tracker.as_mut().expect("set above")
}

#[test]
fn a_pose_that_nothing_speaks_against_may_be_measured() {
    let arm = kr210();
    assert_eq!(verdict(&arm, &level(), &free()), Ok(()));
    assert_eq!(verdict(&arm, &level(), &seen_from_before(&arm, 5000.0)), Ok(()));
}

#[test]
fn a_limit_is_named_with_its_margin() {
    let arm = kr210();
    // Joint 3 goes from −120° to 155°.
    let mut joints = level();
    joints[2] = 154.0_f64.to_radians();
    assert_eq!(verdict(&arm, &joints, &free()), Ok(()));
    let mut constraints = free();
    constraints.limit_margin_rad = 2.0_f64.to_radians();
    let found = verdict(&arm, &joints, &constraints).expect_err("1° before its limit");
    let text = found.to_string();
    assert!(matches!(found, Unsuitable::BeyondLimit { .. }));
    assert!(text.contains("154.000°") && text.contains("153.000°"), "{text}");
    joints[2] = f64::NAN;
    assert!(verdict(&arm, &joints, &free()).is_err());
}

#[test]
fn configuration_and_singularity_are_reported() {
    let arm = kr210();
    let nominal = arm.no_offsets();
    let own = Configuration::of(&arm, &nominal, &level()).expect("six axes");
    let mut constraints = free();
    constraints.configuration = Some(own);
    assert_eq!(verdict(&arm, &level(), &constraints), Ok(()));
    let mut flipped = level();
    flipped[4] = -flipped[4];
    assert!(matches!(
        verdict(&arm, &flipped, &constraints),
        Err(Unsuitable::OtherConfiguration { wanted, .. }) if wanted == own
    ));
    // The wrist's factor is sin 30°; those of elbow and shoulder are larger.
    constraints.least_singularity_factor = 0.49;
    assert_eq!(verdict(&arm, &level(), &constraints), Ok(()));
    constraints.least_singularity_factor = 0.51;
    assert!(matches!(
        verdict(&arm, &level(), &constraints),
        Err(Unsuitable::NearSingularity { factor, .. }) if (factor - 0.5).abs() < 1e-12
    ));
}

#[test]
fn a_box_stops_the_part_that_enters_it() {
    let arm = kr210();
    let within = |least_mm: [f64; 3], most_mm: [f64; 3]| {
        let mut constraints = free();
        constraints.keep_out = vec![KeepOut { name: "fixture".to_owned(), least_mm, most_mm }];
        verdict(&arm, &level(), &constraints)
    };
    let stopped = |part| {
        Err(Unsuitable::InKeepOut { keep_out: "fixture".to_owned(), part, margin_mm: 100.0 })
    };
    // Next to the middle of the upper arm, which is at x = 350: no joint origin is near. 99 mm are too near, 101 not.
    let beside = |gap: f64| within([350.0 + gap, -10.0, 1200.0], [600.0, 10.0, 1300.0]);
    assert_eq!(beside(99.0), stopped(Part::Link(2)));
    assert_eq!(beside(101.0), Ok(()));
    // Around the target, which is 315 mm in front of the wrist, 30° down; the flange is 100 mm behind it.
    let target = *arm.flange(&level()).isometry() * free().flange_from_target;
    let at = target.translation.vector;
    let before = [at.x + 90.0, at.y - 10.0, at.z - 50.0];
    let found = within(before, [before[0] + 50.0, before[1] + 20.0, before[2] + 20.0]);
    assert_eq!(found, stopped(Part::Target));
    // A floor under the base, up to the first axis' own line.
    assert_eq!(within([-2000.0, -2000.0, -500.0], [2000.0, 2000.0, -150.0]), Ok(()));
}

#[test]
fn range_and_acceptance_are_held() {
    let arm = kr210();
    for (away, range_mm) in [(900.0, 900.0), (21_000.0, 21_000.0)] {
        assert!(matches!(
            verdict(&arm, &level(), &seen_from_before(&arm, away)),
            Err(Unsuitable::OutOfRange { range_mm: found, .. }) if (found - range_mm).abs() < 1e-6
        ));
    }
    // 40° off the target's axis, where 30° are accepted; turned about the target's x.
    let mut constraints = seen_from_before(&arm, 5000.0);
    let tilt = 40.0_f64.to_radians();
    let facing = Vector3::new(0.0, tilt.sin(), tilt.cos());
    line_of_sight(&mut constraints).facing = UnitVector3::new_normalize(facing);
    assert!(matches!(
        verdict(&arm, &level(), &constraints),
        Err(Unsuitable::TurnedAway { angle_deg, .. }) if (angle_deg - 40.0).abs() < 1e-9
    ));
    line_of_sight(&mut constraints).acceptance_rad = 41.0_f64.to_radians();
    assert_eq!(verdict(&arm, &level(), &constraints), Ok(()));
}

#[test]
fn the_upper_arm_stands_in_the_beam_of_a_tracker_behind_it() {
    let arm = kr210();
    // The target faces back over the arm; the tracker is behind the base, on the other side of the upper arm.
    let mut constraints = seen_from_before(&arm, 5000.0);
    let line_of_sight = line_of_sight(&mut constraints);
    line_of_sight.tracker = Point3::new(-4000.0, 0.0, 700.0);
    line_of_sight.acceptance_rad = FRAC_PI_2 * 2.0;
    let found = verdict(&arm, &level(), &constraints);
    assert!(
        matches!(found, Err(Unsuitable::BeamBlocked { part: Part::Link(2), distance_mm, .. }) if distance_mm < 1e-9),
        "{found:?}"
    );
    // From far enough to the side the same target is visible.
    if let Some(line_of_sight) = constraints.tracker.as_mut() {
        line_of_sight.tracker = Point3::new(1700.0, 6000.0, 1000.0);
    }
    assert_eq!(verdict(&arm, &level(), &constraints), Ok(()));
}

#[test]
fn an_arm_without_six_axes_is_reported_so_only_when_it_matters() {
    let text = include_str!("../../../../pipelines/robots/kr210-r2700-extra.toml");
    let mut file: RobotFile = toml::from_str(text).expect("a robot file");
    file.joint.truncate(3);
    file.home_deg = None;
    let arm = file.arm().expect("three axes");
    let joints = [0.0, -FRAC_PI_2, FRAC_PI_2];
    assert_eq!(verdict(&arm, &joints, &free()), Ok(()));
    let mut constraints = free();
    constraints.least_singularity_factor = 0.1;
    assert_eq!(verdict(&arm, &joints, &constraints), Err(Unsuitable::NoConfiguration { axes: 3 }));
}
