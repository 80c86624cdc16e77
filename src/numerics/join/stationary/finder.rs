//! Samples in order of time, piece by piece → the stationary stretches.
//!
//! 1. The first [`OPENING`] samples are gathered: their median interval is the usual one and gives the samples of a window.
//! 2. From then on windows are judged as soon as their samples have come ([`Levels`]), and the samples are evicted.
//! 3. At the end the threshold is chosen, and its stretches are the result.

use super::levels::{Levels, Samples};
use super::pairs;
use super::plateau::Ladder;
use super::quantum::Quanta;
use super::ranges::Ranges;
use super::sums::Sums;
use super::{Stationary, StationaryRule};
use crate::units::{NS_PER_S, round_ns};

/// Number of samples from which the usual interval is found, and the longest window: a longer one would mean a broken clock.
const OPENING: usize = 1 << 16;
const PIECE: usize = 2048;
/// The least number of samples in which stationary is distinguished from motion.
const MIN_WINDOW_SAMPLES: usize = 3;

#[derive(Debug, Clone)]
pub struct Finder {
    rule: StationaryRule,
    ladder: Ladder,
    /// The values of the samples that are still needed, sample after sample.
    values: Vec<f64>,
    samples: Samples,
    quanta: Quanta,
    ranges: Ranges,
    /// Radians that one unit of each column counts as; empty where all columns count alike.
    counted: Vec<f64>,
    pace: Option<Pace>,
    first_ns: i64,
}

/// The state that depends on the usual interval.
#[derive(Debug, Clone)]
struct Pace {
    interval_ns: i64,
    gap_ns: i64,
    window: usize,
    levels: Levels,
    /// The first sample of the next window.
    next: usize,
    /// The largest motion in a window so far.
    top: f64,
}

/// The threshold was found too late: its stretches were dropped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Forgotten {
    pub threshold: f64,
}

impl Finder {
    pub fn new(columns: usize, rule: &StationaryRule) -> Self {
        Self {
            rule: *rule,
            ladder: Ladder::from(rule.floor),
            values: Vec::new(),
            samples: Samples {
                sums: vec![Sums::default(); pairs::count(columns)],
                columns,
                ..Samples::default()
            },
            quanta: Quanta::of(columns),
            ranges: Ranges::default(),
            counted: Vec::new(),
            pace: None,
            first_ns: 0,
        }
    }

    /// Drops all samples so far, before they are replayed.
    pub fn restart(&mut self) {
        let counted = std::mem::take(&mut self.counted);
        *self = Self::new(self.samples.columns, &self.rule);
        self.counted = counted;
    }

    /// States what one unit of each column counts as, for columns of different units; before any sample. Motions and thresholds
    /// are in the unit that they count as, means in each column's own.
    pub fn count_as(&mut self, counted: Vec<f64>) {
        self.counted = counted;
    }

    /// Takes the next samples: stamps that do not decrease, and the first sample's values, then the second's.
    pub fn push(&mut self, stamps_ns: &[i64], values: &[f64]) {
        if self.samples.first == 0 && self.samples.stamps_ns.is_empty() {
            self.first_ns = stamps_ns.first().copied().unwrap_or(0);
        }
        let values = values.chunks(PIECE * self.samples.columns.max(1));
        for (stamps_ns, values) in stamps_ns.chunks(PIECE).zip(values) {
            self.push_piece(stamps_ns, values);
        }
    }

    fn push_piece(&mut self, stamps_ns: &[i64], values: &[f64]) {
        self.samples.stamps_ns.extend_from_slice(stamps_ns);
        self.values.extend_from_slice(values);
        for (pair, sums) in self.samples.sums.iter_mut().enumerate() {
            sums.push(pairs::of(values, self.samples.columns, pair));
        }
        self.quanta.push(values);
        let held = self.samples.stamps_ns.len();
        if self.pace.is_none() && held >= OPENING {
            self.set_pace(OPENING);
        }
        if let Some(pace) = &self.pace
            && held >= 2 * pace.window + PIECE
        {
            self.judge(false);
        }
    }

    pub fn finish(mut self) -> Result<Stationary, Forgotten> {
        let held = self.samples.stamps_ns.len();
        let samples = self.samples.first + held;
        if self.pace.is_none() {
            self.set_pace(held.max(1));
        }
        if held > 0 {
            self.judge(true);
        }
        let threshold = self.threshold();
        let pace = self.pace.as_mut().expect("set above");
        Ok(Stationary {
            stretches: pace.levels.take(threshold).ok_or(Forgotten { threshold })?,
            threshold,
            interval_ns: pace.interval_ns,
            samples,
            columns: self.samples.columns,
            span_ns: (self.first_ns, self.samples.stamps_ns.last().copied().unwrap_or(0)),
        })
    }

