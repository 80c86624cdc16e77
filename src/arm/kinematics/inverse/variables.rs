//! Joint variables for a search: which are lengths, which repeat after a turn, and the turn within the limits.

use std::f64::consts::{PI, TAU};

use crate::kinematics::arm::{Arm, Joint};
use crate::kinematics::chain::Element;
use crate::kinematics::motion::Motion;
use crate::units::SLIDE_MM_PER_RAD;

/// Largest rounding error of a joint variable, rad or mm: one that is beyond a limit by less than this is within it.
const LIMIT_ROUNDING: f64 = 1e-9;

/// The kind of a joint variable, by the axes that it moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointVariable {
    /// A length, mm: every axis that it moves is linear.
    Length,
    /// An angle, rad, after a turn of which the arm is where it was.
    Turning,
    /// An angle, rad, that moves some axis by another share than whole turns.
    Angle,
}

impl JointVariable {
    pub fn of(arm: &Arm) -> Vec<Self> {
        let joints = arm.joints().len();
        let at_rest = arm.axes(&vec![0.0; joints]);
        let moved = |joint: usize| -> Vec<f64> {
            let unit: Vec<f64> = (0..joints).map(|own| f64::from(u8::from(own == joint))).collect();
            arm.axes(&unit).into_iter().zip(&at_rest).map(|(axis, rest)| axis - rest).collect()
        };
        (0..joints).map(|joint| Self::moving(arm, &moved(joint))).collect()
    }

    fn moving(arm: &Arm, axes: &[f64]) -> Self {
        let moves = arm.chain().elements().iter().filter_map(|element| match element {
            Element::Joint { motion, joint, sign } if axes[*joint] != 0.0 => {
                Some((motion, sign * axes[*joint]))
            }
            _ => None,
        });
        let mut own = Self::Turning;
        let mut turns = false;
        for (motion, share) in moves {
            let is_linear = matches!(motion, Motion::Translation(_));
            turns |= !is_linear;
            if is_linear || (share - share.round()).abs() > 1e-9 {
                own = Self::Angle;
            }
        }
        if own == Self::Angle && !turns { Self::Length } else { own }
    }

    /// Unit of the search for this joint: 1 rad for an angle; for a length the mm that count as one.
    pub const fn scale(self) -> f64 {
        match self {
            Self::Length => SLIDE_MM_PER_RAD,
            Self::Turning | Self::Angle => 1.0,
        }
    }

    /// The limits, or one turn within them where turns are alike; 2π or 10 m about zero without finite limits.
    pub(super) fn range(self, joint: &Joint) -> [f64; 2] {
        let widest = if self == Self::Length { 1e4 } else { PI };
        let [low, high] = [joint.lower.max(-1e3 * widest), joint.upper.min(1e3 * widest)];
        let middle = 0.0_f64.clamp(low, high.max(low));
        match self {
            Self::Turning if high - low > TAU => {
                let low = (middle - PI).max(low).min(high - TAU);
                [low, low + TAU]
            }
            _ if joint.lower.is_finite() && joint.upper.is_finite() => [low, high],
            _ => [(middle - widest).max(low), (middle + widest).min(high)],
        }
    }

    /// The value on the turn that is nearest to `near` of those within the limits; the value as it is where no turn is.
    pub(super) fn within(self, joint: &Joint, value: f64, near: f64) -> f64 {
        if self != Self::Turning {
            return value;
        }
        let nearest = value + TAU * ((near - value) / TAU).round();
        let turns = |beyond: f64| TAU * (beyond / TAU).ceil();
        let turned = if nearest < joint.lower - LIMIT_ROUNDING {
            nearest + turns(joint.lower - LIMIT_ROUNDING - nearest)
        } else if nearest > joint.upper + LIMIT_ROUNDING {
            nearest - turns(nearest - joint.upper - LIMIT_ROUNDING)
        } else {
            nearest
        };
        if is_within(joint, turned) { turned } else { value }
    }
}

pub(super) fn is_within(joint: &Joint, value: f64) -> bool {
    value >= joint.lower - LIMIT_ROUNDING && value <= joint.upper + LIMIT_ROUNDING
}

