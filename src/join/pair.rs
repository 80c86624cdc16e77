//! Pairing: arm dwells, the clocks and the placement → a verdict for each dwell and a fate for each reading.
//!
//! For each dwell of the arm:
//! 1. the target's dwells that overlap it by more than half of the shorter one are its candidates;
//! 2. candidates far from where the nominal arm can have been are another reflector;
//! 3. candidates that agree are one sighting (a beam lost in between); those that do not leave the dwell ambiguous;
//! 4. readings after settling, without outliers, make the mean.

use std::ops::Range;

use nalgebra::{Point3, Vector3};

use super::average::{kept, mean_and_scatter, mean_orientation};
use super::dwell::{ArmDwell, TargetDwell};
use super::fate::{Fate, Why};
use super::placement::Placement;
use super::{Attained, JoinSettings, Pairing, Unmeasured};
use crate::ingest::{Recording, TemperatureSamples};
use crate::units::{ClockModel, NS_PER_S, Stamp, Tracker, round_ns};

/// Everything a verdict rests on.
pub struct Evidence<'a> {
    /// The session.
    pub recording: &'a Recording,
    /// Indices of the readings that are measurements.
    pub measured: &'a [usize],
    /// The target's dwells, in indices of `measured`.
    pub target: &'a [TargetDwell],
    /// The clocks.
    pub clock: ClockModel,
    /// Base and target, rough.
    pub placement: Placement,
    /// Further than this from the placement is another reflector, mm.
    pub gate_mm: f64,
    /// Dwells closer together than this are one sighting, mm.
    pub same_mm: f64,
    /// The session's usual standard deviation of a reading per axis, mm.
    pub usual_mm: [f64; 3],
    /// Readings younger than this after the arm's arrival are left out, s.
    pub settle_s: f64,
    /// As the pipeline file states them.
    pub settings: &'a JoinSettings,
}

/// A dwell's moment in tracker time.
#[derive(Debug, Clone, Copy)]
struct Window {
    start: Stamp<Tracker>,
    end: Stamp<Tracker>,
}

