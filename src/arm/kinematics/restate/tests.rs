use super::*;
use crate::kinematics::Arm;

const FILES: [&str; 6] = [
    include_str!("../../../../pipelines/robots/irb120.toml"),
    include_str!("../../../../pipelines/robots/kr210-r2700-extra.toml"),
    include_str!("../../../../pipelines/robots/ur10.toml"),
    include_str!("../../../../pipelines/robots/ur10e.toml"),
    include_str!("../../../../pipelines/robots/ur5.toml"),
    include_str!("../../../../pipelines/robots/ur5e.toml"),
];

fn read(text: &str) -> RobotFile {
    toml::from_str(text).expect("a robot file")
}

/// The largest differences of two arms' flanges, mm and rad, over joint vectors spread over their ranges.
fn apart(one: &Arm, other: &Arm, count: u32) -> (f64, f64) {
    let (mut mm, mut rad) = (0.0_f64, 0.0_f64);
    for index in 0..count {
        let share =
            |joint: u32| (f64::from(index) * (0.618_033_988_749 + 0.1 * f64::from(joint))).fract();
        let joints: Vec<f64> = one
            .joints()
            .iter()
            .zip(0..)
            .map(|(joint, number)| joint.lower + (joint.upper - joint.lower) * share(number))
            .collect();
        let between = one.flange(&joints).isometry().inverse() * other.flange(&joints).isometry();
        mm = mm.max(between.translation.vector.norm());
        rad = rad.max(2.0 * between.rotation.imag().norm());
    }
    (mm, rad)
}

/// A seven-axis arm on a track, with skew axes and a passive joint.
const SKEW: &str = include_str!("tests/skew.toml");

#[test]
fn skew_axes_a_track_and_a_passive_joint_are_the_same_in_every_convention() {
    let file = read(SKEW);
    let arm = file.arm().expect("an arm");
    for convention in Convention::ALL {
        let restated = file.restated(convention).expect("the same arm");
        let (mm, rad) = apart(&arm, &restated.arm().expect("an arm"), 10_000);
        // A table puts this arm's common normals up to 9 m away: rounding there is that of 10 m.
        assert!(mm < 1e-8 && rad < 1e-12, "{convention:?}: {mm:e} mm, {rad:e} rad");
    }
}

#[test]
fn nearly_parallel_axes_have_no_place_in_a_table() {
    let mut file = read(FILES[0]).restated(Convention::Urdf).expect("the same arm");
    let axis = file.joint[2].axis.expect("an axis");
    // The third axis is turned by a millionth of a radian from the second, to which it was parallel.
    file.joint[2].axis = Some([axis[0], axis[1], axis[2] + 1e-6]);
    let told = file.restated(Convention::StandardDh).expect_err("far away").to_string();
    assert!(told.contains("joint_2") && told.contains("from parallel"), "{told}");
    for convention in [Convention::Cpc, Convention::Poe, Convention::MinimalPoe] {
        let other = file.restated(convention).expect("no such place").arm().expect("an arm");
        let (mm, _) = apart(&file.arm().expect("an arm"), &other, 1000);
        assert!(mm < 1e-9, "{convention:?}: {mm:e} mm");
    }
}

#[test]
fn an_arm_alone_is_stated_again() {
    // A saved model has no robot file any more.
    for text in [SKEW, FILES[1]] {
        let arm = read(text).arm().expect("an arm");
        for convention in Convention::ALL {
            let file = RobotFile::of_arm(&arm, convention).expect("the same arm");
            let (mm, rad) = apart(&arm, &file.arm().expect("an arm"), 200);
            assert!(mm < 1e-8 && rad < 1e-12, "{convention:?}: {mm:e} mm, {rad:e} rad");
        }
    }
}

#[test]
fn an_arm_is_the_same_in_every_convention() {
    for text in FILES {
        let file = read(text);
        let arm = file.arm().expect("an arm");
        for convention in Convention::ALL {
            let restated = file.restated(convention).expect("the same arm");
            let written = toml::to_string(&restated).expect("TOML");
            let other =
                read(&written).arm().unwrap_or_else(|e| panic!("{convention:?}: {e}\n{written}"));
            let (mm, rad) = apart(&arm, &other, 10_000);
            assert!(
                mm < 1e-9 && rad < 1e-12,
                "{} {convention:?}: {mm:e} mm, {rad:e} rad\n{written}",
                file.model
            );
        }
    }
}
