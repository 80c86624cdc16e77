//! Arms with more or fewer than six joints, with a linear axis, and without arm configurations.

use super::*;
use crate::kinematics::{Axis, Chain, Convention, Element, Joint, LinkQuantity, Motion, Parameter};

/// A link in standard DH: a, α in degrees, d.
type Link = [f64; 3];

/// Joints of ±170° in standard DH, each link with its four parameters; a track along y before them where there is one.
fn arm_of(links: &[Link], has_track: bool) -> Arm {
    let mut elements = Vec::new();
    let mut joints = Vec::new();
    let mut named = |limit: f64| {
        joints.push(Joint {
            name: format!("j{}", joints.len() + 1),
            lower: -limit,
            upper: limit,
            slides: limit > 100.0,
        });
    };
    if has_track {
        named(2000.0);
        elements.push(Element::Joint { motion: Motion::Translation(Axis::Y), joint: 0, sign: 1.0 });
    }
    for (place, [a, alpha, d]) in links.iter().enumerate() {
        named(170.0_f64.to_radians());
        elements.extend(link([*a, *alpha, *d], place + usize::from(has_track)));
    }
    let size = joints.len();
    let row = |row| (0..size).map(|own| f64::from(u8::from(own == row))).collect();
    let map: Vec<Vec<f64>> = (0..size).map(row).collect();
    Arm::new("arm".to_owned(), Convention::StandardDh, joints, &map, Chain::new(elements))
        .expect("an arm")
}

fn link([a, alpha, d]: Link, joint: usize) -> Vec<Element> {
    let free = |motion, nominal, quantity| Element::Free {
        motion,
        nominal,
        parameter: Parameter::Link { joint: joint + 1, quantity },
    };
    let (about, along) = (Motion::Rotation, Motion::Translation);
    vec![
        free(about(Axis::Z), 0.0, LinkQuantity::Theta),
        Element::Joint { motion: about(Axis::Z), joint, sign: 1.0 },
        free(along(Axis::Z), d, LinkQuantity::D),
        free(along(Axis::X), a, LinkQuantity::A),
        free(about(Axis::X), alpha.to_radians(), LinkQuantity::Alpha),
    ]
}

/// Like an LBR iiwa 14.
const SEVEN: [Link; 7] = [
    [0.0, -90.0, 360.0],
    [0.0, 90.0, 0.0],
    [0.0, 90.0, 420.0],
    [0.0, -90.0, 0.0],
    [0.0, -90.0, 400.0],
    [0.0, 90.0, 0.0],
    [0.0, 0.0, 126.0],
];
/// The last axis is 150 mm beside the fourth: no spherical wrist.
const OFFSET_WRIST: [Link; 6] = [
    [0.0, 90.0, 245.0],
    [540.0, 0.0, 0.0],
    [0.0, 90.0, 0.0],
    [0.0, -90.0, 540.0],
    [0.0, 90.0, 150.0],
    [0.0, 0.0, 160.0],
];
/// Base, three parallel axes, and the roll of the tool.
const FIVE: [Link; 5] =
    [[0.0, 90.0, 400.0], [500.0, 0.0, 0.0], [400.0, 0.0, 0.0], [0.0, 90.0, 0.0], [0.0, 0.0, 188.0]];

/// Identified with 0.4 mm and 0.3 mrad at each parameter, measured within ±1.6 rad and ±1 m.
fn measured(arm: &Arm) -> IdentifiedArm {
    let of = |joint: &Joint| if joint.upper > 100.0 { 1000.0 } else { 1.6 };
    let ranges = arm.joints().iter().map(of).map(|most| [-most, most]);
    measured_within(arm, ranges.collect())
}

fn at(angles: &[f64]) -> Target {
    Target {
        name: "rivet 7".to_owned(),
        joints: Some(TargetJoints { names: Vec::new(), slides: None, angles: angles.to_vec() }),
        ..Target::default()
    }
}

