//! Arm configuration (one of eight) of a six-axis arm, and its distance from the singularities between them. With `z_i`
//! the unit vector of axis i and `o_i` a point on it:
//!
//! 1. wrist: `(z4 × z5) · z6`, zero where axes 4 and 6 align.
//! 2. elbow: `z2 · ((o3 − o2) × (o5 − o3))`, zero where the arm is stretched or folded.
//! 3. shoulder: `det J / (elbow · wrist)`, the distance of the wrist from the shoulder's plane or axis.
//!
//! The Jacobian's determinant has these factors where six axes rotate, axes 2 and 3 are parallel, and either axes 4, 5
//! and 6 meet in one point (KUKA, ABB) or axis 4 is parallel too and axes 5 and 6 meet (UR), where the elbow is
//! measured to. Other arms have no configuration; how near they are to a singularity is the smallest singular value of
//! their Jacobian (`conditioning`).

use std::fmt;

use nalgebra::{DMatrix, Matrix6, Point3, Vector3};

use super::arm::Arm;
use super::held::{ChainView, HeldChain};
use super::twist::Twist;

/// Axes at a smaller angle's sine count as parallel: ten times what identified arms are off by.
const PARALLEL_SINE: f64 = 0.02;
/// Axes that miss each other by less than this share of the stretched arm count as meeting: identified arms miss by
/// thousandths, drawn offsets are hundredths.
const MEETING_SHARE: f64 = 0.01;

type Line = (Point3<f64>, Vector3<f64>);

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Configuration {
    /// In front of the shoulder's singularity or behind it.
    pub shoulder: Side,
    pub elbow: Side,
    pub wrist: Side,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Side {
    Minus,
    /// The factor is zero or positive.
    Plus,
}

/// The factors of the Jacobian's determinant, dimensionless: 0 at the singularity, of order 1 far from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SingularityFactors {
    /// Distance of the wrist from the shoulder's singularity over the length of the stretched arm.
    pub shoulder: f64,
    /// Sine of the angle between upper arm and forearm.
    pub elbow: f64,
    /// Volume that the last three axes span; the sine of joint 5 where its neighbours are perpendicular to it.
    pub wrist: f64,
}

impl Side {
    fn of(factor: f64) -> Self {
        if factor < 0.0 { Self::Minus } else { Self::Plus }
    }
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Minus => "-",
            Self::Plus => "+",
        })
    }
}

impl fmt::Display for Configuration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "shoulder{} elbow{} wrist{}", self.shoulder, self.elbow, self.wrist)
    }
}

impl SingularityFactors {
    /// Factors at reported joint angles (rad); `None` for an arm without any, or whose upper arm or forearm has no length.
    pub fn of(arm: &Arm, offsets: &[f64], joints: &[f64]) -> Option<Self> {
        Self::of_view(&HeldChain::fixed(arm.chain(), offsets).view(&arm.axes(joints)))
    }

    pub(super) fn of_view(view: &ChainView) -> Option<Self> {
        let (axes, twists) = (&view.axes.first, &view.joints);
        let forearm_end = forearm_end(axes, twists)?;
        let z = |axis: usize| axes[axis - 1].1;
        let upper_arm = axes[2].0 - axes[1].0;
        let forearm = forearm_end - axes[2].0;
        // Only components perpendicular to axis 2 count: a shift of the wrist along that axis does not bend the elbow.
        let across = |v: Vector3<f64>| v - z(2) * v.dot(&z(2));
        let (upper, fore) = (across(upper_arm).norm(), across(forearm).norm());
        if upper * fore < f64::EPSILON {
            return None;
        }
        let wrist = z(4).cross(&z(5)).dot(&z(6));
        let elbow_mm2 = z(2).dot(&upper_arm.cross(&forearm));
        let elbow = elbow_mm2 / (upper * fore);
        // On a singularity of elbow or wrist the quotient is undefined, and the pose is singular anyway.
        let quotient = determinant(twists) / (elbow_mm2 * wrist) / (upper + fore);
        let shoulder = if (elbow * wrist).abs() < 1e-12 { 0.0 } else { quotient };
        Some(Self { shoulder, elbow, wrist })
    }

    /// The smallest factor: how near the nearest singularity is.
    pub fn smallest(&self) -> f64 {
        self.shoulder.abs().min(self.elbow.abs()).min(self.wrist.abs())
    }

    pub fn configuration(&self) -> Configuration {
        Configuration {
            shoulder: Side::of(self.shoulder),
            elbow: Side::of(self.elbow),
            wrist: Side::of(self.wrist),
        }
    }
}

