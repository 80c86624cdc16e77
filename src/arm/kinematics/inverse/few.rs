//! Arms with fewer than six joints: the position exactly, the orientation as near as the arm has it there.

use nalgebra::{DMatrix, DVector, Isometry3, Vector6};

use super::InverseError;
use super::search::{Search, shortened};

/// Steps before giving up: the orientation converges linearly.
const STEPS: usize = 100;
/// A step shorter than this ends the search, rad or levers.
const SHORTEST: f64 = 1e-11;
/// Singular values below this share of the largest count as zero.
const ZERO: f64 = 1e-6;

impl Search<'_> {
    /// Joint angles near `seed` with the target's position and the nearest orientation; an error where the settings do
    /// not allow it. Each step moves the position by Newton's method and turns the end within the motions that leave it
    /// alone (task priority; Siciliano and Slotine 1991).
    pub(super) fn nearest_orientation(
        &self,
        target: &Isometry3<f64>,
        seed: &[f64],
    ) -> Result<Vec<f64>, InverseError> {
        let mut joints = seed.to_vec();
        for _ in 0..STEPS {
            let residual = self.residual(target, &self.end(&joints));
            let step = self.prioritised(&joints, &residual);
            let length = step.amax();
            joints = self.moved(&joints, &shortened(step));
            if length < SHORTEST {
                break;
            }
        }
        let (position_mm, orientation_rad) = self.parts(&self.residual(target, &self.end(&joints)));
        if position_mm > self.settings.position_tolerance_mm {
            return Err(self.not_reachable(target, &joints));
        }
        let allowed = self.settings.orientation_slack_rad;
        if orientation_rad > allowed.max(self.settings.orientation_tolerance_rad) {
            return Err(InverseError::Orientation {
                joints: joints.len(),
                off_deg: orientation_rad.to_degrees(),
            });
        }
        Ok(joints)
    }

    /// The step by the position's residual and, with what freedom is left, by as much of the rotation's.
    fn prioritised(&self, joints: &[f64], residual: &Vector6<f64>) -> DVector<f64> {
        let jacobian = self.jacobian(joints);
        let position = jacobian.rows(0, 3).into_owned();
        let rotation = jacobian.rows(3, 3).into_owned();
        let back = pseudo_inverse(&position);
        let first = &back * residual.fixed_rows::<3>(0);
        let size = joints.len();
        let own = DMatrix::identity(size, size) - &back * &position;
        let left = residual.fixed_rows::<3>(3) - &rotation * &first;
        let second = pseudo_inverse(&(&rotation * &own)) * left;
        first + own * second
    }
}

/// The pseudo-inverse; directions of nearly no effect count as of none.
fn pseudo_inverse(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let svd = matrix.clone().svd(true, true);
    let least = ZERO * svd.singular_values.max();
    svd.pseudo_inverse(least).unwrap_or_else(|_| DMatrix::zeros(matrix.ncols(), matrix.nrows()))
}
