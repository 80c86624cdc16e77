//! The stationary stretches of each of many thresholds, found at the same time.
//!
//! Windows come one by one, each with its *level*: the number of the lowest threshold by which it is stationary. Only where the
//! level changes from one window to the next do stretches begin or end, and only those of the thresholds in between. A
//! stretch that ended continues when the next stationary window overlaps it.
//!
//! Most thresholds are not the final one. When their stretches become too many, only those of the thresholds near the
//! best one so far are kept, fewer each time; of the others only the lengths are kept.

use std::ops::Range;

use super::lengths::Lengths;
use super::sums::{Sum, Sums, means};
use super::{StationaryStretch, Stretch};

/// The most stretches that are kept before some are dropped.
const MOST_STRETCHES: usize = 50_000;
/// Thresholds kept at first on either side of the best one so far: two rungs of the ladder.
const NEAR: usize = 6;
/// The least number of thresholds kept on either side of it.
const NEAREST: usize = 1;

/// The samples that a window may need.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    pub first: usize,
    pub stamps_ns: Vec<i64>,
    pub sums: Vec<Sums>,
    pub columns: usize,
}

impl Samples {
    fn stamp_ns(&self, sample: usize) -> i64 {
        self.stamps_ns[sample - self.first]
    }

    /// The columns' sums over all samples before `sample`.
    fn sums_before(&self, sample: usize, sums: &mut Vec<Sum>) {
        sums.clear();
        sums.extend(self.sums.iter().map(|s| s.before(sample - self.first)));
    }
}

#[derive(Debug, Clone)]
pub struct Levels {
    thresholds: Vec<f64>,
    by: Vec<ByThreshold>,
    level: usize,
    window: usize,
    min_stretch_ns: i64,
    kept: Range<usize>,
    near: usize,
    most_stretches: usize,
}

#[derive(Debug, Clone, Default)]
struct ByThreshold {
    open: Option<Open>,
    sums_before: Vec<Sum>,
    sums_to_end: Vec<Sum>,
    lengths: Lengths,
    stretches: Vec<StationaryStretch>,
}

#[derive(Debug, Clone, Copy)]
struct Open {
    first: usize,
    before_ns: Option<i64>,
    start_ns: i64,
    end: Option<End>,
}

#[derive(Debug, Clone, Copy)]
struct End {
    last: usize,
    at_ns: i64,
    after_ns: Option<i64>,
}

impl Levels {
    /// Levels for these sorted thresholds, with windows of `window` samples.
    pub fn new(thresholds: Vec<f64>, window: usize, min_stretch_ns: i64) -> Self {
        Self {
            by: vec![ByThreshold::default(); thresholds.len()],
            level: thresholds.len(),
            kept: 0..thresholds.len(),
            thresholds,
            window,
            min_stretch_ns,
            near: NEAR,
            most_stretches: MOST_STRETCHES,
        }
    }

    /// Processes the windows that begin at the sample `first` and after it, with `ranges` as their motions.
    pub fn windows(&mut self, first: usize, ranges: &[f64], samples: &Samples) {
        let mut next = 0;
        loop {
            let (above, up_to) = self.bounds();
            let of_another = |&range: &f64| range <= above || range > up_to;
            let Some(same) = ranges[next..].iter().position(of_another) else { return };
            next += same;
            self.change(first + next, ranges[next], samples);
        }
    }

    /// Processes the window that begins at the sample `first` and whose level differs from that of the previous window.
    fn change(&mut self, first: usize, range: f64, samples: &Samples) {
        let level = self.level_of(range);
        // Its last sample is the first one after the previous window.
        let ended = |last| End {
            last,
            at_ns: samples.stamp_ns(last),
            after_ns: Some(samples.stamp_ns(last + 1)),
        };
        for by in &mut self.by[self.level.min(level)..level] {
            by.end(ended(first + self.window - 2), self.min_stretch_ns, samples);
        }
        for place in level..self.level.max(level) {
            let by = &mut self.by[place];
            if !by.goes_on(first) {
                by.close(self.min_stretch_ns, self.kept.contains(&place), samples.columns);
                by.begin(first, samples);
            }
        }
        self.level = level;
    }

