//! Stretches at rest: columns sampled over time → runs of samples in which no column moves.
//!
//! The same rule serves joint angles and target positions, at any rate and any noise:
//! 1. a median of three takes single spikes out (for finding rest only, never for a mean);
//! 2. the range (largest − smallest) of each column over a short window; the largest over the columns says how much
//!    moves in that window;
//! 3. a window is still when that is within the threshold; overlapping still windows are one stretch;
//! 4. the threshold, where none is given, is read from the samples: over a ladder of thresholds the number of
//!    stretches is erratic inside the noise, then stays put over a wide plateau, then falls as moves are swallowed.
//!    (Below the flicker of a quantised column the number stays put too: the ladder begins above it.)
//!    The threshold is six times the start of the lowest good plateau, or its middle where that is lower.

use std::collections::VecDeque;

use super::pattern::MIN_PAIRS;
use crate::units::{NS_PER_S, round_ns};

/// Ratio of neighbouring thresholds on the ladder.
const LADDER_RATIO: f64 = 1.5;
/// Stretch counts within this share of each other belong to one plateau: some tiny moves may drown.
const PLATEAU_TOLERANCE: f64 = 0.02;
/// A plateau this many rungs wide (a factor of 3.4) is no accident.
const PLATEAU_RUNGS: usize = 4;
/// The ladder ends this far above the largest motion: where samples were taken only at rest, breaks in time alone end
/// the stretches, and that is a plateau too.
const ABOVE_ALL: f64 = 10.0;
/// How far above its start the threshold stands in a wide plateau.
const ABOVE_PLATEAU_START: f64 = 6.0;
/// A quantised value at rest flickers between neighbours, and noise may reach one further.
const FLICKER: f64 = 2.5;
/// Steps up to this many quanta tell whether a column is quantised; at least so many of them are needed.
const QUANTA: f64 = 20.0;
const MIN_QUANTISED_STEPS: usize = 8;
/// The least samples in which rest can be told from motion.
const MIN_WINDOW_SAMPLES: usize = 3;

/// What counts as rest.
#[derive(Debug, Clone, Copy)]
pub struct RestRule {
    /// Length of the window in which nothing may move, s (never fewer than three samples).
    pub window_s: f64,
    /// A longer break between samples ends a stretch, s (never less than five usual sample intervals).
    pub gap_s: f64,
    /// The least duration of a stretch, s.
    pub min_stretch_s: f64,
    /// The threshold in the columns' unit, where it is given.
    pub threshold: Option<f64>,
    /// Below this the ladder does not look, in the columns' unit.
    pub floor: f64,
}

/// A run of samples at rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stretch {
    /// Index of the first sample.
    pub first: usize,
    /// Index of the last sample.
    pub last: usize,
}

/// Where the samples rest, and by which threshold.
#[derive(Debug, Clone, PartialEq)]
pub struct Rest {
    /// In time order; they do not overlap.
    pub stretches: Vec<Stretch>,
    /// In the columns' unit.
    pub threshold: f64,
    /// The usual interval between samples, ns.
    pub interval_ns: i64,
    /// A longer break between samples ends a stretch, ns.
    pub gap_ns: i64,
}

/// The stretches at rest of `columns` (each as long as `stamps_ns`, which do not decrease).
pub fn at_rest(stamps_ns: &[i64], columns: &[Vec<f64>], rule: &RestRule) -> Rest {
    let interval_ns = usual_interval_ns(stamps_ns);
    let windows = Windows::new(stamps_ns, columns, interval_ns, rule);
    let threshold = rule.threshold.unwrap_or_else(|| {
        let quantum = columns
            .iter()
            .map(|column| quantum(column))
            .fold(0.0, f64::max);
        windows.plateau_threshold(rule.floor.max(FLICKER * quantum))
    });
    Rest {
        stretches: windows.stretches(threshold),
        threshold,
        interval_ns,
        gap_ns: windows.gap_ns,
    }
}

/// The median interval between samples, ns; at least one.
fn usual_interval_ns(stamps_ns: &[i64]) -> i64 {
    let mut steps: Vec<i64> = stamps_ns
        .windows(2)
        .map(|pair| pair[1].saturating_sub(pair[0]))
        .collect();
    if steps.is_empty() {
        return 1;
    }
    let middle = steps.len() / 2;
    (*steps.select_nth_unstable(middle).1).max(1)
}

/// How much moves in the window that starts at each sample.
struct Windows<'a> {
    stamps_ns: &'a [i64],
    samples: usize,
    gap_ns: i64,
    min_stretch_ns: i64,
    /// One per window: the largest range of a column, infinite across a break in time.
    ranges: Vec<f64>,
}

