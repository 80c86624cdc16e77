//! Whether a parameter is identifiable, and what it is confounded with: every limit of that stands here.
//!
//! The method is in [`crate::method::identification`].

use nalgebra::DMatrix;

use super::Calibration;

/// A parameter is identifiable when its standard error is below this share of its prior's.
const SHARE_OF_PRIOR: f64 = 0.5;
/// Two parameters are confounded when they correlate by more than this.
const CONFOUNDED: f64 = 0.9;

/// How far the poses determine a parameter, and if not, why.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Identifiability {
    /// The poses determine it.
    Identifiable,
    /// No pose moves with it.
    MovesNothing,
    /// It is the same motion as others, whatever the noise.
    StructurallyDependent,
    /// The poses say hardly more of it than its prior.
    Weak,
}

/// Whether a standard error says more than the prior's; without a prior it does.
pub fn is_identifiable(standard_error: f64, prior_sd: Option<f64>) -> bool {
    prior_sd.is_none_or(|sd| standard_error < SHARE_OF_PRIOR * sd)
}

/// The parameters that parameter `place` is confounded with by their covariance.
pub fn confounded(covariance: &DMatrix<f64>, place: usize) -> Vec<usize> {
    others(covariance, place)
        .filter(|&other| correlation(covariance, place, other).abs() > CONFOUNDED)
        .collect()
}

/// The parameter that correlates most with parameter `place`, and their correlation; `None` where none does.
pub fn most_correlated(covariance: &DMatrix<f64>, place: usize) -> Option<(usize, f64)> {
    others(covariance, place)
        .map(|other| (other, correlation(covariance, place, other)))
        .filter(|(_, found)| found.abs() > 0.0)
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
}

fn others(covariance: &DMatrix<f64>, place: usize) -> impl Iterator<Item = usize> {
    (0..covariance.nrows()).filter(move |&other| other != place)
}

/// The correlation of two parameters; zero where one of the two does not vary.
fn correlation(covariance: &DMatrix<f64>, a: usize, b: usize) -> f64 {
    let scale = (covariance[(a, a)] * covariance[(b, b)]).sqrt();
    if scale > 0.0 {
        covariance[(a, b)] / scale
    } else {
        0.0
    }
}

impl Calibration {
    /// Whether unknown `place` is identifiable, and if not, why.
    pub fn identifiability(&self, place: usize) -> Identifiability {
        if self.nominal_structure.zero_columns.contains(&place) {
            Identifiability::MovesNothing
        } else if self.identifiable(place) {
            Identifiability::Identifiable
        } else if self.nominal_structure.indistinguishable[place].is_empty() {
            Identifiability::Weak
        } else {
            Identifiability::StructurallyDependent
        }
    }

    /// Whether unknown `place` is identifiable: its standard error is below half its prior's, or, without a prior, it
    /// takes part in no structural null direction.
    pub fn identifiable(&self, place: usize) -> bool {
        let structural = !self.nominal_structure.zero_columns.contains(&place);
        structural
            && match self.prior_sd[place] {
                Some(sd) => is_identifiable(self.standard_error(place), Some(sd)),
                None => self.nominal_structure.indistinguishable[place].is_empty(),
            }
    }

    /// What unknown `place` is confounded with: structural partners, else those it correlates with.
    pub fn confounded_with(&self, place: usize) -> Vec<usize> {
        if self.identifiable(place) {
            return Vec::new();
        }
        let structural = &self.nominal_structure.indistinguishable[place];
        if structural.is_empty() {
            confounded(&self.covariance, place)
        } else {
            structural.clone()
        }
    }
}
