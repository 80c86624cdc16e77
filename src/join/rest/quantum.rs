//! The step between neighbouring values of a quantised column, found while its values come by.

/// Steps up to this many quanta tell whether a column is quantised; at least so many of them are needed.
const QUANTA: f64 = 20.0;
const MIN_QUANTISED_STEPS: usize = 8;
/// A step this much smaller than the least one so far is another quantum, not its rounding.
const SMALLER: f64 = 0.99;

/// What the steps of one column look like, from the first of the smallest ones on.
#[derive(Debug, Clone)]
pub struct Steps {
    before: Option<f64>,
    least: f64,
    /// Steps of a few quanta, and those of them that are whole ones.
    small: usize,
    whole: usize,
}

impl Default for Steps {
    fn default() -> Self {
        Self {
            before: None,
            least: f64::INFINITY,
            small: 0,
            whole: 0,
        }
    }
}

impl Steps {
    /// Takes the column's next values in.
    pub fn push(&mut self, values: &[f64]) {
        let Some(&first) = values.first() else {
            return;
        };
        let mut before = self.before.unwrap_or(first);
        let mut reach = QUANTA * self.least;
        for &value in values {
            let step = (value - before).abs();
            before = value;
            if step < reach && step > 0.0 {
                self.small_step(step);
                reach = QUANTA * self.least;
            }
        }
        self.before = Some(before);
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
    pub fn quantum(&self) -> f64 {
        let quantised = self.small >= MIN_QUANTISED_STEPS && self.whole * 50 >= self.small * 49;
        if quantised { self.least } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quantum(column: &[f64]) -> f64 {
        let mut steps = Steps::default();
        column.chunks(5).for_each(|values| steps.push(values));
        steps.quantum()
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
    fn steps_seen_before_the_smallest_do_not_count() {
        // Moves by 7 quanta, then flicker by one: 7/1 is whole, but they were taken for the quantum.
        let counts = [0, 7, 14, 21, 14, 15, 14, 15, 16, 15, 14, 13, 12];
        let quantised: Vec<f64> = counts.map(|count| f64::from(count) * 1e-3).to_vec();
        assert!((quantum(&quantised) - 1e-3).abs() < 1e-9);
        assert!(quantum(&quantised[..8]).abs() < 1e-9); // three steps of one are too few
    }
}
