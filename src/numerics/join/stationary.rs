//! Stationary stretches: columns sampled over time → runs of samples in which no column moves.
//!
//! One rule serves joint angles and target positions, at any rate and any noise:
//! 1. a median of three removes single spikes (for finding stationary stretches only, never for a mean);
//! 2. the range (largest − smallest) of each column over a short window; the largest over the columns is the motion
//!    in that window (`ranges`);
//! 3. a window is stationary when that is within the threshold; overlapping stationary windows are one stretch (`levels`);
//! 4. the threshold, where none is given, is found from the samples: over a ladder of thresholds the number of
//!    stretches is erratic inside the noise, then constant over a wide plateau, then falls as dwells merge.
//!    (Below the flicker of a quantised column the number is constant too: the ladder begins above it, `quantum`.)
//!    The threshold is six times the start of the lowest good plateau, or its middle where that is lower; its start itself where that
//!    is where the ladder begins (`plateau`).
//!
//! Columns of different units (joints that turn and joints that slide) are compared in what a unit of each counts as
//! ([`Finder::count_as`]): a mm of sliding as a mrad.
//!
//! The samples are processed once, in order of time, and none is kept (`finder`): the stretches of every threshold that may
//! be chosen are found at the same time.

mod finder;
mod lengths;
mod levels;
mod pairs;
mod plateau;
mod quantum;
mod ranges;
mod sums;

pub use finder::{Finder, Forgotten};

#[derive(Debug, Clone, Copy)]
pub struct StationaryRule {
    /// Length of the window in which nothing may move, s (never fewer than three samples).
    pub window_s: f64,
    /// A longer break between samples ends a stretch, s (never less than five usual sample intervals).
    pub gap_s: f64,
    pub min_stretch_s: f64,
    /// The threshold in the columns' unit; `None` to find it from the samples.
    pub threshold: Option<f64>,
    /// The ladder's lowest threshold, in the columns' unit.
    pub floor: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stretch {
    pub first: usize,
    pub last: usize,
}

/// A stretch with the stamps and means of its samples.
#[derive(Debug, Clone, PartialEq)]
pub struct StationaryStretch {
    pub stretch: Stretch,
    pub start_ns: i64,
    pub end_ns: i64,
    /// The stamp of the sample before it, ns; `None` at the start of the log.
    pub before_ns: Option<i64>,
    /// The stamp of the sample after it, ns; `None` at the end of the log.
    pub after_ns: Option<i64>,
    pub means: Vec<f64>,
}

/// The stationary stretches of all samples, and the threshold used.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Stationary {
    /// The stretches in time order; they do not overlap.
    pub stretches: Vec<StationaryStretch>,
    pub threshold: f64,
    /// The usual interval between samples, ns.
    pub interval_ns: i64,
    pub samples: usize,
    pub columns: usize,
    /// The first and the last sample's stamp, ns; 0 without samples.
    pub span_ns: (i64, i64),
}

/// The stationary stretches of the samples that `replay` passes to a finder; it is called a second time where the threshold
/// is found too late. Also returns the result of the last replay.
pub fn stationary_of<T, E>(
    columns: usize,
    rule: &StationaryRule,
    mut replay: impl FnMut(&mut Finder) -> Result<T, E>,
) -> Result<(Stationary, T), E> {
    let mut find = |rule: &StationaryRule| {
        let mut finder = Finder::new(columns, rule);
        let replayed = replay(&mut finder)?;
        Ok((finder.finish(), replayed))
    };
    let threshold = match find(rule)? {
        (Ok(stationary), replayed) => return Ok((stationary, replayed)),
        (Err(Forgotten { threshold }), _) => Some(threshold),
    };
    let (stationary, replayed) = find(&StationaryRule { threshold, ..*rule })?;
    Ok((stationary.expect("with one threshold no stretch is dropped"), replayed))
}

#[cfg(test)]
pub(in crate::join) mod tests {
    use std::convert::Infallible;

    use super::*;

    /// The stationary stretches of `columns` columns: `values` are the first sample's, then the second's; stamps do not decrease.
    pub(in crate::join) fn find_stationary(
        stamps_ns: &[i64],
        values: &[f64],
        columns: usize,
        rule: &StationaryRule,
    ) -> Stationary {
        let found = stationary_of(columns, rule, |finder| {
            finder.push(stamps_ns, values);
            Ok::<_, Infallible>(())
        });
        let (stationary, ()) = found.unwrap_or_else(|never| match never {});
        stationary
    }

    const RULE: StationaryRule = StationaryRule {
        window_s: 0.1,
        gap_s: 1.0,
        min_stretch_s: 0.0,
        threshold: None,
        floor: 1e-3,
    };

