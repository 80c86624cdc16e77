//! Nice ranges and ticks: steps of 1, 2 or 5 times a power of ten; on logarithmic axes 1, 2, 5 of each decade.

use crate::figures::extremes;

/// The position of values between the two ends of an axis, and its ticks.
#[derive(Debug, Clone, PartialEq)]
pub struct Scale {
    low: f64,
    high: f64,
    log: bool,
    pub ticks: Vec<Tick>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    pub value: f64,
    /// The value with as many decimals as the ticks of its axis need.
    pub label: String,
}

/// Approximate number of steps between the ticks of an axis.
const STEPS: f64 = 5.0;
/// Largest number of decades that have ticks at 1, 2 and 5.
const FEW_DECADES: i32 = 2;

impl Scale {
    /// Makes the scale end at `low` and `high` themselves, with the ticks between: for axes that need not end at a tick.
    #[must_use]
    pub(super) fn ending_at(mut self, low: f64, high: f64) -> Self {
        if low < high && !self.log {
            let slack = 1e-9 * (high - low);
            self.ticks.retain(|tick| (low - slack..=high + slack).contains(&tick.value));
            (self.low, self.high) = (low, high);
        }
        self
    }

    #[must_use]
    pub(super) fn in_whole_numbers(mut self) -> Self {
        self.ticks.retain(|tick| (tick.value - tick.value.round()).abs() < 1e-9);
        for tick in &mut self.ticks {
            tick.label = format!("{:.0}", tick.value);
        }
        self
    }

    /// A scale with a name at each of 1, 2, 3 and so on.
    pub fn of_names(names: &[String]) -> Self {
        let tick = |(place, name): (usize, &String)| Tick {
            value: place as f64 + 1.0,
            label: name.clone(),
        };
        Self {
            low: 0.4,
            high: names.len() as f64 + 0.6,
            log: false,
            ticks: names.iter().enumerate().map(tick).collect(),
        }
    }

    /// A scale over finite `values`, positive ones where it is logarithmic; `None` without any.
    pub fn over(values: impl Iterator<Item = f64>, log: bool) -> Option<Self> {
        let (low, high) = extremes(values)?;
        Some(if log { Self::logarithmic(low, high) } else { Self::linear(low, high) })
    }

    fn linear(low: f64, high: f64) -> Self {
        // A single value gets some room around it.
        let room = if high > low { 0.0 } else { 0.5 * high.abs().max(1.0) };
        let step = nice((high - low + 2.0 * room) / STEPS);
        let (first, last) = (((low - room) / step).floor(), ((high + room) / step).ceil());
        // Values that differ only in the last digit would have more ticks than numbers between them.
        let count = (last - first).clamp(1.0, 2.0 * STEPS);
        let digits = decimals(step);
        let tick = |place: f64| {
            let value = (first + place) * step + 0.0;
            let label = format!("{value:.digits$}");
            Tick { value, label }
        };
        let places = std::iter::successors(Some(0.0), |place| Some(place + 1.0));
        Self {
            low: first * step,
            high: last * step,
            log: false,
            ticks: places.take_while(|place| *place <= count).map(tick).collect(),
        }
    }

    fn logarithmic(low: f64, high: f64) -> Self {
        let (first, last) = (nice_below(low), nice(high));
        let (first, last) = if first < last { (first, last) } else { (first, first * 10.0) };
        let decades = exponent(last) - exponent(first);
        let factors: &[f64] = if decades <= FEW_DECADES { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let of_decade = |decade: i32| factors.iter().map(move |factor| factor * power(decade));
        let values = (exponent(first)..=exponent(last)).flat_map(of_decade);
        let inside = values.filter(|v| (first * 0.999..=last * 1.001).contains(v));
        let tick = |value| Tick { value, label: format!("{value:.0$}", decimals(value)) };
        Self { low: first, high: last, log: true, ticks: inside.map(tick).collect() }
    }

    pub fn share(&self, value: f64) -> f64 {
        let of = |v: f64| if self.log { v.ln() } else { v };
        (of(value) - of(self.low)) / (of(self.high) - of(self.low))
    }
}

/// The smallest of 1, 2, 5 times a power of ten that is not below `step`.
fn nice(step: f64) -> f64 {
    let decade = power(exponent(step));
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * decade >= step * (1.0 - 1e-9));
    factor.unwrap_or(10.0) * decade
}

/// The largest of 1, 2, 5 times a power of ten that is not above `value`.
pub(super) fn nice_below(value: f64) -> f64 {
    let decade = power(exponent(value));
    let factors = [5.0, 2.0].into_iter();
    let factor = factors.into_iter().find(|factor| factor * decade <= value * (1.0 + 1e-9));
    factor.unwrap_or(1.0) * decade
}

#[expect(clippy::cast_possible_truncation, reason = "between -324 and 308; the cast saturates")]
fn exponent(value: f64) -> i32 {
    // The logarithm of 1000 is a little below 3.
    (value.log10() + 1e-9).floor() as i32
}

/// Ten to a whole power, parsed from text, which is rounded best.
fn power(exponent: i32) -> f64 {
    format!("1e{exponent}").parse().expect("a power of ten is a number")
}

/// Number of decimals that a multiple of `step` needs, twelve at most.
fn decimals(step: f64) -> usize {
    usize::try_from(-exponent(step)).map_or(0, |digits| digits.min(12))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(values: &[f64], log: bool) -> Vec<String> {
        let scale = Scale::over(values.iter().copied(), log).expect("values");
        scale.ticks.into_iter().map(|tick| tick.label).collect()
    }

    #[test]
    fn ticks_are_round_numbers_around_the_values() {
        assert_eq!(labels(&[0.0, 0.47], false), ["0.0", "0.1", "0.2", "0.3", "0.4", "0.5"]);
        assert_eq!(labels(&[-170.0, 155.0], false), ["-200", "-100", "0", "100", "200"]);
        assert_eq!(labels(&[0.001, 3.0], true), ["0.001", "0.01", "0.1", "1"]);
        assert_eq!(labels(&[0.03, 0.4], true), ["0.02", "0.05", "0.1", "0.2", "0.5"]);
        // A single value, and values that differ in the last digit only.
        assert_eq!(labels(&[3.0], false).len(), 5);
        assert!(labels(&[1e15, 1e15 + 0.125], false).len() <= 11);
    }

    #[test]
    fn what_is_counted_has_whole_ticks() {
        // Steps of 0.2, of which the fifteenth is 3.0000000000000004.
        let scale = Scale::over([2.0, 3.0].into_iter(), false).expect("values");
        let whole = scale.ending_at(2.0, 3.0).in_whole_numbers();
        let labels: Vec<_> = whole.ticks.iter().map(|tick| &*tick.label).collect();
        assert_eq!(labels, ["2", "3"]);
    }

    #[test]
    fn shares_run_from_one_end_to_the_other() {
        let linear = Scale::over([0.0, 10.0].into_iter(), false).expect("values");
        assert!((linear.share(2.5) - 0.25).abs() < 1e-12);
        let log = Scale::over([0.01, 1.0].into_iter(), true).expect("values");
        assert!((log.share(0.1) - 0.5).abs() < 1e-12);
        assert!(Scale::over(std::iter::empty(), true).is_none());
        let tight = linear.ending_at(1.0, 9.0);
        assert_eq!((tight.share(9.0), tight.ticks.len()), (1.0, 4)); // 2, 4, 6, 8
    }
}
