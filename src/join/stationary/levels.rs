//! The stationary stretches by each of many thresholds, found side by side.
//!
//! Windows come one by one, each with its *level*: the number of the lowest threshold by which it is stationary. Only where the
//! level changes from one window to the next does anything begin or end, and only by the thresholds in between. A
//! stretch that ended goes on when the next stationary window overlaps it.
//!
//! Most thresholds will not be the right one. When their stretches grow too many, only those by the thresholds near the
//! one that would be right so far are kept, each time by fewer; of the others it is known how long they are.

use std::ops::Range;

use super::lengths::Lengths;
use super::sums::{Sum, Sums, means};
use super::{StationaryStretch, Stretch};

/// Stretches that are kept before some are forgotten.
const MOST_STRETCHES: usize = 50_000;
/// Thresholds kept at first on either side of the one that would be right so far: two rungs of the ladder.
const NEAR: usize = 6;
/// Thresholds kept on either side of it at last.
const NEAREST: usize = 1;

/// The samples that a window may ask for.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    /// Index of the first of them among all.
    pub first: usize,
    /// ns.
    pub stamps_ns: Vec<i64>,
    /// One for each pair of columns.
    pub sums: Vec<Sums>,
    /// How many columns there are.
    pub columns: usize,
}

impl Samples {
    fn stamp_ns(&self, sample: usize) -> i64 {
        self.stamps_ns[sample - self.first]
    }

    /// The columns' sums of all that comes before a sample.
    fn sums_before(&self, sample: usize, sums: &mut Vec<Sum>) {
        sums.clear();
        sums.extend(self.sums.iter().map(|s| s.before(sample - self.first)));
    }
}

/// The thresholds and what is stationary by each.
#[derive(Debug, Clone)]
pub struct Levels {
    thresholds: Vec<f64>,
    by: Vec<ByThreshold>,
    /// Of the window before.
    level: usize,
    window: usize,
    min_stretch_ns: i64,
    kept: Range<usize>,
    near: usize,
    most_stretches: usize,
}

/// What is stationary by one threshold.
#[derive(Debug, Clone, Default)]
struct ByThreshold {
    open: Option<Open>,
    sums_before: Vec<Sum>,
    sums_to_end: Vec<Sum>,
    lengths: Lengths,
    stretches: Vec<StationaryStretch>,
}

/// A stretch that may go on.
#[derive(Debug, Clone, Copy)]
struct Open {
    first: usize,
    before_ns: Option<i64>,
    start_ns: i64,
    end: Option<End>,
}

/// Where it ends unless it goes on.
#[derive(Debug, Clone, Copy)]
struct End {
    last: usize,
    at_ns: i64,
    after_ns: Option<i64>,
}

impl Levels {
    /// By these thresholds, sorted, in windows of so many samples.
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

    /// Takes the windows that begin at sample `first` and behind it, and in which so much moves.
    pub fn windows(&mut self, first: usize, ranges: &[f64], samples: &Samples) {
        let mut next = 0;
        loop {
            let (above, up_to) = self.bounds();
            let of_another = |&range: &f64| range <= above || range > up_to;
            let Some(same) = ranges[next..].iter().position(of_another) else {
                return;
            };
            next += same;
            self.change(first + next, ranges[next], samples);
        }
    }

