//! Two estimates of one arm → what a change between them explains.
//!
//! Let x be the truth at the first estimate and x + δ at the second, `Λ_i`, `η_i` what the stations of each say. With x integrated
//! out under a weak prior P, the log likelihood of δ is quadratic: score `u = η₂ − Λ₂ A⁻¹ (η₁ + η₂)` at δ = 0 and information
//! `V = Λ₂ − Λ₂ A⁻¹ Λ₂`, `A = Λ₁ + Λ₂ + P` (the parallel sum of Λ₁ and Λ₂: what both determine). Without a change `u ~ N(0, V)`.
//! That only the columns G changed explains `u_Gᵀ V_GG⁺ u_G`, chi-square with as many degrees of freedom as `V_GG` has rank; the shift
//! is `V_GG⁺ u_G` with covariance `V_GG⁺`. Directions in which a change of a whole unit (3 mm, 3 mrad, 0.3 mrad of a curve)
//! would be less than one standard deviation count as not determined.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::bits;
use super::estimate::{Column, Estimate};
use super::inverse_above;

/// Information of a direction below which it is not determined: one standard deviation a unit.
const DETERMINED: f64 = 1.0;

/// A second estimate held against a first.
#[derive(Debug, Clone)]
pub struct Comparison {
    columns: Vec<Column>,
    /// u.
    score: DVector<f64>,
    /// V.
    information: DMatrix<f64>,
}

/// What a change of some columns explains.
#[derive(Debug, Clone)]
pub struct Explained {
    /// Chi-square and its degrees of freedom.
    pub test: ChiSquare,
    /// The shift, in the columns' units.
    pub shift: DVector<f64>,
    /// Its covariance.
    pub covariance: DMatrix<f64>,
}

/// A chi-square statistic.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ChiSquare {
    /// The statistic.
    #[serde(with = "bits::number")]
    pub statistic: f64,
    /// Degrees of freedom.
    pub freedom: usize,
}

/// How far one column moved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Shift {
    /// The column.
    pub column: Column,
    /// By how much, mm or rad.
    #[serde(with = "bits::number")]
    pub value: f64,
    /// Its standard deviation.
    #[serde(with = "bits::number")]
    pub sd: f64,
}

impl ChiSquare {
    /// Probability of so much or more where nothing changed.
    pub fn p_value(self) -> f64 {
        match ChiSquared::new(self.freedom as f64) {
            Ok(law) if self.statistic > 0.0 => law.sf(self.statistic),
            // No degree of freedom, or no deviation at all.
            _ => 1.0,
        }
    }

    /// What remains of `all` beside this.
    #[must_use]
    pub fn remainder(self, all: Self) -> Self {
        Self {
            statistic: (all.statistic - self.statistic).max(0.0),
            freedom: all.freedom.saturating_sub(self.freedom),
        }
    }
}

impl Comparison {
    /// Holds `later` against `earlier`.
    pub fn new(earlier: &Estimate, later: &Estimate) -> Self {
        let both = earlier.plus(later);
        let (base, target) = both.frames();
        let columns = both.columns().to_vec();
        let (first, first_moment) = earlier.spread(&columns, base, target);
        let (second, second_moment) = later.spread(&columns, base, target);
        let size = columns.len();
        let all = &first + &second + DMatrix::identity(size, size);
        // Positive definite but for rounding; then nothing can be said.
        let Some(factor) = all.cholesky() else {
            return Self {
                columns,
                score: DVector::zeros(size),
                information: DMatrix::zeros(size, size),
            };
        };
        let score = &second_moment - &second * factor.solve(&(first_moment + &second_moment));
        let information = &second - &second * factor.solve(&second);
        Self {
            columns,
            score,
            information: (&information + information.transpose()) * 0.5,
        }
    }

    /// The columns that either knows something of.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Places of the columns that `is_asked`.
    pub fn places(&self, is_asked: impl Fn(&Column) -> bool) -> Vec<usize> {
        (0..self.columns.len())
            .filter(|&place| is_asked(&self.columns[place]))
            .collect()
    }

    /// What a change of the columns at `places` explains.
    pub fn explained(&self, places: &[usize]) -> Explained {
        let size = places.len();
        let block = DMatrix::from_fn(size, size, |i, j| self.information[(places[i], places[j])]);
        let score = DVector::from_fn(size, |i, _| self.score[places[i]]);
        let (covariance, freedom) = inverse_above(&block, DETERMINED);
        let shift = &covariance * &score;
        Explained {
            test: ChiSquare {
                statistic: score.dot(&shift),
                freedom,
            },
            shift,
            covariance,
        }
    }
}

impl Explained {
    /// The shifts of the columns at `places`, those left out that are not determined at all.
    pub fn shifts(&self, comparison: &Comparison, places: &[usize]) -> Vec<Shift> {
        let shift = |(i, &place): (usize, &usize)| {
            let column = comparison.columns[place];
            let sd = self.covariance[(i, i)].max(0.0).sqrt() * column.unit();
            (sd > 0.0).then(|| Shift {
                column,
                value: self.shift[i] * column.unit(),
                sd,
            })
        };
        places.iter().enumerate().filter_map(shift).collect()
    }
}
