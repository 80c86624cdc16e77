//! Whether a parameter is identifiable, and what it is confounded with; all limits for this are here.
//!
//! The method is in [`crate::method::identification`].

use nalgebra::DMatrix;

use super::Calibration;

/// A parameter is identifiable when its standard error is below this share of its prior's.
const SHARE_OF_PRIOR: f64 = 0.5;
/// Two parameters are confounded when they correlate by more than this: one takes part in whatever is not known of the other.
const CONFOUNDED: f64 = 0.9;
/// Neither of two parameters is identifiable when they correlate by more than this: each has seven times the standard error that it
/// would have if the other were known.
const ONE_NUMBER: f64 = 0.99;
/// The standard error of a parameter of two that are one number, in those that it would have if the other were known: `1/√(1 − 0.99²)`.
pub(super) const CONFOUNDED_ERRORS: f64 = 7.0;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Identifiability {
    Identifiable,
    MovesNothing,
    /// It has the same effect as other parameters at any noise.
    StructurallyDependent,
    /// The poses determine it hardly better than its prior.
    Weak,
    /// It correlates so much with another parameter that the poses determine the two together only, or with one that they do not
    /// determine.
    Confounded,
    /// It is zero by convention: offsets are counted from the frames that this very fit found.
    ByConvention,
}

/// Whether a standard error is small enough compared with the prior's; always true without a prior.
pub fn is_identifiable(standard_error: f64, prior_sd: Option<f64>) -> bool {
    prior_sd.is_none_or(|sd| standard_error < SHARE_OF_PRIOR * sd)
}

/// The parameters with which the parameter at `place` is confounded by their covariance.
pub fn confounded(covariance: &DMatrix<f64>, place: usize) -> Vec<usize> {
    others(covariance, place)
        .filter(|&other| correlation(covariance, place, other).abs() > CONFOUNDED)
        .collect()
}

/// The parameter that correlates most with the one at `place`, and their correlation; `None` where none does.
pub fn most_correlated(covariance: &DMatrix<f64>, place: usize) -> Option<(usize, f64)> {
    others(covariance, place)
        .map(|other| (other, correlation(covariance, place, other)))
        .filter(|(_, found)| found.abs() > 0.0)
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
}

/// What each parameter is by itself (`alone`), with what its correlations with the others take from it.
pub fn with_correlations(
    alone: &[Identifiability],
    covariance: &DMatrix<f64>,
) -> Vec<Identifiability> {
    let is_confounded = |place: usize| {
        others(covariance, place).any(|other| {
            let found = correlation(covariance, place, other).abs();
            let is_open = alone[other] != Identifiability::Identifiable;
            found > ONE_NUMBER || (is_open && found > CONFOUNDED)
        })
    };
    let with = |(place, own): (usize, &Identifiability)| match own {
        Identifiability::Identifiable if is_confounded(place) => Identifiability::Confounded,
        own => *own,
    };
    alone.iter().enumerate().map(with).collect()
}

fn others(covariance: &DMatrix<f64>, place: usize) -> impl Iterator<Item = usize> {
    (0..covariance.nrows()).filter(move |&other| other != place)
}

/// The correlation of two parameters; zero where one of the two does not vary.
fn correlation(covariance: &DMatrix<f64>, a: usize, b: usize) -> f64 {
    let scale = (covariance[(a, a)] * covariance[(b, b)]).sqrt();
    if scale > 0.0 { covariance[(a, b)] / scale } else { 0.0 }
}

impl Calibration {
    /// Whether each unknown is identifiable, and if not, why; in their order.
    pub fn identifiability(&self) -> Vec<Identifiability> {
        let alone: Vec<Identifiability> = (0..self.unknowns.len())
            .map(|place| self.alone(place, self.standard_error(place)))
            .collect();
        with_correlations(&alone, &self.covariance)
    }

    /// Whether unknown `place` is identifiable by its `standard_error`, maybe of another model, and by the nominal arm's structure.
    pub fn alone(&self, place: usize, standard_error: f64) -> Identifiability {
        let structure = &self.nominal_structure;
        let is_dependent = !structure.indistinguishable[place].is_empty();
        let prior_sd = self.prior_sd[place];
        if structure.zero_columns.contains(&place) {
            Identifiability::MovesNothing
        } else if is_identifiable(standard_error, prior_sd) && !(prior_sd.is_none() && is_dependent)
        {
            Identifiability::Identifiable
        } else if is_dependent {
            Identifiability::StructurallyDependent
        } else {
            Identifiability::Weak
        }
    }

    /// The unknowns with which the one at `place` is confounded where it is not identifiable: its structural partners, otherwise those
    /// it correlates with.
    pub fn confounded_with(&self, place: usize) -> Vec<usize> {
        let structural = &self.nominal_structure.indistinguishable[place];
        if structural.is_empty() { confounded(&self.covariance, place) } else { structural.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Identifiability::{Confounded, Identifiable, Weak};

    /// Unit variances, with these correlations of 0 and 1, and of 1 and 2.
    fn covariance(first: f64, second: f64) -> DMatrix<f64> {
        DMatrix::from_row_slice(3, 3, &[1.0, first, 0.0, first, 1.0, second, 0.0, second, 1.0])
    }

    #[test]
    fn two_parameters_that_are_one_number_are_not_identifiable() {
        let of = |first, second| with_correlations(&[Identifiable; 3], &covariance(first, second));
        assert_eq!(of(-0.999_987, 0.0), [Confounded, Confounded, Identifiable]);
        assert_eq!(of(0.98, -0.98), [Identifiable; 3]);
    }

    #[test]
    fn what_goes_with_something_unknown_is_unknown() {
        // The second is hardly more than its prior; the first goes with it, the third does not.
        let alone = [Identifiable, Weak, Identifiable];
        assert_eq!(
            with_correlations(&alone, &covariance(-0.95, 0.5)),
            [Confounded, Weak, Identifiable]
        );
    }
}
