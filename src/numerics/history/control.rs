//! Control charts: one figure over the sessions → whether it stays within its ordinary level and spread.
//!
//! An exponentially weighted moving average (EWMA, weight 0.2) of self-starting scores: the n-th value is compared with mean
//! and standard deviation of the n − 1 before it, and Student's t made normal by its distribution function,
//! `Q_n = Φ⁻¹ F_{n−2}(√((n−1)/n) (x_n − x̄)/s)` (Hawkins 1987). Where sessions are independent and normal the scores are
//! independent standard normal, whatever level and spread are, so the run length of the average follows from its limit
//! alone. The limit is found by the Markov chain of Brook and Evans (1972).
//!
//! A robot has 30 charts at most: base and target with six components each, ten joints, eight accuracy figures. Each has a run
//! length of 30 000 sessions without a change, so all together alarm by chance in one of 1000 sessions at most. After an
//! alarm a chart restarts with the value that raised it.

use std::sync::LazyLock;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

use super::FALSE_ALARM;
use super::bits;

pub const WEIGHT: f64 = 0.2;
const CHARTS: usize = 30;
/// States of the Markov chain: the limit is good to a thousandth.
const STATES: usize = 81;
/// Scores are limited to this, to either side.
const LARGEST_SCORE: f64 = 30.0;

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Chart {
    count: usize,
    #[serde(with = "bits::number")]
    mean: f64,
    /// Sum of squared deviations from the mean.
    #[serde(with = "bits::number")]
    squares: f64,
    #[serde(with = "bits::number")]
    average: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Charted {
    pub name: String,
    #[serde(with = "bits::number")]
    pub value: f64,
    #[serde(with = "bits::optional")]
    pub sd: Option<f64>,
    /// The value's score; absent before the third value, or when all earlier values are equal.
    #[serde(with = "bits::optional")]
    pub score: Option<f64>,
    /// The moving average of the scores; absent when there is no score yet.
    #[serde(with = "bits::optional")]
    pub average: Option<f64>,
    #[serde(with = "bits::number")]
    pub limit: f64,
    /// Whether the value differs from the mean of those before it by less than counts.
    pub is_small: bool,
}

impl Charted {
    /// Whether the average is beyond its limit, and the value as far off as counts; `None` where there is no average yet.
    pub fn is_out(&self) -> Option<bool> {
        self.average.map(|average| average.abs() > self.limit && !self.is_small)
    }
}

impl Chart {
    /// Puts the next value on the chart; it counts where it is `least` or more from the mean of those before it.
    pub fn next(&mut self, name: &str, value: f64, sd: Option<f64>, least: f64) -> Charted {
        let score = self.score(value);
        if let Some(score) = score {
            self.average += WEIGHT * (score - self.average);
        }
        let charted = Charted {
            name: name.to_owned(),
            value,
            sd,
            score,
            average: score.map(|_| self.average),
            limit: limit(),
            is_small: (value - self.mean).abs() < least,
        };
        if charted.is_out() == Some(true) {
            *self = Self::default();
        }
        self.learn(value);
        charted
    }

    fn learn(&mut self, value: f64) {
        self.count += 1;
        let off = value - self.mean;
        self.mean += off / self.count as f64;
        self.squares += off * (value - self.mean);
    }

    fn score(&self, value: f64) -> Option<f64> {
        let before = self.count as f64;
        if self.count < 2 || self.squares <= 0.0 {
            return None;
        }
        let sd = (self.squares / (before - 1.0)).sqrt();
        let t = (before / (before + 1.0)).sqrt() * (value - self.mean) / sd;
        let law = StudentsT::new(0.0, 1.0, before - 1.0).ok()?;
        // Computed in the tail: near 1 the distribution function has lost its digits.
        let tail = law.cdf(-t.abs());
        let size = -Normal::standard().inverse_cdf(tail);
        Some(size.min(LARGEST_SCORE).copysign(t))
    }
}

pub fn limit() -> f64 {
    static LIMIT: LazyLock<f64> = LazyLock::new(|| limit_of(CHARTS as f64 / FALSE_ALARM));
    *LIMIT
}

/// The limit that gives a run length, by bisection.
fn limit_of(sessions: f64) -> f64 {
    let (mut low, mut high) = (0.5, 3.0);
    for _ in 0..40 {
        let middle = f64::midpoint(low, high);
        if run_length(middle) < sessions {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Mean number of sessions until the average, starting at zero, leaves ±`limit` without a change.
pub fn run_length(limit: f64) -> f64 {
    let normal = Normal::standard();
    let width = 2.0 * limit / STATES as f64;
    let middle = |state: usize| -limit + width * (state as f64 + 0.5);
    let below =
        |edge: f64, from: usize| normal.cdf((edge - (1.0 - WEIGHT) * middle(from)) / WEIGHT);
    let stays = DMatrix::from_fn(STATES, STATES, |from, to| {
        let share = below(middle(to) + 0.5 * width, from) - below(middle(to) - 0.5 * width, from);
        f64::from(from == to) - share
    });
    let lengths = stays.lu().solve(&DVector::from_element(STATES, 1.0));
    lengths.map_or(f64::INFINITY, |lengths| lengths[STATES / 2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_has_the_run_length_of_the_literature() {
        // Lucas and Saccucci 1990, table 3: weight 0.2, L = 2.860 gives 370; L = 2.962 gives 500.
        let of = |l: f64| run_length(l * (WEIGHT / (2.0 - WEIGHT)).sqrt());
        assert!((of(2.860) / 370.0 - 1.0).abs() < 0.03, "{}", of(2.860));
        assert!((of(2.962) / 500.0 - 1.0).abs() < 0.03, "{}", of(2.962));
        assert!((run_length(limit()) / 30_000.0 - 1.0).abs() < 1e-3);
    }

    #[test]
    fn a_step_is_out_and_the_chart_restarts_with_it() {
        let mut chart = Chart::default();
        let values = (0..20).map(|i| f64::from(i % 3)).chain([9.0; 6]);
        let out: Vec<bool> =
            values.map(|value| chart.next("x", value, None, 0.0).is_out() == Some(true)).collect();
        // Before the step no value is out; the second value after it raises one alarm, and the chart restarts from it.
        assert_eq!(out.iter().position(|out| *out), Some(21));
        assert_eq!(out.iter().filter(|out| **out).count(), 1, "{out:?}");
    }

    #[test]
    fn values_that_are_all_the_same_have_no_score() {
        let mut chart = Chart::default();
        for _ in 0..5 {
            assert_eq!(chart.next("x", 1.0, None, 0.0).is_out(), None);
        }
    }
}
