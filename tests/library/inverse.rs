//! Joint angles for poses of any arm: success on random reachable poses from the pose alone and from a near seed, and time.
//!
//! `cargo test --features s3 --test library inverse:: -- --ignored --nocapture` takes 10,000 poses of each arm and prints what it counts;
//! 300 of each are in the usual tests.

mod arms;

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::time::{Duration, Instant};

use arms::{
    Drawn, arms, coupled, five, iiwa, kr210, offset_wrist, on_track, palletiser, scara, ur10, wam,
};
use nalgebra::{DMatrix, DVector, Isometry3, Translation3};
use posegrid::geometry::isometry_from_rpy;
use posegrid::kinematics::{
    Anywhere, Arm, Chain, Configuration, Convention, Element, InverseError, InverseSettings,
    Parameter, SingularityFactors, inverse,
};

/// Poses count as away from singularities from this smallest singular value of the Jacobian, with lengths over 500 mm: the
/// end moves by 10 mm, or turns by 20 mrad, a radian of the joints in the direction in which it moves least.
const AWAY: f64 = 0.02;
const LEVER_MM: f64 = 500.0;

/// Outcomes of random poses of one arm.
#[derive(Default)]
struct Counts {
    away: usize,
    reached: usize,
    near: usize,
    reached_near: usize,
    from_seed: usize,
    /// Time of each pose, from the pose alone and from a seed.
    any: Vec<Duration>,
    seeded: Vec<Duration>,
    refused: Vec<InverseError>,
}

fn tool() -> Isometry3<f64> {
    isometry_from_rpy([20.0, -30.0, 140.0], [0.2, -0.1, 0.4])
}

/// The smallest singular value of the Jacobian with lengths over the lever.
fn conditioning(drawn: &Drawn, joints: &[f64]) -> f64 {
    jacobian(drawn, joints).singular_values().min()
}

/// The Jacobian with lengths over the lever, by another way than the search's: central differences of the end's pose.
fn jacobian(drawn: &Drawn, joints: &[f64]) -> DMatrix<f64> {
    let arm = &drawn.arm;
    let columns: Vec<[f64; 6]> = (0..joints.len())
        .map(|joint| {
            let half = 1e-5 * drawn.unit(joint, LEVER_MM);
            let at = |shift: f64| {
                let mut moved = joints.to_vec();
                moved[joint] += shift;
                *arm.flange(&moved).isometry()
            };
            let (plus, minus) = (at(half), at(-half));
            let linear = (plus.translation.vector - minus.translation.vector) / 2e-5 / LEVER_MM;
            let angular = (plus.rotation * minus.rotation.inverse()).scaled_axis() / 2e-5;
            [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z]
        })
        .collect();
    DMatrix::from_fn(6, columns.len(), |row, column| columns[column][row])
}

fn nominal(arm: &Arm) -> Vec<f64> {
    arm.no_offsets()
}

fn assert_reaches(drawn: &Drawn, target: &Isometry3<f64>, found: &[f64]) {
    let reached = drawn.arm.flange(found).isometry() * tool();
    let off_mm = (reached.translation.vector - target.translation.vector).norm();
    let off_rad = reached.rotation.angle_to(&target.rotation);
    assert!(off_mm < 1e-8 && off_rad < 1e-7, "{}: {off_mm} mm, {off_rad} rad", drawn.name);
    assert!(drawn.arm.within_limits_or_rounding(found), "{}: {found:?}", drawn.name);
}

trait Rounded {
    fn within_limits_or_rounding(&self, joints: &[f64]) -> bool;
}

impl Rounded for Arm {
    fn within_limits_or_rounding(&self, joints: &[f64]) -> bool {
        let mut pairs = self.joints().iter().zip(joints);
        pairs.all(|(joint, q)| *q > joint.lower - 1e-8 && *q < joint.upper + 1e-8)
    }
}

fn count(drawn: &Drawn, poses: u32) -> Counts {
    let nominal = nominal(&drawn.arm);
    let tool = tool();
    let settings = InverseSettings::default();
    let anywhere = Anywhere::new(&drawn.arm, &nominal, tool, settings);
    let mut counts = Counts::default();
    for number in 0..poses {
        let truth = drawn.joints(number);
        let target = drawn.arm.flange(&truth).isometry() * tool;
        let away = conditioning(drawn, &truth) >= AWAY;
        let began = Instant::now();
        let found = anywhere.joints_where(&target, None, |_| true);
        counts.any.push(began.elapsed());
        if let Ok(found) = &found {
            assert_reaches(drawn, &target, found);
        }
        let reached = usize::from(found.is_ok());
        if away {
            counts.away += 1;
            counts.reached += reached;
            counts.refused.extend(found.err());
        } else {
            counts.near += 1;
            counts.reached_near += reached;
        }
        let seed = drawn.beside(&truth, number);
        let began = Instant::now();
        let found = inverse(&drawn.arm, &nominal, &target, &tool, &seed, &settings);
        counts.seeded.push(began.elapsed());
        counts.from_seed += usize::from(away && found.is_ok());
    }
    counts
}

