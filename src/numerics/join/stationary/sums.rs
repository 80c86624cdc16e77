//! Sums of columns up to each sample, so exact that the mean of any stretch can be computed from two of them.

use super::pairs::{Pair, minus, plus};

/// The sums of a pair of columns up to each sample of a piece.
#[derive(Debug, Clone)]
pub struct Sums(Vec<Sum>);

/// The sums up to one sample, in two parts: the second is the rounding error of the first.
#[derive(Debug, Clone, Copy, Default)]
pub struct Sum {
    high: Pair,
    low: Pair,
}

impl Default for Sums {
    fn default() -> Self {
        Self(vec![Sum::default()])
    }
}

impl Sums {
    pub fn push(&mut self, values: impl Iterator<Item = Pair>) {
        let Sum { mut high, mut low } = self.0[self.0.len() - 1];
        self.0.extend(values.map(|value| {
            // Knuth's exact sum of two numbers.
            let sum = plus(high, value);
            let of_value = minus(sum, high);
            let left = plus(minus(high, minus(sum, of_value)), minus(value, of_value));
            (high, low) = (sum, plus(low, left));
            Sum { high, low }
        }));
    }

    /// Removes the sums up to the first `samples` samples.
    pub(super) fn drop_front(&mut self, samples: usize) {
        self.0.drain(..samples);
    }

    /// The sums of all values before the ones at `place`.
    pub fn before(&self, place: usize) -> Sum {
        self.0[place]
    }
}

/// The means of the `count` values between two sums.
pub fn means(from: &Sum, to: &Sum, count: usize) -> Pair {
    let mean = |k: usize| ((to.high[k] - from.high[k]) + (to.low[k] - from.low[k])) / count as f64;
    std::array::from_fn(mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_is_exact_after_a_million_other_values() {
        let mut sums = Sums::default();
        sums.push((0..1_000_000).map(|k| [(f64::from(k) * 0.37).sin(); 2]));
        let values = [0.1, 0.2, 0.3, 0.1, 0.1];
        sums.push(values.into_iter().map(|value| [value, -value]));
        let between = |from, to| means(&sums.before(from), &sums.before(to), to - from);
        let mean = between(1_000_000, 1_000_003);
        assert!((mean[0] - 0.2).abs() < 1e-16 && (mean[1] + 0.2).abs() < 1e-16);
        assert!((between(1_000_003, 1_000_005)[0] - 0.1).abs() < 1e-17);
        sums.drop_front(1_000_000);
        assert!((means(&sums.before(0), &sums.before(3), 3)[0] - 0.2).abs() < 1e-16);
    }
}
