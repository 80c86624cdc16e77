//! Arms whose geometry is known exactly: their corrections are checked by forward kinematics.

use nalgebra::{Point3, Vector3};

use super::*;
use crate::compensation::TargetJoints;
use crate::fit::{FramePair, IdentifiedGeometry};
use crate::geometry::isometry_from_rpy;
use crate::kinematics::{Configuration, InverseError, RobotFile, SingularityFactors};

mod other_arms;

fn arm(text: &str) -> Arm {
    let file: RobotFile = toml::from_str(text).expect("a robot file of this repository");
    file.arm().expect("a valid arm")
}

fn kr210() -> Arm {
    arm(include_str!("../../../../pipelines/robots/kr210-r2700-extra.toml"))
}

fn ur10() -> Arm {
    arm(include_str!("../../../../pipelines/robots/ur10.toml"))
}

/// Whether joint angles are the same but for rounding.
fn same(own: &[f64], other: &[f64]) -> bool {
    own.len() == other.len() && own.iter().zip(other).all(|(a, b)| (a - b).abs() < 1e-12)
}

fn radians(degrees: [f64; 6]) -> Vec<f64> {
    degrees.map(f64::to_radians).to_vec()
}

/// 0.4 mm and 0.3 mrad at each parameter; commands are stated in a frame turned by 90° from the base.
fn identified(arm: &Arm, lower: [f64; 6], upper: [f64; 6]) -> IdentifiedArm {
    let ranges = radians(lower).into_iter().zip(radians(upper));
    measured_within(arm, ranges.map(<[f64; 2]>::from).collect())
}

fn measured_within(arm: &Arm, measured: Vec<[f64; 2]>) -> IdentifiedArm {
    let tool = isometry_from_rpy([30.0, -20.0, 150.0], [0.1, 0.2, 0.3]);
    let offsets: Vec<f64> = arm
        .chain()
        .parameters()
        .iter()
        .map(|parameter| if parameter.is_angle() { 3e-4 } else { 0.4 })
        .collect();
    let frames = FramePair::only(
        Transform::claim(isometry_from_rpy([4000.0, 0.0, -600.0], [0.0, 0.0, 2.5])),
        Transform::claim(isometry_from_rpy([0.0, 0.0, 90.0], [0.0; 3])),
    );
    IdentifiedArm {
        table_id: "00ff".to_owned(),
        arm: arm.clone(),
        frames,
        flange_from_tool: Transform::claim(tool),
        command_from_base: Transform::claim(isometry_from_rpy(
            [100.0, -50.0, 20.0],
            [0.0, 0.0, std::f64::consts::FRAC_PI_2],
        )),
        model: ArmModel {
            model: Model::Geometric,
            predicts: Box::new(IdentifiedGeometry {
                chain: arm.chain().with_offsets(&offsets),
                frames: vec![frames.into()],
                misfit_mm: 0.02,
            }),
            session: 0,
            shown: None,
        },
        measured,
        configurations: ["+", "-"]
            .iter()
            .flat_map(|shoulder| ["+", "-"].map(|elbow| (*shoulder, elbow)))
            .flat_map(|(shoulder, elbow)| {
                ["+", "-"].map(|wrist| format!("shoulder{shoulder} elbow{elbow} wrist{wrist}"))
            })
            .collect(),
        validity: Validity::default(),
        frame_uncertainty: FrameUncertainty::default(),
    }
}

/// The KR 210 with ranges as one cell would measure them.
fn cell() -> IdentifiedArm {
    identified(
        &kr210(),
        [-60.0, -120.0, 40.0, -90.0, 20.0, -120.0],
        [60.0, -40.0, 130.0, 90.0, 110.0, 120.0],
    )
}

const JOINTS: [f64; 6] = [33.0, -72.0, 101.0, -58.0, 44.0, 107.0];

fn at_joints(degrees: [f64; 6]) -> Target {
    Target {
        name: "rivet 7".to_owned(),
        joints: Some(TargetJoints { slides: None, names: Vec::new(), angles: radians(degrees) }),
        ..Target::default()
    }
}

/// The pose that the nominal arm has at joint angles, in the frame of commands, with its arm configuration.
fn at_pose(identified: &IdentifiedArm, joints: &[f64]) -> Target {
    let arm = &identified.arm;
    let nominal = arm.no_offsets();
    let pose =
        identified.command_from_base.isometry() * identified.error_frame().nominal_tool(joints);
    let configuration = Configuration::of(arm, &nominal, joints);
    Target {
        name: "rivet 7".to_owned(),
        position: Some(Position::claim(Point3::from(pose.translation.vector))),
        orientation: Some(pose.rotation),
        configuration: configuration.map(|own| own.to_string()),
        ..Target::default()
    }
}

