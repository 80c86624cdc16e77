//! S, the status of a KUKA position, or the letters of FANUC's `CONFIG` → the arm configuration that it asks for.
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
//!
//! FANUC's letters are the same three: F where J5 is positive, D where J2 + J3 is beyond the angle at which the arm is stretched, B where the
//! wrist's centre is behind axis 1. Controllers' own lists of positions (CURPOS.DG) show N U T, published joint angles with their letters
//! all eight; those with B come from one source only, and are taken as not proven.

use crate::kinematics::{Arm, Configuration, Side};
use crate::value::Letters;

/// The meaning of the bits of S for an arm: its configuration at S 2, the usual home with a bent wrist. Of FANUC's letters that at N U T.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Postures {
    home: Configuration,
}

/// Joint angles as the controller shows them: upper arm upright, forearm level, wrist bent down. S is 2.
const HOME_DEG: [f64; 6] = [0.0, -90.0, 90.0, 0.0, 45.0, 0.0];
/// Likewise of FANUC; `CONFIG` is N U T.
const FANUC_HOME_DEG: [f64; 6] = [0.0, 0.0, 0.0, 0.0, -90.0, 0.0];

impl Postures {
    /// Postures of an arm; `None` for one without six axes.
    pub fn of_arm(arm: &Arm) -> Option<Self> {
        Self::at(arm, HOME_DEG)
    }

    /// Postures of a FANUC arm; `None` also for one whose joint 3 is counted in another way than FANUC's.
    pub fn of_fanuc(arm: &Arm) -> Option<Self> {
        Self::at(arm, FANUC_HOME_DEG).filter(|_| counts_from_horizontal(arm))
    }

    fn at(arm: &Arm, home_deg: [f64; 6]) -> Option<Self> {
        if arm.joints().len() != home_deg.len() {
            return None;
        }
        let home = Configuration::of(arm, &arm.no_offsets(), &home_deg.map(f64::to_radians))?;
        Some(Self { home })
    }

    /// The arm configuration of a status; `None` where it has bits without a meaning.
    pub fn configuration(&self, status: u8) -> Option<Configuration> {
        let is_set = |bit: u8| status & (1 << bit) != 0;
        (status < 32).then(|| self.turned([is_set(0), !is_set(1), is_set(2)]))
    }

    /// The arm configuration of FANUC's letters; `None` where that is not proven.
    pub fn of_letters(&self, letters: Letters) -> Option<Configuration> {
        (!letters.back).then(|| self.turned([false, letters.down, letters.flip]))
    }

    /// The home's, with shoulder, elbow and wrist on their other sides.
    const fn turned(self, [shoulder, elbow, wrist]: [bool; 3]) -> Configuration {
        const fn side(own: Side, is_other: bool) -> Side {
            match (own, is_other) {
                (side, false) => side,
                (Side::Plus, true) => Side::Minus,
                (Side::Minus, true) => Side::Plus,
            }
        }
        Configuration {
            shoulder: side(self.home.shoulder, shoulder),
            elbow: side(self.home.elbow, elbow),
            wrist: side(self.home.wrist, wrist),
        }
    }
}

/// Whether an arm's joint 3 is counted as FANUC counts it: against the horizontal, so that axis 3 turns by the sum of joints 2 and 3.
pub(crate) fn counts_from_horizontal(arm: &Arm) -> bool {
    let map = arm.axes_from_joints();
    let part = |row: usize, column: usize| map.get((row, column)).copied().unwrap_or_default();
    (part(2, 1) - part(2, 2)).abs() < 1e-12 && part(2, 2).abs() > 0.5 && part(1, 2).abs() < 1e-12
}

#[cfg(test)]
mod stated;

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Rotation3, Vector3};

    use super::*;
    use crate::kinematics::{RobotFile, SingularityFactors};

    fn kr210() -> Arm {
        let text = include_str!("../../pipelines/robots/kr210-r2700-extra.toml");
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

    fn letters(config: &str) -> Letters {
        let is = |letter| config.contains(letter);
        Letters { flip: is('F'), down: is('D'), back: is('B') }
    }

    #[test]
    fn letters_of_fanuc_are_those_of_stated_joint_angles() {
        // CURPOS.DG of two controllers, the home of FANUC's manuals, and joint angles that UnderAutomation publishes with their letters.
        let stated = [
            ([0.0, 0.0, 0.0, 0.0, -90.0, 0.0], "NUT"),
            ([86.75, -45.63, -10.99, 56.19, -81.55, -94.01], "NUT"),
            ([0.0, -10.0, 40.0, 5.0, -90.0, -95.0], "NUT"),
            ([10.0, 20.0, 40.0, 10.0, -10.0, 0.0], "NUT"),
            ([3.2969, 19.0319, 27.7002, 58.2991, 4.783, -51.728], "FUT"),
            ([10.204, 47.1644, 69.1161, 3.0266, -39.0031, 7.6007], "NDT"),
            ([-15.6154, 48.3697, 60.5986, 142.0264, 34.2715, -150.7098], "FDT"),
        ];
        for file in [
            include_str!("../../pipelines/robots/r2000ic-165f.toml"),
            include_str!("../../pipelines/robots/m20ia.toml"),
        ] {
            let arm = toml::from_str::<RobotFile>(file).unwrap().arm().unwrap();
            let postures = Postures::of_fanuc(&arm).unwrap();
            for (degrees, config) in stated {
                let found =
                    Configuration::of(&arm, &arm.no_offsets(), &degrees.map(f64::to_radians));
                assert_eq!(postures.of_letters(letters(config)), found, "{config} {degrees:?}");
            }
            assert_eq!(postures.of_letters(letters("NUB")), None);
        }
        assert_eq!(Postures::of_fanuc(&kr210()), None, "its joint 3 is counted from the upper arm");
    }
}
