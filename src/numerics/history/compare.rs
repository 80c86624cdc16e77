//! Two estimates of one arm → the change between them and its significance.
//!
//! Let x be the truth at the first estimate and x + δ at the second, `Λ_i`, `η_i` information and moment of each. With x
//! integrated out under a weak prior P, the log likelihood of δ is quadratic: score `u = η₂ − Λ₂ A⁻¹ (η₁ + η₂)` at δ = 0 and
//! information `V = Λ₂ − Λ₂ A⁻¹ Λ₂`, `A = Λ₁ + Λ₂ + P` (the parallel sum of Λ₁ and Λ₂: what both determine). Without a change
//! `u ~ N(0, V)`. A change of the columns G alone explains `u_Gᵀ V_GG⁺ u_G`, chi-square with as many degrees of freedom as
//! `V_GG` has rank; the shift is `V_GG⁺ u_G` with covariance `V_GG⁺`. Directions in which a change of a whole unit (3 mm, 3
//! mrad, 0.3 mrad or mm of a curve) would be less than one standard deviation count as not determined.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::bits;
use super::estimate::{Column, Estimate};
use super::inverse_above;

/// Information below which a direction is not determined: a standard deviation of one unit.
const DETERMINED: f64 = 1.0;

#[derive(Debug, Clone)]
pub struct Comparison {
    /// The columns of which either estimate has information.
    pub columns: Vec<Column>,
    score: DVector<f64>,
    information: DMatrix<f64>,
}

#[derive(Debug, Clone)]
pub struct Explained {
    pub test: ChiSquare,
    pub shift: DVector<f64>,
    pub covariance: DMatrix<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ChiSquare {
    #[serde(with = "bits::number")]
    pub statistic: f64,
    pub freedom: usize,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Shift {
    pub column: Column,
    #[serde(with = "bits::number")]
    pub value: f64,
    /// The shift's standard deviation, mm or rad.
    #[serde(with = "bits::number")]
    pub sd: f64,
}

impl ChiSquare {
    /// The p-value: the probability of this statistic or a larger one without a change.
    pub fn p_value(self) -> f64 {
        match ChiSquared::new(self.freedom as f64) {
            Ok(law) if self.statistic > 0.0 => law.sf(self.statistic),
            // No degree of freedom, or no deviation at all.
            _ => 1.0,
        }
    }

    /// The part of `all` that this statistic does not explain.
    #[must_use]
    pub fn remainder(self, all: Self) -> Self {
        Self {
            statistic: (all.statistic - self.statistic).max(0.0),
            freedom: all.freedom.saturating_sub(self.freedom),
        }
    }
}

impl Comparison {
    pub fn new(earlier: &Estimate, later: &Estimate) -> Self {
        let both = earlier.plus(later);
        let (base, target) = (both.base.as_ref(), both.target.as_ref());
        let columns = both.columns.clone();
        let (first, first_moment) = earlier.spread(&columns, base, target);
        let (second, second_moment) = later.spread(&columns, base, target);
        let size = columns.len();
        let all = &first + &second + DMatrix::identity(size, size);
        // Only rounding can make it not positive definite; then nothing is determined.
        let Some(factor) = all.cholesky() else {
            return Self {
                columns,
                score: DVector::zeros(size),
                information: DMatrix::zeros(size, size),
            };
        };
        let score = &second_moment - &second * factor.solve(&(first_moment + &second_moment));
        let information = &second - &second * factor.solve(&second);
        Self { columns, score, information: (&information + information.transpose()) * 0.5 }
    }

    /// Places of the columns for which `is_asked` is true.
    pub fn places(&self, is_asked: impl Fn(&Column) -> bool) -> Vec<usize> {
        (0..self.columns.len()).filter(|&place| is_asked(&self.columns[place])).collect()
    }

    /// The shifts of the columns for which `is_moved` is true, all estimated together.
    pub fn shifts(&self, is_moved: impl Fn(&Column) -> bool) -> Vec<Shift> {
        let places = self.places(is_moved);
        self.explained(&places).shifts(self, &places)
    }

    /// The test and the size of a change of the columns at `places` alone.
    pub fn explained(&self, places: &[usize]) -> Explained {
        let size = places.len();
        let block = DMatrix::from_fn(size, size, |i, j| self.information[(places[i], places[j])]);
        let score = DVector::from_fn(size, |i, _| self.score[places[i]]);
        let (covariance, freedom) = inverse_above(&block, DETERMINED);
        let shift = &covariance * &score;
        Explained { test: ChiSquare { statistic: score.dot(&shift), freedom }, shift, covariance }
    }
}

impl Explained {
    /// The shifts of the columns at `places`, without columns that are not determined at all.
    pub fn shifts(&self, comparison: &Comparison, places: &[usize]) -> Vec<Shift> {
        let shift = |(i, &place): (usize, &usize)| {
            let column = comparison.columns[place];
            let sd = self.covariance[(i, i)].max(0.0).sqrt() * column.unit();
            let of_both = comparison.information[(place, place)] > 0.0;
            (of_both && sd > 0.0).then(|| Shift {
                column,
                value: self.shift[i] * column.unit(),
                sd,
            })
        };
        places.iter().enumerate().filter_map(shift).collect()
    }
}