    fn threshold(&self) -> f64 {
        let pace = self.pace.as_ref().expect("set before anything is judged");
        self.rule.threshold.unwrap_or_else(|| {
            let count = |rung| pace.levels.lengths(self.ladder.rungs()[rung]).count();
            self.ladder.choose(self.quanta.largest(&self.counted), pace.top, count)
        })
    }

    fn set_pace(&mut self, most_window: usize) {
        let stamps_ns = &self.samples.stamps_ns;
        let interval_ns = usual_interval_ns(&stamps_ns[..stamps_ns.len().min(OPENING)]);
        let window = window_samples(self.rule.window_s, interval_ns).min(most_window);
        let given = self.rule.threshold.map(|threshold| vec![threshold]);
        let thresholds = given.unwrap_or_else(|| self.ladder.thresholds());
        let min_stretch_ns = round_ns(self.rule.min_stretch_s * NS_PER_S);
        self.pace = Some(Pace {
            interval_ns,
            gap_ns: round_ns(self.rule.gap_s * NS_PER_S).max(interval_ns.saturating_mul(5)),
            window,
            levels: Levels::new(thresholds, window, min_stretch_ns),
            next: 0,
            top: 0.0,
        });
    }

    /// Judges all windows whose samples have come, and evicts samples that no later window needs.
    fn judge(&mut self, is_last: bool) {
        let pace = self.pace.as_mut().expect("set before");
        let samples = &self.samples;
        let (first, held) = (samples.first, samples.stamps_ns.len());
        // The last sample's neighbour has not come yet.
        let end = (first + held - usize::from(!is_last) + 1).saturating_sub(pace.window);
        self.ranges.begin(end.saturating_sub(pace.next));
        for pair in 0..samples.sums.len() {
            let values = pairs::of(&self.values, samples.columns, pair);
            let ends = (pace.next == 0, is_last);
            if self.counted.is_empty() {
                self.ranges.widen(values, pace.window, ends);
            } else {
                let [a, b] = pairs::places(samples.columns, pair).map(|place| self.counted[place]);
                let values = values.map(|value| [a * value[0], b * value[1]]);
                self.ranges.widen(values, pace.window, ends);
            }
        }
        pace.mark_breaks(samples, &mut self.ranges);
        let ranges = &self.ranges.of_windows;
        pace.levels.windows(pace.next, ranges, samples);
        for &range in ranges {
            if range > pace.top && range.is_finite() {
                pace.top = range;
            }
        }
        pace.next = end.max(pace.next);
        if is_last {
            pace.levels.finish(first + held - 1, samples);
        } else {
            self.let_go();
        }
    }

    fn let_go(&mut self) {
        let pace = self.pace.as_mut().expect("set before");
        // A window's first sample is smoothed by the one before it.
        let done = pace.next.saturating_sub(1) - self.samples.first;
        self.values.drain(..done * self.samples.columns);
        self.samples.stamps_ns.drain(..done);
        for sums in &mut self.samples.sums {
            sums.drop_front(done);
        }
        self.samples.first += done;
        if pace.levels.are_too_many() {
            let threshold = self.threshold();
            self.pace.as_mut().expect("set before").levels.forget_all_but(threshold);
        }
    }
}

impl Pace {
    /// Marks the windows across a break between two samples as not stationary.
    fn mark_breaks(&self, samples: &Samples, ranges: &mut Ranges) {
        let gap_ns = self.gap_ns.unsigned_abs();
        for (place, pair) in samples.stamps_ns.windows(2).enumerate() {
            // The sample before the first window is kept too.
            if pair[1].abs_diff(pair[0]) > gap_ns
                && let Some(before) = (samples.first + place).checked_sub(self.next)
            {
                ranges.break_at(before, self.window);
            }
        }
    }
}

/// The median interval between samples, ns; at least one.
fn usual_interval_ns(stamps_ns: &[i64]) -> i64 {
    let mut steps: Vec<i64> =
        stamps_ns.windows(2).map(|pair| pair[1].saturating_sub(pair[0])).collect();
    if steps.is_empty() {
        return 1;
    }
    let middle = steps.len() / 2;
    (*steps.select_nth_unstable(middle).1).max(1)
}

fn window_samples(window_s: f64, interval_ns: i64) -> usize {
    let intervals = (window_s * NS_PER_S / interval_ns as f64).round();
    let intervals = usize::try_from(round_ns(intervals)).map_or(0, |count| count.min(OPENING));
    (intervals + 1).max(MIN_WINDOW_SAMPLES)
}