impl<'a> Windows<'a> {
    fn new(stamps_ns: &'a [i64], columns: &[Vec<f64>], interval_ns: i64, rule: &RestRule) -> Self {
        let samples = window_samples(rule.window_s, interval_ns).min(stamps_ns.len().max(1));
        let gap_ns = round_ns(rule.gap_s * NS_PER_S).max(interval_ns.saturating_mul(5));
        let mut ranges = vec![0.0_f64; (stamps_ns.len() + 1).saturating_sub(samples)];
        for column in columns {
            widen_by_ranges(&mut ranges, &median_of_three(column), samples);
        }
        for (index, pair) in stamps_ns.windows(2).enumerate() {
            if pair[1].saturating_sub(pair[0]) > gap_ns {
                let first = (index + 2).saturating_sub(samples);
                let end = (index + 1).min(ranges.len());
                ranges[first.min(end)..end].fill(f64::INFINITY);
            }
        }
        Self {
            stamps_ns,
            samples,
            gap_ns,
            min_stretch_ns: round_ns(rule.min_stretch_s * NS_PER_S),
            ranges,
        }
    }

    /// Calls `found` with each stretch whose windows are all within `threshold`.
    fn for_each_stretch(&self, threshold: f64, mut found: impl FnMut(Stretch)) {
        let mut open: Option<Stretch> = None;
        let mut close = |stretch: Option<Stretch>| {
            if let Some(s) = stretch {
                let lasted = self.stamps_ns[s.last].saturating_sub(self.stamps_ns[s.first]);
                if lasted >= self.min_stretch_ns {
                    found(s);
                }
            }
        };
        for (first, &range) in self.ranges.iter().enumerate() {
            if range > threshold {
                continue;
            }
            let last = first + self.samples - 1;
            match &mut open {
                Some(stretch) if first <= stretch.last => stretch.last = last,
                _ => close(open.replace(Stretch { first, last })),
            }
        }
        close(open);
    }

    fn stretches(&self, threshold: f64) -> Vec<Stretch> {
        let mut stretches = Vec::new();
        self.for_each_stretch(threshold, |stretch| stretches.push(stretch));
        stretches
    }

    /// How many stretches there are, without those shorter than half of the long ones (their 90 % quantile): turning
    /// points of moves look like rest for a moment.
    fn count(&self, threshold: f64) -> usize {
        let mut lengths: Vec<usize> = Vec::new();
        self.for_each_stretch(threshold, |stretch| {
            lengths.push(stretch.last - stretch.first);
        });
        if lengths.is_empty() {
            return 0;
        }
        let long = lengths.len() * 9 / 10;
        let long = *lengths.select_nth_unstable(long).1;
        lengths.iter().filter(|&&length| 2 * length >= long).count()
    }

    /// The threshold by a plateau of the number of stretches; `floor` where nothing ever moves.
    fn plateau_threshold(&self, floor: f64) -> f64 {
        let top = self
            .ranges
            .iter()
            .copied()
            .filter(|range| range.is_finite())
            .fold(floor, f64::max);
        let ladder: Vec<f64> =
            std::iter::successors(Some(floor), |threshold| Some(threshold * LADDER_RATIO))
                .take_while(|&threshold| threshold < ABOVE_ALL * top)
                .collect();
        let counts: Vec<usize> = ladder.iter().map(|&level| self.count(level)).collect();
        chosen_plateau(&counts).map_or(floor, |(first, last)| {
            let middle = (ladder[first] * ladder[last]).sqrt();
            middle.min(ladder[first] * ABOVE_PLATEAU_START)
        })
    }
}

/// The step between neighbouring values of a quantised column; 0 where values are not quantised.
fn quantum(column: &[f64]) -> f64 {
    let steps = || {
        column
            .windows(2)
            .map(|pair| (pair[1] - pair[0]).abs())
            .filter(|&step| step > 0.0)
    };
    let least = steps().fold(f64::INFINITY, f64::min);
    let (mut small, mut whole) = (0_usize, 0_usize);
    for quanta in steps()
        .map(|step| step / least)
        .filter(|&quanta| quanta < QUANTA)
    {
        small += 1;
        whole += usize::from((quanta - quanta.round()).abs() < 0.05);
    }
    let quantised = small >= MIN_QUANTISED_STEPS && whole * 50 >= small * 49;
    if quantised { least } else { 0.0 }
}

fn window_samples(window_s: f64, interval_ns: i64) -> usize {
    let intervals = (window_s * NS_PER_S / interval_ns as f64).round();
    // A window of more than a million samples means a broken clock, not a fast one.
    let intervals = usize::try_from(round_ns(intervals)).map_or(0, |count| count.min(1_000_000));
    (intervals + 1).max(MIN_WINDOW_SAMPLES)
}

