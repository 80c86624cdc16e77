//! The step between neighbouring values of a quantised column, found while its values are processed.

use super::pairs::larger;

/// Steps up to this many quanta show whether a column is quantised; at least this number of them is needed.
const QUANTA: f64 = 20.0;
const MIN_QUANTISED_STEPS: usize = 8;
/// Number of samples checked together: most steps are not small.
const TOGETHER: usize = 16;
/// A step below this share of the least one so far is a smaller quantum, not its rounding.
const SMALLER: f64 = 0.99;

#[derive(Debug, Clone)]
pub struct Quanta {
    of_columns: Vec<Steps>,
    before: Vec<f64>,
}

/// The steps of one column, since the first of the smallest ones.
#[derive(Debug, Clone)]
struct Steps {
    least: f64,
    /// Numbers of steps of a few quanta, and of those that are whole quanta.
    small: usize,
    whole: usize,
}

impl Default for Steps {
    fn default() -> Self {
        Self { least: f64::INFINITY, small: 0, whole: 0 }
    }
}

impl Quanta {
    /// No steps yet, of `columns` columns.
    pub fn of(columns: usize) -> Self {
        Self { of_columns: vec![Steps::default(); columns], before: Vec::new() }
    }

    pub fn push(&mut self, values: &[f64]) {
        let columns = self.of_columns.len();
        let Some((first, later)) = values.split_at_checked(columns) else { return };
        let before = std::mem::take(&mut self.before);
        self.steps(&before, first);
        let before = values.chunks(columns * TOGETHER);
        for (before, after) in before.zip(later.chunks(columns * TOGETHER)) {
            let before = &before[..after.len()];
            if self.some_are_small(before, after) {
                self.steps(before, after);
            }
        }
        self.before.extend(&values[values.len() - columns..]);
    }

    /// Whether any step may be a small one of its column.
    fn some_are_small(&self, before: &[f64], after: &[f64]) -> bool {
        let reach = self.of_columns.iter().map(Steps::reach).fold(0.0, larger);
        let steps = before.iter().zip(after);
        // Without a branch for each.
        let small = steps.fold(0, |small, (before, after)| {
            let step = (after - before).abs();
            small | u64::from(step < reach && step > 0.0)
        });
        small > 0
    }

    /// Adds the steps from one sample's values to the next sample's.
    fn steps(&mut self, before: &[f64], after: &[f64]) {
        let columns = self.of_columns.len();
        for (before, after) in before.chunks_exact(columns).zip(after.chunks_exact(columns)) {
            let values = before.iter().zip(after);
            for (steps, (before, after)) in self.of_columns.iter_mut().zip(values) {
                steps.step((after - before).abs());
            }
        }
    }

    /// The largest quantum; 0 where no column is quantised. `counted` is what one unit of each column counts as; empty where all
    /// columns count alike.
    pub fn largest(&self, counted: &[f64]) -> f64 {
        let counted = counted.iter().copied().chain(std::iter::repeat(1.0));
        let quanta = self.of_columns.iter().zip(counted);
        quanta.fold(0.0, |largest, (steps, counted)| largest.max(counted * steps.quantum()))
    }
}

impl Steps {
    /// Steps below this count.
    fn reach(&self) -> f64 {
        QUANTA * self.least
    }

    fn step(&mut self, step: f64) {
        if step < self.reach() && step > 0.0 {
            self.small_step(step);
        }
    }

    fn small_step(&mut self, step: f64) {
        if step < SMALLER * self.least {
            (self.least, self.small, self.whole) = (step, 0, 0);
        }
        let quanta = step / self.least;
        self.small += 1;
        self.whole += usize::from((quanta - quanta.round()).abs() < 0.05);
    }

    /// The quantum; 0 where values are not quantised.
    fn quantum(&self) -> f64 {
        let quantised = self.small >= MIN_QUANTISED_STEPS && self.whole * 50 >= self.small * 49;
        if quantised { self.least } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quantum(column: &[f64]) -> f64 {
        let mut quanta = Quanta::of(1);
        column.chunks(5).for_each(|values| quanta.push(values));
        quanta.largest(&[])
    }

    #[test]
    fn a_quantised_column_shows_its_quantum() {
        let counts = [0, 0, 1, 0, 2, 2, 3, 1, 0, 1, 4, 4, 0, 1];
        let quantised: Vec<f64> = counts.map(|count| f64::from(count) * 1.75e-4).to_vec();
        assert!((quantum(&quantised) - 1.75e-4).abs() < 1e-12);
        let free: Vec<f64> = (0..40).map(|k| (f64::from(k) * 1.7).sin()).collect();
        assert!(quantum(&free).abs() < 1e-12);
    }

    #[test]
    fn each_column_has_its_own() {
        let fine = [0.0, 1.0, 1.0, 2.0, 0.0, 1.0, 3.0, 2.0, 1.0, 2.0, 2.0, 1.0];
        let mut quanta = Quanta::of(2);
        for fine in fine {
            quanta.push(&[fine * 1e-5, 7.0 + 1e-3 * (2.0 - fine)]);
        }
        assert!((quanta.largest(&[]) - 1e-3).abs() < 1e-9);
        assert!((quanta.of_columns[0].quantum() - 1e-5).abs() < 1e-12);
    }

    #[test]
    fn steps_seen_before_the_smallest_do_not_count() {
        // Moves by 7 quanta, then flicker by one: 7/1 is whole, but they were taken for the quantum.
        let counts = [0, 7, 14, 21, 14, 15, 14, 15, 16, 15, 14, 13, 12];
        let quantised: Vec<f64> = counts.map(|count| f64::from(count) * 1e-3).to_vec();
        assert!((quantum(&quantised) - 1e-3).abs() < 1e-9);
        assert!(quantum(&quantised[..8]).abs() < 1e-9); // three steps of one are too few
    }
}
