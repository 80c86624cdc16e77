//! Counts of intervals that hold the truth, with a standard error that knows that one session's intervals stand together.

use std::collections::BTreeMap;

use super::quantities::Quantity;

/// Half the width of a 95 % interval over its standard deviation.
const INTERVAL: f64 = 1.959_964;
/// The 95 % point of χ² with three degrees of freedom.
const ELLIPSOID: f64 = 7.814_728;

/// Intervals of one session.
#[derive(Debug, Clone, Copy, Default)]
pub struct Count {
    inside: f64,
    all: f64,
    squares: f64,
}

impl Count {
    /// Counts intervals by their normalised errors.
    pub fn intervals(errors: &[f64]) -> Self {
        let inside = errors.iter().filter(|error| error.abs() <= INTERVAL);
        Self {
            inside: inside.count() as f64,
            all: errors.len() as f64,
            squares: errors.iter().map(|error| error * error).sum(),
        }
    }

    /// Counts ellipsoids in space by their squared Mahalanobis distances.
    pub fn ellipsoids(squares: &[f64]) -> Self {
        let inside = squares.iter().filter(|square| **square <= ELLIPSOID);
        Self {
            inside: inside.count() as f64,
            all: squares.len() as f64,
            squares: squares.iter().sum::<f64>() / 3.0,
        }
    }
}

/// Counts of every quantity, session by session.
#[derive(Debug, Clone, Default)]
pub struct Tally(BTreeMap<Quantity, Vec<Count>>);

/// The share of intervals that hold the truth.
#[derive(Debug, Clone, Copy)]
pub struct Share {
    /// Over all sessions.
    pub inside: f64,
    /// Its standard error, by how sessions differ.
    pub error: f64,
    /// Mean squared normalised error: 1 where the standard deviations are right.
    pub mean_square: f64,
    /// Intervals.
    pub intervals: f64,
}

impl Tally {
    /// One session's intervals of a quantity.
    pub fn add(&mut self, quantity: Quantity, count: Count) {
        self.0.entry(quantity).or_default().push(count);
    }

    /// All sessions of several tallies.
    pub fn of<'t>(tallies: impl IntoIterator<Item = &'t Self>) -> Self {
        let mut sum = Self::default();
        for (quantity, counts) in tallies.into_iter().flat_map(|tally| &tally.0) {
            sum.0.entry(*quantity).or_default().extend(counts);
        }
        sum
    }

    /// The ratio estimate over sessions and its standard error (Cochran, Sampling Techniques, 6.4).
    pub fn share(&self, quantity: Quantity) -> Share {
        let counts = &self.0[&quantity];
        let sum = |of: fn(&Count) -> f64| counts.iter().map(of).sum::<f64>();
        let (inside, all, squares) = (sum(|c| c.inside), sum(|c| c.all), sum(|c| c.squares));
        let share = inside / all;
        let off = |c: &Count| (c.inside - share * c.all).powi(2);
        Share {
            inside: share,
            error: counts.iter().map(off).sum::<f64>().sqrt() / all,
            mean_square: squares / all,
            intervals: all,
        }
    }
}