fn one(identified: &IdentifiedArm, target: Target) -> Result<Corrected, Reason> {
    let mut all = identified.compensate(&[target], &[], Covariances::Given);
    all.remove(0).map_err(|refused| refused.reason)
}

#[test]
fn the_identified_arm_attains_the_target_at_the_corrected_command() {
    let identified = cell();
    let found = one(&identified, at_joints(JOINTS)).expect("inside");
    let geometry = identified.model.is::<IdentifiedGeometry>();
    let geometry = geometry.expect("made so");
    let joints = found.joints.as_ref().expect("joint angles");
    assert!(same(&joints.target, &radians(JOINTS)), "{joints:?}");
    let tool = identified.flange_from_tool.isometry();
    let attained = geometry.chain.nominal(&joints.command) * tool;
    let nominal = identified.arm.chain().nominal(&radians(JOINTS)) * tool;
    assert!((attained.translation.vector - nominal.translation.vector).norm() < 1e-6);
    assert!(found.correction.norm() > 0.5, "a large correction");
    // The orientation is commanded without a correction.
    let commanded = identified.arm.chain().nominal(&joints.command) * tool;
    assert!(commanded.rotation.angle_to(&nominal.rotation) < 1e-9);
    // 0.02 mm along each axis, whatever the frame.
    assert!(
        (found.standard_deviation_norm().expect("given") - 0.02 * 3.0_f64.sqrt()).abs() < 1e-12
    );
}

#[test]
fn a_correction_is_as_uncertain_as_the_surveyed_frame_is_at_the_target() {
    let mut identified = cell();
    let without = one(&identified, at_joints(JOINTS)).expect("inside");
    identified.frame_uncertainty =
        FrameUncertainty { origin_mm: 0.03, rotation_rad: 1e-4, lever_mm: 0.04 };
    let with = one(&identified, at_joints(JOINTS)).expect("inside");
    assert_eq!(with.command, without.command);
    // The axes of commands lie in (100, −50, 20) mm from the base's origin, and the form of the covariance is that of any turned axes.
    let at = with.target.coords() - Vector3::new(100.0, -50.0, 20.0);
    let across = Matrix3::identity() * at.norm_squared() - at * at.transpose();
    let expected = Matrix3::identity() * 0.0025 + across * 1e-8;
    let [with_covariance, without_covariance] =
        [&with, &without].map(|own| own.covariance.expect("given"));
    let added = with_covariance - without_covariance;
    assert!((added - expected).abs().max() < 1e-12, "{added}");
    assert!((with.of_frame - expected).abs().max() < 1e-12);
    assert!(expected.trace() > 10.0 * without_covariance.trace(), "not lost beside the model's");
}

#[test]
fn a_pose_and_its_joint_angles_give_the_same_command() {
    let identified = cell();
    let by_joints = one(&identified, at_joints(JOINTS)).expect("inside");
    let pose = at_pose(&identified, &radians(JOINTS));
    let by_pose = one(&identified, pose.clone()).expect("inside");
    assert!((by_pose.command.coords() - by_joints.command.coords()).norm() < 1e-6);
    assert!((by_pose.correction - by_joints.correction).norm() < 1e-6);
    let both = Target { orientation: None, ..pose };
    let both = Target { joints: at_joints(JOINTS).joints, ..both };
    let by_both = one(&identified, both).expect("inside");
    assert!((by_both.command.coords() - by_joints.command.coords()).norm() < 1e-6);
    let turned = at_pose(&identified, &radians(JOINTS)).orientation.map(|own| own.inverse());
    let contrary = Target { orientation: turned, ..at_joints(JOINTS) };
    let refused = one(&identified, contrary).expect_err("an orientation of other joint angles");
    assert!(matches!(refused, Reason::Apart { apart_deg, .. } if apart_deg > 5.0), "{refused}");
    let (Some(a), Some(b)) = (by_pose.joints, by_joints.joints) else {
        panic!("joint angles");
    };
    let apart = a.command.iter().zip(&b.command).map(|(a, b)| (a - b).abs());
    assert!(apart.fold(0.0, f64::max) < 1e-8);
}

#[test]
fn named_joints_may_be_in_any_order() {
    let identified = cell();
    let mut target = at_joints(JOINTS);
    let own = identified.arm.joints().iter().rev();
    let joints = target.joints.as_mut().expect("joint angles");
    joints.angles.reverse();
    joints.names = own.map(|joint| joint.name.clone()).collect();
    let turned = one(&identified, target.clone()).expect("the same target");
    let plain = one(&identified, at_joints(JOINTS)).expect("inside");
    assert_eq!(turned, plain);
    target.joints.as_mut().expect("joint angles").names[2] = "elbow".to_owned();
    let refused = one(&identified, target).expect_err("of another arm");
    assert!(refused.to_string().contains("elbow"), "{refused}");
    assert!(matches!(refused, Reason::Joints { .. }));
}

