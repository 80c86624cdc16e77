//! Readings: the tracker's readings, read piece by piece → the measurements among them, and the target's stationary stretches.
//!
//! Readings may be too many for memory, so they are read a few at a time ([`Poses`]): once to find stationary stretches, then
//! dwell by dwell.

use std::ops::Range;

use super::stationary::{Finder, Stationary, Stretch, stationary_of};
use super::{JoinError, JoinSettings};
use crate::ingest::{Poses, TargetReadings};
use crate::units::{Stamp, Tracker};

const PIECE: usize = 4096;
/// Beyond the reach of any tracker, mm; larger numbers or NaN would only overflow the fits.
const FARTHEST_MM: f64 = 1e9;

/// Whether a reading is a measurement: within reach, and not the exact zeros of a missing reflector.
pub(super) fn is_measurement(position: &[f64; 3]) -> bool {
    position.iter().all(|x| x.abs() < FARTHEST_MM) && position.iter().any(|&x| x != 0.0)
}

/// The tracker's readings and the target's stationary stretches.
#[derive(Debug)]
pub struct Readings<'a> {
    poses: &'a dyn Poses<Tracker>,
    /// Stretches in rows of the readings.
    pub stationary: Stationary,
    missing: Missing,
    equal: Equal,
}

#[derive(Debug)]
pub struct Seen {
    pub rows: Range<usize>,
    pub readings: TargetReadings,
}

#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct Missing {
    runs: Vec<Run>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct Run {
    start: usize,
    end: usize,
    /// Number of missing readings up to its end.
    missing: usize,
}

impl<'a> Readings<'a> {
    /// Reads all readings, which have to be in order of time, and finds the stationary stretches.
    pub fn find(
        readings: &'a dyn Poses<Tracker>,
        settings: &JoinSettings,
    ) -> Result<Self, JoinError> {
        let mut seen = Self {
            poses: readings,
            stationary: Stationary::default(),
            missing: Missing::default(),
            equal: Equal::default(),
        };
        let rule = settings.target_rule();
        (seen.stationary, ()) = stationary_of(3, &rule, |finder| seen.replay(finder))?;
        for stretch in &mut seen.stationary.stretches {
            stretch.stretch = Stretch {
                first: seen.missing.row(stretch.stretch.first),
                last: seen.missing.row(stretch.stretch.last),
            };
        }
        Ok(seen)
    }

    fn replay(&mut self, finder: &mut Finder) -> Result<(), JoinError> {
        (self.missing, self.equal) = (Missing::default(), Equal::default());
        for seen in pieces(self.poses) {
            let seen = seen?;
            self.missing.extend(&seen);
            seen.rows.clone().for_each(|row| self.equal.push(row, seen.position(row)));
            let stamps: Vec<i64> = seen.measured().map(|row| seen.stamp(row).ns()).collect();
            let measured: Vec<[f64; 3]> = seen.measured().map(|row| seen.position(row)).collect();
            finder.push(&stamps, measured.as_flattened());
        }
        self.equal.finish();
        Ok(())
    }

    /// Runs of rows with equal readings.
    pub fn equal(&self) -> &[Range<usize>] {
        &self.equal.runs
    }

    pub fn count(&self) -> usize {
        self.poses.count()
    }

    /// Runs of rows that are no measurements.
    pub fn missing(&self) -> impl Iterator<Item = Range<usize>> {
        self.missing.runs.iter().map(|run| run.start..run.end)
    }

    pub fn read(&self, rows: Range<usize>) -> Result<Seen, JoinError> {
        let readings = self.poses.read(rows.clone())?;
        Ok(Seen { rows, readings })
    }

    pub fn of(&self, stretch: Stretch) -> Result<Seen, JoinError> {
        self.read(stretch.first..stretch.last + 1)
    }

    pub fn stamp(&self, row: usize) -> Result<Stamp<Tracker>, JoinError> {
        Ok(self.poses.stamp(row)?)
    }

    pub fn between(&self, start: Stamp<Tracker>, end: Stamp<Tracker>) -> Result<Seen, JoinError> {
        let first = self.poses.count_while(&|stamp| stamp < start)?;
        let behind = self.poses.count_while(&|stamp| stamp <= end)?;
        self.read(first..behind.max(first))
    }
}