impl Evidence<'_> {
    /// The verdict on one dwell of the arm, and the mean where there is one; writes the fates of its readings.
    pub fn verdict(&self, dwell: &ArmDwell, fates: &mut [Fate]) -> (Pairing, Option<Attained>) {
        let window = self.window(dwell);
        let candidates = self.candidates(window);
        if candidates.is_empty() {
            return (Pairing::Unmeasured(self.why_nothing(window)), None);
        }
        let predicted = self.placement.predict(&dwell.flange);
        let far = |index: usize| (self.target[index].position - predicted).norm() > self.gate_mm;
        let (wrong, near): (Vec<usize>, Vec<usize>) = candidates.into_iter().partition(|&c| far(c));
        for index in wrong {
            self.leave(index, window, Why::WrongTarget, fates);
        }
        let Some(&first) = near.first() else {
            return (Pairing::Unmeasured(Unmeasured::WrongTarget), None);
        };
        let apart = |&index: &usize| {
            (self.target[index].position - self.target[first].position).norm() > self.same_mm
        };
        if near.iter().any(apart) {
            for index in near {
                self.leave(index, window, Why::Ambiguous, fates);
            }
            return (Pairing::Ambiguous, None);
        }
        self.attained(&near, window, fates).map_or(
            (Pairing::Unmeasured(Unmeasured::TooFewReadings), None),
            |attained| (Pairing::Paired, Some(attained)),
        )
    }

    /// From edge to edge: half a sample beyond the first and last still joint sample.
    fn window(&self, dwell: &ArmDwell) -> Window {
        let moment = |seconds: f64| {
            let controller = self.clock.origin.plus_ns(round_ns(seconds * NS_PER_S));
            self.clock.to_tracker(controller)
        };
        Window {
            start: moment(dwell.span.arrival_s()),
            end: moment(dwell.span.departure_s()),
        }
    }

    fn stamp(&self, measured: usize) -> Stamp<Tracker> {
        self.recording.readings.stamps[self.measured[measured]]
    }

    /// Measured readings within the window.
    fn within(&self, window: Window) -> Range<usize> {
        let stamps = &self.recording.readings.stamps;
        let first = self
            .measured
            .partition_point(|&index| stamps[index] < window.start);
        let end = self
            .measured
            .partition_point(|&index| stamps[index] <= window.end);
        first..end.max(first)
    }

    fn candidates(&self, window: Window) -> Vec<usize> {
        let from = self
            .target
            .partition_point(|dwell| self.stamp(dwell.stretch.last) < window.start);
        let begun = |&index: &usize| self.stamp(self.target[index].stretch.first) <= window.end;
        let overlaps = |&index: &usize| {
            let stretch = self.target[index].stretch;
            let (start, end) = (self.stamp(stretch.first), self.stamp(stretch.last));
            let common = end.min(window.end).since_ns(start.max(window.start));
            let shorter = end.since_ns(start).min(window.end.since_ns(window.start));
            common > shorter / 2
        };
        (from..self.target.len())
            .take_while(begun)
            .filter(overlaps)
            .collect()
    }

    fn why_nothing(&self, window: Window) -> Unmeasured {
        let readings = self.within(window).len();
        let stamps = &self.recording.readings.stamps;
        let outside = stamps.first().is_none_or(|&first| window.end < first)
            || stamps.last().is_none_or(|&last| window.start > last);
        match readings {
            0 if outside => Unmeasured::OutsideTrackerLog,
            0 => Unmeasured::NoReadings,
            few if few < self.settings.min_readings => Unmeasured::TooFewReadings,
            _ => Unmeasured::TargetMoved,
        }
    }

    /// A target dwell's readings within the window.
    fn part(&self, target: usize, window: Window) -> Range<usize> {
        let (stretch, within) = (self.target[target].stretch, self.within(window));
        let first = stretch.first.max(within.start);
        first..(stretch.last + 1).min(within.end).max(first)
    }

    /// From the first to the last reading of one sighting: noise and single bad readings break rest, not the dwell.
    fn span_of(&self, near: &[usize], window: Window) -> Range<usize> {
        let parts = near.iter().map(|&target| self.part(target, window));
        parts
            .reduce(|a, b| a.start.min(b.start)..a.end.max(b.end))
            .unwrap_or(0..0)
    }

    fn leave(&self, target: usize, window: Window, why: Why, fates: &mut [Fate]) {
        for measured in self.part(target, window) {
            fates[self.measured[measured]] = Fate::Unpaired(why);
        }
    }

    fn attained(&self, near: &[usize], window: Window, fates: &mut [Fate]) -> Option<Attained> {
        let settled_at = window.start.plus_ns(round_ns(self.settle_s * NS_PER_S));
        let mut settled = Vec::new();
        for measured in self.span_of(near, window) {
            if self.stamp(measured) < settled_at {
                fates[self.measured[measured]] = Fate::Settling;
            } else {
                settled.push(self.measured[measured]);
            }
        }
        let positions: Vec<_> = settled
            .iter()
            .map(|&index| self.recording.readings.positions[index])
            .collect();
        let keep = kept(&positions, self.settings.mad_factor, self.usual_mm);
        let enough = keep.iter().filter(|&&keep| keep).count() >= self.settings.min_readings;
        let mut used = Vec::with_capacity(settled.len());
        for (&index, keep) in settled.iter().zip(keep) {
            fates[index] = match (keep, enough) {
                (false, _) => Fate::Outlier,
                (true, false) => Fate::Unpaired(Why::TooFew),
                (true, true) => Fate::Kept,
            };
            if keep {
                used.push(index);
            }
        }
        enough.then(|| self.mean(&used, self.within(window).len()))
    }

    fn mean(&self, used: &[usize], readings: usize) -> Attained {
        let all = &self.recording.readings;
        let positions: Vec<_> = used
            .iter()
            .map(|&i| Vector3::from(all.positions[i]))
            .collect();
        let (mean, scatter) = mean_and_scatter(&positions);
        let orientation = all.orientations.as_ref().and_then(|orientations| {
            let used: Vec<_> = used.iter().map(|&i| orientations[i]).collect();
            mean_orientation(&used)
        });
        let (first, last) = (all.stamps[used[0]], all.stamps[used[used.len() - 1]]);
        Attained {
            position: Point3::from(mean),
            orientation: orientation.map(|(mean, _)| mean),
            scatter_mm: scatter.into(),
            orientation_scatter_rad: orientation.map(|(_, scatter)| scatter),
            stated_covariance: all
                .covariances
                .as_ref()
                .map(|stated| mean_covariance(stated, used)),
            kept: used.len(),
            readings,
            first,
            last,
            temperature_c: nearest(
                &self.recording.temperatures,
                first.plus_ns(last.since_ns(first) / 2),
            ),
        }
    }
}

fn mean_covariance(stated: &[[f64; 6]], used: &[usize]) -> [f64; 6] {
    std::array::from_fn(|term| {
        used.iter().map(|&index| stated[index][term]).sum::<f64>() / used.len() as f64
    })
}

/// The temperature nearest in time; of two equally near the earlier one.
fn nearest(temperatures: &TemperatureSamples, moment: Stamp<Tracker>) -> Option<f64> {
    let after = temperatures.stamps.partition_point(|&stamp| stamp < moment);
    let distance = |&index: &usize| temperatures.stamps[index].since_ns(moment).saturating_abs();
    [after.checked_sub(1), Some(after)]
        .into_iter()
        .flatten()
        .filter(|&index| index < temperatures.stamps.len())
        .min_by_key(distance)
        .map(|index| temperatures.celsius[index])
}
