use super::*;
use crate::kinematics::parameter::{LinkQuantity, Parameter};
use crate::kinematics::{Axis, Element, Motion};
use crate::kinematics::{HeldChain, RobotFile};

/// Poses of `axes` variables within ±3, without randomness; 150 is two whole blocks and part of a third.
fn columns(axes: usize, poses: usize) -> Vec<Vec<f64>> {
    let angle = |axis: usize, i: usize| 3.0 * ((i * 37 + axis * 101) as f64 * 0.618).sin();
    (0..axes).map(|axis| (0..poses).map(|i| angle(axis, i)).collect()).collect()
}

fn free(motion: Motion, nominal: f64) -> Element {
    Element::Free {
        motion,
        nominal,
        parameter: Parameter::Link { joint: 1, quantity: LinkQuantity::A },
    }
}

/// Turning and sliding joints about all three axes, one variable twice, constants in any direction between them.
fn odd_chain() -> Chain {
    let joint = |motion, joint, sign| Element::Joint { motion, joint, sign };
    Chain::new(vec![
        Element::Fixed(Motion::Rotation(Axis::X).by(0.3) * Motion::Translation(Axis::Y).by(40.0)),
        free(Motion::Translation(Axis::Z), 120.0),
        joint(Motion::Rotation(Axis::Z), 0, -1.0),
        free(Motion::Rotation(Axis::Y), 0.7),
        free(Motion::Translation(Axis::X), 300.0),
        joint(Motion::Rotation(Axis::X), 2, 1.0),
        joint(Motion::Translation(Axis::Y), 1, 1.0),
        joint(Motion::Rotation(Axis::Y), 0, 0.5),
        Element::Fixed(Motion::Rotation(Axis::Y).by(-1.1) * Motion::Rotation(Axis::Z).by(2.0)),
        // Nearly parallel to the one before: where the two turns about z are least determined.
        joint(Motion::Rotation(Axis::Y), 3, 1.0),
        free(Motion::Rotation(Axis::X), 1e-9),
        joint(Motion::Rotation(Axis::Y), 2, 1.0),
        free(Motion::Rotation(Axis::Z), -0.4),
        free(Motion::Translation(Axis::Z), 80.0),
    ])
}

/// Constants whose pitch is a right angle but for rounding, where roll and yaw are one.
fn upright_chain() -> Chain {
    let right = |part: f64| {
        let turn = Motion::Rotation(Axis::X).by(part) * Motion::Rotation(Axis::Z).by(0.4);
        turn * (turn.inverse() * Motion::Rotation(Axis::Y).by(std::f64::consts::FRAC_PI_2))
            * Motion::Rotation(Axis::X).by(part)
    };
    let joint = |joint| Element::Joint { motion: Motion::Rotation(Axis::Z), joint, sign: 1.0 };
    Chain::new(vec![
        Element::Fixed(right(0.7)),
        joint(0),
        free(Motion::Translation(Axis::X), 300.0),
        Element::Fixed(right(-1.3).inverse()),
        joint(1),
        Element::Fixed(right(2.9)),
        free(Motion::Translation(Axis::Z), 80.0),
    ])
}

fn robots() -> Vec<Chain> {
    let files = [
        include_str!("../../../../pipelines/robots/kr210-r2700-extra.toml"),
        include_str!("../../../../pipelines/robots/irb120.toml"),
        include_str!("../../../../pipelines/robots/ur10.toml"),
    ];
    let chain = |text: &&str| {
        let file: RobotFile = toml::from_str(text).expect("a robot file of this repository");
        file.arm().expect("a valid arm").chain().clone()
    };
    files.iter().map(chain).collect()
}

/// Offsets as an identified arm has them: tenths of mm and mrad, different everywhere.
fn offsets(chain: &Chain) -> Vec<f64> {
    let size = |place: usize, p: &Parameter| {
        let by = (place as f64 * 1.7).sin();
        if p.is_angle() { 1e-3 * by } else { 0.3 * by }
    };
    let parameters = chain.parameters();
    parameters.iter().enumerate().map(|(place, parameter)| size(place, parameter)).collect()
}

fn pose_of(axes: &[Vec<f64>], i: usize) -> Vec<f64> {
    axes.iter().map(|column| column[i]).collect()
}

