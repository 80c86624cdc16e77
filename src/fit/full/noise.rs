//! The noise between model and measurement: the instrument's covariance, the arm's repeatability as a whole, and the
//! repeatability of each joint seen through the arm.
//!
//! `N = instrument + s₀² I + Σ_j s_j² J_j J_jᵀ`, over the station's weight. The sizes follow from leave-one-out
//! residuals: `s_k² ← s_k² (s_k² Σ αᵀ T_k α + ν₀) / (s_k² Σ tr(K T_k) + ν₀ s_k²/a_k)`, repeated until it converges, with a weak
//! inverse-gamma prior (ν₀ observations of the expected size `a_k`), like that of the model's parts ([`super::components`]). The stated
//! variance of a source that reads a length has a factor of its own, found by the same rule.

use nalgebra::{DMatrix, DVector};

use super::settings::FullSettings;
use crate::fit::observation::Observation;
use crate::fit::observation::measured::{Shown, moved};
use crate::kinematics::Twist;
use crate::units::SLIDE_MM_PER_RAD;

/// Variances of the repeatability.
#[derive(Debug, Clone, PartialEq)]
pub struct Repeatability {
    /// Variance of the arm as a whole, per axis, mm².
    pub position: f64,
    /// Variance of measured orientations beyond the instrument's, per axis, rad².
    pub orientation: f64,
    /// Variance of each joint, rad²; mm² where it slides.
    pub joints: Vec<f64>,
    /// Factor of the stated variance of each source that reads a length, by its index; sources after the last have 1.
    pub lengths: Vec<f64>,
}

/// A variance changes by no more than this factor in a step.
const LARGEST_CHANGE: f64 = 3.0;
/// Steps on the same residuals: with only a few the sizes stay near their start.
const PASSES: usize = 12;
/// Weight of the expected sizes, in squared residuals: equal to that of the model's other parts. Without it a size
/// that a session hardly determines falls to zero, and the stated widths with it.
const PRIOR: f64 = 2.0;

impl Repeatability {
    /// The expected sizes for the joints of `slides`: a joint that slides repeats a mm as another repeats a mrad.
    pub fn expected(settings: &FullSettings, slides: &[bool]) -> Self {
        let size =
            |slides: &bool| settings.joint_noise_rad * if *slides { SLIDE_MM_PER_RAD } else { 1.0 };
        Self {
            position: settings.noise_mm.powi(2),
            orientation: (2.0 * settings.joint_noise_rad).powi(2),
            joints: slides.iter().map(|own| size(own).powi(2)).collect(),
            lengths: Vec::new(),
        }
    }

    /// The covariance of one observation's residual at weight 1; it shows `shown` of the target's motion by each joint.
    pub fn covariance(
        &self,
        observation: &Observation,
        shown: &Shown,
        joints: &[Twist],
    ) -> DMatrix<f64> {
        let columns: Vec<DVector<f64>> = joints.iter().map(|twist| column(twist, shown)).collect();
        let instrument = observation.measured.instrument();
        self.beside(instrument * self.factor(of_length(observation)), &columns)
    }

    /// Factor of an instrument's stated variance; 1 of one that reads places.
    fn factor(&self, of_length: Option<usize>) -> f64 {
        let own = of_length.and_then(|source| self.lengths.get(source));
        own.copied().unwrap_or(1.0)
    }

    /// Adds the repeatability to the instrument's `covariance`.
    fn beside(&self, mut covariance: DMatrix<f64>, columns: &[DVector<f64>]) -> DMatrix<f64> {
        for axis in 0..covariance.nrows() {
            covariance[(axis, axis)] += if axis < 3 {
                self.position
            } else {
                self.orientation
            };
        }
        for (column, variance) in columns.iter().zip(&self.joints) {
            covariance.ger(*variance, column, column, 1.0);
        }
        covariance
    }

    /// Moves the sizes to values at which the leave-one-out residuals have their expected size; `before` holds the sizes
    /// expected before any residual.
    pub fn update(&mut self, evidence: &[NoiseEvidence], before: &Self) {
        for _ in 0..PASSES {
            let lengths = 2 + self.joints.len();
            let size = lengths + self.lengths.len();
            let (mut found, mut expected) = (DVector::zeros(size), DVector::zeros(size));
            for own in evidence {
                own.add_to(self, &mut found, &mut expected);
            }
            let step = |variance: &mut f64, term: usize, before: f64| {
                let found = *variance * found[term] + PRIOR;
                let expected = *variance * (expected[term] + PRIOR / before);
                *variance *= (found / expected).clamp(LARGEST_CHANGE.recip(), LARGEST_CHANGE);
            };
            step(&mut self.position, 0, before.position);
            step(&mut self.orientation, 1, before.orientation);
            for (joint, variance) in self.joints.iter_mut().enumerate() {
                step(variance, 2 + joint, before.joints[joint]);
            }
            for (source, factor) in self.lengths.iter_mut().enumerate() {
                step(factor, lengths + source, 1.0);
            }
        }
    }
}

/// The evidence of one observation on the sizes of the noise.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseEvidence {
    /// Its leave-one-out residual.
    pub residual: DVector<f64>,
    /// Covariance of its prediction from all other observations.
    pub open: DMatrix<f64>,
    /// Covariance of the instrument.
    pub instrument: DMatrix<f64>,
    /// Its motion per unit of each joint.
    pub columns: Vec<DVector<f64>>,
    /// Its robust weight.
    pub weight: f64,
    /// Its Fisher information as a share of its weight.
    pub information: f64,
    /// The source, where it reads a length.
    pub of_length: Option<usize>,
}

/// The source of an observation that is a length.
pub(super) fn of_length(observation: &Observation) -> Option<usize> {
    observation.measured.length().map(|_| observation.source.0)
}

impl NoiseEvidence {
    /// Adds `αᵀ T α` and `tr(K T)` of every size, `K = (open + N / (weight · information))⁻¹`, `α = K r`.
    ///
    /// A size converges where `w r²` has its expected size: the weight belongs to the residual, the share of information
    /// does not.
    fn add_to(&self, sizes: &Repeatability, found: &mut DVector<f64>, expected: &mut DVector<f64>) {
        let counted = self.weight * self.information;
        let instrument = &self.instrument * sizes.factor(self.of_length);
        let noise = sizes.beside(instrument, &self.columns) / counted;
        let k = (&self.open + noise)
            .try_inverse()
            .expect("a positive definite covariance");
        let alpha = &k * &self.residual;
        let mut add = |term: usize, square: f64, trace: f64| {
            found[term] += square / (counted * self.information);
            expected[term] += trace / counted;
        };
        for axis in 0..alpha.len() {
            add(axis / 3, alpha[axis] * alpha[axis], k[(axis, axis)]);
        }
        for (joint, column) in self.columns.iter().enumerate() {
            let square = alpha.dot(column).powi(2);
            add(2 + joint, square, column.dot(&(&k * column)));
        }
        let lengths = 2 + self.columns.len();
        if let Some(source) = self.of_length.filter(|own| *own < sizes.lengths.len()) {
            let square = alpha.dot(&(&self.instrument * &alpha));
            add(lengths + source, square, (&k * &self.instrument).trace());
        }
    }
}

/// The change of a reading's rows by a twist of the target.
pub fn column(twist: &Twist, shown: &Shown) -> DVector<f64> {
    let mut rows = DVector::zeros(shown.rows());
    moved(shown, twist, 1.0, rows.as_mut_slice());
    rows
}
