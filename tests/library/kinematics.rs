//! The arms of `pipelines/robots/` against independent forward kinematics, and the differential against differences.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector6};
use posegrid::geometry::isometry_from_rpy;
use posegrid::kinematics::{
    Arm, Axis, Element, InverseSettings, Motion, Parameter, RobotFile, SingularityFactors, Twist,
    inverse,
};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

const ROBOTS: [&str; 6] = ["irb120", "kr210-r2700-extra", "ur10", "ur10e", "ur5", "ur5e"];

/// Flange poses by another way: the joint origins and axes of the public URDF descriptions (ROS-Industrial
/// packages of the KR 210 and the IRB 120 with their tool0, the UR ones from their inner base link, which is the
/// controller's base and stands 180° about z from the outer one), multiplied out with numpy in a script that knows no DH.
/// Those of the other six-axis arms are by `tests/readers/ready_robots.py`, which has the origins and axes, in the base and
/// flange frames of the robot files. Joint angles are as the controller counts them.
const FLANGES: &str = include_str!("kinematics/urdf_flanges.csv");

/// Robot, joint angles in degrees, and the flange there.
fn flanges() -> Vec<(String, [f64; 6], Isometry3<f64>)> {
    let mut reader = csv::Reader::from_reader(FLANGES.as_bytes());
    let rows = reader.deserialize::<(String, [f64; 6], [f64; 3], [f64; 4])>();
    rows.map(|row| {
        let (robot, degrees, position, quaternion) = row.expect("a row as the header says");
        (robot, degrees, pose(position, quaternion))
    })
    .collect()
}

