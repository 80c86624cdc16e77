use nalgebra::{DMatrix, DVector};

use super::*;
use crate::geometry::isometry_from_rpy;
use crate::kinematics::{Axis, Motion, Parameter};

/// A lift, a turn and a slide: what no ready robot has.
const LIFT: &str = r#"
model = "a lift with an arm"
source = "made up"
convention = "urdf"

[[joint]]
name = "lift"
kind = "prismatic"
origin = { xyz_mm = [0, 0, 400], euler_deg = [0, 0, 0], euler_order = "fixed-xyz" }
axis = [0, 0, 1]
limits_mm = [0, 900]

[[joint]]
name = "turn"
origin = { xyz_mm = [200, 30, 0], euler_deg = [20, -40, 10], euler_order = "fixed-xyz" }
axis = [0.6, 0.8, 0]
limits_deg = [-170, 170]

[[joint]]
name = "nod"
origin = { xyz_mm = [600, 0, 50], euler_deg = [0, 30, 0], euler_order = "fixed-xyz" }
axis = [0, 1, 0]
limits_deg = [-100, 100]

[[joint]]
name = "slide"
kind = "prismatic"
origin = { xyz_mm = [100, 0, 0], euler_deg = [0, 0, 0], euler_order = "fixed-xyz" }
axis = [1, 0, 0]
limits_mm = [0, 300]
"#;

fn iiwa() -> Arm {
    arm(include_str!("../../../../pipelines/robots/lbr-iiwa14-r820.toml"))
}

fn arm(text: &str) -> Arm {
    toml::from_str::<RobotFile>(text).unwrap().arm().unwrap()
}

/// Errors of a millimetre and a milliradian, of links, base and flange.
fn errors(arm: &Arm) -> Errors {
    let mut parameters = arm.chain().parameters();
    for axis in Axis::ALL {
        parameters.push(Parameter::Base(Motion::Translation(axis)));
        parameters.push(Parameter::Base(Motion::Rotation(axis)));
        parameters.push(Parameter::Target(Motion::Translation(axis)));
    }
    let size = |place: usize| ((place + 1) as f64 * 0.618_034).fract() * 2.0 - 1.0;
    let offset =
        |(place, own): (usize, &Parameter)| size(place) * if own.is_angle() { 1e-3 } else { 1.0 };
    let offsets: Vec<f64> = parameters.iter().enumerate().map(offset).collect();
    let count = parameters.len();
    Errors {
        parameters,
        offsets: DVector::from_vec(offsets),
        covariance: DMatrix::identity(count, count),
    }
}

/// The arm as a chain of origins in frames of its own, with a fixed joint in it and one behind it where `tip` asks for it.
fn chain(arm: &Arm, tip: bool) -> Vec<ChainJoint> {
    let none = arm.no_offsets();
    let plain = AtZero::of(&arm.chain().with_offsets(&none));
    let screws = crate::kinematics::Screws::of(arm.chain(), &none);
    let mut before = Isometry3::identity();
    let mut joints = Vec::new();
    for (number, screw) in screws.axes.iter().enumerate() {
        // A frame on the axis' line, turned as it happens to be.
        let turn = isometry_from_rpy([0.0; 3], [0.3 * number as f64, -0.2, 0.9]).rotation;
        let frame = Isometry3::from_parts(screw.line.point.into(), turn);
        if number == 2 {
            let halfway = isometry_from_rpy([10.0, 20.0, 30.0], [0.1, 0.2, 0.3]);
            joints.push(ChainJoint { name: "halfway".to_owned(), origin: halfway, moves: None });
            before *= halfway;
        }
        let axis = turn.inverse() * screw.line.direction.scale(screw.factor.signum());
        joints.push(ChainJoint {
            name: format!("joint {number}"),
            origin: before.inverse() * frame,
            moves: Some(Moves { axis: UnitVector3::new_normalize(axis), slides: screw.slides }),
        });
        before = frame;
    }
    let last = before.inverse() * plain.end;
    if tip {
        joints.push(ChainJoint { name: "tip".to_owned(), origin: last, moves: None });
    }
    joints
}