    /// Takes the window that begins at sample `first` and whose level is another than that of the window before.
    fn change(&mut self, first: usize, range: f64, samples: &Samples) {
        let level = self.level_of(range);
        // Its last sample is the first one behind the window before.
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
                by.close(
                    self.min_stretch_ns,
                    self.kept.contains(&place),
                    samples.columns,
                );
                by.begin(first, samples);
            }
        }
        self.level = level;
    }

    /// Windows in which more moves than the first, but not more than the second, are of the same level.
    fn bounds(&self) -> (f64, f64) {
        let (below, above) = self.thresholds.split_at(self.level);
        (
            below.last().copied().unwrap_or(f64::NEG_INFINITY),
            above.first().copied().unwrap_or(f64::INFINITY),
        )
    }

    /// The number of the lowest threshold that a range is within, which is seldom far from the one before.
    fn level_of(&self, range: f64) -> usize {
        let (below, above) = self.thresholds.split_at(self.level);
        let down = below.iter().rev().take_while(|&&t| range <= t).count();
        let up = above.iter().take_while(|&&t| range > t).count();
        self.level - down + up
    }

    /// Ends what is open at the last of all samples.
    pub fn finish(&mut self, last: usize, samples: &Samples) {
        let end = || End {
            last,
            at_ns: samples.stamp_ns(last),
            after_ns: None,
        };
        for by in &mut self.by[self.level..] {
            by.end(end(), self.min_stretch_ns, samples);
        }
        for (place, by) in self.by.iter_mut().enumerate() {
            by.close(
                self.min_stretch_ns,
                self.kept.contains(&place),
                samples.columns,
            );
        }
    }

    /// Lengths of the stretches by a threshold, in samples less one.
    pub fn lengths(&self, threshold: f64) -> &Lengths {
        &self.by[self.place(threshold)].lengths
    }

    /// The stretches by a threshold; `None` where they were forgotten.
    pub fn take(&mut self, threshold: f64) -> Option<Vec<StationaryStretch>> {
        let place = self.place(threshold);
        let kept = self.kept.contains(&place);
        kept.then(|| std::mem::take(&mut self.by[place].stretches))
    }

    fn place(&self, threshold: f64) -> usize {
        self.thresholds.partition_point(|&t| t < threshold)
    }

    /// Whether too many stretches are kept.
    pub(super) fn are_too_many(&self) -> bool {
        let stretches = self.by.iter().map(|by| by.stretches.len());
        stretches.sum::<usize>() > self.most_stretches
    }

    /// Keeps only the stretches by the thresholds near this one.
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
        // The more is known, the less the threshold moves: the next time fewer are kept, if that would help.
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

    /// The window before was the last stationary one.
    fn end(&mut self, end: End, min_stretch_ns: i64, samples: &Samples) {
        let open = self
            .open
            .as_mut()
            .expect("by this threshold it was stationary");
        open.end = Some(end);
        if open.lasts(end, min_stretch_ns) {
            samples.sums_before(end.last + 1, &mut self.sums_to_end);
        }
    }

    /// Whether the window that begins at `first` overlaps the stretch; it then goes on.
    fn goes_on(&mut self, first: usize) -> bool {
        let goes_on = |open: &&mut Open| open.end.is_none_or(|end| first <= end.last);
        let open = self.open.as_mut().filter(goes_on);
        open.map(|open| open.end = None).is_some()
    }

    fn close(&mut self, min_stretch_ns: i64, keep: bool, columns: usize) {
        let Some(open) = self.open.take() else {
            return;
        };
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
                stretch: Stretch {
                    first: open.first,
                    last: end.last,
                },
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

    /// The stretches by one threshold, straight from the definition.
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

    /// Samples 10 ns apart whose one column counts them, and windows in which more or less moves.
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
            if i % 97 == 0 {
                f64::INFINITY
            } else {
                6.0 * slow * slow + f64::from(i * 7919 % 13)
            }
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
            let stretches = found.take(threshold).expect("none is forgotten");
            let places: Vec<Stretch> = stretches.iter().map(|stretch| stretch.stretch).collect();
            assert_eq!(places, expected, "{threshold}");
            for stretch in &stretches {
                let Stretch { first, last } = stretch.stretch;
                let at = |sample: usize| samples.stamps_ns.get(sample).copied();
                assert_eq!(
                    (Some(stretch.start_ns), Some(stretch.end_ns)),
                    (at(first), at(last))
                );
                assert_eq!(stretch.before_ns, first.checked_sub(1).and_then(at));
                assert_eq!(stretch.after_ns, at(last + 1));
                assert_eq!(stretch.means, [(first + last) as f64 / 2.0]);
            }
        }
    }

    #[test]
    fn of_stretches_forgotten_the_lengths_are_known() {
        let (samples, ranges) = scene();
        let (all, mut near) = (
            levels(&ranges, &samples, false),
            levels(&ranges, &samples, true),
        );
        for threshold in (1..=40).map(f64::from) {
            assert_eq!(all.lengths(threshold), near.lengths(threshold));
        }
        // Six thresholds on either side of 20.
        assert!(near.take(14.0).is_some() && near.take(26.0).is_some());
        assert!(near.take(13.0).is_none() && near.take(27.0).is_none());
        assert_ne!(*near.lengths(13.0), Lengths::default());
    }
}
