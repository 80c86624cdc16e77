//! Redundant arms: of all joint angles that reach a pose, those closest to the seed and within the limits.

use nalgebra::{DVector, Isometry3};

use super::search::Search;
use super::variables::{JointVariable, is_within};

/// Steps along the arm's own motion before the joint angles count as close enough.
const STEPS: usize = 30;
/// Longest step along it, rad or levers: the pose is found again by Newton's method after each.
const LONGEST: f64 = 0.3;
/// Longest step towards the limits, rad: little further than is needed.
const INWARDS: f64 = 0.1;
/// A step shorter than this ends it, rad or levers: repeated calls differ by less.
const SHORTEST: f64 = 1e-10;

impl Search<'_> {
    /// Joint angles of the same pose that are closest to `seed`, whatever the way from it: each step is the part of
    /// `seed − q` that does not move the end, `(I − J⁺ J)(seed − q)`.
    pub(super) fn closest(
        &self,
        target: &Isometry3<f64>,
        seed: &[f64],
        mut joints: Vec<f64>,
    ) -> Vec<f64> {
        if joints.len() <= 6 {
            return joints;
        }
        for _ in 0..STEPS {
            let Some(step) = self.own_motion(&joints, self.apart(&joints, seed)) else { break };
            let length = step.amax();
            if length < SHORTEST {
                break;
            }
            let step = step * (LONGEST / length).min(1.0);
            let Ok(next) = self.solve(target, &self.moved(&joints, &step)) else { break };
            let is_closer = self.apart(&next, seed).norm() < self.apart(&joints, seed).norm();
            if !is_closer {
                break;
            }
            joints = next;
        }
        joints
    }

    /// Joint angles of the same pose within the limits, by the arm's own motion; those given where that fails.
    pub(super) fn within_limits(&self, target: &Isometry3<f64>, given: Vec<f64>) -> Vec<f64> {
        if given.len() <= 6 {
            return given;
        }
        let mut joints = given.clone();
        for _ in 0..STEPS {
            if self.check_limits(&joints).is_ok() {
                return joints;
            }
            let inwards = self.apart(&joints, &self.brought_inside(&joints));
            let Some(step) = self.own_motion(&joints, inwards) else { break };
            let step = &step * (INWARDS / step.amax()).min(1.0);
            let Ok(next) = self.solve(target, &self.moved(&joints, &step)) else { break };
            joints = next;
        }
        given
    }

    /// Angles beyond their limits in the middle of these, everything else as it is.
    fn brought_inside(&self, joints: &[f64]) -> Vec<f64> {
        let own = self.arm.joints().iter().zip(&self.variables).zip(joints);
        let inside = own.map(|((joint, variable), value)| {
            let [low, high] = variable.range(joint);
            let stays = *variable == JointVariable::Length || is_within(joint, *value);
            if stays { *value } else { low.midpoint(high) }
        });
        inside.collect()
    }

    /// The part of a motion that does not move the end; `None` at a singularity.
    fn own_motion(&self, joints: &[f64], motion: DVector<f64>) -> Option<DVector<f64>> {
        let jacobian = self.jacobian(joints);
        let across = (&jacobian * jacobian.transpose()).cholesky()?;
        let moves_end = jacobian.tr_mul(&across.solve(&(&jacobian * &motion)));
        Some(motion - moves_end)
    }
}
