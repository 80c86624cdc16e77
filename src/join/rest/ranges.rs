//! How much each column moves within a window, for every window of a piece of the samples.

/// Buffers that are kept from one piece to the next.
#[derive(Debug, Clone, Default)]
pub struct Ranges {
    largest: Vec<f64>,
    smallest: Vec<f64>,
    /// One per window: the largest range of a column so far.
    pub of_windows: Vec<f64>,
}

impl Ranges {
    /// Begins with so many windows in which nothing moves.
    pub fn begin(&mut self, windows: usize) {
        self.of_windows.clear();
        self.of_windows.resize(windows, 0.0);
    }

    /// Raises the windows' ranges to those of `column` over `samples` samples each, if these are larger. Its first and
    /// last value are `ends` of the whole column (which stay as they are), or only there for the median of their
    /// neighbours.
    pub fn widen(&mut self, column: &[f64], samples: usize, ends: (bool, bool)) {
        median_of_three(column, ends, &mut self.largest);
        self.smallest.clone_from(&self.largest);
        over_windows(&mut self.largest, samples, |a, b| if a > b { a } else { b });
        over_windows(
            &mut self.smallest,
            samples,
            |a, b| if a < b { a } else { b },
        );
        let ranges = self.largest.iter().zip(&self.smallest);
        for (widest, (largest, smallest)) in self.of_windows.iter_mut().zip(ranges) {
            let range = largest - smallest;
            *widest = if range > *widest { range } else { *widest };
        }
    }

    /// Windows that reach across a break in time hold no rest.
    pub fn break_at(&mut self, sample_before: usize, samples: usize) {
        let end = (sample_before + 1).min(self.of_windows.len());
        let first = (sample_before + 2).saturating_sub(samples).min(end);
        self.of_windows[first..end].fill(f64::INFINITY);
    }
}

fn median_of_three(column: &[f64], (is_first, is_last): (bool, bool), smooth: &mut Vec<f64>) {
    smooth.clear();
    if is_first {
        smooth.extend(column.first());
    }
    smooth.extend(column.windows(3).map(|around| {
        let (a, b, c) = (around[0], around[1], around[2]);
        a.min(b).max(a.max(b).min(c))
    }));
    if is_last && (column.len() > 1 || !is_first) {
        smooth.extend(column.last());
    }
}

/// Makes each value that of the window of so many values that begins there, by doubling the windows.
fn over_windows(values: &mut [f64], samples: usize, pick: impl Fn(f64, f64) -> f64) {
    let mut covered = 1;
    while covered < samples {
        let step = covered.min(samples - covered);
        for at in 0..values.len().saturating_sub(step) {
            values[at] = pick(values[at], values[at + step]);
        }
        covered += step;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_over_windows_and_across_a_break() {
        let mut ranges = Ranges::default();
        ranges.begin(4);
        // The median of three makes 1 1 2 2 2 2 of it: the spike of 9 goes.
        ranges.widen(&[1.0, 1.0, 9.0, 2.0, 2.0, 2.0], 3, (true, true));
        assert_eq!(ranges.of_windows, [1.0, 1.0, 0.0, 0.0]);
        ranges.widen(&[0.0; 6], 3, (true, true));
        assert_eq!(ranges.of_windows, [1.0, 1.0, 0.0, 0.0]);
        // A break between samples 3 and 4 lies in the windows that begin at 2 and 3.
        ranges.break_at(3, 3);
        assert_eq!(ranges.of_windows[..2], [1.0, 1.0]);
        assert!(
            ranges.of_windows[2..]
                .iter()
                .all(|range| range.is_infinite())
        );
    }

    #[test]
    fn a_piece_gives_the_windows_of_the_whole() {
        let column: Vec<f64> = (0..100).map(|k| (f64::from(k) * 0.7).sin()).collect();
        let (mut whole, mut piece) = (Ranges::default(), Ranges::default());
        whole.begin(94);
        whole.widen(&column, 7, (true, true));
        // Samples 29 to 70: windows 30 to 63.
        piece.begin(34);
        piece.widen(&column[29..=70], 7, (false, false));
        assert_eq!(piece.of_windows, whole.of_windows[30..64]);
    }
}
