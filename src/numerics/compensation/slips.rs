//! Slips of units in a file of targets: what a refused target would be in the unit that was probably meant.
//!
//! A slip is named only where the target has a command without it: what it would be is corrected as any target and given to nobody.
//! Angles in the other unit are looked for only where numbers can be of it: degrees beyond a turn of radians, radians within one.

use std::f64::consts::TAU;
use std::fmt;

use super::{Target, TargetJoints};
use crate::geometry::Position;
use crate::units::MM_PER_M;

/// A unit that a target's numbers are probably in, though their columns say another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Slip {
    RadiansAsDegrees,
    DegreesAsRadians,
    MetresAsMillimetres,
}

/// Positions within this of the origin along every axis may be metres: no arm reaches further, and a target in millimetres that
/// near to the origin would be inside the robot.
const MOST_METRES: f64 = 20.0;

impl Slip {
    pub const ALL: [Self; 3] =
        [Self::RadiansAsDegrees, Self::DegreesAsRadians, Self::MetresAsMillimetres];

    /// The target without this slip; `None` where its numbers cannot be of it.
    pub fn undone(self, target: &Target) -> Option<Target> {
        match self {
            Self::RadiansAsDegrees => {
                let is_within_a_turn = |q: &f64| q.abs() <= TAU;
                with_angles(target, f64::to_degrees, |angles| angles.iter().all(is_within_a_turn))
            }
            Self::DegreesAsRadians => {
                let is_beyond_a_turn = |q: &f64| q.abs() > TAU.to_radians();
                with_angles(target, f64::to_radians, |angles| angles.iter().any(is_beyond_a_turn))
            }
            Self::MetresAsMillimetres => {
                let at = target.position?.coords();
                let is_near = at.amax() <= MOST_METRES && at.amax() > 0.0;
                let position = Some(Position::claim((at * MM_PER_M).into()));
                is_near.then(|| Target { position, ..target.clone() })
            }
        }
    }
}

/// A target with its joint angles as `meant`, where these are ones that `may` be.
fn with_angles(
    target: &Target,
    meant: impl Fn(f64) -> f64,
    may: impl Fn(&[f64]) -> bool,
) -> Option<Target> {
    let joints = target.joints.as_ref()?;
    // A position has no such slip, and says nothing of one.
    if joints.slides.iter().flatten().any(|slides| *slides) {
        return None;
    }
    let angles: Vec<f64> = joints.angles.iter().copied().map(meant).collect();
    may(&angles).then(|| Target {
        joints: Some(TargetJoints { angles, ..joints.clone() }),
        ..target.clone()
    })
}

impl fmt::Display for Slip {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::RadiansAsDegrees => {
                "as radians its joint angles would have a command: if they are, name the columns q1_rad, q2_rad …"
            }
            Self::DegreesAsRadians => {
                "as degrees its joint angles would have a command: if they are, name the columns q1_deg, q2_deg …"
            }
            Self::MetresAsMillimetres => {
                "in metres its position would have a command: if it is, multiply x_mm, y_mm and z_mm by 1000"
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    fn at(angles: [f64; 2]) -> Target {
        Target {
            joints: Some(TargetJoints { slides: None, names: Vec::new(), angles: angles.to_vec() }),
            ..Target::default()
        }
    }

    fn angles(slip: Slip, target: &Target) -> Option<Vec<f64>> {
        slip.undone(target)?.joints.map(|joints| joints.angles)
    }

    #[test]
    fn angles_are_taken_in_the_other_unit_where_they_can_be_of_it() {
        // 1.2 and −0.5 rad in columns of degrees were read as 1.2° and −0.5°.
        let read = at([1.2_f64.to_radians(), (-0.5_f64).to_radians()]);
        let meant = angles(Slip::RadiansAsDegrees, &read).unwrap();
        assert!((meant[0] - 1.2).abs() < 1e-12 && (meant[1] + 0.5).abs() < 1e-12);
        assert_eq!(angles(Slip::RadiansAsDegrees, &at([0.2, 0.0])), None, "11.5 rad");
        // 90° and −30° in columns of radians.
        let meant = angles(Slip::DegreesAsRadians, &at([90.0, -30.0])).unwrap();
        assert!((meant[0] - TAU / 4.0).abs() < 1e-12);
        assert_eq!(angles(Slip::DegreesAsRadians, &at([3.0, -6.0])), None, "within a turn");
    }

    #[test]
    fn a_position_of_a_few_is_taken_in_metres() {
        let target = |x: f64| Target {
            position: Some(Position::claim(Point3::new(x, 0.25, -1.0))),
            ..Target::default()
        };
        let meant = Slip::MetresAsMillimetres.undone(&target(1.5)).unwrap();
        assert!((meant.position.unwrap().coords().x - 1500.0).abs() < 1e-9);
        assert_eq!(Slip::MetresAsMillimetres.undone(&target(150.0)), None);
        assert_eq!(Slip::MetresAsMillimetres.undone(&at([1.0, 1.0])), None);
    }
}