    /// The limits of the current level: windows with a motion above the first and up to the second have it.
    fn bounds(&self) -> (f64, f64) {
        let (below, above) = self.thresholds.split_at(self.level);
        let below = below.last().copied().unwrap_or(f64::NEG_INFINITY);
        (below, above.first().copied().unwrap_or(f64::INFINITY))
    }

    /// The number of the lowest threshold that a range is within; the search begins at the previous level.
    fn level_of(&self, range: f64) -> usize {
        let (below, above) = self.thresholds.split_at(self.level);
        let down = below.iter().rev().take_while(|&&t| range <= t).count();
        let up = above.iter().take_while(|&&t| range > t).count();
        self.level - down + up
    }

    /// Ends open stretches at the last of all samples.
    pub fn finish(&mut self, last: usize, samples: &Samples) {
        let end = || End { last, at_ns: samples.stamp_ns(last), after_ns: None };
        for by in &mut self.by[self.level..] {
            by.end(end(), self.min_stretch_ns, samples);
        }
        for (place, by) in self.by.iter_mut().enumerate() {
            by.close(self.min_stretch_ns, self.kept.contains(&place), samples.columns);
        }
    }

    /// Lengths of the stretches of a threshold, in samples less one.
    pub fn lengths(&self, threshold: f64) -> &Lengths {
        &self.by[self.place(threshold)].lengths
    }

    /// The stretches of a threshold; `None` where they were dropped.
    pub fn take(&mut self, threshold: f64) -> Option<Vec<StationaryStretch>> {
        let place = self.place(threshold);
        self.kept.contains(&place).then(|| std::mem::take(&mut self.by[place].stretches))
    }

    fn place(&self, threshold: f64) -> usize {
        self.thresholds.partition_point(|&t| t < threshold)
    }

    pub(super) fn are_too_many(&self) -> bool {
        self.by.iter().map(|by| by.stretches.len()).sum::<usize>() > self.most_stretches
    }

    pub(super) fn forget_all_but(&mut self, threshold: f64) {
        let place = self.place(threshold);
        let near = place.saturating_sub(self.near)..place + self.near + 1;
        self.kept = near.start.max(self.kept.start)..near.end.min(self.kept.end);
        let mut left = 0;
        for (place, by) in self.by.iter_mut().enumerate() {
            if !self.kept.contains(&place) {
                by.stretches = Vec::new();
            }
            left += by.stretches.len();
        }
        // With more samples the threshold moves less: the next time fewer are kept.
        self.near = (self.near / 2).max(NEAREST);
        if self.near == NEAREST {
            self.most_stretches = self.most_stretches.max(2 * left);
        }
    }
}

impl ByThreshold {
    fn begin(&mut self, first: usize, samples: &Samples) {
        self.open = Some(Open {
            first,
            before_ns: (first > 0).then(|| samples.stamp_ns(first - 1)),
            start_ns: samples.stamp_ns(first),
            end: None,
        });
        samples.sums_before(first, &mut self.sums_before);
    }

    /// Ends a stretch at the previous window, the last stationary one.
    fn end(&mut self, end: End, min_stretch_ns: i64, samples: &Samples) {
        let open = self.open.as_mut().expect("by this threshold it was stationary");
        open.end = Some(end);
        if open.lasts(end, min_stretch_ns) {
            samples.sums_before(end.last + 1, &mut self.sums_to_end);
        }
    }

    /// Whether the window that begins at `first` overlaps the stretch, which then continues.
    fn goes_on(&mut self, first: usize) -> bool {
        let goes_on = |open: &&mut Open| open.end.is_none_or(|end| first <= end.last);
        let open = self.open.as_mut().filter(goes_on);
        open.map(|open| open.end = None).is_some()
    }

    fn close(&mut self, min_stretch_ns: i64, keep: bool, columns: usize) {
        let Some(open) = self.open.take() else { return };
        let end = open.end.expect("it ended before the next one begins");
        if !open.lasts(end, min_stretch_ns) {
            return;
        }
        self.lengths.add(end.last - open.first);
        if keep {
            let count = end.last - open.first + 1;
            let sums = self.sums_before.iter().zip(&self.sums_to_end);
            let mut means: Vec<f64> = sums.flat_map(|(from, to)| means(from, to, count)).collect();
            means.truncate(columns);
            self.stretches.push(StationaryStretch {
                stretch: Stretch { first: open.first, last: end.last },
                start_ns: open.start_ns,
                end_ns: end.at_ns,
                before_ns: open.before_ns,
                after_ns: end.after_ns,
                means,
            });
        }
    }
}