impl Configuration {
    /// Configuration at reported joint angles (rad); `None` for an arm that has none ([`SingularityFactors::of`]).
    pub fn of(arm: &Arm, offsets: &[f64], joints: &[f64]) -> Option<Self> {
        SingularityFactors::of(arm, offsets, joints).map(|factors| factors.configuration())
    }
}

/// The point at which the elbow's triangle ends, the chain's own point of axis 5 where that is as good; `None` where
/// the determinant does not have the three factors.
fn forearm_end(axes: &[Line], twists: &[Twist]) -> Option<Point3<f64>> {
    let rotates = |twist: &Twist| twist.angular.norm_squared() > 0.0;
    let &[_, second, third, fourth, fifth, sixth] = axes else { return None };
    if twists.len() != 6 || !twists.iter().all(rotates) || !are_parallel(&second, &third) {
        return None;
    }
    let across = |v: Vector3<f64>| v - second.1 * v.dot(&second.1);
    let length =
        |end: &Point3<f64>| across(third.0 - second.0).norm() + across(end - third.0).norm();
    let (bend, flange) = (meeting(&fifth, &fourth), meeting(&fifth, &sixth)?);
    if are_parallel(&third, &fourth) {
        let near = MEETING_SHARE * length(&fourth.0);
        let is_own = across(fifth.0 - fourth.0).norm() <= near;
        return (flange.1 <= near).then_some(if is_own { fifth.0 } else { fourth.0 });
    }
    let bend = bend?;
    let near = MEETING_SHARE * length(&bend.0);
    let is_one_point = bend.1.max(flange.1).max((bend.0 - flange.0).norm()) <= near;
    let is_own = (fifth.0 - bend.0).norm() <= near;
    is_one_point.then_some(if is_own { fifth.0 } else { bend.0 })
}

fn are_parallel(a: &Line, b: &Line) -> bool {
    a.1.cross(&b.1).norm() < PARALLEL_SINE
}

/// The point of a line that is nearest to another, and its distance from it, mm; `None` for parallel lines.
fn meeting(line: &Line, other: &Line) -> Option<(Point3<f64>, f64)> {
    if are_parallel(line, other) {
        return None;
    }
    let between = other.0 - line.0;
    let normal = line.1.cross(&other.1);
    let along = between.cross(&other.1).dot(&normal) / normal.norm_squared();
    let distance = between.dot(&normal).abs() / normal.norm();
    Some((line.0 + line.1 * along, distance))
}

/// The smallest singular value of the Jacobian over `lever_mm`: 0 at a singularity. Rows of angles are multiplied by
/// `lever_mm`, and columns by `scales` (1 for an angle, the mm that count as a radian for a length); for any arm.
pub(super) fn conditioning(twists: &[Twist], scales: &[f64], lever_mm: f64) -> f64 {
    let least = DMatrix::from_fn(6, twists.len(), |row, column| {
        let value = if row < 3 {
            twists[column].linear[row]
        } else {
            twists[column].angular[row - 3] * lever_mm
        };
        value * scales[column]
    })
    .singular_values()
    .min();
    least / lever_mm
}

