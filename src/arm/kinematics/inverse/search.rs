//! The search: damped Newton steps, the approach in small steps, and the checks of the solution.

use nalgebra::{DVector, Isometry3, Matrix6xX, Translation3, UnitQuaternion, Vector6};

use super::variables::{JointVariable, is_within};
use super::{InverseError, InverseSettings};
use crate::kinematics::arm::Arm;
use crate::kinematics::configuration::{Configuration, SingularityFactors, conditioning};
use crate::kinematics::held::HeldChain;

/// Longest Newton step, rad, or that many levers for a length: a longer one may end on another branch.
const LONGEST_STEP: f64 = 0.5;
/// A joint of an arm without configurations that moves further in one step (rad, or levers) may be on another branch:
/// the way is then taken in smaller steps.
const FAR: f64 = 1.5;
/// A residual below this share of the tolerances is rounding.
const ROUNDING: f64 = 0.01;
/// Links that fall short of a pose by less, mm, may reach it but for rounding.
const LINKS_MM: f64 = 1e-3;
/// Tolerances within which a pose on the way is passed: a µm, since the next search only starts there.
const WAYPOINT: f64 = 1e6;

#[derive(Debug)]
pub(super) struct Search<'a> {
    pub(super) arm: &'a Arm,
    chain: HeldChain,
    flange_from_end: Isometry3<f64>,
    pub(super) settings: InverseSettings,
    pub(super) variables: Vec<JointVariable>,
    /// The unit in which the search counts each joint: 1 rad, or the lever for a length.
    pub(super) scales: Vec<f64>,
}

impl<'a> Search<'a> {
    pub(super) fn new(
        arm: &'a Arm,
        offsets: &[f64],
        flange_from_end: Isometry3<f64>,
        settings: InverseSettings,
    ) -> Self {
        let variables = JointVariable::of(arm);
        let scales = variables.iter().map(|own| own.scale()).collect();
        let chain = HeldChain::fixed(arm.chain(), offsets);
        Self { arm, chain, flange_from_end, settings, variables, scales }
    }

    /// This search with the linear axes of a redundant arm held, so a track under an arm stays where the seed has it;
    /// `None` for an arm that has none, or needs them.
    pub(super) fn with_lengths_held(&self) -> Option<Self> {
        let is_redundant = self.scales.len() > 6;
        let has_lengths = self.variables.contains(&JointVariable::Length);
        (is_redundant && has_lengths).then(|| Self {
            scales: vec![1.0; self.scales.len()],
            variables: self.variables.clone(),
            chain: self.chain.clone(),
            ..*self
        })
    }

    pub(super) fn moved(&self, joints: &[f64], step: &DVector<f64>) -> Vec<f64> {
        let steps = step.iter().zip(&self.scales);
        joints.iter().zip(steps).map(|(q, (d, scale))| q + d * scale).collect()
    }

    pub(super) fn apart(&self, from: &[f64], to: &[f64]) -> DVector<f64> {
        DVector::from_fn(from.len(), |joint, _| (to[joint] - from[joint]) / self.scales[joint])
    }