#[test]
fn a_batch_equals_its_chain_within_a_picometre() {
    let chains = robots().into_iter().chain([odd_chain(), upright_chain()]);
    for chain in chains {
        let axes = columns(chain.joint_count(), 150);
        let offsets = offsets(&chain);
        let batch = BatchChain::new(&chain, &offsets);
        let (poses, positions) = (batch.poses(&axes), batch.positions(&axes));
        assert_eq!((poses.count(), positions[2].len()), (150, 150));
        assert_eq!(poses.position, positions, "positions and poses have the same arithmetic");
        for i in 0..150 {
            let wanted = chain.forward(&pose_of(&axes, i), &offsets);
            let found = poses.isometry(i);
            let apart = (found.translation.vector - wanted.translation.vector).norm();
            assert!(apart < 1e-9, "pose {i}: {apart} mm");
            assert!(found.rotation.angle_to(&wanted.rotation) < 1e-12);
        }
    }
}

#[test]
fn columns_are_the_chains_own_differential() {
    let chains = robots().into_iter().chain([odd_chain(), upright_chain()]);
    for chain in chains {
        let axes = columns(chain.joint_count(), 70);
        let offsets = offsets(&chain);
        // Every third parameter is fixed; the others are counted from the last.
        let count = offsets.len();
        let unknowns: Vec<_> =
            (0..count).map(|place| (place % 3 != 1).then_some(count - place)).collect();
        let batch = BatchColumns::new(&chain, &offsets, &unknowns);
        let held = HeldChain::new(&chain, &offsets, &unknowns);
        let mut found = Vec::new();
        let variables = Variables::of(axes.clone());
        for first in [0, BLOCK] {
            let (_, end) = batch.block(&variables, first, &mut found);
            for i in 0..BLOCK.min(70 - first) {
                let view = held.view(&pose_of(&axes, first + i));
                let apart = |row: usize| end[row][i] - view.end.translation.vector[row];
                assert!((0..3).all(|row| apart(row).abs() < 1e-9));
                assert_eq!(view.unknowns.len(), found.len());
                for ((column, unknown), (of, twist)) in
                    found.iter().zip(batch.unknowns()).zip(&view.unknowns)
                {
                    assert_eq!(unknown, of);
                    let angular = |row: usize| column.angular().map_or(0.0, |a| a[row][i]);
                    for row in 0..3 {
                        assert!((column.linear[row][i] - twist.linear[row]).abs() < 1e-9);
                        assert!((angular(row) - twist.angular[row]).abs() < 1e-12);
                    }
                }
            }
        }
    }
}

#[test]
fn a_pose_gives_the_same_bytes_at_any_place_in_the_columns() {
    let chain = &robots()[0];
    let batch = BatchChain::new(chain, &offsets(chain));
    let axes = columns(6, 150);
    let all = batch.positions(&axes);
    let alone: Vec<Vec<f64>> = axes.iter().map(|column| vec![column[100]]).collect();
    let one = batch.positions(&alone);
    for row in 0..3 {
        assert_eq!(one[row][0].to_bits(), all[row][100].to_bits());
    }
}

#[test]
fn no_poses_give_empty_columns() {
    let chain = &robots()[0];
    let none = vec![Vec::<f64>::new(); 6];
    let poses = BatchChain::new(chain, &offsets(chain)).poses(&none);
    assert_eq!(poses.count(), 0);
}

#[test]
fn axes_apply_the_joint_map() {
    let text = include_str!("../../../../pipelines/robots/kr210-r2700-extra.toml");
    let mut file: RobotFile = toml::from_str(text).expect("a robot file");
    let mut map = vec![vec![0.0; 6]; 6];
    for (axis, row) in map.iter_mut().enumerate() {
        row[axis] = 1.0;
    }
    map[2][1] = 1.0;
    file.joint_map = Some(map);
    let arm = file.arm().expect("an invertible map");
    let joints = [0.1, -0.7, 0.4, 0.2, 1.1, -0.3];
    let axes = arm.axes(&joints);
    assert!((axes[2] - (joints[1] + joints[2])).abs() < 1e-15);
    assert_eq!(axes[5].to_bits(), joints[5].to_bits());
}