    /// Ten stationary stretches of 20 samples at 50 ms with noise of a hundredth, ten samples of motion by 1 between them.
    fn steps() -> (Vec<i64>, Vec<f64>) {
        let value = |k: i64| {
            let (stationary, within) = (k / 30, k % 30);
            let moved = (within - 20).max(0) as f64 / 10.0;
            stationary as f64 + moved + 0.01 * ((k * 7919) % 11 - 5) as f64 / 5.0
        };
        ((0..300).map(|k| k * 50_000_000).collect(), (0..300).map(value).collect())
    }

    #[test]
    fn the_plateau_separates_noise_from_motion() {
        let (stamps_ns, column) = steps();
        let stationary = find_stationary(&stamps_ns, &column, 1, &RULE);
        assert_eq!(stationary.stretches.len(), 10);
        // Samples 30 to 50 are stationary: 20 in the stretch, and the first sample of the motion is still at its start.
        assert_eq!(stationary.stretches[1].stretch, Stretch { first: 30, last: 50 });
        assert_eq!(stationary.interval_ns, 50_000_000);
        // Above the noise's range of 0.02, below three samples of motion, 0.2.
        assert!((0.02..0.2).contains(&stationary.threshold), "{}", stationary.threshold);
    }

    #[test]
    fn a_single_spike_does_not_end_a_stretch_and_a_break_in_time_does() {
        let (mut stamps_ns, mut column) = steps();
        column[40] += 0.5;
        stamps_ns[70..].iter_mut().for_each(|stamp| *stamp += 2_000_000_000);
        let stationary = find_stationary(&stamps_ns, &column, 1, &RULE);
        assert_eq!(stationary.stretches[1].stretch, Stretch { first: 30, last: 50 });
        assert_eq!(stationary.stretches[2].stretch, Stretch { first: 60, last: 69 });
        assert_eq!(stationary.stretches[3].stretch, Stretch { first: 70, last: 80 });
    }

    #[test]
    fn samples_are_replayed_when_the_threshold_is_found_too_late() {
        // 4000 stretches of 20 samples with noise of a thousandth, 1 apart; then 9000 with noise of three fifths, 100 000
        // apart. The first ones alone would have another threshold, and they are too many to be kept for every threshold.
        let value = |k: i64| {
            let (stationary, noise) = (k / 20, ((k * 7919) % 1009) as f64 / 1009.0);
            let late = (stationary - 4000).max(0) as f64;
            let noise_of = if stationary < 4000 { 1e-3 } else { 0.6 };
            stationary.min(4000) as f64 + late * 1e5 + noise * noise_of
        };
        let stamps_ns: Vec<i64> = (0..260_000).map(|k| k * 50_000_000).collect();
        let column: Vec<f64> = (0..260_000).map(value).collect();
        let mut replays = 0;
        let found = stationary_of(1, &RULE, |finder| {
            finder.push(&stamps_ns, &column);
            replays += 1;
            Ok::<_, Infallible>(replays)
        });
        let (stationary, last) = found.unwrap_or_else(|never| match never {});
        assert_eq!(last, 2);
        // With a threshold above 1 the first 4000 merge into one, and with the next.
        assert_eq!(stationary.stretches.len(), 9000);
        assert!((1.0..1e5).contains(&stationary.threshold), "{}", stationary.threshold);
        let given = StationaryRule { threshold: Some(stationary.threshold), ..RULE };
        assert_eq!(find_stationary(&stamps_ns, &column, 1, &given), stationary);
    }

    #[test]
    fn columns_of_two_units_are_compared_by_what_they_count_as() {
        // An angle that is still throughout, and a position in mm with the steps of the angle before, a thousandfold.
        let (stamps_ns, column) = steps();
        let values = column.iter().flat_map(|value| [1000.0 * value, 0.5]);
        let values: Vec<f64> = values.collect();
        let mut finder = Finder::new(2, &RULE);
        finder.count_as(vec![1e-3, 1.0]);
        finder.push(&stamps_ns, &values);
        let counted = finder.finish().expect("no stretch is dropped");
        let alone = find_stationary(&stamps_ns, &column, 1, &RULE);
        assert_eq!(counted.stretches.len(), alone.stretches.len());
        assert!((counted.threshold / alone.threshold - 1.0).abs() < 1e-9);
        // Means stay in each column's own unit.
        let (own, mm) = (&alone.stretches[3].means, &counted.stretches[3].means);
        assert!((mm[0] - 1000.0 * own[0]).abs() < 1e-9 && (mm[1] - 0.5).abs() < 1e-12);
    }

    #[test]
    fn nothing_and_one_sample_have_no_plateau() {
        assert!(find_stationary(&[], &[], 2, &RULE).stretches.is_empty());
        let one = find_stationary(&[5], &[1.0], 1, &RULE);
        assert!((one.threshold - RULE.floor).abs() < 1e-12);
    }
}
