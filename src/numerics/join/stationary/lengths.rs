//! The lengths of any number of stretches, stored as the count of each length.

use std::collections::BTreeMap;

/// Lengths below this are counted in a table.
const SHORT: usize = 4096;

#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Lengths {
    short: Vec<usize>,
    long: BTreeMap<usize, usize>,
}

impl Lengths {
    pub fn add(&mut self, length: usize) {
        if length >= SHORT {
            *self.long.entry(length).or_default() += 1;
            return;
        }
        if self.short.len() <= length {
            self.short.resize(length + 1, 0);
        }
        self.short[length] += 1;
    }

    /// Number of stretches not shorter than half of the long ones (their 90 % quantile). Turning points of
    /// moves look stationary for a moment.
    pub fn count(&self) -> usize {
        let all: usize = self.occurring().map(|(_, times)| times).sum();
        let mut before = 0;
        let quantile = self.occurring().find(|(_, times)| {
            before += times;
            before > all * 9 / 10
        });
        let Some((long, _)) = quantile else { return 0 };
        self.occurring().filter(|(length, _)| 2 * length >= long).map(|(_, times)| times).sum()
    }

    fn occurring(&self) -> impl Iterator<Item = (usize, usize)> {
        let short = self.short.iter().copied().enumerate();
        short.chain(self.long.iter().map(|(&length, &times)| (length, times)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(lengths: &[usize]) -> Lengths {
        let mut found = Lengths::default();
        for &length in lengths {
            found.add(length);
        }
        found
    }

    #[test]
    fn short_stretches_are_turning_points() {
        // The 90 % quantile of eleven is 40: 12 is shorter than half of it.
        assert_eq!(of(&[40, 40, 40, 40, 40, 12, 40, 40, 40, 40, 40]).count(), 10);
        assert_eq!(of(&[]).count(), 0);
        assert_eq!(of(&[7]).count(), 1);
    }

    #[test]
    fn the_count_is_that_of_the_sorted_lengths() {
        let mut lengths: Vec<usize> = (0..500).map(|i| i * 7919 % 10_007).collect();
        for kept in [499, 100, 11, 10, 9, 2] {
            lengths.truncate(kept);
            let found = of(&lengths).count();
            let mut sorted = lengths.clone();
            sorted.sort_unstable();
            let long = sorted[sorted.len() * 9 / 10];
            let expected = sorted.iter().filter(|&&length| 2 * length >= long);
            assert_eq!(found, expected.count());
        }
    }
}
