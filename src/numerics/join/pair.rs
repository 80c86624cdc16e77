//! Pairing: arm dwells, the clocks and the placement → a verdict for each dwell and a disposition for each reading.
//!
//! For each dwell of the arm:
//! 1. the target's dwells that overlap it by more than half of the shorter one are its candidates;
//! 2. candidates far from every place that the nominal arm can have had are another reflector;
//! 3. candidates that agree are one group (a beam lost in between); candidates that do not make the dwell ambiguous;
//! 4. readings after settling, without outliers, make the mean.

use std::ops::Range;

use nalgebra::{Point3, Vector3};

use super::MIN_PAIRS;
use super::average::{kept, mean_and_scatter, mean_orientation};
use super::disposition::{Disposition, Dispositions, Why};
use super::dwell::{ArmDwell, TargetDwell};
use super::moved::explains;
use super::placement::{NOMINAL_MM, Placement, ReadingAtFlange};
use super::reading::{MeanOrientation, MeanPoint, Reading, SourceId, TargetId, Value};
use super::readings::{Readings, Seen};
use super::{JoinError, JoinSettings, Pairing, Unmeasured};
use crate::geometry::PoseCovariance;
use crate::ingest::{TemperatureSamples, covariances};
use crate::units::{ClockModel, NS_PER_S, Stamp, Tracker, round_ns};

/// The geometry gate is at least this many median distances, for arms worse than it assumes.
const GATE_REACH: f64 = 10.0;
/// Readings that place a target, at most: of more, some spread over all of them.
const PLACED_BY: usize = 5000;

/// The placement of a target by its own readings, which are in order of time, and the distance from it beyond which a reading is another
/// reflector's, mm; `None` where too few readings place it. Where none holds for most of them, it is that of the half under which the
/// others agree with the arm once the base is placed anew ([`super::moved`]).
pub fn placed(readings: &[ReadingAtFlange], settings: &JoinSettings) -> Option<(Placement, f64)> {
    let whole = placed_by(readings, settings)?;
    if whole.0.median_mm(readings) <= NOMINAL_MM {
        return Some(whole);
    }
    let (first, second) = readings.split_at(readings.len() / 2);
    let halves = [first, second].map(|half| {
        let (placement, gate_mm) = placed_by(half, settings)?;
        let is_sound = placement.median_mm(half) <= NOMINAL_MM;
        Some((placement, gate_mm)).filter(|_| is_sound && explains(readings, &placement, gate_mm))
    });
    Some(halves.into_iter().flatten().next().unwrap_or(whole))
}

fn placed_by(readings: &[ReadingAtFlange], settings: &JoinSettings) -> Option<(Placement, f64)> {
    let stride = readings.len().div_ceil(PLACED_BY).max(1);
    let spread: Vec<ReadingAtFlange> = readings.iter().step_by(stride).copied().collect();
    let placement = Placement::fit_far(&spread).filter(|_| readings.len() >= MIN_PAIRS)?;
    Some((placement, gate_mm(placement.median_mm(readings), settings)))
}

/// Distance from a placement beyond which a reading is another reflector's, mm, where half of them are within `median_mm`.
pub fn gate_mm(median_mm: f64, settings: &JoinSettings) -> f64 {
    settings.geometry_gate_mm.max(GATE_REACH * median_mm)
}

pub struct Evidence<'a> {
    pub readings: &'a Readings<'a>,
    pub temperatures: &'a TemperatureSamples,
    pub target: &'a [TargetDwell],
    pub clock: ClockModel,
    pub placement: Placement,
    pub gate_mm: f64,
    pub moved: &'a [(Stamp<Tracker>, Stamp<Tracker>)],
    /// Dwells closer together than this are one group, mm.
    pub same_mm: f64,
    /// The session's usual standard deviation of a reading per axis, mm.
    pub usual_mm: [f64; 3],
    /// Readings younger than this after the arm's arrival are left out, s.
    pub settle_s: f64,
    pub settings: &'a JoinSettings,
}