#[test]
fn angles_not_measured_are_refused_with_joint_and_distance_and_can_be_allowed() {
    let identified = cell();
    let mut asked = JOINTS;
    asked[0] = 72.5;
    let refused = one(&identified, at_joints(asked)).expect_err("12.5° beyond");
    let Reason::JointRange { joint, beyond, unit, .. } = &refused else { panic!("{refused}") };
    assert_eq!(joint, "joint_a1");
    assert!((beyond - 12.5).abs() < 1e-9 && *unit == "°");
    let allowed =
        identified.compensate(&[at_joints(asked)], &[Exception::JointRange], Covariances::Given);
    let allowed = allowed[0].as_ref().expect("allowed");
    assert_eq!(allowed.allowed, [Exception::JointRange]);
    // Half a degree beyond the rim is as good as measured.
    asked[0] = 60.4;
    assert!(one(&identified, at_joints(asked)).is_ok());
}

#[test]
fn an_arm_configuration_that_no_station_was_in_is_refused_and_can_be_allowed() {
    let mut identified = cell();
    let own = at_pose(&identified, &radians(JOINTS)).configuration;
    let own = own.expect("six axes");
    identified.configurations.retain(|other| *other != own);
    assert_eq!(identified.configurations.len(), 7);
    let refused = one(&identified, at_joints(JOINTS)).expect_err("never measured");
    assert!(matches!(refused, Reason::NeverMeasured { .. }));
    assert!(
        refused.to_string().contains(&format!("{own:?}"))
            && refused.to_string().contains(&identified.configurations[0]),
        "{refused}"
    );
    let allowed = identified.compensate(
        &[at_joints(JOINTS)],
        &[Exception::Configuration],
        Covariances::Given,
    );
    let allowed = allowed[0].as_ref().expect("allowed");
    assert_eq!(allowed.allowed, [Exception::Configuration]);
    // Another exception does not allow it.
    let ranges =
        identified.compensate(&[at_joints(JOINTS)], &[Exception::JointRange], Covariances::Given);
    assert!(ranges[0].is_err());
    identified.configurations = vec![own];
    let within = one(&identified, at_joints(JOINTS)).expect("measured");
    assert_eq!(within.allowed, []);
}

#[test]
fn limits_and_singularities_are_refused_for_targets_in_joint_angles() {
    let identified = cell();
    let mut target = JOINTS;
    target[4] = 0.5; // sin 0.5° = 0.009, below the 0.02 of grids
    let singular = one(&identified, at_joints(target));
    assert!(matches!(singular, Err(Reason::Arm(InverseError::NearSingularity { .. }))));
    target[4] = 126.0; // the limit is 125°
    let beyond = one(&identified, at_joints(target));
    assert!(matches!(beyond, Err(Reason::Arm(InverseError::LimitReached { .. }))));
    let mut turned = at_joints(JOINTS);
    turned.configuration = Some("shoulder+ elbow+ wrist+".to_owned());
    let refused = one(&identified, turned).expect_err("the joint angles are in another");
    assert!(matches!(refused, Reason::Configuration { .. }), "{refused:?}");
}

#[test]
fn the_same_joint_angles_are_found_for_poses_all_over_the_work_space() {
    let wide = [
        identified(
            &kr210(),
            [-170.0, -135.0, -100.0, -340.0, -120.0, -340.0],
            [170.0, -10.0, 150.0, 340.0, 120.0, 340.0],
        ),
        identified(&ur10(), [-180.0; 6], [180.0; 6]),
    ];
    for identified in &wide {
        let reach = Reach::new(&identified.arm, *identified.flange_from_tool.isometry());
        let spread = |number: u32| -> Vec<f64> {
            let share =
                |joint: usize| (f64::from(number) * 2.0_f64.sqrt() * (joint + 3) as f64).fract();
            let ranges = identified.measured.iter().enumerate();
            ranges.map(|(joint, [low, high])| low + (high - low) * share(joint)).collect()
        };
        let pose = |joints: &Vec<f64>| identified.error_frame().nominal_tool(joints);
        // Nearer than 6° to a stretched elbow the search may end at the stretched arm from any seed.
        let nominal = identified.arm.no_offsets();
        let is_far = |joints: &Vec<f64>| {
            SingularityFactors::of(&identified.arm, &nominal, joints)
                .is_some_and(|factors| factors.smallest() > 0.1)
        };
        let reachable = |joints: &Vec<f64>| {
            is_far(joints) && reach.inverse.joints(&pose(joints), joints).is_ok()
        };
        let asked: Vec<Vec<f64>> = (0..400).map(spread).filter(reachable).collect();
        let targets: Vec<Target> = asked.iter().map(|joints| at_pose(identified, joints)).collect();
        let outcomes = identified.compensate(&targets, &[], Covariances::Given);
        let mut found = 0;
        for (joints, done) in asked.iter().zip(&outcomes) {
            let Ok(done) = done else { continue };
            found += 1;
            let again = &done.joints.as_ref().expect("joint angles").target;
            let apart: Vector3<f64> =
                pose(again).translation.vector - pose(joints).translation.vector;
            assert!(apart.norm() < 1e-6);
            assert!(pose(again).rotation.angle_to(&pose(joints).rotation) < 1e-7);
        }
        let refused = outcomes.iter().filter_map(|outcome| outcome.as_ref().err());
        let refused: Vec<String> = refused.map(ToString::to_string).collect();
        println!("{found} of {}", asked.len());
        // A failed search refuses a pose that is reachable: at most one in a hundred may fail, and none may be wrong.
        assert!(asked.len() > 250, "{}", asked.len());
        assert!(100 * found >= 99 * asked.len(), "{refused:?}");
    }
}