impl Open {
    fn lasts(&self, end: End, min_stretch_ns: i64) -> bool {
        end.at_ns.saturating_sub(self.start_ns) >= min_stretch_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WINDOW: usize = 4;

    /// The stretches of one threshold, computed directly from the definition.
    fn by_one(ranges: &[f64], threshold: f64, min_samples: usize) -> Vec<Stretch> {
        let mut found: Vec<Stretch> = Vec::new();
        for (first, &range) in ranges.iter().enumerate() {
            let last = first + WINDOW - 1;
            match found.last_mut() {
                _ if range > threshold => {}
                Some(stretch) if first <= stretch.last => stretch.last = last,
                _ => found.push(Stretch { first, last }),
            }
        }
        found.retain(|stretch| stretch.last - stretch.first >= min_samples);
        found
    }

    /// Samples 10 ns apart whose one column counts them, and windows of different motions.
    fn scene() -> (Samples, Vec<f64>) {
        let count = 2000;
        let mut sums = Sums::default();
        sums.push((0..count).map(|i| [f64::from(i); 2]));
        let samples = Samples {
            first: 0,
            stamps_ns: (0..i64::from(count)).map(|i| 10 * i).collect(),
            sums: vec![sums],
            columns: 1,
        };
        let range = |i: i32| {
            let slow = (f64::from(i) * 0.05).sin() + 1.0;
            if i % 97 == 0 { f64::INFINITY } else { 6.0 * slow * slow + f64::from(i * 7919 % 13) }
        };
        (samples, (0..count - 3).map(range).collect())
    }

    fn levels(ranges: &[f64], samples: &Samples, forget: bool) -> Levels {
        let thresholds = (1..=40).map(f64::from).collect();
        let mut levels = Levels::new(thresholds, WINDOW, 60);
        // In pieces, as they come.
        for (piece, ranges) in ranges.chunks(77).enumerate() {
            levels.windows(77 * piece, ranges, samples);
            if forget && piece == 13 {
                levels.forget_all_but(20.0);
            }
        }
        levels.finish(ranges.len() + WINDOW - 2, samples);
        levels
    }

    #[test]
    fn each_threshold_has_the_stretches_it_would_have_alone() {
        let (samples, ranges) = scene();
        let mut found = levels(&ranges, &samples, false);
        for threshold in (1..=40).map(f64::from) {
            let expected = by_one(&ranges, threshold, 6); // 60 ns
            let stretches = found.take(threshold).expect("none is dropped");
            let places: Vec<Stretch> = stretches.iter().map(|stretch| stretch.stretch).collect();
            assert_eq!(places, expected, "{threshold}");
            for stretch in &stretches {
                let Stretch { first, last } = stretch.stretch;
                let at = |sample: usize| samples.stamps_ns.get(sample).copied();
                assert_eq!((Some(stretch.start_ns), Some(stretch.end_ns)), (at(first), at(last)));
                assert_eq!(stretch.before_ns, first.checked_sub(1).and_then(at));
                assert_eq!(stretch.after_ns, at(last + 1));
                assert_eq!(stretch.means, [(first + last) as f64 / 2.0]);
            }
        }
    }

    #[test]
    fn the_lengths_of_dropped_stretches_are_kept() {
        let (samples, ranges) = scene();
        let (all, mut near) = (levels(&ranges, &samples, false), levels(&ranges, &samples, true));
        for threshold in (1..=40).map(f64::from) {
            assert_eq!(all.lengths(threshold), near.lengths(threshold));
        }
        // Six thresholds on either side of 20.
        assert!(near.take(14.0).is_some() && near.take(26.0).is_some());
        assert!(near.take(13.0).is_none() && near.take(27.0).is_none());
        assert_ne!(*near.lengths(13.0), Lengths::default());
    }
}