/// Point `number` of a sequence that fills the box of `ranges` evenly: multiples of the powers of the generalised
/// golden ratio, modulo 1 (Roberts 2018).
pub fn spread(number: u32, ranges: &[[f64; 2]]) -> Vec<f64> {
    let degree = ranges.len() as f64 + 1.0;
    // The root of φ^degree = φ + 1, by fixed-point iteration.
    let golden = (0..60).fold(1.5_f64, |golden, _| (golden + 1.0).powf(degree.recip()));
    let share = |joint: i32| (0.5 + f64::from(number) * golden.powi(-joint)).fract();
    (1..).zip(ranges).map(|(joint, [low, high])| low + (high - low) * share(joint)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::chain::Chain;
    use crate::kinematics::convention::Convention;
    use crate::kinematics::motion::Axis;

    fn joint(lower: f64, upper: f64) -> Joint {
        Joint { name: "joint".to_owned(), lower, upper, slides: false }
    }

    #[test]
    fn a_joint_is_what_the_axes_that_it_moves_are() {
        let element = |motion, joint, sign| Element::Joint { motion, joint, sign };
        let (turn, slide) = (Motion::Rotation(Axis::Z), Motion::Translation(Axis::X));
        let chain = Chain::new(vec![
            element(slide, 0, 1.0),
            element(turn, 1, 1.0),
            element(turn, 2, 1.0),
            // Passive: turned back by joint 2, and dragged along by a third of joint 4.
            element(turn, 1, -1.0),
            element(turn, 3, 1.0),
            element(turn, 3, 1.0 / 3.0),
        ]);
        // Joint 3 moves the axis of joint 2 with its own by a quarter.
        let map = [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.25, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ];
        let joints = vec![joint(-1.0, 1.0); 4];
        let map = map.map(Vec::from);
        let arm = Arm::new("arm".to_owned(), Convention::StandardDh, joints, &map, chain)
            .expect("an arm");
        let (length, angle) = (JointVariable::Length, JointVariable::Angle);
        let expected = [length, JointVariable::Turning, angle, angle];
        assert_eq!(JointVariable::of(&arm), expected);
    }

    #[test]
    fn a_value_takes_the_nearest_turn_within_its_limits() {
        let wide = joint(-350_f64.to_radians(), 350_f64.to_radians());
        let turned = |value: f64, near: f64| {
            let own = JointVariable::Turning;
            own.within(&wide, value.to_radians(), near.to_radians()).to_degrees()
        };
        for (value, near, taken) in [
            (40.0, 0.0, 40.0),
            (40.0, -300.0, -320.0),
            (-320.0, 50.0, 40.0),
            (355.0, 355.0, -5.0),
            (715.0, 715.0, -5.0),
            (-355.0, -400.0, 5.0),
        ] {
            assert!((turned(value, near) - taken).abs() < 1e-9, "{value} {near}");
        }
        // No turn of 170° is within ±150°, and lengths and coupled angles have none.
        let narrow = joint(-2.6, 2.6);
        assert!((JointVariable::Turning.within(&narrow, 2.97, 0.0) - 2.97).abs() < 1e-12);
        assert!((JointVariable::Length.within(&narrow, 9.0, 0.0) - 9.0).abs() < 1e-12);
        assert!((JointVariable::Angle.within(&narrow, 9.0, 0.0) - 9.0).abs() < 1e-12);
    }

    #[test]
    fn a_search_covers_the_limits_or_one_turn() {
        let range = |own: JointVariable, lower, upper| own.range(&joint(lower, upper));
        let (turning, angle) = (JointVariable::Turning, JointVariable::Angle);
        let is = |found: [f64; 2], low: f64, high: f64| {
            assert!((found[0] - low).abs() < 1e-9 && (found[1] - high).abs() < 1e-9);
        };
        is(range(turning, -2.0, 1.0), -2.0, 1.0);
        is(range(turning, -6.1, 6.1), -PI, PI);
        is(range(turning, 1.0, 9.0), 1.0, 1.0 + TAU);
        is(range(turning, f64::NEG_INFINITY, f64::INFINITY), -PI, PI);
        is(range(angle, -6.1, 6.1), -6.1, 6.1);
        is(range(JointVariable::Length, -6000.0, 6000.0), -6000.0, 6000.0);
    }
}
