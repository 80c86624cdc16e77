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

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Status(u8);

impl Status {
    /// The status of a number; `None` where it has undefined bits.
    pub fn of(number: i64) -> Option<Self> {
        u8::try_from(number).ok().filter(|s| *s < 32).map(Self)
    }

    const fn is_set(self, bit: u8) -> bool {
        self.0 & (1 << bit) != 0
    }

    pub(super) const fn taught_absolutely_accurate(self) -> bool {
        self.is_set(4)
    }
}

/// The meaning of the bits of S for an arm: its configuration at S 2, the usual home with a bent wrist.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Postures {
    home: Configuration,
}

/// Joint angles as the controller shows them: upper arm upright, forearm level, wrist bent down. S is 2.
const HOME_DEG: [f64; 6] = [0.0, -90.0, 90.0, 0.0, 45.0, 0.0];
/// Nearer to the angle where its bit changes an axis may be on either side, rad: the offset of axes 3 and 4 amounts to
/// 2° on large arms and 8° on small ones.
const UNSURE_RAD: f64 = 0.2;

impl Postures {
    /// Postures of arms whose robot files are in standard DH with the signs of
    /// `pipelines/robots/kr210-r2700-extra.toml`.
    pub const STANDARD_DH: Self = Self {
        home: Configuration { shoulder: Side::Minus, elbow: Side::Plus, wrist: Side::Minus },
    };

    /// Postures of an arm; `None` for one without six axes.
    pub fn of_arm(arm: &Arm) -> Option<Self> {
        if arm.joints().len() != HOME_DEG.len() {
            return None;
        }
        let nominal = arm.no_offsets();
        let home = Configuration::of(arm, &nominal, &HOME_DEG.map(f64::to_radians))?;
        Some(Self { home })
    }

    /// Postures by the joint angles (rad) and configuration of its nodes; `None` where they do not agree with
    /// [`Self::STANDARD_DH`].
    pub fn of_table<'j>(
        configuration: Option<&str>,
        joints: impl IntoIterator<Item = &'j [f64]>,
    ) -> Option<Self> {
        let own = Self::STANDARD_DH;
        let said = (0..8).map(Status).find(|status| {
            Some(own.configuration(*status).to_string().as_str()) == configuration
        })?;
        let agrees = |joints: &[f64]| {
            let &[_, _, q3, _, q5, _] = joints else { return false };
            (q3.abs() < UNSURE_RAD || (q3 > 0.0) == said.is_set(1)) && (q5 < 0.0) == said.is_set(2)
        };
        joints.into_iter().all(agrees).then_some(own)
    }

    pub fn configuration(&self, status: Status) -> Configuration {
        let side = |own: Side, other: bool| match (own, other) {
            (side, false) => side,
            (Side::Plus, true) => Side::Minus,
            (Side::Minus, true) => Side::Plus,
        };
        Configuration {
            shoulder: side(self.home.shoulder, status.is_set(0)),
            elbow: side(self.home.elbow, !status.is_set(1)),
            wrist: side(self.home.wrist, status.is_set(2)),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Rotation3, Vector3};

    use super::*;
    use crate::kinematics::{RobotFile, SingularityFactors};

    fn kr210() -> Arm {
        let text = include_str!("../../../../pipelines/robots/kr210-r2700-extra.toml");
        toml::from_str::<RobotFile>(text).unwrap().arm().unwrap()
    }

    /// S by its definition, from the pose of the arm: joint angles as the controller shows them, degrees.
    fn by_definition(arm: &Arm, degrees: [f64; 6]) -> Status {
        let joints = degrees.map(f64::to_radians);
        let flange = *arm.flange(&joints).isometry();
        // The wrist's centre lies 215 mm behind the flange of a KR 210 R2700 extra.
        let wrist = flange * Point3::new(0.0, 0.0, -215.0);
        // A1 counts clockwise from above, so its frame is turned by −A1.
        let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), joints[0]) * wrist;
        // Axis 4 passes axis 3 at 41 mm, and the wrist is 1200 mm along it.
        let stretched = -(41.0_f64 / 1200.0).atan();
        let bits = [turned.x < 0.0, joints[2] > stretched, joints[4] < 0.0];
        Status((0..3).filter(|&bit| bits[bit]).map(|bit| 1 << bit).sum())
    }

    #[test]
    fn each_bit_is_the_side_of_a_singularity_at_any_joint_angles() {
        let arm = kr210();
        let nominal = arm.no_offsets();
        let postures = Postures::of_arm(&arm).unwrap();
        assert_eq!(postures, Postures::STANDARD_DH);
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
            seen[usize::from(status.0)] += 1;
            assert_eq!(postures.configuration(status), factors.configuration(), "{degrees:?}");
        }
        assert!(seen.iter().all(|&n| n > 20), "every S was met: {seen:?}");
    }

    #[test]
    fn a_table_of_another_convention_is_not_taken_for_this_one() {
        let home = HOME_DEG.map(f64::to_radians);
        let label = Postures::STANDARD_DH.configuration(Status(2)).to_string();
        let of = |label: &str, joints: &[f64]| Postures::of_table(Some(label), [joints]);
        assert_eq!(of(&label, &home), Some(Postures::STANDARD_DH));
        // The same label with a wrist bent the other way: a chain that counts the other way.
        let mut other = home;
        other[4] = -0.5;
        assert_eq!(of(&label, &other), None);
        assert_eq!(of("shoulder? elbow", &home), None);
        assert_eq!(Postures::of_table(None, [home.as_slice()]), None);
        assert_eq!(of(&label, &home[..5]), None);
    }
}