/// Microseconds a pose: the median of means over a hundred poses, as a shared machine stops a test now and then.
fn micros(times: &[Duration]) -> f64 {
    let mean = |some: &[Duration]| some.iter().sum::<Duration>().as_secs_f64() / some.len() as f64;
    let mut means: Vec<f64> = times.chunks(100).map(mean).collect();
    means.sort_by(f64::total_cmp);
    1e6 * means[means.len() / 2]
}

fn print(drawn: &Drawn, counts: &Counts) {
    let share = |part: usize, of: usize| 100.0 * part as f64 / of.max(1) as f64;
    println!(
        "{:<22} {:>6} {:>8.3} % {:>6} {:>8.2} % {:>8.2} % {:>9.1} {:>9.1}",
        drawn.name,
        counts.away,
        share(counts.reached, counts.away),
        counts.near,
        share(counts.reached_near, counts.near),
        share(counts.from_seed, counts.away),
        micros(&counts.any),
        micros(&counts.seeded)
    );
    for refused in counts.refused.iter().take(3) {
        println!("    {refused}");
    }
}

fn check(poses: u32) {
    println!(
        "{:<22} {:>6} {:>10} {:>6} {:>10} {:>10} {:>9} {:>9}",
        "arm", "away", "reached", "near", "reached", "from seed", "µs", "µs seeded"
    );
    let mut failed = Vec::new();
    for drawn in arms() {
        let counts = count(&drawn, poses);
        print(&drawn, &counts);
        if 1000 * (counts.away - counts.reached) > counts.away {
            failed.push(drawn.name);
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

/// A tool pose of an arm at joint values.
fn tool_at(arm: &Arm, joints: &[f64]) -> Isometry3<f64> {
    arm.flange(joints).isometry() * tool()
}

fn from_seed(arm: &Arm, target: &Isometry3<f64>, seed: &[f64]) -> Result<Vec<f64>, InverseError> {
    inverse(arm, &nominal(arm), target, &tool(), seed, &InverseSettings::default())
}

fn from_pose(
    arm: &Arm,
    target: &Isometry3<f64>,
    near: Option<&[f64]>,
) -> Result<Vec<f64>, InverseError> {
    let nominal = nominal(arm);
    Anywhere::new(arm, &nominal, tool(), InverseSettings::default()).joints_where(
        target,
        near,
        |_| true,
    )
}

fn moved(pose: &Isometry3<f64>, by_mm: [f64; 3]) -> Isometry3<f64> {
    Translation3::from(by_mm) * pose
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    apart.fold(0.0, f64::max)
}

#[test]
fn seven_axes_stay_as_near_to_the_seed_as_the_pose_allows() {
    for drawn in [Drawn::new("iiwa", iiwa()), Drawn::new("wam", wam())] {
        let seed = [0.3, 0.6, -0.4, 1.2, 0.5, -0.8, 0.2];
        let here = tool_at(&drawn.arm, &seed);
        for by_mm in [[0.3, -0.2, 0.4], [60.0, 40.0, -50.0]] {
            let found = from_seed(&drawn.arm, &moved(&here, by_mm), &seed).expect("near");
            // Half a millimetre at half a metre is a milliradian.
            assert!(by_mm[0] > 1.0 || largest_difference(&found, &seed) < 5e-3);
            // What the arm may do without moving the tool, it has not done.
            let jacobian = jacobian(&drawn, &found);
            let normal = jacobian.tr_mul(&jacobian).symmetric_eigen();
            let own = normal.eigenvectors.column(normal.eigenvalues.imin());
            let away = DVector::from_fn(7, |joint, _| found[joint] - seed[joint]);
            assert!(own.dot(&away).abs() < 1e-6, "{}: {}", drawn.name, own.dot(&away));
        }
    }
}

#[test]
fn a_track_stays_where_the_seed_has_it_and_moves_where_the_arm_needs_it() {
    let arm = on_track();
    let seed = [200.0, 0.1, 0.3, 0.4, 0.2, 0.9, -0.3];
    let here = tool_at(&arm, &seed);
    let found = from_seed(&arm, &moved(&here, [20.0, -30.0, 10.0]), &seed).expect("near");
    assert!((found[0] - seed[0]).abs() < 0.01, "{found:?}");
    let found = from_seed(&arm, &moved(&here, [0.0, 1200.0, 0.0]), &seed).expect("along the track");
    assert!(found[0] - seed[0] > 100.0, "{found:?}");
}

#[test]
fn a_joint_takes_the_turn_nearest_to_what_is_asked_for_and_within_its_limits() {
    let arm = coupled();
    let truth = [0.3, 0.4, 0.2, 0.5, 0.8, 0.7];
    let pose = tool_at(&arm, &truth);
    let on_turn = |turns: f64| {
        let mut near = truth.to_vec();
        near[5] += turns * TAU;
        // Other solutions of the pose are further away in joints that have no second turn.
        let close = |joints: &[f64]| largest_difference(&joints[..5], &truth[..5]) < 0.1;
        let nominal = nominal(&arm);
        let anywhere = Anywhere::new(&arm, &nominal, tool(), InverseSettings::default());
        let found = anywhere.joints_where(&pose, Some(&near), close).expect("reachable");
        (found[5] - truth[5]) / TAU
    };
    // Joint 6 has ±450°, and is at 40°: one turn on is 400°, two turns are beyond, and one turn back is −320°.
    for (asked, taken) in [(0.0, 0.0), (1.0, 1.0), (2.0, 1.0), (-1.0, -1.0), (-2.0, -1.0)] {
        assert!((on_turn(asked) - taken).abs() < 1e-9, "{asked}: {}", on_turn(asked));
    }
}

#[test]
fn joints_without_limits_are_searched_over_one_turn() {
    let mut all = coupled().joints().to_vec();
    for joint in [3, 5] {
        (all[joint].lower, all[joint].upper) = (f64::NEG_INFINITY, f64::INFINITY);
    }
    let chain = coupled().chain().clone();
    let map: Vec<Vec<f64>> = (0..6)
        .map(|row| (0..6).map(|column| f64::from(u8::from(row == column))).collect())
        .collect();
    let arm = Arm::new("continuous".to_owned(), Convention::StandardDh, all, &map, chain)
        .expect("an arm");
    let truth = [0.3, 0.4, 0.2, 7.0, 0.8, -9.0];
    let found = from_pose(&arm, &tool_at(&arm, &truth), None).expect("reachable");
    assert!(found[3].abs() <= PI && found[5].abs() <= PI, "{found:?}");
    let found = from_pose(&arm, &tool_at(&arm, &truth), Some(&truth)).expect("reachable");
    assert!((found[5] - truth[5]).abs() <= PI, "{found:?}");
}

#[test]
fn five_axes_have_the_position_and_an_orientation_as_near_as_the_settings_allow() {
    let arm = five();
    let seed = [0.3, 0.9, -0.8, -0.4, 0.5];
    let here = tool_at(&arm, &seed);
    // Half a millimetre aside at some 400 mm from axis 1 turns the tool with it by a milliradian or so.
    let aside = moved(&here, [0.3, -0.4, 0.2]);
    let refused = from_seed(&arm, &aside, &seed).expect_err("turned");
    let InverseError::Orientation { joints: 5, off_deg } = refused else { panic!("{refused}") };
    assert!((1e-3..0.2).contains(&off_deg), "{off_deg}");
    assert!(refused.to_string().contains("5 joints"), "{refused}");
    let settings = InverseSettings { orientation_slack_rad: 0.01, ..InverseSettings::default() };
    let found = inverse(&arm, &nominal(&arm), &aside, &tool(), &seed, &settings).expect("allowed");
    let reached = tool_at(&arm, &found);
    assert!((reached.translation.vector - aside.translation.vector).norm() < 1e-9);
    let turned = reached.rotation.angle_to(&aside.rotation);
    assert!((turned.to_degrees() - off_deg).abs() < 1e-6);
    // No joint angles with this position have an orientation nearer to it: the arm has two ways left to turn its tool.
    for direction in 0..5 {
        let mut beside = found.clone();
        beside[direction] += 1e-3;
        let beside = inverse(&arm, &nominal(&arm), &aside, &tool(), &beside, &settings);
        let other = tool_at(&arm, &beside.expect("allowed"));
        assert!(other.rotation.angle_to(&aside.rotation) > turned - 1e-9);
    }
}

#[test]
fn a_linear_joint_beyond_its_limit_is_named_in_millimetres() {
    let arm = scara();
    let beyond = [0.4, 0.9, 212.5, 0.3];
    let refused = from_pose(&arm, &tool_at(&arm, &beyond), None).expect_err("beyond the lift");
    let message = refused.to_string();
    assert!(
        message.contains("\"lift\" would have to move to 212.500 mm") && message.contains("200 mm"),
        "{message}"
    );
}

#[test]
fn a_pose_beyond_the_arm_is_refused_with_what_is_missing() {
    let arm = iiwa();
    let pose = isometry_from_rpy([2000.0, 0.0, 360.0], [0.0, FRAC_PI_2, 0.0]);
    // Stretched, the flange is 420 + 400 + 126 mm from the shoulder, and the tool's end some 140 mm further.
    let refused = from_pose(&arm, &pose, None).expect_err("2 m away");
    let InverseError::NotReachable { position_mm, .. } = refused else { panic!("{refused}") };
    assert!((800.0..1300.0).contains(&position_mm), "{position_mm}");
}

#[test]
fn identified_arms_are_reached_from_the_pose_alone() {
    for drawn in arms() {
        let parameters = drawn.arm.chain().parameters();
        let offset = |parameter: &Parameter| if parameter.is_angle() { 3e-4 } else { 0.4 };
        let offsets: Vec<f64> = parameters.iter().map(offset).collect();
        let anywhere = Anywhere::new(&drawn.arm, &offsets, tool(), InverseSettings::default());
        let chain = drawn.arm.chain();
        let at = |joints: &[f64]| chain.forward(&drawn.arm.axes(joints), &offsets) * tool();
        let mut reached = 0;
        for number in 0..20 {
            let target = at(&drawn.joints(number));
            let Ok(found) = anywhere.joints_where(&target, None, |_| true) else {
                continue;
            };
            reached += 1;
            let off = at(&found).translation.vector - target.translation.vector;
            assert!(off.norm() < 1e-8, "{}", drawn.name);
        }
        assert!(reached >= 19, "{}: {reached}", drawn.name);
    }
}

#[test]
fn arms_without_the_three_factors_have_no_configuration() {
    let has = |arm: &Arm| {
        let joints: Vec<f64> = arm.joints().iter().map(|j| 0.3 * j.upper + 0.1).collect();
        Configuration::of(arm, &nominal(arm), &joints).is_some()
    };
    assert!(has(&kr210()) && has(&ur10()) && has(&coupled()));
    for other in [offset_wrist(), iiwa(), wam(), on_track(), five(), scara(), palletiser()] {
        assert!(!has(&other), "{}", other.model());
    }
}

/// A link's frame may stand anywhere on its axis: in a URDF, or with screw axes.
#[test]
fn factors_do_not_depend_on_where_a_frame_is_on_its_axis() {
    let arm = coupled();
    let mut elements = Vec::new();
    for element in arm.chain().elements() {
        let turn = matches!(element, Element::Joint { joint: 4, .. });
        let along = |mm| Element::Fixed(Translation3::new(0.0, 0.0, mm).into());
        if turn {
            elements.extend([along(250.0), element.clone(), along(-250.0)]);
        } else {
            elements.push(element.clone());
        }
    }
    let other = arm.with_chain(Chain::new(elements));
    for number in 0..50 {
        let joints = Drawn::new("coupled", coupled()).joints(number);
        let of = |arm: &Arm| SingularityFactors::of(arm, &nominal(arm), &joints).expect("factors");
        let (a, b) = (of(&arm), of(&other));
        assert_eq!(a.configuration(), b.configuration());
        assert!((a.elbow - b.elbow).abs() < 1e-9 && (a.shoulder - b.shoulder).abs() < 1e-6);
    }
}

#[test]
fn a_six_axis_arm_without_configurations_stays_on_its_side_of_its_singularities() {
    let drawn = Drawn::new("offset wrist", offset_wrist());
    let side = |joints: &[f64]| jacobian(&drawn, joints).determinant() > 0.0;
    let (mut found, mut across) = (0, 0);
    for number in 0..300 {
        let seed = drawn.joints(number);
        let target: Vec<f64> = seed.iter().map(|q| q + 0.25).collect();
        across += usize::from(side(&target) != side(&seed));
        if let Ok(joints) = from_seed(&drawn.arm, &tool_at(&drawn.arm, &target), &seed) {
            found += 1;
            assert_eq!(side(&joints), side(&seed), "{number}");
        }
    }
    assert!(found > 200 && across > 20, "{found} {across}");
}

#[test]
fn random_poses_of_every_arm_are_reached_from_the_pose_alone() {
    check(300);
}

#[test]
#[ignore = "10,000 poses of each arm take minutes"]
fn ten_thousand_random_poses_of_every_arm_are_reached_from_the_pose_alone() {
    check(10_000);
}