/// First and last rung of the plateau to stand on: the lowest of those at least [`PLATEAU_RUNGS`] wide that have the
/// dwells of a session and half of those of the widest; otherwise the widest. Turning points of moves make plateaus of
/// their own above the right one, columns frozen for a while below it.
fn chosen_plateau(counts: &[usize]) -> Option<(usize, usize)> {
    let plateaus: Vec<(usize, usize)> = (0..counts.len())
        .filter(|&first| counts[first] >= 2)
        .map(|first| (first, plateau_end(counts, first)))
        .collect();
    let width = |&(first, last): &(usize, usize)| last - first;
    // `max_by_key` would take the last of equals; the lowest is the stricter one.
    let widest = plateaus.iter().rev().max_by_key(|plateau| width(plateau))?;
    let enough = (counts[widest.0] / 2).max(MIN_PAIRS);
    let good = |plateau: &&(usize, usize)| {
        width(plateau) + 1 >= PLATEAU_RUNGS && counts[plateau.0] >= enough
    };
    Some(*plateaus.iter().find(good).unwrap_or(widest))
}

/// The last rung from `first` on with like counts.
fn plateau_end(counts: &[usize], first: usize) -> usize {
    let allowed = (counts[first] as f64 * PLATEAU_TOLERANCE).max(1.0);
    let alike = |&&count: &&usize| count >= 2 && (count.abs_diff(counts[first]) as f64) <= allowed;
    first + counts[first..].iter().take_while(alike).count() - 1
}

fn median_of_three(column: &[f64]) -> Vec<f64> {
    let mut smooth = column.to_vec();
    for (middle, around) in smooth[..].iter_mut().skip(1).zip(column.windows(3)) {
        let (a, b, c) = (around[0], around[1], around[2]);
        *middle = a.min(b).max(a.max(b).min(c));
    }
    smooth
}

/// Raises each of `ranges` to the range of `column` over the window that starts there, if that is larger.
fn widen_by_ranges(ranges: &mut [f64], column: &[f64], samples: usize) {
    let (mut largest, mut smallest) = (VecDeque::new(), VecDeque::new());
    for (index, &value) in column.iter().enumerate() {
        while largest.back().is_some_and(|&(_, v)| v <= value) {
            largest.pop_back();
        }
        while smallest.back().is_some_and(|&(_, v)| v >= value) {
            smallest.pop_back();
        }
        largest.push_back((index, value));
        smallest.push_back((index, value));
        let Some(first) = (index + 1).checked_sub(samples) else {
            continue;
        };
        for extremes in [&mut largest, &mut smallest] {
            while extremes.front().is_some_and(|&(at, _)| at < first) {
                extremes.pop_front();
            }
        }
        ranges[first] = ranges[first].max(largest[0].1 - smallest[0].1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULE: RestRule = RestRule {
        window_s: 0.1,
        gap_s: 1.0,
        min_stretch_s: 0.0,
        threshold: None,
        floor: 1e-3,
    };

    /// Ten rests of 20 samples at 50 ms with noise of a hundredth, ten samples of motion by 1 between them.
    fn steps() -> (Vec<i64>, Vec<f64>) {
        let value = |k: i64| {
            let (rest, within) = (k / 30, k % 30);
            let moved = (within - 20).max(0) as f64 / 10.0;
            rest as f64 + moved + 0.01 * ((k * 7919) % 11 - 5) as f64 / 5.0
        };
        (
            (0..300).map(|k| k * 50_000_000).collect(),
            (0..300).map(value).collect(),
        )
    }

    #[test]
    fn the_plateau_separates_noise_from_motion() {
        let (stamps_ns, column) = steps();
        let rest = at_rest(&stamps_ns, &[column], &RULE);
        assert_eq!(rest.stretches.len(), 10);
        // Samples 30 to 50 rest: 20 still ones, and the first of the motion is no further than its start.
        assert_eq!(
            rest.stretches[1],
            Stretch {
                first: 30,
                last: 50
            }
        );
        assert_eq!(rest.interval_ns, 50_000_000);
        // Above the noise's range of 0.02, below three samples of motion, 0.2.
        assert!((0.02..0.2).contains(&rest.threshold), "{}", rest.threshold);
    }

    #[test]
    fn a_single_spike_does_not_end_a_stretch_and_a_break_in_time_does() {
        let (mut stamps_ns, mut column) = steps();
        column[40] += 0.5;
        stamps_ns[70..]
            .iter_mut()
            .for_each(|stamp| *stamp += 2_000_000_000);
        let rest = at_rest(&stamps_ns, &[column], &RULE);
        assert_eq!(
            rest.stretches[1],
            Stretch {
                first: 30,
                last: 50
            }
        );
        assert_eq!(
            rest.stretches[2],
            Stretch {
                first: 60,
                last: 69
            }
        );
        assert_eq!(
            rest.stretches[3],
            Stretch {
                first: 70,
                last: 80
            }
        );
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
    fn nothing_and_one_sample_have_no_plateau() {
        assert!(at_rest(&[], &[vec![], vec![]], &RULE).stretches.is_empty());
        let one = at_rest(&[5], &[vec![1.0]], &RULE);
        assert!((one.threshold - RULE.floor).abs() < 1e-12);
    }
}