/// Joint angles of the target and of its command, after the identified arm was seen to attain the target there.
fn attained(identified: &IdentifiedArm, target: Target) -> JointCommand {
    let found = one(identified, target).expect("inside");
    let joints = found.joints.clone().expect("joint angles");
    let geometry = identified.model.is::<IdentifiedGeometry>();
    let arm = &identified.arm;
    let tool = identified.flange_from_tool.isometry();
    let chain = &geometry.expect("made so").chain;
    let reached = chain.nominal(&arm.axes(&joints.command)) * tool;
    let wanted = arm.flange(&joints.target).isometry() * tool;
    let off = reached.translation.vector - wanted.translation.vector;
    assert!(off.norm() < 1e-6, "{off}");
    assert!(found.correction.norm() > 0.3, "a large correction");
    joints
}

#[test]
fn seven_axes_are_corrected_about_the_joint_angles_of_the_target() {
    let identified = measured(&arm_of(&SEVEN, false));
    let angles = [0.3, 0.6, -0.4, 1.2, 0.5, -0.8, 0.2];
    let joints = attained(&identified, at(&angles));
    assert!(same(&joints.target, &angles), "{joints:?}");
    // Some 2 mm at half a metre: no joint goes far, not even along the arm's own motion.
    let moved = joints.correction();
    assert!(moved.iter().all(|q| q.abs() < 0.02), "{moved:?}");
    let mut beyond = angles;
    beyond[2] = 1.7;
    let refused = one(&identified, at(&beyond)).expect_err("not measured");
    assert!(matches!(refused, Reason::JointRange { .. }), "{refused}");
}

#[test]
fn a_pose_alone_does_not_say_how_seven_axes_reach_it() {
    let identified = measured(&arm_of(&SEVEN, false));
    let pose = at_pose(&identified, &[0.3, 0.6, -0.4, 1.2, 0.5, -0.8, 0.2]);
    assert_eq!(pose.configuration, None);
    let refused = one(&identified, pose).expect_err("infinitely many ways");
    assert_eq!(refused, Reason::Redundant { joints: 7 });
    assert!(refused.to_string().contains("give q1_rad"), "{refused}");
}

#[test]
fn five_axes_are_corrected_in_position_and_turn_a_little() {
    let identified = measured(&arm_of(&FIVE, false));
    let joints = attained(&identified, at(&[0.3, 0.9, -1.1, -0.4, 0.5]));
    let turned = |joints: &[f64]| identified.arm.flange(joints).isometry().rotation;
    let by = turned(&joints.command).angle_to(&turned(&joints.target));
    assert!((1e-5..0.01).contains(&by), "{by}");
}

#[test]
fn a_track_under_an_arm_stays_where_it_is_commanded() {
    let identified = measured(&arm_of(&OFFSET_WRIST, true));
    let mut asked = [700.0, 0.3, 1.2, 0.4, -0.5, 0.9, 0.3];
    let joints = attained(&identified, at(&asked));
    assert!((joints.command[0] - 700.0).abs() < 0.01, "{joints:?}");
    // Half a degree counts as measured, and 8.7 mm of a track, a mm as a mrad.
    asked[0] = 1008.0;
    attained(&identified, at(&asked));
    asked[0] = 1011.25;
    let refused = one(&identified, at(&asked)).expect_err("more than 8.7 mm beyond");
    assert!(refused.to_string().contains("11.250 mm beyond the -1000.000 mm"), "{refused}");
}

#[test]
fn a_pose_alone_is_reached_within_the_ranges_measured_by_an_arm_without_configurations() {
    let identified = measured(&arm_of(&OFFSET_WRIST, false));
    let angles = [0.3, 1.2, 0.4, -0.5, 0.9, 0.3];
    let by_joints = attained(&identified, at(&angles));
    assert!(same(&by_joints.target, &angles), "{by_joints:?}");
    let pose = at_pose(&identified, &angles);
    assert_eq!(pose.configuration, None);
    let by_pose = attained(&identified, pose);
    let within = |joints: &[f64]| joints.iter().all(|q| q.abs() <= 1.6 + RIM_RAD);
    assert!(within(&by_pose.target) && within(&by_pose.command), "{by_pose:?}");
}
