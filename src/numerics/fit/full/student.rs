//! Heavy tails: the Student t that weights stations, with degrees of freedom found from the session itself.
//!
//! Input: squared leave-one-out distances `d²` of observations with p rows. A multivariate t of ν degrees of freedom has
//! the density `Γ((ν+p)/2) / (Γ(ν/2) (πνs)^{p/2}) (1 + d²/(νs))^{−(ν+p)/2}` (Lange, Little and Taylor 1989). For each ν of
//! a fixed list the scale s that fits best is found by its fixed point; the ν with the largest likelihood is taken. Clean
//! stations give a normal distribution: no weights, no inflation.

use serde::{Deserialize, Serialize};
use statrs::function::gamma::ln_gamma;

/// Degrees of freedom that are tried in addition to the normal distribution; below 3 the covariance is hardly defined, above
/// 64 the difference is negligible.
const TRIED: [f64; 9] = [3.0, 4.0, 6.0, 8.0, 11.0, 16.0, 23.0, 32.0, 64.0];
/// Passes of the scale's fixed point; each at least halves the remaining error.
const PASSES: usize = 30;

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Tails {
    Normal,
    Student(f64),
}

impl Tails {
    /// The distribution of a setting, in which 0 stands for a normal distribution.
    pub(super) fn from_setting(freedom: f64) -> Self {
        if freedom > 0.0 { Self::Student(freedom) } else { Self::Normal }
    }

    pub const fn setting(self) -> f64 {
        match self {
            Self::Normal => 0.0,
            Self::Student(freedom) => freedom,
        }
    }

    /// The likeliest distribution of squared leave-one-out distances, each with its number of rows.
    pub(super) fn of(distances: &[(f64, f64)]) -> Self {
        let tried = TRIED.map(Self::Student);
        let likeliest = |best: (Self, f64), tails: &Self| {
            let likelihood = tails.log_likelihood(distances);
            if likelihood > best.1 { (*tails, likelihood) } else { best }
        };
        let normal = (Self::Normal, Self::Normal.log_likelihood(distances));
        tried.iter().fold(normal, likeliest).0
    }

    /// The weight of an observation at a squared distance: `(ν + p)/(ν + d²)`.
    pub fn weight(self, distance_squared: f64, rows: f64) -> f64 {
        match self {
            Self::Normal => 1.0,
            Self::Student(freedom) => (freedom + rows) / (freedom + distance_squared),
        }
    }

    /// The information of a weighted observation on the mean, as a share of its weight: `(ν + p)/(ν + p + 2)`, the Fisher
    /// information of a t over its expected weight. A weight that depends on the residual is not a known precision.
    pub fn information(self, rows: f64) -> f64 {
        match self {
            Self::Normal => 1.0,
            Self::Student(freedom) => (freedom + rows) / (freedom + rows + 2.0),
        }
    }

    /// Ratio of covariance to scale.
    pub(super) fn inflation(self) -> f64 {
        match self {
            Self::Student(freedom) if freedom > 2.0 => freedom / (freedom - 2.0),
            Self::Normal | Self::Student(_) => 1.0,
        }
    }

    /// The log likelihood at the best scale, without the constant `π`.
    fn log_likelihood(self, distances: &[(f64, f64)]) -> f64 {
        let rows: f64 = distances.iter().map(|(_, rows)| rows).sum();
        let mut scale = 1.0;
        for _ in 0..PASSES {
            let weighed = |(square, rows): &(f64, f64)| self.weight(square / scale, *rows) * square;
            scale = (distances.iter().map(weighed).sum::<f64>() / rows).max(f64::MIN_POSITIVE);
        }
        let likelihood = |(square, rows): &(f64, f64)| {
            self.ln_density(square / scale, *rows) - 0.5 * rows * scale.ln()
        };
        distances.iter().map(likelihood).sum()
    }

    fn ln_density(self, square: f64, rows: f64) -> f64 {
        match self {
            Self::Normal => -0.5 * (square + rows * 2.0_f64.ln()),
            Self::Student(freedom) => {
                let whole = 0.5 * (freedom + rows);
                ln_gamma(whole)
                    - ln_gamma(0.5 * freedom)
                    - 0.5 * rows * freedom.ln()
                    - whole * (square / freedom).ln_1p()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Squared distances of three rows at the quantiles of the normal distribution's χ²₃, by Wilson and Hilferty.
    fn normal_distances(count: u32) -> Vec<(f64, f64)> {
        let normal = statrs::distribution::Normal::standard();
        let quantile = |i: u32| {
            let share = (f64::from(i) + 0.5) / f64::from(count);
            statrs::distribution::ContinuousCDF::inverse_cdf(&normal, share)
        };
        let distance = |i: u32| {
            let spread = (2.0_f64 / 27.0).sqrt();
            3.0 * (1.0 - 2.0 / 27.0 + spread * quantile(i)).max(0.0).powi(3)
        };
        (0..count).map(|i| (distance(i), 3.0)).collect()
    }

    #[test]
    fn clean_residuals_are_normal_at_any_scale() {
        for scale in [1.0, 0.25] {
            let distances: Vec<_> = normal_distances(500)
                .into_iter()
                .map(|(square, rows)| (scale * square, rows))
                .collect();
            let found = Tails::of(&distances);
            assert!(matches!(found, Tails::Normal | Tails::Student(64.0)), "{found:?}");
        }
    }

    #[test]
    fn one_in_twenty_far_away_gives_the_heaviest_tails() {
        let mut distances = normal_distances(500);
        distances.iter_mut().step_by(20).for_each(|d| d.0 += 400.0);
        assert_eq!(Tails::of(&distances), Tails::Student(3.0));
    }

    #[test]
    fn the_density_tends_to_the_normal_one() {
        let student = Tails::Student(1e7).ln_density(2.3, 3.0);
        assert!((student - Tails::Normal.ln_density(2.3, 3.0)).abs() < 1e-5);
    }
}