/// The end of a chain as a URDF has it.
fn end(chain: &[ChainJoint], origins: &Origins, q: &[f64]) -> Isometry3<f64> {
    let mut angles = q.iter();
    let joints = chain.iter().zip(&origins.joints);
    let end = joints.fold(Isometry3::identity(), |end, (joint, origin)| {
        let moved = joint.moves.map_or_else(Isometry3::identity, |moves| {
            let by = moves.axis.scale(*angles.next().unwrap());
            if moves.slides {
                Translation3::from(by).into()
            } else {
                Isometry3::from_parts(
                    Translation3::identity(),
                    UnitQuaternion::from_scaled_axis(by),
                )
            }
        });
        end * origin.unwrap_or(joint.origin) * moved
    });
    end * origins.rest.unwrap_or_else(Isometry3::identity)
}

/// The arm with its errors.
fn truth(arm: &Arm, errors: &Errors, q: &[f64]) -> Isometry3<f64> {
    let whole = measured(arm.chain(), &Isometry3::identity());
    let offset = |wanted: &Parameter| {
        let place = errors.parameters.iter().position(|own| own == wanted);
        place.map_or(0.0, |place| errors.offsets[place])
    };
    let offsets: Vec<f64> = whole.parameters().iter().map(offset).collect();
    whole.forward(q, &offsets)
}

#[test]
fn seven_axes_and_axes_that_slide_are_the_arm_with_its_errors() {
    for arm in [iiwa(), arm(LIFT)] {
        let errors = errors(&arm);
        let chain = chain(&arm, true);
        let origins = Origins::carrying(&arm, &errors, &chain).unwrap();
        assert!(origins.rest.is_none());
        for place in 100..150 {
            let q = spread_joints(&arm, place);
            let off = end(&chain, &origins, &q).to_homogeneous()
                - truth(&arm, &errors, &q).to_homogeneous();
            assert!(off.abs().max() < 1e-7, "{}: {off}", arm.model());
        }
        let halfway = chain.iter().position(|joint| joint.name == "halfway").unwrap();
        assert_eq!(origins.joints[halfway], None, "a fixed joint inside stays as it is");
        for (joint, origin) in chain.iter().zip(&origins.joints) {
            let moved = joint.origin.inverse() * origin.unwrap_or(joint.origin);
            assert!(
                moved.translation.vector.norm() < 6.0 && moved.rotation.angle() < 6e-3,
                "{moved}"
            );
        }
    }
}

#[test]
fn without_a_fixed_joint_behind_the_last_axis_what_is_left_lies_across_it() {
    let arm = iiwa();
    let errors = errors(&arm);
    // The last frame is the flange's own.
    let mut chain = chain(&arm, true);
    let tip = chain.pop().unwrap().origin;
    let last = chain.last_mut().unwrap();
    let axis = last.moves.unwrap().axis;
    last.origin *= tip;
    last.moves = Some(Moves { axis: tip.rotation.inverse() * axis, slides: false });
    let origins = Origins::carrying(&arm, &errors, &chain).unwrap();
    let rest = origins.rest.unwrap();
    let axis = chain.last().unwrap().moves.unwrap().axis;
    assert!(rest.translation.vector.dot(&axis).abs() < 1e-9);
    assert!(rest.rotation.scaled_axis().dot(&axis).abs() < 1e-9);
    for place in 100..150 {
        let q = spread_joints(&arm, place);
        let off =
            end(&chain, &origins, &q).to_homogeneous() - truth(&arm, &errors, &q).to_homogeneous();
        assert!(off.abs().max() < 1e-7, "{off}");
    }
}

#[test]
fn a_motion_is_what_goes_along_an_axis_and_what_goes_across() {
    let motion = isometry_from_rpy([1.0, -2.0, 3.0], [0.02, -0.01, 0.3]);
    let axis = UnitVector3::new_normalize(Vector3::new(0.1, 0.2, 0.9));
    let along = along(&motion, &axis);
    let across = along.inverse() * motion;
    assert!(across.rotation.scaled_axis().dot(&axis).abs() < 1e-12);
    assert!(along.rotation.scaled_axis().cross(&axis).norm() < 1e-12);
    assert!(along.translation.vector.cross(&axis).norm() < 1e-12);
}