fn arm(robot: &str) -> Arm {
    let path = format!("{}/pipelines/robots/{robot}.toml", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let file: RobotFile = toml::from_str(&text).unwrap_or_else(|error| panic!("{path}: {error}"));
    file.arm().unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The KR 210 with axis 3 turning by what joints 2 and 3 report together, and axis 6 dragged along by joint 5.
fn coupled_arm() -> Arm {
    let text = include_str!("../../pipelines/robots/kr210-r2700-extra.toml");
    let mut file: RobotFile = toml::from_str(text).expect("a robot file");
    let mut map = vec![vec![0.0; 6]; 6];
    for (axis, row) in map.iter_mut().enumerate() {
        row[axis] = 1.0;
    }
    map[2][1] = 1.0;
    map[5][4] = -0.25;
    file.joint_map = Some(map);
    file.arm().expect("an invertible map")
}

fn pose(position: [f64; 3], quaternion: [f64; 4]) -> Isometry3<f64> {
    let [x, y, z, w] = quaternion;
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Isometry3::from_parts(Translation3::from(position), rotation)
}

#[test]
fn every_robot_file_loads_and_says_where_it_is_from() {
    let folder = format!("{}/pipelines/robots", env!("CARGO_MANIFEST_DIR"));
    let entries = std::fs::read_dir(folder).expect("the folder of robot files");
    let names = entries.map(|entry| entry.expect("an entry").file_name());
    let names: Vec<String> = names
        .map(|name| name.into_string().expect("UTF-8"))
        .filter_map(|name| name.strip_suffix(".toml").map(str::to_owned))
        .collect();
    for robot in ROBOTS {
        assert!(names.contains(&robot.to_owned()), "{robot}");
    }
    for robot in &names {
        assert!([6, 7].contains(&arm(robot).joints().len()), "{robot}");
    }
}

#[test]
fn flanges_agree_with_the_urdf() {
    for (robot, degrees, expected) in flanges() {
        let found = *arm(&robot).flange(&degrees.map(f64::to_radians)).isometry();
        let off = (found.translation.vector - expected.translation.vector).norm();
        // The literals are rounded to 1e-6 mm and 1e-9.
        assert!(off < 2e-6, "{robot} {degrees:?}: {off} mm");
        let turned = found.rotation.angle_to(&expected.rotation);
        assert!(turned < 1e-8, "{robot} {degrees:?}: {turned} rad");
    }
}

#[test]
fn hayati_stands_where_axes_are_parallel() {
    for robot in ROBOTS {
        let expected: &[usize] = if robot.starts_with("ur") { &[2, 3] } else { &[2] };
        assert_eq!(arm(robot).parallel_joints(), expected, "{robot}");
    }
}

/// The change of the end per unit, by central differences: a twist in the base frame.
fn difference(plus: &Isometry3<f64>, minus: &Isometry3<f64>, width: f64) -> Twist {
    Twist {
        linear: (plus.translation.vector - minus.translation.vector) / width,
        angular: (plus.rotation * minus.rotation.inverse()).scaled_axis() / width,
    }
}

/// The twist as one column, its angles seen at 1 m.
fn column(twist: &Twist) -> Vector6<f64> {
    let mut column = Vector6::zeros();
    column.fixed_rows_mut::<3>(0).copy_from(&twist.linear);
    column.fixed_rows_mut::<3>(3).copy_from(&(twist.angular * 1000.0));
    column
}

#[track_caller]
fn assert_same_column(what: &str, analytic: &Twist, numerical: &Twist) {
    let (analytic, numerical) = (column(analytic), column(numerical));
    let off = (analytic - numerical).norm() / analytic.norm();
    assert!(off < 1e-7, "{what}: analytic {analytic} numerical {numerical}");
}

/// Half the width of a central difference: its truncation (h²/6, of third derivatives as large as the first) and the
/// rounding of metres (1e-12 mm / h) are both below 1e-8 of the column.
fn half_width(is_angle: bool) -> f64 {
    if is_angle { 1e-4 } else { 1e-1 }
}

fn check_differential(arm: &Arm, joints: &[f64]) {
    let before = Axis::ALL.map(Motion::Translation).into_iter();
    let before = before.chain(Axis::ALL.map(Motion::Rotation)).map(|motion| Element::Free {
        motion,
        nominal: 0.1,
        parameter: Parameter::Base(motion),
    });
    let after = Axis::ALL.map(Motion::Translation).map(|motion| Element::Free {
        motion,
        nominal: 60.0,
        parameter: Parameter::Target(motion),
    });
    let chain = arm.chain().extended(before.collect(), after.to_vec());
    let parameters = chain.parameters();
    let offsets: Vec<f64> =
        parameters.iter().map(|parameter| if parameter.is_angle() { 2e-3 } else { 0.7 }).collect();
    let axes = arm.axes(joints);
    let analytic = chain.differential(&axes, &offsets);
    for (index, parameter) in parameters.iter().enumerate() {
        let half = half_width(parameter.is_angle());
        let at = |shift: f64| {
            let mut moved = offsets.clone();
            moved[index] += shift;
            chain.forward(&axes, &moved)
        };
        let numerical = difference(&at(half), &at(-half), 2.0 * half);
        assert_same_column(&parameter.to_string(), &analytic.parameters[index], &numerical);
    }
    for (index, twist) in arm.joint_twists(&analytic.joints).iter().enumerate() {
        let half = half_width(true);
        let at = |shift: f64| {
            let mut moved = joints.to_vec();
            moved[index] += shift;
            chain.forward(&arm.axes(&moved), &offsets)
        };
        let numerical = difference(&at(half), &at(-half), 2.0 * half);
        assert_same_column(&arm.joints()[index].name, twist, &numerical);
    }
}

#[test]
fn differentials_agree_with_central_differences() {
    for (_, degrees, _) in &flanges()[..4] {
        let joints = degrees.map(f64::to_radians);
        for robot in ROBOTS {
            check_differential(&arm(robot), &joints);
        }
        check_differential(&coupled_arm(), &joints);
    }
}

fn any_robot() -> impl Strategy<Value = Arm> {
    (0..=ROBOTS.len())
        .prop_map(|index| ROBOTS.get(index).map_or_else(coupled_arm, |robot| arm(robot)))
}

/// Joint angles anywhere in the limits of every arm here but for the KR 210's second, which ends at −5°.
fn any_joints() -> impl Strategy<Value = [f64; 6]> {
    prop::array::uniform6(-1.9..1.2_f64)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, rng_seed: RngSeed::Fixed(20), ..ProptestConfig::default() })]

    #[test]
    fn offsets_added_or_taken_into_the_chain_are_the_same(
        arm in any_robot(), joints in any_joints(), scale in -3.0..3.0_f64,
    ) {
        let chain = arm.chain();
        let offsets: Vec<f64> = (0..chain.parameters().len()).map(|i| scale * ((i % 5) as f64 - 2.0)).collect();
        let added = chain.forward(&joints, &offsets);
        let taken = chain.with_offsets(&offsets).nominal(&joints);
        prop_assert!((added.translation.vector - taken.translation.vector).norm() < 1e-9);
        prop_assert!(added.rotation.angle_to(&taken.rotation) < 1e-7);
    }

    #[test]
    fn extending_a_chain_multiplies(arm in any_robot(), joints in any_joints(), x in -900.0..900.0_f64, turn in -3.0..3.0_f64) {
        let before = isometry_from_rpy([x, 10.0, -x], [turn, 0.2, -turn]);
        let after = isometry_from_rpy([5.0, x, 30.0], [0.3, turn / 3.0, turn]);
        let extended = arm.chain().extended(vec![Element::Fixed(before)], vec![Element::Fixed(after)]);
        let product = before * arm.chain().nominal(&joints) * after;
        let found = extended.nominal(&joints);
        prop_assert!((found.translation.vector - product.translation.vector).norm() < 1e-9);
        prop_assert!(found.rotation.angle_to(&product.rotation) < 1e-7);
        prop_assert_eq!(extended.differential(&joints, &vec![0.0; extended.parameters().len()]).end, found);
    }

    #[test]
    fn inverse_undoes_forward(
        arm in any_robot(), joints in any_joints(), away in prop::array::uniform6(-0.15..0.15_f64),
    ) {
        let joints: Vec<f64> = joints.iter().zip(arm.joints()).map(|(q, joint)| q.clamp(joint.lower, joint.upper)).collect();
        let seed: Vec<f64> = joints.iter().zip(away).map(|(q, d)| q + d).collect();
        let offsets = arm.no_offsets();
        let factors = SingularityFactors::of(&arm, &offsets, &joints).expect("six axes");
        let at_seed = SingularityFactors::of(&arm, &offsets, &seed).expect("six axes");
        // Near a singularity the way from the seed may leave its configuration: that is for other tests.
        prop_assume!(factors.smallest() > 0.3 && at_seed.smallest() > 0.3);
        prop_assume!(factors.configuration() == at_seed.configuration());
        let tool = isometry_from_rpy([20.0, -30.0, 140.0], [0.2, -0.1, 0.4]);
        let target = arm.flange(&joints).isometry() * tool;
        let found = inverse(&arm, &offsets, &target, &tool, &seed, &InverseSettings::default());
        let found = found.map_err(|error| TestCaseError::fail(error.to_string()))?;
        for (found, truth) in found.iter().zip(&joints) {
            prop_assert!((found - truth).abs() < 1e-9, "{:?} {:?}", found, truth);
        }
    }
}