#[test]
fn an_error_far_beyond_those_of_the_stations_is_refused_with_both_numbers() {
    let mut identified = cell();
    let found = one(&identified, at_joints(JOINTS)).expect("nothing is said of the stations");
    let correction_mm = found.correction.norm();
    identified.validity.largest_error_mm = Some(correction_mm / 1.4);
    assert!(one(&identified, at_joints(JOINTS)).is_ok());
    identified.validity.largest_error_mm = Some(correction_mm / 1.6);
    let refused = one(&identified, at_joints(JOINTS)).expect_err("1.6 times the largest");
    let Reason::TooLarge { error_mm, largest_mm } = refused else { panic!("{refused}") };
    // The error at the target and at its command differ by micrometres.
    assert!((error_mm - correction_mm).abs() < 0.05);
    assert!((largest_mm - correction_mm / 1.6).abs() < 1e-12);
}

#[test]
fn a_joint_a_whole_turn_away_is_commanded_there_where_its_errors_repeat() {
    let identified = cell();
    let here = one(&identified, at_joints(JOINTS)).expect("measured");
    let mut turned = JOINTS;
    turned[5] -= 360.0; // −253°, the limit is −350°
    let there = one(&identified, at_joints(turned)).expect("the same but for a turn");
    assert!((here.command.coords() - there.command.coords()).norm() < 1e-6);
    let [here, there] = [here, there].map(|found| found.joints.expect("joint angles"));
    for joint in 0..6 {
        let turn = if joint == 5 { TAU } else { 0.0 };
        assert!((here.command[joint] - there.command[joint] - turn).abs() < 1e-9);
        assert!((here.target[joint] - there.target[joint] - turn).abs() < 1e-9);
    }
    // Another turn is beyond the limit, and a part of one is another pose, beside what was measured on every turn.
    turned[5] = 107.0 + 360.0;
    let beyond = one(&identified, at_joints(turned)).expect_err("467°");
    assert!(matches!(beyond, Reason::Arm(InverseError::LimitReached { .. })));
    turned[5] = 107.0 + 100.0;
    let part = one(&identified, at_joints(turned)).expect_err("never measured");
    assert!(matches!(part, Reason::JointRange { .. }));
}

#[test]
fn a_joint_that_moves_another_axis_by_a_part_of_a_turn_does_not_repeat() {
    let text = include_str!("../../../../pipelines/robots/kr210-r2700-extra.toml");
    let mut file: RobotFile = toml::from_str(text).expect("a robot file of this repository");
    let mut map = vec![vec![0.0; 6]; 6];
    for (axis, row) in map.iter_mut().enumerate() {
        row[axis] = 1.0;
    }
    // Axis 5 turns by a sixth of joint 6, and axis 6 once more with joint 4.
    map[4][5] = 1.0 / 6.0;
    map[5][3] = 1.0;
    file.joint_map = Some(map);
    let coupled = identified(&file.arm().expect("a valid arm"), [-60.0; 6], [60.0; 6]);
    let periods = coupled.periods();
    assert_eq!(periods, [Some(TAU), Some(TAU), Some(TAU), Some(TAU), Some(TAU), None]);
    // Whether so many whole turns are taken off an angle of a joint whose errors repeat after a period.
    let takes = |joint: usize, degrees: f64, period: Option<f64>, expected: f64| {
        let turns = coupled.turns_beyond(joint, degrees.to_radians(), period);
        (turns / TAU - expected).abs() < 1e-9
    };
    assert!(takes(3, 330.0, periods[3], 1.0));
    assert!(takes(3, 20.0, periods[3], 0.0));
    assert!(takes(3, 100.0, periods[3], 0.0));
    assert!(takes(5, 330.0, periods[5], 0.0));
    // Of curves that repeat after two turns, one turn is not enough.
    assert!(takes(3, 330.0, Some(2.0 * TAU), 0.0));
    assert!(takes(3, 690.0, Some(2.0 * TAU), 2.0));
}
