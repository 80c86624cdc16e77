//! Counts of intervals that hold the truth, with a standard error that knows that one session's intervals stand together.

use std::collections::BTreeMap;

/// Inside and in all, and the sum of squared normalised errors, session by session.
#[derive(Debug, Clone, Default)]
pub struct Tally(BTreeMap<&'static str, Vec<Count>>);

#[derive(Debug, Clone, Copy, Default)]
pub struct Count {
    inside: f64,
    all: f64,
    squares: f64,
}

impl Count {
    /// Counts normalised errors (one per interval).
    pub fn of(errors: impl IntoIterator<Item = f64>) -> Self {
        errors
            .into_iter()
            .fold(Self::default(), |count, error| Self {
                inside: count.inside + f64::from(u8::from(error.abs() <= 1.959_964)),
                all: count.all + 1.0,
                squares: count.squares + error * error,
            })
    }

    /// Counts squared Mahalanobis distances of three dimensions.
    pub fn of_ellipsoids(squares: impl IntoIterator<Item = f64>) -> Self {
        squares
            .into_iter()
            .fold(Self::default(), |count, square| Self {
                // The 95 % point of χ² with three degrees of freedom.
                inside: count.inside + f64::from(u8::from(square <= 7.814_728)),
                all: count.all + 1.0,
                squares: count.squares + square / 3.0,
            })
    }
}

/// Share inside over all sessions, its standard error over sessions, and the mean squared normalised error.
#[derive(Debug, Clone, Copy)]
pub struct Share {
    pub share: f64,
    pub error: f64,
    pub mean_square: f64,
    pub intervals: f64,
}

impl Tally {
    pub fn add(&mut self, quantity: &'static str, count: Count) {
        self.0.entry(quantity).or_default().push(count);
    }

    pub fn merge(&mut self, other: &Self) {
        for (quantity, counts) in &other.0 {
            self.0.entry(quantity).or_default().extend(counts);
        }
    }

    pub fn quantities(&self) -> impl Iterator<Item = &'static str> {
        self.0.keys().copied()
    }

    /// The ratio estimate over sessions and its standard error.
    pub fn share(&self, quantity: &str) -> Option<Share> {
        let counts = self.0.get(quantity)?;
        let sum = |of: fn(&Count) -> f64| counts.iter().map(of).sum::<f64>();
        let (inside, all, squares) = (sum(|c| c.inside), sum(|c| c.all), sum(|c| c.squares));
        if all == 0.0 {
            return None;
        }
        let share = inside / all;
        let off: f64 = counts
            .iter()
            .map(|c| (c.inside - share * c.all).powi(2))
            .sum();
        Some(Share {
            share,
            error: off.sqrt() / all,
            mean_square: squares / all,
            intervals: all,
        })
    }
}
