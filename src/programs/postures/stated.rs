//! What controllers state of an arm configuration, held against what this crate reads in it (`stated.toml`).

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};
use serde::Deserialize;

use super::Postures;
use crate::kinematics::{Arm, Configuration, RobotFile};
use crate::value::Letters;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    links: BTreeMap<String, Vec<[f64; 4]>>,
    cell: Vec<Cell>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Cell {
    model: String,
    arm: String,
    origin: String,
    joints: Joints,
    base: Option<Vec<f64>>,
    tool: Option<Vec<f64>>,
    #[serde(default = "digits_written")]
    within_mm: f64,
    points: Vec<Point>,
}

#[derive(Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Joints {
    Stated,
    Solved,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Point {
    /// S and T.
    status: Option<u8>,
    turn: Option<u8>,
    /// `CONFIG`.
    letters: Option<String>,
    turns: Option<[i32; 3]>,
    /// cf1, cf4, cf6 and cfx.
    cf: Option<[i32; 4]>,
    pose: Option<Vec<f64>>,
    joints: [f64; 6],
}

/// Joint angles are written to 0.0001°, of a tool up to 4 m from axis 1.
const fn digits_written() -> f64 {
    0.02
}

fn table() -> Table {
    toml::from_str(include_str!("stated.toml")).unwrap()
}

impl Table {
    fn arm(&self, cell: &Cell) -> Arm {
        let robots = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../pipelines/robots");
        let text = std::fs::read_to_string(robots.join(&cell.arm).with_extension("toml")).unwrap();
        let mut file = toml::from_str::<RobotFile>(&text).unwrap();
        let links = self.links.get(&cell.model).into_iter().flatten();
        for (joint, [a, alpha, d, offset]) in file.joint.iter_mut().zip(links) {
            joint.a_mm = Some(*a);
            joint.alpha_deg = Some(*alpha);
            joint.d_mm = Some(*d);
            joint.offset_deg = Some(*offset);
        }
        file.arm().unwrap()
    }

    /// Each point with its cell and its arm.
    fn each(&self, mut held: impl FnMut(&Cell, &Arm, &Point)) {
        for cell in &self.cell {
            let arm = self.arm(cell);
            cell.points.iter().for_each(|point| held(cell, &arm, point));
        }
    }
}

impl Cell {
    /// A frame as the cell's maker writes one.
    fn frame(&self, numbers: &[f64]) -> Isometry3<f64> {
        let turn = match (self.model.split(' ').next(), &numbers[3..]) {
            (Some("KUKA"), [a, b, c]) => euler_deg([*c, *b, *a]),
            (Some("FANUC"), [w, p, r]) => euler_deg([*w, *p, *r]),
            (Some("ABB"), [q1, q2, q3, q4]) => {
                UnitQuaternion::from_quaternion(Quaternion::new(*q1, *q2, *q3, *q4))
            }
            (Some("UR10e"), vector) => {
                UnitQuaternion::from_scaled_axis(Vector3::from_row_slice(vector))
            }
            _ => panic!("{}: {numbers:?}", self.origin),
        };
        Isometry3::from_parts(Vector3::from_row_slice(&numbers[..3]).into(), turn)
    }
}

impl Point {
    fn configuration(&self, arm: &Arm) -> Configuration {
        let joints = self.joints.map(f64::to_radians);
        Configuration::of(arm, &arm.no_offsets(), &joints).unwrap()
    }
}

/// About the fixed axes x, y, z.
fn euler_deg(angles: [f64; 3]) -> UnitQuaternion<f64> {
    let [x, y, z] = angles.map(f64::to_radians);
    UnitQuaternion::from_euler_angles(x, y, z)
}

