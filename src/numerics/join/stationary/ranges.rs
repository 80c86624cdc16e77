//! The motion within a window, for every window of a piece of the samples.
//!
//! The largest and the smallest value of a window are found by the method of van Herk and of Gil and Werman: samples are cut
//! into blocks as long as a window, and a window is the end of one block and the beginning of the next.

use super::pairs::{Pair, larger, largest, smallest, widest};

#[derive(Debug, Clone, Default)]
pub struct Ranges {
    smooth: Vec<Pair>,
    /// Largest and smallest value from each sample to the end of its block.
    to_block_end: Vec<(Pair, Pair)>,
    /// One per window: the largest range of a column so far.
    pub of_windows: Vec<f64>,
}

impl Ranges {
    /// Begins with `windows` windows without motion.
    pub fn begin(&mut self, windows: usize) {
        self.of_windows.clear();
        self.of_windows.resize(windows, 0.0);
    }

    /// Raises the windows' ranges to those of a pair of columns over `samples` samples each, if these are larger. The first
    /// and the last of `values` are `ends` of the whole columns (which stay as they are), or only there for the median
    /// of their neighbours.
    pub fn widen(
        &mut self,
        values: impl Iterator<Item = Pair>,
        samples: usize,
        ends: (bool, bool),
    ) {
        median_of_three(values, ends, &mut self.smooth);
        self.gather_block_ends(samples);
        let Some(range) = self.of_windows.first_mut() else { return };
        let (high, low) = self.to_block_end[0];
        *range = larger(*range, widest(high, low));
        for (block, values) in self.smooth.chunks(samples).enumerate().skip(1) {
            // The window that ends with the block's first value, and those after it.
            let first = (block - 1) * samples + 1;
            let to_block_end = &self.to_block_end[first..];
            let ranges = &mut self.of_windows[first..];
            let (mut high, mut low) = (values[0], values[0]);
            for ((&value, ends), range) in values.iter().zip(to_block_end).zip(ranges) {
                (high, low) = (largest(high, value), smallest(low, value));
                let window = widest(largest(ends.0, high), smallest(ends.1, low));
                *range = larger(*range, window);
            }
        }
    }

    fn gather_block_ends(&mut self, samples: usize) {
        self.to_block_end.resize(self.smooth.len(), Default::default());
        let ends = self.to_block_end.chunks_mut(samples);
        for (ends, block) in ends.zip(self.smooth.chunks(samples)) {
            let last = block[block.len() - 1];
            let (mut high, mut low) = (last, last);
            for (end, &value) in ends.iter_mut().zip(block).rev() {
                (high, low) = (largest(high, value), smallest(low, value));
                *end = (high, low);
            }
        }
    }

    /// Marks windows across a break in time as not stationary.
    pub(super) fn break_at(&mut self, sample_before: usize, samples: usize) {
        let end = (sample_before + 1).min(self.of_windows.len());
        let first = (sample_before + 2).saturating_sub(samples).min(end);
        self.of_windows[first..end].fill(f64::INFINITY);
    }
}

fn median_of_three(
    mut values: impl Iterator<Item = Pair>,
    (is_first, is_last): (bool, bool),
    smooth: &mut Vec<Pair>,
) {
    smooth.clear();
    let (Some(mut before), second) = (values.next(), values.next()) else { return };
    if is_first {
        smooth.push(before);
    }
    let Some(mut here) = second else {
        if is_last && !is_first {
            smooth.push(before);
        }
        return;
    };
    smooth.extend(values.map(|next| {
        let median = largest(smallest(before, here), smallest(largest(before, here), next));
        (before, here) = (here, next);
        median
    }));
    if is_last {
        smooth.push(here);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_over_windows_and_across_a_break() {
        let pairs = |values: [f64; 6]| values.into_iter().map(|value| [value, 0.1 * value]);
        let mut ranges = Ranges::default();
        ranges.begin(4);
        // The median of three gives 1 1 2 2 2 2: the spike of 9 is removed.
        ranges.widen(pairs([1.0, 1.0, 9.0, 2.0, 2.0, 2.0]), 3, (true, true));
        assert_eq!(ranges.of_windows, [1.0, 1.0, 0.0, 0.0]);
        ranges.widen(pairs([0.0; 6]), 3, (true, true));
        assert_eq!(ranges.of_windows, [1.0, 1.0, 0.0, 0.0]);
        // A break between samples 3 and 4 lies in the windows that begin at 2 and 3.
        ranges.break_at(3, 3);
        assert_eq!(ranges.of_windows[..2], [1.0, 1.0]);
        assert!(ranges.of_windows[2..].iter().all(|range| range.is_infinite()));
    }

    /// The ranges, computed for each window separately.
    fn one_by_one(smooth: &[f64], samples: usize) -> Vec<f64> {
        let range = |window: &[f64]| {
            let high = window.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            high - window.iter().copied().fold(f64::INFINITY, f64::min)
        };
        smooth.windows(samples).map(range).collect()
    }

    #[test]
    fn a_piece_gives_the_windows_of_the_whole() {
        // Slow enough that the median of each three values is the middle one.
        let column: Vec<f64> = (0..100).map(|k| (f64::from(k) * 0.01).sin()).collect();
        let pairs =
            |samples: std::ops::Range<usize>| column[samples].iter().map(|&value| [value; 2]);
        let (mut whole, mut piece) = (Ranges::default(), Ranges::default());
        for samples in [1, 2, 3, 7, 40, 100] {
            let windows = 101 - samples;
            whole.begin(windows);
            whole.widen(pairs(0..100), samples, (true, true));
            assert_eq!(whole.of_windows, one_by_one(&column, samples), "{samples}");
        }
        whole.begin(94);
        whole.widen(pairs(0..100), 7, (true, true));
        // Samples 29 to 70: windows 30 to 63.
        piece.begin(34);
        piece.widen(pairs(29..71), 7, (false, false));
        assert_eq!(piece.of_windows, whole.of_windows[30..64]);
    }
}