/// All readings, some at a time; an error where they are not in order of time.
pub(super) fn pieces(
    readings: &dyn Poses<Tracker>,
) -> impl Iterator<Item = Result<Seen, JoinError>> {
    let (count, mut latest) = (readings.count(), Stamp::from_ns(i64::MIN));
    (0..count).step_by(PIECE).map(move |first| {
        let rows = first..(first + PIECE).min(count);
        let seen = Seen { readings: readings.read(rows.clone())?, rows };
        latest = seen.check_order(latest)?;
        Ok(seen)
    })
}

impl Seen {
    /// Checks that stamps do not decrease, from `latest` on; returns the last one.
    fn check_order(&self, mut latest: Stamp<Tracker>) -> Result<Stamp<Tracker>, JoinError> {
        let samples = "readings";
        for (row, &stamp) in self.rows.clone().zip(&self.readings.stamps) {
            if stamp < latest {
                return Err(JoinError::OutOfOrder { samples, row });
            }
            latest = stamp;
        }
        Ok(latest)
    }

    /// The rows that are measurements.
    pub fn measured(&self) -> impl Iterator<Item = usize> {
        self.rows.clone().filter(|&row| is_measurement(&self.position(row)))
    }

    pub(super) fn is_measured(&self, row: usize) -> bool {
        is_measurement(&self.position(row))
    }

    /// The coordinates of the measurements, mm, one column per axis.
    pub fn axes(&self) -> [Vec<f64>; 3] {
        let axis = |axis: usize| self.measured().map(|row| self.position(row)[axis]).collect();
        std::array::from_fn(axis)
    }

    pub fn stamp(&self, row: usize) -> Stamp<Tracker> {
        self.readings.stamps[row - self.rows.start]
    }

    /// The position of a row, mm.
    pub fn position(&self, row: usize) -> [f64; 3] {
        self.readings.positions[row - self.rows.start]
    }
}

impl Missing {
    fn extend(&mut self, seen: &Seen) {
        let missing = |row: &usize| !is_measurement(&seen.position(*row));
        for row in seen.rows.clone().filter(missing) {
            match self.runs.last_mut() {
                Some(run) if run.end == row => {
                    run.end += 1;
                    run.missing += 1;
                }
                last => {
                    let before = last.map_or(0, |run| run.missing);
                    self.runs.push(Run { start: row, end: row + 1, missing: before + 1 });
                }
            }
        }
    }

    /// The row of a reading from its number among the measurements.
    fn row(&self, measured: usize) -> usize {
        // The number of measurements before a run is its end less the missing rows up to there.
        let runs = self.runs.partition_point(|run| run.end - run.missing <= measured);
        measured + self.runs[..runs].last().map_or(0, |run| run.missing)
    }
}

/// Runs of equal readings, found as readings come.
#[derive(Debug, Default)]
struct Equal {
    runs: Vec<Range<usize>>,
    run: Range<usize>,
    last: [f64; 3],
}

impl Equal {
    /// Readings in a run at least.
    const LEAST: usize = 3;

    fn push(&mut self, row: usize, position: [f64; 3]) {
        let is_same = self.last.map(f64::to_bits) == position.map(f64::to_bits);
        if self.run.end == row && is_same && is_measurement(&position) {
            self.run.end += 1;
        } else {
            self.finish();
            (self.run, self.last) = (row..row + 1, position);
        }
    }

    fn finish(&mut self) {
        let run = std::mem::take(&mut self.run);
        if run.len() >= Self::LEAST {
            self.runs.push(run);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measurements_are_found_between_missing_readings() {
        let missing = [0, 1, 5, 6, 7, 9];
        let position = |row: usize| {
            let x = if missing.contains(&row) { 0.0 } else { 1.0 };
            [x, 0.0, 0.0]
        };
        let readings = TargetReadings {
            stamps: (0..12).map(Stamp::from_ns).collect(),
            positions: (0..12).map(position).collect(),
            ..TargetReadings::default()
        };
        let mut found = Missing::default();
        for rows in [0..6, 6..12] {
            found.extend(&Seen { readings: readings.read(rows.clone()).expect("in memory"), rows });
        }
        let runs: Vec<_> = found.runs.iter().map(|run| (run.start, run.end)).collect();
        assert_eq!(runs, [(0, 2), (5, 8), (9, 10)]);
        let rows: Vec<_> = (0..6).map(|measured| found.row(measured)).collect();
        assert_eq!(rows, [2, 3, 4, 8, 10, 11]);
    }
}
