//! Models of a semivariogram: spherical, exponential, Gaussian, with nugget, sill and range.
//!
//! For a given range every model is linear in its nugget and its partial sill, so the fit is two numbers by weighted
//! least squares (weights: pair counts) inside a search over the range alone. Neither number may be negative, and the range is
//! positive, however near to each other the first pairs lie.

use super::{Alikeness, Bin};

/// The shape of a model, as a function of separation over range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// `1.5 t − 0.5 t³` up to the range, then 1.
    Spherical,
    /// `1 − exp(−3 t)`: 95 % of the sill at the range.
    Exponential,
    /// `1 − exp(−3 t²)`: 95 % of the sill at the range.
    Gaussian,
}

impl Shape {
    pub const ALL: [Self; 3] = [Self::Spherical, Self::Exponential, Self::Gaussian];

    /// Share of the partial sill reached at separation over range `t`.
    pub fn at(self, t: f64) -> f64 {
        match self {
            Self::Spherical if t >= 1.0 => 1.0,
            Self::Spherical => 0.5 * t * (3.0 - t * t),
            Self::Exponential => 1.0 - (-3.0 * t).exp(),
            Self::Gaussian => 1.0 - (-3.0 * t * t).exp(),
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VariogramModel {
    pub shape: Shape,
    /// Semivariance at separation zero: noise and what varies below the least separation, mm².
    pub nugget: f64,
    /// Semivariance that far pairs reach, nugget included, mm².
    pub sill: f64,
    /// Separation at which the sill is reached (to 95 % for the asymptotic shapes).
    pub range: f64,
    /// Weighted sum of squared deviations from the bins, per pair, mm⁴.
    pub misfit: f64,
}

/// Fewer bins than this do not determine nugget, sill and range.
const LEAST_BINS: usize = 4;
/// Ranges tried between the first and twice the last separation.
const RANGES: u32 = 200;
/// The least range tried, as a share of a bin's width.
const SHARE_OF_A_BIN: f64 = 0.01;
/// A rising curve explains at least this share of the bins' weighted variance.
const RISING_SHARE: f64 = 0.5;

/// All shapes fitted to `bins`, the best first; empty with too few bins.
pub(super) fn fit_all(bins: &[Bin]) -> Vec<VariogramModel> {
    if bins.len() < LEAST_BINS {
        return Vec::new();
    }
    let mut models: Vec<_> = Shape::ALL.into_iter().filter_map(|shape| fit(shape, bins)).collect();
    models.sort_by(|a, b| a.misfit.total_cmp(&b.misfit));
    models
}

pub fn alikeness(bins: &[Bin], models: &[VariogramModel]) -> Alikeness {
    let Some(best) = models.first() else { return Alikeness::TooFewPairs };
    let pairs: f64 = bins.iter().map(|bin| bin.pairs as f64).sum();
    let mean = bins.iter().map(|bin| bin.pairs as f64 * bin.gamma).sum::<f64>() / pairs;
    let flat =
        bins.iter().map(|bin| bin.pairs as f64 * (bin.gamma - mean).powi(2)).sum::<f64>() / pairs;
    // A curve whose bins differ by a few percent of their level is flat, however well a model follows the ripple.
    let rises =
        best.sill - best.nugget > 0.2 * best.sill && best.misfit < (1.0 - RISING_SHARE) * flat;
    if rises { Alikeness::Rising } else { Alikeness::Flat }
}

fn fit(shape: Shape, bins: &[Bin]) -> Option<VariogramModel> {
    // The separation of repeated visits may be zero, which is not a valid range; a bin shows nothing about ranges far below its own
    // width.
    let first = bins.first()?;
    let first = first.separation.max(SHARE_OF_A_BIN * (first.to - first.from));
    let last = 2.0 * bins.last()?.separation;
    let ratio = (last / first).max(1.0);
    let range = |step: u32| first * ratio.powf(f64::from(step) / f64::from(RANGES));
    (0..=RANGES)
        .map(|step| at_range(shape, range(step), bins))
        .min_by(|a, b| a.misfit.total_cmp(&b.misfit))
}

/// Nugget and partial sill at a given range, both at least zero.
fn at_range(shape: Shape, range: f64, bins: &[Bin]) -> VariogramModel {
    let rows =
        bins.iter().map(|bin| (bin.pairs as f64, shape.at(bin.separation / range), bin.gamma));
    let sum =
        |term: fn(f64, f64, f64) -> f64| rows.clone().map(|(w, f, g)| term(w, f, g)).sum::<f64>();
    let (w, wf, wff) = (sum(|w, _, _| w), sum(|w, f, _| w * f), sum(|w, f, _| w * f * f));
    let (wg, wfg) = (sum(|w, _, g| w * g), sum(|w, f, g| w * f * g));
    let determinant = w.mul_add(wff, -(wf * wf));
    let (mut nugget, mut partial) = (wg / w, 0.0);
    if determinant > 1e-12 * w * wff {
        nugget = wff.mul_add(wg, -(wf * wfg)) / determinant;
        partial = w.mul_add(wfg, -(wf * wg)) / determinant;
    }
    if nugget < 0.0 {
        (nugget, partial) = (0.0, wfg / wff);
    }
    if partial < 0.0 {
        (nugget, partial) = (wg / w, 0.0);
    }
    let misfit = rows.map(|(w, f, g)| w * (g - nugget - partial * f).powi(2)).sum::<f64>() / w;
    VariogramModel { shape, nugget, sill: nugget + partial, range, misfit }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bins_of(gamma: impl Fn(f64) -> f64) -> Vec<Bin> {
        let bin = |i: i32| {
            let (from, to) = (f64::from(i) * 10.0, f64::from(i + 1) * 10.0);
            Bin { from, to, separation: from + 5.0, pairs: 100, gamma: gamma(from + 5.0) }
        };
        (0..15).map(bin).collect()
    }

    #[test]
    fn a_spherical_curve_is_recovered() {
        let bins = bins_of(|h| 0.01 + 0.2 * Shape::Spherical.at(h / 80.0));
        let models = fit_all(&bins);
        assert_eq!(models[0].shape, Shape::Spherical);
        assert!((models[0].nugget - 0.01).abs() < 2e-3, "{models:?}");
        assert!((models[0].sill - 0.21).abs() < 2e-3);
        assert!((models[0].range - 80.0).abs() < 2.0);
        assert_eq!(alikeness(&bins, &models), Alikeness::Rising);
    }

    #[test]
    fn repeated_visits_have_a_model_too() {
        let mut bins = bins_of(|h| 0.01 + 0.2 * Shape::Exponential.at(h / 80.0));
        bins[0].separation = 0.0;
        bins[0].gamma = 0.0;
        let models = fit_all(&bins);
        assert_eq!(models.len(), 3);
        for model in &models {
            let numbers = [model.nugget, model.sill, model.range, model.misfit];
            assert!(numbers.iter().all(|x| x.is_finite()), "{model:?}");
            assert!(model.range > 0.0);
        }
        assert_eq!(alikeness(&bins, &models), Alikeness::Rising);
        // Equal errors everywhere: no semivariance in any bin.
        for bin in &mut bins {
            bin.gamma = 0.0;
        }
        let models = fit_all(&bins);
        assert!(models.iter().all(|model| model.misfit == 0.0), "{models:?}");
        assert_eq!(alikeness(&bins, &models), Alikeness::Flat);
    }

    #[test]
    fn a_flat_curve_shows_that_there_is_nothing_to_interpolate() {
        let bins = bins_of(|h| 0.2 + 0.001 * (h * 0.7).sin());
        assert_eq!(alikeness(&bins, &fit_all(&bins)), Alikeness::Flat);
        assert_eq!(alikeness(&bins[..3], &fit_all(&bins[..3])), Alikeness::TooFewPairs);
    }
}