#[test]
fn joint_angles_of_the_table_reach_the_stated_poses() {
    let mut held = 0;
    table().each(|cell, arm, point| {
        assert_eq!(point.pose.is_some(), cell.tool.is_some(), "{}", cell.origin);
        let (Some(pose), Some(tool)) = (&point.pose, &cell.tool) else { return };
        let base = cell.base.as_ref().map_or_else(Isometry3::identity, |base| cell.frame(base));
        let flange = *arm.flange(&point.joints.map(f64::to_radians)).isometry();
        let apart = (base * cell.frame(pose)).inv_mul(&(flange * cell.frame(tool)));
        let (mm, degrees) = (apart.translation.vector.norm(), apart.rotation.angle().to_degrees());
        assert!(mm < cell.within_mm && degrees < 0.01, "{mm} mm, {degrees}° at {point:?}");
        held += 1;
    });
    assert_eq!(held, 95);
}

#[test]
fn s_and_the_bits_of_t_are_those_of_the_joint_angles() {
    let mut held = 0;
    table().each(|_, arm, point| {
        let (Some(status), Some(turn)) = (point.status, point.turn) else { return };
        let postures = Postures::of_arm(arm).unwrap();
        assert_eq!(postures.configuration(status), Some(point.configuration(arm)), "{point:?}");
        for (joint, degrees) in point.joints.iter().enumerate() {
            assert_eq!(turn >> joint & 1 == 1, *degrees < 0.0, "{point:?}");
        }
        held += 1;
    });
    assert_eq!(held, 25);
}

#[test]
fn letters_are_those_of_the_joint_angles_and_turns_those_of_joints_1_4_and_6() {
    let mut held = 0;
    table().each(|_, arm, point| {
        let (Some(letters), Some(turns)) = (&point.letters, point.turns) else { return };
        let is = |letter| letters.contains(letter);
        let letters = Letters { flip: is('F'), down: is('D'), back: is('B') };
        let postures = Postures::of_fanuc(arm).unwrap();
        assert_eq!(postures.of_letters(letters), Some(point.configuration(arm)), "{point:?}");
        // $SCR_GRP[1].$TURN_AXIS is 1, 4, 6 in SYMOTN.VA of both controllers of which that file is there.
        for (turn, joint) in turns.into_iter().zip([0, 3, 5]) {
            let apart = point.joints[joint] / 360.0 - f64::from(turn);
            assert!(apart.abs() <= 0.5, "{point:?}");
        }
        held += 1;
    });
    assert_eq!(held, 21);
}

/// Joint angles at which cfx is 0: forearm level, wrist bent down.
const ABB_HOME_DEG: [f64; 6] = [0.0, 0.0, 0.0, 0.0, 45.0, 0.0];

#[test]
fn quarter_turns_are_those_of_joints_1_4_and_6_and_cfx_counts_the_sides_of_the_singularities() {
    let mut seen = [0; 8];
    table().each(|_, arm, point| {
        let Some([cf1, cf4, cf6, cfx]) = point.cf else { return };
        for (quarter, joint) in [(cf1, 0), (cf4, 3), (cf6, 5)] {
            let apart = point.joints[joint] / 90.0 - f64::from(quarter) - 0.5;
            assert!(apart.abs() <= 0.5 + 1e-5, "{point:?}");
        }
        let is_set = |bit: u8| cfx >> bit & 1 == 1;
        let home = Postures::at(arm, ABB_HOME_DEG).unwrap();
        let stated = home.turned([is_set(2), is_set(1), is_set(0)]);
        assert_eq!(stated, point.configuration(arm), "{point:?}");
        seen[usize::try_from(cfx).unwrap()] += 1;
    });
    assert_eq!(seen, [25, 2, 4, 1, 1, 1, 1, 1]);
}

#[test]
fn each_maker_states_joint_angles_of_its_own_beside_a_configuration() {
    for maker in ["KUKA", "ABB", "FANUC", "UR10e"] {
        let table = table();
        let mut cells = table.cell.iter().filter(|cell| cell.model.starts_with(maker));
        assert!(cells.any(|cell| cell.joints == Joints::Stated), "{maker}");
    }
}
