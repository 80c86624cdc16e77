//! The search: damped Newton steps, the approach in small steps, and the checks of the solution.

use nalgebra::{DMatrix, DVector, Isometry3, Translation3, UnitQuaternion, Vector6};

use super::{InverseError, InverseSettings};
use crate::kinematics::arm::Arm;
use crate::kinematics::configuration::{Configuration, SingularityFactors};

/// Longest Newton step, rad (or mm for a prismatic joint, which no arm here has): a longer one may end on another branch.
const LONGEST_STEP: f64 = 0.5;
/// Largest rounding error of an angle, rad: an angle beyond a limit by less than this is within it.
const LIMIT_ROUNDING: f64 = 1e-9;

/// The inverse-kinematics problem of one arm.
pub(super) struct Search<'a> {
    pub(super) arm: &'a Arm,
    pub(super) offsets: &'a [f64],
    pub(super) flange_from_end: &'a Isometry3<f64>,
    pub(super) settings: &'a InverseSettings,
}

impl Search<'_> {
    pub(super) fn end(&self, joints: &[f64]) -> Isometry3<f64> {
        let chain = self.arm.chain();
        chain.forward(&self.arm.axes(joints), self.offsets) * self.flange_from_end
    }

    /// Walks from the seed's pose to the target pose in equal steps, each solved from the one before.
    pub(super) fn approach(
        &self,
        target: &Isometry3<f64>,
        seed: &[f64],
        steps: u32,
    ) -> Result<Vec<f64>, InverseError> {
        let start = self.end(seed);
        let mut joints = seed.to_vec();
        for step in 1..=steps {
            let way = f64::from(step) / f64::from(steps);
            let waypoint = if step == steps {
                *target
            } else {
                between(&start, target, way)
            };
            let Some(next) = self.solve(&waypoint, &joints) else {
                return Err(self.not_reachable(target, &joints));
            };
            joints = next;
        }
        Ok(joints)
    }

    /// The joint angles where damped Newton steps from `seed` end; `None` when they do not reach the target pose.
    fn solve(&self, target: &Isometry3<f64>, seed: &[f64]) -> Option<Vec<f64>> {
        let mut joints = seed.to_vec();
        let mut residual = self.residual(target, &self.end(&joints));
        let mut damping = 1.0;
        for _ in 0..self.settings.iterations {
            if self.reached(&residual) {
                return Some(self.polished(target, joints, &residual));
            }
            let step = self.step(&joints, &residual, damping);
            let next: Vec<f64> = joints.iter().zip(step.iter()).map(|(q, d)| q + d).collect();
            let left = self.residual(target, &self.end(&next));
            if left.norm() < residual.norm() {
                (joints, residual) = (next, left);
                damping = (damping / 10.0_f64).max(1e-3);
            } else {
                damping *= 10.0;
            }
        }
        None
    }

    /// One more Newton step costs little and takes the residual from the tolerance to rounding.
    fn polished(
        &self,
        target: &Isometry3<f64>,
        joints: Vec<f64>,
        residual: &Vector6<f64>,
    ) -> Vec<f64> {
        let step = self.step(&joints, residual, 0.0);
        let next: Vec<f64> = joints.iter().zip(step.iter()).map(|(q, d)| q + d).collect();
        if self.residual(target, &self.end(&next)).norm() < residual.norm() {
            next
        } else {
            joints
        }
    }

    /// The damped Newton step `(JᵀJ + λ I)⁻¹ Jᵀ r`, shortened to [`LONGEST_STEP`]; `λ` in mm².
    pub(super) fn step(
        &self,
        joints: &[f64],
        residual: &Vector6<f64>,
        damping: f64,
    ) -> DVector<f64> {
        let jacobian = self.jacobian(joints);
        let gradient = jacobian.tr_mul(residual);
        let mut normal = jacobian.tr_mul(&jacobian);
        // The floor keeps an exactly singular pose solvable; it is far below any curvature an arm has.
        let lambda = damping * residual.norm_squared() + 1e-12 * normal.trace();
        for joint in 0..joints.len() {
            normal[(joint, joint)] += lambda;
        }
        let step = normal
            .cholesky()
            .expect("a matrix of products plus a positive diagonal is positive definite")
            .solve(&gradient);
        let longest = step.amax();
        if longest > LONGEST_STEP {
            step * (LONGEST_STEP / longest)
        } else {
            step
        }
    }

    /// Six rows per joint: mm per rad, and rad per rad times the lever.
    fn jacobian(&self, joints: &[f64]) -> DMatrix<f64> {
        let at = self
            .arm
            .chain()
            .differential(&self.arm.axes(joints), self.offsets);
        let twists = self.arm.joint_twists(&at.joints);
        let lever = at.end.rotation * self.flange_from_end.translation.vector;
        DMatrix::from_fn(6, joints.len(), |row, joint| {
            let twist = &twists[joint];
            if row < 3 {
                (twist.linear + twist.angular.cross(&lever))[row]
            } else {
                twist.angular[row - 3] * self.settings.lever_mm
            }
        })
    }

    pub(super) fn residual(&self, target: &Isometry3<f64>, end: &Isometry3<f64>) -> Vector6<f64> {
        let position = target.translation.vector - end.translation.vector;
        let rotation = (target.rotation * end.rotation.inverse()).scaled_axis();
        let mut residual = Vector6::zeros();
        residual.fixed_rows_mut::<3>(0).copy_from(&position);
        residual
            .fixed_rows_mut::<3>(3)
            .copy_from(&(rotation * self.settings.lever_mm));
        residual
    }

    fn parts(&self, residual: &Vector6<f64>) -> (f64, f64) {
        let orientation = residual.fixed_rows::<3>(3).norm() / self.settings.lever_mm;
        (residual.fixed_rows::<3>(0).norm(), orientation)
    }

    fn reached(&self, residual: &Vector6<f64>) -> bool {
        let (position_mm, orientation_rad) = self.parts(residual);
        position_mm <= self.settings.position_tolerance_mm
            && orientation_rad <= self.settings.orientation_tolerance_rad
    }

    pub(super) fn not_reachable(&self, target: &Isometry3<f64>, joints: &[f64]) -> InverseError {
        let (position_mm, orientation_rad) = self.parts(&self.residual(target, &self.end(joints)));
        InverseError::NotReachable {
            position_mm,
            orientation_rad,
        }
    }

    pub(super) fn checked(&self, seed: &[f64], joints: Vec<f64>) -> Result<Vec<f64>, InverseError> {
        if let Some(before) = Configuration::of(self.arm, self.offsets, seed) {
            self.check_configuration(before, &joints)?;
        }
        let beyond = self
            .arm
            .joints()
            .iter()
            .zip(&joints)
            .find(|(joint, angle)| {
                **angle < joint.lower - LIMIT_ROUNDING || **angle > joint.upper + LIMIT_ROUNDING
            });
        match beyond {
            Some((joint, angle)) => Err(InverseError::LimitReached {
                joint: joint.name.clone(),
                angle_deg: angle.to_degrees(),
                lower_deg: joint.lower.to_degrees(),
                upper_deg: joint.upper.to_degrees(),
            }),
            None => Ok(joints),
        }
    }

    fn check_configuration(&self, seed: Configuration, joints: &[f64]) -> Result<(), InverseError> {
        let Some(factors) = SingularityFactors::of(self.arm, self.offsets, joints) else {
            return Ok(());
        };
        let (found, factor) = (factors.configuration(), factors.smallest());
        let least = self.settings.least_singularity_factor;
        if found != seed {
            return Err(InverseError::ConfigurationChanged { seed, found });
        }
        if factor < least {
            return Err(InverseError::NearSingularity {
                factor,
                least,
                configuration: found,
            });
        }
        Ok(())
    }
}

/// The pose `way` (0 to 1) of the way from `start` to `target`: a straight line and the shortest turn.
fn between(start: &Isometry3<f64>, target: &Isometry3<f64>, way: f64) -> Isometry3<f64> {
    let position = start
        .translation
        .vector
        .lerp(&target.translation.vector, way);
    let turn = (target.rotation * start.rotation.inverse()).scaled_axis() * way;
    Isometry3::from_parts(
        Translation3::from(position),
        UnitQuaternion::from_scaled_axis(turn) * start.rotation,
    )
}
