//! S, the status of a KUKA position → the arm configuration that it asks for.
//!
//! - Bit 0: the wrist's centre has a negative x in the frame that turns with axis 1.
//! - Bit 1: axis 3 is beyond the angle at which the arm is stretched: A3 = 0° where axes 3 and 4 meet, else
//!   −atan(offset / forearm).
//! - Bit 2: A5 is negative. (Some editions of the manual print the reverse; bit 4 of T, the sign of A5, on points that
//!   controllers taught shows which is right.)
//! - Bit 4: the point was taught by a robot with the absolute-accuracy option.
//!
//! These are the sides of the singularities that [`Configuration`] names, except for the direction in which a chain
//! counts. So one posture that every such arm can take shows what each bit means for it.

use crate::kinematics::{Arm, Configuration, Side};

/// The meaning of the bits of S for an arm: its configuration at S 2, the usual home with a bent wrist.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Postures {
    home: Configuration,
}

/// Joint angles as the controller shows them: upper arm upright, forearm level, wrist bent down. S is 2.
const HOME_DEG: [f64; 6] = [0.0, -90.0, 90.0, 0.0, 45.0, 0.0];

impl Postures {
    /// Postures of an arm; `None` for one without six axes.
    pub fn of_arm(arm: &Arm) -> Option<Self> {
        if arm.joints().len() != HOME_DEG.len() {
            return None;
        }
        let nominal = arm.no_offsets();
        let home = Configuration::of(arm, &nominal, &HOME_DEG.map(f64::to_radians))?;
        Some(Self { home })
    }

    /// The arm configuration of a status; `None` where it has bits without a meaning.
    pub fn configuration(&self, status: u8) -> Option<Configuration> {
        let is_set = |bit: u8| status & (1 << bit) != 0;
        let side = |own: Side, other: bool| match (own, other) {
            (side, false) => side,
            (Side::Plus, true) => Side::Minus,
            (Side::Minus, true) => Side::Plus,
        };
        (status < 32).then(|| Configuration {
            shoulder: side(self.home.shoulder, is_set(0)),
            elbow: side(self.home.elbow, !is_set(1)),
            wrist: side(self.home.wrist, is_set(2)),
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Rotation3, Vector3};

    use super::*;
    use crate::kinematics::{RobotFile, SingularityFactors};

    fn kr210() -> Arm {
        let text = include_str!("../../../pipelines/robots/kr210-r2700-extra.toml");
        toml::from_str::<RobotFile>(text).unwrap().arm().unwrap()
    }

    /// S by its definition, from the pose of the arm: joint angles as the controller shows them, degrees.
    fn by_definition(arm: &Arm, degrees: [f64; 6]) -> u8 {
        let joints = degrees.map(f64::to_radians);
        let flange = *arm.flange(&joints).isometry();
        // The wrist's centre lies 215 mm behind the flange of a KR 210 R2700 extra.
        let wrist = flange * Point3::new(0.0, 0.0, -215.0);
        // A1 counts clockwise from above, so its frame is turned by −A1.
        let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), joints[0]) * wrist;
        // Axis 4 passes axis 3 at 41 mm, and the wrist is 1200 mm along it.
        let stretched = -(41.0_f64 / 1200.0).atan();
        let bits = [turned.x < 0.0, joints[2] > stretched, joints[4] < 0.0];
        (0..3).filter(|&bit| bits[bit]).map(|bit| 1 << bit).sum()
    }

    #[test]
    fn each_bit_is_the_side_of_a_singularity_at_any_joint_angles() {
        let arm = kr210();
        let nominal = arm.no_offsets();
        let postures = Postures::of_arm(&arm).unwrap();
        assert_eq!(postures.configuration(32), None);
        let mut seen = [0_usize; 8];
        for number in 1..4000_u32 {
            let mut degrees = [0.0; 6];
            for (joint, (degrees, limits)) in (1_u32..).zip(degrees.iter_mut().zip(arm.joints())) {
                // An irrational rotation per joint covers the limits evenly without randomness.
                let share = (f64::from(number) * f64::from(joint + 1).sqrt().sqrt()).fract();
                *degrees = (limits.lower + share * (limits.upper - limits.lower)).to_degrees();
            }
            let joints = degrees.map(f64::to_radians);
            let factors = SingularityFactors::of(&arm, &nominal, &joints).unwrap();
            if factors.smallest() < 1e-6 {
                continue;
            }
            let status = by_definition(&arm, degrees);
            seen[usize::from(status)] += 1;
            assert_eq!(
                postures.configuration(status),
                Some(factors.configuration()),
                "{degrees:?}"
            );
        }
        assert!(seen.iter().all(|&n| n > 20), "every S was met: {seen:?}");
    }
}