fn determinant(twists: &[Twist]) -> f64 {
    Matrix6::from_fn(|row, column| {
        if row < 3 { twists[column].linear[row] } else { twists[column].angular[row - 3] }
    })
    .determinant()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::RobotFile;

    fn arm(file: &str) -> Arm {
        let file: RobotFile = toml::from_str(file).expect("a robot file of this repository");
        file.arm().expect("a valid arm")
    }

    fn kr210() -> Arm {
        arm(include_str!("../../../pipelines/robots/kr210-r2700-extra.toml"))
    }

    fn ur10() -> Arm {
        arm(include_str!("../../../pipelines/robots/ur10.toml"))
    }

    fn factors(arm: &Arm, degrees: [f64; 6]) -> SingularityFactors {
        let offsets = arm.no_offsets();
        SingularityFactors::of(arm, &offsets, &degrees.map(f64::to_radians)).expect("six axes")
    }

    #[test]
    fn factors_of_the_kr210_agree_with_its_drawing() {
        // Arm 90° up, forearm level: wrist 1200 mm ahead of axis 2 and 41 mm above axis 3. q5 = 30° gives sin 30°.
        let found = factors(&kr210(), [0.0, -90.0, 90.0, 0.0, 30.0, 0.0]);
        let forearm = 1200.0_f64.hypot(41.0);
        assert!((found.wrist.abs() - 0.5).abs() < 1e-12);
        assert!((found.elbow.abs() - 1200.0 / forearm).abs() < 1e-12);
        // The wrist centre is 350 + 1200 mm from axis 1; upper arm and forearm are 1150 mm and √(1200² + 41²) mm.
        assert!((found.shoulder.abs() - 1550.0 / (1150.0 + forearm)).abs() < 1e-12);
    }

    #[test]
    fn factors_of_the_ur10_are_those_of_its_closed_form_determinant() {
        // det J of the UR arms: a2 a3 sin θ3 sin θ5 (a2 cos θ2 + a3 cos θ23 + d5 sin θ234), up to its sign.
        let degrees = [10.0, -70.0, 100.0, -50.0, 60.0, 20.0_f64];
        let [_, t2, t3, t4, t5, _] = degrees.map(f64::to_radians);
        let found = factors(&ur10(), degrees);
        assert!((found.wrist.abs() - t5.sin()).abs() < 1e-12);
        assert!((found.elbow.abs() - t3.sin()).abs() < 1e-12);
        let shoulder = -612.0 * t2.cos() - 572.3 * (t2 + t3).cos() + 115.7 * (t2 + t3 + t4).sin();
        assert!((found.shoulder.abs() - shoulder.abs() / (612.0 + 572.3)).abs() < 1e-12);
    }

    /// Walks each joint through its whole range from many poses: wherever the smallest singular value says the arm is
    /// well away from every singularity, no factor may be near zero, and wherever it is on one, a factor must be.
    fn factors_vanish_exactly_at_singularities(arm: &Arm) {
        let offsets = arm.no_offsets();
        let mut seen = [0_usize; 2];
        for step in 0..4000_u32 {
            // An irrational rotation per joint covers the ranges evenly without randomness.
            let joints: Vec<f64> = (0..6)
                .map(|joint| {
                    let turn = f64::from(step) * (2.0_f64.sqrt() * f64::from(joint + 2)).fract();
                    turn.fract() * std::f64::consts::TAU
                })
                .collect();
            let factors = SingularityFactors::of(arm, &offsets, &joints).expect("six axes");
            let twists = arm.chain().differential(&joints, &offsets).joints;
            let least = 500.0 * conditioning(&twists, &[1.0; 6], 500.0);
            // The determinant is the product of the factors: each side bounds the other.
            if factors.smallest() < 0.003 {
                assert!(least < 6.0, "{joints:?}: {factors:?}, {least}");
                seen[0] += 1;
            }
            if least < 0.1 {
                assert!(factors.smallest() < 0.01, "{joints:?}: {factors:?}, {least}");
                seen[1] += 1;
            }
        }
        assert!(seen.iter().all(|&n| n > 0), "the walk met singularities: {seen:?}");
    }

    #[test]
    fn factors_are_zero_exactly_at_singularities() {
        factors_vanish_exactly_at_singularities(&ur10());
        factors_vanish_exactly_at_singularities(&kr210());
    }

    #[test]
    fn each_sign_flips_at_its_own_singularity_only() {
        let both = |arm: &Arm, before: [f64; 6], after: [f64; 6]| {
            (factors(arm, before).configuration(), factors(arm, after).configuration())
        };
        let base = [20.0, -60.0, 80.0, 35.0, 25.0, -40.0];
        // The same pose with the wrist flipped: q4 + 180°, −q5, q6 + 180°.
        let flipped = [20.0, -60.0, 80.0, 215.0, -25.0, 140.0];
        let (before, after) = both(&kr210(), base, flipped);
        assert_eq!((before.shoulder, before.elbow), (after.shoulder, after.elbow));
        assert_ne!(before.wrist, after.wrist);
        // The elbow is stretched where the wrist centre lies on the line through axes 2 and 3; at q3 = 0 it
        // is 41 mm below that line.
        let stretched = -(41.0_f64 / 1200.0).atan().to_degrees();
        let (before, after) = both(
            &kr210(),
            [0.0, -45.0, stretched + 1.0, 0.0, 40.0, 0.0],
            [0.0, -45.0, stretched - 1.0, 0.0, 40.0, 0.0],
        );
        assert_eq!((before.shoulder, before.wrist), (after.shoulder, after.wrist));
        assert_ne!(before.elbow, after.elbow);
        // Upright the wrist is 350 + 1200 cos 85° mm before axis 1; leaning back, 350 − 855 − 739 mm behind it.
        let (before, after) =
            both(&kr210(), [0.0, -90.0, 5.0, 0.0, 40.0, 0.0], [0.0, -138.0, 10.0, 0.0, 40.0, 0.0]);
        assert_eq!((before.elbow, before.wrist), (after.elbow, after.wrist));
        assert_ne!(before.shoulder, after.shoulder);
    }

    #[test]
    fn displays_by_name() {
        let configuration =
            Configuration { shoulder: Side::Plus, elbow: Side::Minus, wrist: Side::Plus };
        assert_eq!(configuration.to_string(), "shoulder+ elbow- wrist+");
    }
}
