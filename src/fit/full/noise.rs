//! What is left between model and measurement: the instrument's covariance, the arm's repeatability as a whole, and the
//! repeatability of each joint seen through the arm.
//!
//! `N = instrument + s₀² I + Σ_j s_j² J_j J_jᵀ`, over the station's weight. The sizes follow from leave-one-out
//! residuals: `s_k² ← s_k² Σ αᵀ T_k α / Σ tr(K T_k)`, a step to where both agree.

use nalgebra::{DMatrix, DVector};

use super::settings::FullSettings;
use crate::fit::observation::Observation;
use crate::kinematics::Twist;

/// Variances of the repeatability.
#[derive(Debug, Clone, PartialEq)]
pub struct Repeatability {
    /// Of the arm as a whole, per axis, mm².
    pub position: f64,
    /// Of measured orientations beyond the instrument's, per axis, rad².
    pub orientation: f64,
    /// Of each joint, rad².
    pub joints: Vec<f64>,
}

/// A variance changes by no more than this factor in a step.
const LARGEST_CHANGE: f64 = 3.0;

impl Repeatability {
    /// The expected sizes for an arm of `joints` joints.
    pub fn expected(settings: &FullSettings, joints: usize) -> Self {
        Self {
            position: settings.noise_mm.powi(2),
            orientation: (2.0 * settings.joint_noise_rad).powi(2),
            joints: vec![settings.joint_noise_rad.powi(2); joints],
        }
    }

    /// The covariance of one observation's residual at weight 1.
    pub fn covariance(&self, observation: &Observation, joints: &[Twist]) -> DMatrix<f64> {
        let mut covariance = instrument(observation);
        for axis in 0..covariance.nrows() {
            covariance[(axis, axis)] += if axis < 3 {
                self.position
            } else {
                self.orientation
            };
        }
        for (twist, variance) in joints.iter().zip(&self.joints) {
            let column = column(twist, covariance.nrows());
            covariance.ger(*variance, &column, &column, 1.0);
        }
        covariance
    }

    /// One step of all sizes.
    pub fn update(&mut self, evidence: &[NoiseEvidence]) {
        let step = |variance: &mut f64, term: usize| {
            let found: f64 = evidence.iter().map(|e| e.found[term]).sum();
            let expected: f64 = evidence.iter().map(|e| e.expected[term]).sum();
            if expected > 0.0 {
                *variance *= (found / expected).clamp(LARGEST_CHANGE.recip(), LARGEST_CHANGE);
            }
        };
        step(&mut self.position, 0);
        step(&mut self.orientation, 1);
        for (joint, variance) in self.joints.iter_mut().enumerate() {
            step(variance, 2 + joint);
        }
    }
}

/// What one observation says of each size: position, orientation, then the joints.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseEvidence {
    found: Vec<f64>,
    expected: Vec<f64>,
}

impl NoiseEvidence {
    /// From `α = N⁻¹ r` and `K = N⁻¹ − N⁻¹ H N⁻¹` of one observation whose noise was taken at `weight · information`.
    ///
    /// A size is where `w r²` is as large as expected: the weight belongs to the residual, the share of information does not.
    pub fn new(
        alpha: &DVector<f64>,
        k: &DMatrix<f64>,
        joints: &[Twist],
        weight: f64,
        information: f64,
    ) -> Self {
        let rows = alpha.len();
        let counted = weight * information;
        let part = |from: usize, to: usize| {
            let found: f64 = (from..to.min(rows)).map(|i| alpha[i] * alpha[i]).sum();
            let expected: f64 = (from..to.min(rows)).map(|i| k[(i, i)]).sum();
            (found / (counted * information), expected / counted)
        };
        let joint = |twist: &Twist| {
            let column = column(twist, rows);
            (
                alpha.dot(&column).powi(2) / (counted * information),
                column.dot(&(k * &column)) / counted,
            )
        };
        let terms = [part(0, 3), part(3, 6)]
            .into_iter()
            .chain(joints.iter().map(joint));
        let (found, expected) = terms.unzip();
        Self { found, expected }
    }
}

fn instrument(observation: &Observation) -> DMatrix<f64> {
    let rows = if observation.orientation.is_some() {
        6
    } else {
        3
    };
    let mut covariance = DMatrix::zeros(rows, rows);
    covariance
        .fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&observation.instrument);
    if let Some((_, sd)) = observation.orientation {
        (3..6).for_each(|axis| covariance[(axis, axis)] = sd * sd);
    }
    covariance
}

/// A twist as a column of 3 (position) or 6 (position, orientation) rows.
pub fn column(twist: &Twist, rows: usize) -> DVector<f64> {
    DVector::from_fn(rows, |row, _| {
        if row < 3 {
            twist.linear[row]
        } else {
            twist.angular[row - 3]
        }
    })
}