    pub(super) fn end(&self, joints: &[f64]) -> Isometry3<f64> {
        self.chain.end(&self.arm.axes(joints)) * self.flange_from_end
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
            let next = if step == steps {
                self.solve(target, &joints)
            } else {
                self.neared(&between(&start, target, way), &joints, WAYPOINT).map(|(next, _)| next)
            };
            joints = next.map_err(|_| self.not_reachable(target, &joints))?;
        }
        Ok(joints)
    }

    /// The end of damped Newton steps from `seed`; the joint angles nearest to the target pose as an error when they do
    /// not reach it.
    pub(super) fn solve(
        &self,
        target: &Isometry3<f64>,
        seed: &[f64],
    ) -> Result<Vec<f64>, Vec<f64>> {
        let (joints, residual) = self.neared(target, seed, 1.0)?;
        Ok(self.polished(target, joints, &residual))
    }

    /// Damped Newton steps from `seed` until the pose is within so many tolerances, with the residual that is left.
    fn neared(
        &self,
        target: &Isometry3<f64>,
        seed: &[f64],
        tolerances: f64,
    ) -> Result<(Vec<f64>, Vector6<f64>), Vec<f64>> {
        let (mut joints, mut damping) = (seed.to_vec(), 1.0);
        let mut residual = self.residual(target, &self.end(&joints));
        for _ in 0..self.settings.iterations {
            if self.is_within(&residual, tolerances) {
                return Ok((joints, residual));
            }
            let next = self.moved(&joints, &self.step(&joints, &residual, damping));
            let left = self.residual(target, &self.end(&next));
            if left.norm() < residual.norm() {
                (joints, residual) = (next, left);
                damping = (damping / 10.0_f64).max(1e-3);
            } else {
                damping *= 10.0;
            }
        }
        Err(joints)
    }

    /// One more Newton step costs little and takes the residual from the tolerance to rounding. Joint angles that have the pose but for
    /// rounding stay as they are, to the bit.
    fn polished(
        &self,
        target: &Isometry3<f64>,
        joints: Vec<f64>,
        residual: &Vector6<f64>,
    ) -> Vec<f64> {
        if self.is_within(residual, ROUNDING) {
            return joints;
        }
        let next = self.moved(&joints, &self.step(&joints, residual, 0.0));
        if self.residual(target, &self.end(&next)).norm() < residual.norm() { next } else { joints }
    }

    /// The damped Newton step `(JᵀJ + λ I)⁻¹ Jᵀ r` in the search's units, shortened to [`LONGEST_STEP`]; `λ` in mm².
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
        shortened(step)
    }

    /// Six rows per joint, per unit of the search: mm, and rad times the lever.
    pub(super) fn jacobian(&self, joints: &[f64]) -> Matrix6xX<f64> {
        let (end, twists) = self.chain.end_and_joints(&self.arm.axes(joints));
        let lever = end.rotation * self.flange_from_end.translation.vector;
        let columns = self.arm.joint_twists(&twists).into_iter().zip(&self.scales);
        let columns = columns.map(|(twist, scale)| {
            let mut column = Vector6::zeros();
            let linear = (twist.linear + twist.angular.cross(&lever)) * *scale;
            column.fixed_rows_mut::<3>(0).copy_from(&linear);
            let angular = twist.angular * (self.settings.lever_mm * scale);
            column.fixed_rows_mut::<3>(3).copy_from(&angular);
            column
        });
        Matrix6xX::from_columns(&columns.collect::<Vec<_>>())
    }

    /// Singularity factors at reported joint angles (rad); `None` for an arm that has none.
    pub(super) fn factors(&self, joints: &[f64]) -> Option<SingularityFactors> {
        SingularityFactors::of_view(&self.chain.view(&self.arm.axes(joints)))
    }

    pub(super) fn residual(&self, target: &Isometry3<f64>, end: &Isometry3<f64>) -> Vector6<f64> {
        let position = target.translation.vector - end.translation.vector;
        let rotation = (target.rotation * end.rotation.inverse()).scaled_axis();
        let mut residual = Vector6::zeros();
        residual.fixed_rows_mut::<3>(0).copy_from(&position);
        residual.fixed_rows_mut::<3>(3).copy_from(&(rotation * self.settings.lever_mm));
        residual
    }

    pub(super) fn parts(&self, residual: &Vector6<f64>) -> (f64, f64) {
        let orientation = residual.fixed_rows::<3>(3).norm() / self.settings.lever_mm;
        (residual.fixed_rows::<3>(0).norm(), orientation)
    }

    fn is_within(&self, residual: &Vector6<f64>, tolerances: f64) -> bool {
        let (position_mm, orientation_rad) = self.parts(residual);
        position_mm <= tolerances * self.settings.position_tolerance_mm
            && orientation_rad <= tolerances * self.settings.orientation_tolerance_rad
    }

    /// Refuses a pose that is further away than the links; not of an arm that may turn the end from it.
    pub(super) fn within_links(&self, target: &Isometry3<f64>) -> Result<(), InverseError> {
        let position_mm = self.chain.beyond_links(&(target * self.flange_from_end.inverse()));
        if self.scales.len() < 6 || position_mm <= LINKS_MM {
            return Ok(());
        }
        Err(InverseError::NotReachable { position_mm, orientation_rad: 0.0 })
    }

    pub(super) fn not_reachable(&self, target: &Isometry3<f64>, joints: &[f64]) -> InverseError {
        let (position_mm, orientation_rad) = self.parts(&self.residual(target, &self.end(joints)));
        InverseError::NotReachable { position_mm, orientation_rad }
    }

    /// The solution, or why it is refused. `is_tracked` where the way from the seed was taken in the smallest steps.
    pub(super) fn checked(
        &self,
        seed: &[f64],
        joints: Vec<f64>,
        is_tracked: bool,
    ) -> Result<Vec<f64>, InverseError> {
        match self.factors(seed) {
            Some(before) => self.check_configuration(before.configuration(), &joints)?,
            None => self.check_branch(seed, &joints, is_tracked)?,
        }
        self.check_limits(&joints)?;
        Ok(joints)
    }

    pub(super) fn check_limits(&self, joints: &[f64]) -> Result<(), InverseError> {
        for (joint, value) in self.arm.joints().iter().zip(joints) {
            if !is_within(joint, *value) {
                return Err(InverseError::beyond(joint, *value));
            }
        }
        Ok(())
    }

    fn check_configuration(&self, seed: Configuration, joints: &[f64]) -> Result<(), InverseError> {
        let Some(factors) = self.factors(joints) else { return Ok(()) };
        let found = factors.configuration();
        if found != seed {
            return Err(InverseError::ConfigurationChanged { seed, found });
        }
        self.check_factor(factors.smallest(), Some(found))
    }

    /// Guards an arm without configurations: no sign of a determinant changes, no joint goes far in one step, and the
    /// solution is not near a singularity.
    fn check_branch(
        &self,
        seed: &[f64],
        joints: &[f64],
        is_tracked: bool,
    ) -> Result<(), InverseError> {
        let furthest = self.apart(seed, joints).amax();
        let is_across = joints.len() == 6 && self.orientation(seed) != self.orientation(joints);
        if is_across || (furthest > FAR && !is_tracked) {
            return Err(InverseError::BranchChanged);
        }
        self.check_conditioning(joints)
    }

    fn orientation(&self, joints: &[f64]) -> bool {
        self.jacobian(joints).fixed_columns::<6>(0).into_owned().determinant() < 0.0
    }

    /// Judged by the factors of the arm's determinant or, where it has none, by the conditioning of its Jacobian.
    pub(super) fn check_singularity(&self, joints: &[f64]) -> Result<(), InverseError> {
        match self.factors(joints) {
            Some(factors) => self.check_factor(factors.smallest(), Some(factors.configuration())),
            None => self.check_conditioning(joints),
        }
    }

    fn check_conditioning(&self, joints: &[f64]) -> Result<(), InverseError> {
        if self.settings.least_singularity_factor <= 0.0 {
            return Ok(());
        }
        let lever = self.settings.lever_mm;
        let (_, twists) = self.chain.end_and_joints(&self.arm.axes(joints));
        let factor = conditioning(&self.arm.joint_twists(&twists), &self.scales, lever);
        self.check_factor(factor, None)
    }

    fn check_factor(
        &self,
        factor: f64,
        configuration: Option<Configuration>,
    ) -> Result<(), InverseError> {
        let least = self.settings.least_singularity_factor;
        if factor < least {
            return Err(InverseError::NearSingularity { factor, least, configuration });
        }
        Ok(())
    }
}

pub(super) fn shortened(step: DVector<f64>) -> DVector<f64> {
    let longest = step.amax();
    if longest > LONGEST_STEP { step * (LONGEST_STEP / longest) } else { step }
}

/// The pose `way` (0 to 1) of the way from `start` to `target`: a straight line and the shortest turn.
fn between(start: &Isometry3<f64>, target: &Isometry3<f64>, way: f64) -> Isometry3<f64> {
    let position = start.translation.vector.lerp(&target.translation.vector, way);
    let turn = (target.rotation * start.rotation.inverse()).scaled_axis() * way;
    Isometry3::from_parts(
        Translation3::from(position),
        UnitQuaternion::from_scaled_axis(turn) * start.rotation,
    )
}
