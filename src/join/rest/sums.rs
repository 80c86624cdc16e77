//! Sums of a column up to each sample, so exact that the mean of any stretch follows from two of them.

/// The sum up to each sample of a piece, in two parts: the second is what the first one's rounding leaves.
#[derive(Debug, Clone)]
pub struct Sums {
    high: Vec<f64>,
    low: Vec<f64>,
}

/// Sum up to one sample: high and low part.
pub type Sum = (f64, f64);

impl Default for Sums {
    /// Of no sample.
    fn default() -> Self {
        Self {
            high: vec![0.0],
            low: vec![0.0],
        }
    }
}

impl Sums {
    /// Adds the next values (Knuth's exact sum of two numbers).
    pub fn push(&mut self, values: &[f64]) {
        let (mut high, mut low) = (self.high[self.high.len() - 1], self.low[self.low.len() - 1]);
        self.high.reserve(values.len());
        self.low.reserve(values.len());
        for &value in values {
            let sum = high + value;
            let of_value = sum - high;
            low += (high - (sum - of_value)) + (value - of_value);
            high = sum;
            self.high.push(high);
            self.low.push(low);
        }
    }

    /// Forgets the sums up to the first samples.
    pub fn drop_front(&mut self, samples: usize) {
        self.high.drain(..samples);
        self.low.drain(..samples);
    }

    /// The sum of all values before the one at `place`.
    pub fn before(&self, place: usize) -> Sum {
        (self.high[place], self.low[place])
    }
}

/// The mean of the `count` values between two sums.
pub fn mean(from: Sum, to: Sum, count: usize) -> f64 {
    ((to.0 - from.0) + (to.1 - from.1)) / count as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_is_exact_behind_a_million_other_values() {
        let mut sums = Sums::default();
        let others: Vec<f64> = (0..1_000_000)
            .map(|k| (f64::from(k) * 0.37).sin())
            .collect();
        sums.push(&others);
        sums.push(&[0.1, 0.2, 0.3, 0.1, 0.1]);
        let between = |from, to| mean(sums.before(from), sums.before(to), to - from);
        assert!((between(1_000_000, 1_000_003) - 0.2).abs() < 1e-16);
        assert!((between(1_000_003, 1_000_005) - 0.1).abs() < 1e-17);
        sums.drop_front(1_000_000);
        assert!((mean(sums.before(0), sums.before(3), 3) - 0.2).abs() < 1e-16);
    }
}