#[derive(Debug, Clone, Copy)]
struct Window {
    start: Stamp<Tracker>,
    end: Stamp<Tracker>,
}

impl Evidence<'_> {
    /// The verdict on one dwell of the arm, and its mean where there is one; sets the dispositions of its readings.
    pub fn verdict(
        &self,
        dwell: &ArmDwell,
        dispositions: &mut Dispositions,
    ) -> Result<(Pairing, Option<Reading>), JoinError> {
        let window = self.window(dwell);
        let seen = self.readings.between(window.start, window.end)?;
        let candidates = self.candidates(window);
        if candidates.is_empty() {
            return Ok((Pairing::Unmeasured(self.why_nothing(window, &seen)?), None));
        }
        let predicted = self.placement.predict(&dwell.flange);
        let far = |index: usize| (self.target[index].position - predicted).norm() > self.gate_mm;
        let (wrong, near): (Vec<usize>, Vec<usize>) = candidates.into_iter().partition(|&c| far(c));
        let mut why_far = (Why::WrongTarget, Unmeasured::WrongTarget);
        for index in wrong {
            if self.is_moved(index) {
                why_far = (Why::InstrumentMoved, Unmeasured::InstrumentMoved);
            }
            dispositions.set(self.part(index, &seen), Disposition::Unpaired(why_far.0));
        }
        let Some(&first) = near.first() else { return Ok((Pairing::Unmeasured(why_far.1), None)) };
        let apart = |&index: &usize| {
            (self.target[index].position - self.target[first].position).norm() > self.same_mm
        };
        if near.iter().any(apart) {
            for index in near {
                dispositions.set(self.part(index, &seen), Disposition::Unpaired(Why::Ambiguous));
            }
            return Ok((Pairing::Ambiguous, None));
        }
        let reading = self.reading(&near, window, &seen, dispositions);
        let too_few = Pairing::Unmeasured(Unmeasured::TooFewReadings);
        Ok((reading.as_ref().map_or(too_few, |_| Pairing::Paired), reading))
    }

    /// Whether a dwell of the target is in a stretch at which the instrument or the base stood elsewhere.
    fn is_moved(&self, index: usize) -> bool {
        let own = &self.target[index];
        let mut moved = self.moved.iter();
        moved.any(|(first, last)| *first <= own.start && own.end <= *last)
    }

    /// The dwell from edge to edge: half a sample beyond the first and last stationary joint sample.
    fn window(&self, dwell: &ArmDwell) -> Window {
        let moment = |seconds: f64| {
            self.clock.to_tracker(self.clock.origin.plus_ns(round_ns(seconds * NS_PER_S)))
        };
        Window { start: moment(dwell.span.arrival_s()), end: moment(dwell.span.departure_s()) }
    }

    fn candidates(&self, window: Window) -> Vec<usize> {
        let from = self.target.partition_point(|dwell| dwell.end < window.start);
        let begun = |&index: &usize| self.target[index].start <= window.end;
        let overlaps = |&index: &usize| {
            let TargetDwell { start, end, .. } = self.target[index];
            let common = end.min(window.end).since_ns(start.max(window.start));
            let shorter = end.since_ns(start).min(window.end.since_ns(window.start));
            common > shorter / 2
        };
        (from..self.target.len()).take_while(begun).filter(overlaps).collect()
    }

    fn why_nothing(&self, window: Window, seen: &Seen) -> Result<Unmeasured, JoinError> {
        let readings = seen.measured().count();
        let last = self.readings.count() - 1;
        let outside =
            window.end < self.readings.stamp(0)? || window.start > self.readings.stamp(last)?;
        Ok(match readings {
            0 if outside => Unmeasured::OutsideTrackerLog,
            0 => Unmeasured::NoReadings,
            few if few < self.settings.min_readings => Unmeasured::TooFewReadings,
            _ => Unmeasured::TargetMoved,
        })
    }

    /// The rows of a target dwell within the window.
    fn part(&self, target: usize, seen: &Seen) -> Range<usize> {
        let stretch = self.target[target].stretch;
        let first = stretch.first.max(seen.rows.start);
        first..(stretch.last + 1).min(seen.rows.end).max(first)
    }

    fn reading(
        &self,
        near: &[usize],
        window: Window,
        seen: &Seen,
        dispositions: &mut Dispositions,
    ) -> Option<Reading> {
        let settled_at = window.start.plus_ns(round_ns(self.settle_s * NS_PER_S));
        // From first to last reading of the group: noise and single bad readings break a stationary stretch, not the dwell.
        let parts = near.iter().map(|&target| self.part(target, seen));
        let span = parts.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end)).unwrap_or(0..0);
        let measured = seen.measured().filter(|row| span.contains(row));
        let (settled, settling): (Vec<usize>, Vec<usize>) =
            measured.partition(|&row| seen.stamp(row) >= settled_at);
        dispositions.set_each(settling.into_iter().map(|row| (row, Disposition::Settling)));
        let positions: Vec<_> = settled.iter().map(|&row| seen.position(row)).collect();
        let keep = kept(&positions, self.settings.mad_factor, self.usual_mm);
        let enough = keep.iter().filter(|&&keep| keep).count() >= self.settings.min_readings;
        let disposition = |keep| match (keep, enough) {
            (false, _) => Disposition::Outlier,
            (true, false) => Disposition::Unpaired(Why::TooFew),
            (true, true) => Disposition::Kept,
        };
        let of_settled = settled.iter().copied().zip(keep.iter().copied());
        dispositions.set_each(of_settled.clone().map(|(row, keep)| (row, disposition(keep))));
        let used: Vec<usize> = of_settled.filter(|(_, keep)| *keep).map(|(row, _)| row).collect();
        enough.then(|| self.mean(&used, seen))
    }

    fn mean(&self, used: &[usize], seen: &Seen) -> Reading {
        let all = &seen.readings;
        let place = |&row: &usize| row - seen.rows.start;
        let position = |&row: &usize| Vector3::from(seen.position(row));
        let positions: Vec<_> = used.iter().map(position).collect();
        let (mean, scatter) = mean_and_scatter(&positions);
        let orientation = all.orientations.as_ref().and_then(|orientations| {
            let used: Vec<_> = used.iter().map(|row| orientations[place(row)]).collect();
            mean_orientation(&used)
        });
        let stated = all.covariances.as_ref().map_or_else(PoseCovariance::default, |stated| {
            let used: Vec<_> = used.iter().map(|row| stated[place(row)]).collect();
            covariances::mean(&used)
        });
        let (first, last) = (seen.stamp(used[0]), seen.stamp(used[used.len() - 1]));
        let point = MeanPoint {
            position: Point3::from(mean),
            scatter_mm: scatter.into(),
            stated_covariance: stated.position,
            motion_covariance: None,
        };
        let turn = |(orientation, scatter_rad)| MeanOrientation {
            orientation,
            scatter_rad,
            stated_covariance: stated.turn,
        };
        Reading {
            source: SourceId::ONLY,
            target: TargetId::ONLY,
            value: Value::of(point, orientation.map(turn)),
            kept: used.len(),
            taken: seen.measured().count(),
            first,
            last,
            temperature_c: nearest(self.temperatures, first.plus_ns(last.since_ns(first) / 2)),
        }
    }
}

/// The temperature nearest in time; of two equally near the earlier one.
pub(super) fn nearest(temperatures: &TemperatureSamples, moment: Stamp<Tracker>) -> Option<f64> {
    let after = temperatures.stamps.partition_point(|&stamp| stamp < moment);
    [after.checked_sub(1), Some(after)]
        .into_iter()
        .flatten()
        .filter(|&index| index < temperatures.stamps.len())
        .min_by_key(|&index| temperatures.stamps[index].since_ns(moment).saturating_abs())
        .and_then(|index| temperatures.celsius.get(index).copied())
}
