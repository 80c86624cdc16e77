//! The size of each source's noise, and its share of the information on the unknowns.
//!
//! Stated uncertainties of different instruments are rarely of one scale: one that is stated too small would overrule the others.
//! Where several sources take part, each has a factor of its stated standard deviations, estimated by restricted maximum likelihood
//! (Förstner's iteration of variance components): with `N_k = Σ jᵀj` of the whitened rows of source k and `C = (Σ N_k + P)⁻¹`, its
//! redundancy is `r_k = m_k − tr(C N_k)`, and `s_k² ← s_k² · (rᵀr)_k / r_k` until nothing changes. The standard error of `s_k` is
//! `s_k / √(2 r_k)`. The share of a source is `tr(C N_k)` over the number of unknowns; what is left is the prior's.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::observation::Observation;
use super::problem::Problem;
use super::solve::Solution;
use crate::join::{ReadingKind, SourceId};

pub(super) const ITERATIONS: usize = 12;
/// Factors that change by less than this share have converged.
const CONVERGED: f64 = 2e-3;
const LARGEST_CHANGE: f64 = 10.0;
/// A source that is left with fewer redundant numbers keeps its stated size.
const LEAST_REDUNDANCY: f64 = 1.0;
/// A mean square of whitened residuals below this is of exact readings: no noise has a size there.
const EXACT: f64 = 1e-9;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SourceSize {
    pub source: SourceId,
    pub kind: ReadingKind,
    pub readings: usize,
    pub rows: usize,
    /// Root mean square of the stated standard deviations of its rows that are lengths, repeatability included, mm.
    pub stated_mm: f64,
    /// Factor from stated to found standard deviations; 1 where nothing but this source could show it and it is exact.
    pub factor: f64,
    /// Number of its rows less those that the unknowns took.
    pub redundancy: f64,
    /// Its share of the information on all unknowns, 0 to 1.
    pub share: f64,
}

impl SourceSize {
    /// Standard error of the factor; `None` where nothing is redundant.
    pub fn factor_error(&self) -> Option<f64> {
        (self.redundancy >= LEAST_REDUNDANCY).then(|| self.factor / (2.0 * self.redundancy).sqrt())
    }
}

/// Factor of the stated standard deviations of each source, in their order; all 1 at first.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Factors(Vec<f64>);

impl Factors {
    /// Those of the sources of these observations; `None` where there is only one source.
    pub(super) fn of(observations: &[Observation]) -> Option<Self> {
        let mut sources: Vec<usize> = observations.iter().map(|o| o.source.0).collect();
        sources.sort_unstable();
        sources.dedup();
        let last = *sources.last()?;
        (sources.len() > 1).then(|| Self(vec![1.0; last + 1]))
    }

    /// The observations with standard deviations multiplied by their sources' factors.
    pub(super) fn applied(&self, observations: &[Observation]) -> Vec<Observation> {
        let scaled = |o: &Observation| Observation {
            measured: o.measured.widened(self.0[o.source.0]),
            ..o.clone()
        };
        observations.iter().map(scaled).collect()
    }

    /// The factors after a fit with the present ones; whether they have converged.
    pub(super) fn updated(&mut self, sizes: &[SourceSize]) -> bool {
        let mut converged = true;
        for own in sizes {
            let now = &mut self.0[own.source.0];
            let change = (own.factor / *now).clamp(LARGEST_CHANGE.recip(), LARGEST_CHANGE);
            converged &= (change - 1.0).abs() < CONVERGED;
            *now *= change;
        }
        converged
    }
}

/// The part of each source in a solved problem, whose standard deviations have `factors` applied; `covariance` is that of the unknowns.
/// Sources without readings are left out.
pub(super) fn sizes(
    problem: &Problem<'_>,
    solution: &Solution,
    covariance: &DMatrix<f64>,
    factors: Option<&Factors>,
) -> Vec<SourceSize> {
    let observations = problem.observations;
    let last = observations.iter().map(|o| o.source.0).max();
    let sources = (0..=last.unwrap_or(0)).map(SourceId);
    let norms = problem.norms(&solution.offsets);
    let only = factors.is_none();
    let of = |source: SourceId| {
        let is_own = |o: &Observation| o.source == source;
        let own: Vec<&Observation> = observations.iter().filter(|o| is_own(o)).collect();
        let kind = own.first()?.measured.kind();
        let rows: usize = own.iter().map(|o| o.measured.kind().rows()).sum();
        let information = if only {
            solution.information.clone()
        } else {
            let weights = observations.iter().zip(&solution.weights);
            let weights = weights.map(|(o, weight)| if is_own(o) { *weight } else { 0.0 });
            let weights: Vec<f64> = weights.collect();
            problem.normal(&solution.offsets, &weights).information
        };
        let taken = covariance.component_mul(&information).sum() / solution.variance_factor;
        let redundancy = rows as f64 - taken;
        let squares = observations.iter().zip(&norms).zip(&solution.weights);
        let squares = squares.filter(|((o, _), _)| is_own(o));
        let squares: f64 = squares.map(|((_, norm), weight)| weight * norm * norm).sum();
        let now = factors.and_then(|own| own.0.get(source.0)).copied().unwrap_or(1.0);
        let mean = squares / redundancy;
        let is_shown = redundancy >= LEAST_REDUNDANCY && mean > EXACT;
        let stated: f64 = own.iter().map(|o| o.measured.variance_mm2()).sum();
        Some(SourceSize {
            source,
            kind,
            readings: own.len(),
            rows,
            stated_mm: (stated / own.len() as f64).sqrt() / now,
            factor: if is_shown { now * mean.sqrt() } else { now },
            redundancy: redundancy.max(0.0),
            share: taken / problem.unknowns.len().max(1) as f64,
        })
    };
    sources.filter_map(of).collect()
}

/// Sum of the shares of sources; 1 less this is the prior's.
pub fn shares(sizes: &[SourceSize]) -> f64 {
    sizes.iter().map(|own| own.share).sum()
}
