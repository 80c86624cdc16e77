//! A stream that shows several reflectors at once and does not name them → lanes, in each of which a reading is of one place at a time.
//!
//! Motion capture writes all markers of a moment, and some trackers go round their reflectors with every reading. Dwells cannot be found in
//! such a stream, because it never stands still: so its readings are parted first.
//!
//! 1. A stream shows several at once where more than half of its readings are further from the one before than half of the least
//!    stated distance between two reflectors. Otherwise it is one lane: reflectors are measured one after another.
//! 2. Each reading continues the nearest lane that has none of the same moment, where it is nearer than that; otherwise the lane whose last
//!    reading is the oldest.
//!
//! While the arm stands, a lane is one reflector. Which one is found later, dwell by dwell, so lanes may change while it moves.

use std::ops::Range;

use nalgebra::Vector3;

use super::Stated;
use crate::ingest::{Poses, PosesError, TargetReadings};
use crate::join::JoinError;
use crate::join::readings::is_measurement;
use crate::units::{Stamp, Tracker};

/// Number of readings read together.
const PIECE: usize = 4096;
/// Lanes beside those of the reflectors, for stray readings.
const SPARE: usize = 1;

/// Rows of a stream whose readings follow each other.
#[derive(Debug)]
pub(in crate::join) struct Lane<'a> {
    all: &'a dyn Poses<Tracker>,
    /// The rows, in order; `None`: all.
    rows: Option<Vec<usize>>,
}

/// The lanes of a stream of the stated reflectors.
pub(in crate::join) fn of<'a>(
    all: &'a dyn Poses<Tracker>,
    stated: &Stated,
) -> Result<Vec<Lane<'a>>, JoinError> {
    let whole = Lane { all, rows: None };
    let Some(reach_mm) = reach_mm(stated) else {
        return Ok(vec![whole]);
    };
    let mut jumps = Jumps::default();
    each(all, |_, _, position| jumps.take(position, reach_mm))?;
    if 2 * jumps.far <= jumps.all {
        return Ok(vec![whole]);
    }
    let mut parting = Parting::new(stated.count() + SPARE, reach_mm);
    each(all, |row, at, position| parting.take(row, at, position))?;
    let lanes = parting.lanes.into_iter().map(|own| own.rows);
    let read = lanes.filter(|rows| !rows.is_empty());
    Ok(read.map(|rows| Lane { all, rows: Some(rows) }).collect())
}

/// Half of the least stated distance between two reflectors, mm; `None` where none is stated.
fn reach_mm(stated: &Stated) -> Option<f64> {
    let count = stated.count();
    let pairs = (0..count).flat_map(|one| (one + 1..count).map(move |other| (one, other)));
    let stated = pairs.filter_map(|(one, other)| Some(stated.distance(one, other)?.0));
    stated.reduce(f64::min).map(|least_mm| 0.5 * least_mm)
}

/// Gives every reading to `take`: its row, stamp and position.
fn each(
    all: &dyn Poses<Tracker>,
    mut take: impl FnMut(usize, Stamp<Tracker>, &[f64; 3]),
) -> Result<(), JoinError> {
    let count = all.count();
    for first in (0..count).step_by(PIECE) {
        let rows = first..(first + PIECE).min(count);
        let read = all.read(rows.clone())?;
        for ((row, at), position) in rows.zip(&read.stamps).zip(&read.positions) {
            take(row, *at, position);
        }
    }
    Ok(())
}

/// Readings and those far from the one before.
#[derive(Debug, Default)]
struct Jumps {
    last: Option<Vector3<f64>>,
    all: usize,
    far: usize,
}

impl Jumps {
    fn take(&mut self, position: &[f64; 3], reach_mm: f64) {
        if !is_measurement(position) {
            return;
        }
        let position = Vector3::from(*position);
        let is_far = |last: Vector3<f64>| (position - last).norm() > reach_mm;
        self.all += 1;
        self.far += usize::from(self.last.is_some_and(is_far));
        self.last = Some(position);
    }
}

/// A lane while readings are parted: its rows and its last measurement.
#[derive(Debug, Clone, Default)]
struct Open {
    rows: Vec<usize>,
    last: Option<(Stamp<Tracker>, Vector3<f64>)>,
}

/// Readings being parted into lanes.
struct Parting {
    lanes: Vec<Open>,
    reach_mm: f64,
}

impl Parting {
    fn new(lanes: usize, reach_mm: f64) -> Self {
        Self { lanes: vec![Open::default(); lanes], reach_mm }
    }

    fn take(&mut self, row: usize, at: Stamp<Tracker>, position: &[f64; 3]) {
        if !is_measurement(position) {
            // What is missing is of no reflector, and counted in any lane.
            self.lanes[0].rows.push(row);
            return;
        }
        let position = Vector3::from(*position);
        let place = self.nearest(at, &position).unwrap_or_else(|| self.oldest());
        let lane = &mut self.lanes[place];
        lane.rows.push(row);
        lane.last = Some((at, position));
    }

    /// The nearest lane within reach that has no reading of this moment.
    fn nearest(&self, at: Stamp<Tracker>, position: &Vector3<f64>) -> Option<usize> {
        let lanes = self.lanes.iter().enumerate();
        let away = lanes.filter_map(|(place, lane)| {
            let (_, last) = lane.last.filter(|(last_at, _)| *last_at < at)?;
            Some((place, (position - last).norm()))
        });
        let near = away.filter(|(_, away_mm)| *away_mm <= self.reach_mm);
        near.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(place, _)| place)
    }

    /// The lane whose last reading is the oldest: one without any first.
    fn oldest(&self) -> usize {
        let lanes = self.lanes.iter().enumerate();
        let oldest = lanes.min_by_key(|(_, lane)| lane.last.map(|(at, _)| at));
        oldest.map_or(0, |(place, _)| place)
    }
}

impl Poses<Tracker> for Lane<'_> {
    fn count(&self) -> usize {
        self.rows.as_ref().map_or(self.all.count(), Vec::len)
    }

    fn read(&self, rows: Range<usize>) -> Result<TargetReadings, PosesError> {
        let Some(own) = &self.rows else {
            return self.all.read(rows);
        };
        let mut read = self.all.read(0..0)?;
        // A row that does not exist is the storage's own error.
        let Some(mut wanted) = own.get(rows) else {
            return self.all.read(usize::MAX - 1..usize::MAX);
        };
        while let Some(&first) = wanted.first() {
            let near = wanted.partition_point(|row| *row < first + PIECE);
            let span = self.all.read(first..wanted[near - 1] + 1)?;
            picked(&mut read, &span, wanted[..near].iter().map(|row| row - first));
            wanted = &wanted[near..];
        }
        Ok(read)
    }

    fn stamp(&self, row: usize) -> Result<Stamp<Tracker>, PosesError> {
        match &self.rows {
            None => self.all.stamp(row),
            Some(own) => self.all.stamp(own.get(row).copied().unwrap_or(usize::MAX)),
        }
    }
}

/// Adds some rows of `from` to `to`.
fn picked(
    to: &mut TargetReadings,
    from: &TargetReadings,
    rows: impl Iterator<Item = usize> + Clone,
) {
    fn column<T: Copy>(
        to: &mut Option<Vec<T>>,
        from: Option<&Vec<T>>,
        rows: impl Iterator<Item = usize>,
    ) {
        if let Some(from) = from {
            to.get_or_insert_default().extend(rows.map(|row| from[row]));
        }
    }
    to.stamps.extend(rows.clone().map(|row| from.stamps[row]));
    to.positions.extend(rows.clone().map(|row| from.positions[row]));
    column(&mut to.orientations, from.orientations.as_ref(), rows.clone());
    column(&mut to.covariances, from.covariances.as_ref(), rows);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stated() -> Stated {
        let places = [[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [0.0, 120.0, 0.0]];
        Stated {
            names: ["A", "B", "C"].map(str::to_owned).into(),
            places: places.map(|at| Some((Vector3::from(at), 0.5))).into(),
            distances: Vec::new(),
        }
    }

    fn stream(readings: &[(i64, [f64; 3])]) -> TargetReadings {
        TargetReadings {
            stamps: readings.iter().map(|own| Stamp::from_ns(own.0)).collect(),
            positions: readings.iter().map(|own| own.1).collect(),
            ..TargetReadings::default()
        }
    }

    /// x of the readings of each lane.
    fn lanes(stream: &TargetReadings) -> Vec<Vec<f64>> {
        let found = of(stream, &stated()).expect("in memory");
        let x = |lane: &Lane<'_>| {
            let read = lane.read(0..lane.count()).expect("in memory");
            for (row, at) in read.stamps.iter().enumerate() {
                assert_eq!(lane.stamp(row), Ok(*at));
            }
            read.positions.iter().map(|own| own[0]).collect()
        };
        found.iter().map(x).collect()
    }

    #[test]
    fn reflectors_one_after_another_are_one_lane() {
        let a = (0..10).map(|at| (at, [1000.0, 5.0, 5.0]));
        let b = (10..20).map(|at| (at, [1100.0, 5.0, 5.0]));
        let all: Vec<_> = a.chain(b).collect();
        assert_eq!(lanes(&stream(&all)).len(), 1);
    }

    #[test]
    fn reflectors_at_once_have_a_lane_each_in_any_order_and_across_what_is_missing() {
        // Three of a moment in an order that changes; B is not seen at moment 2, a stray reading is at moment 3, zeros at moment 4.
        let (a, b, c) = ([1000.0, 1.0, 1.0], [1100.0, 1.0, 1.0], [1001.0, 121.0, 1.0]);
        let moments: [&[[f64; 3]]; 6] = [
            &[a, b, c],
            &[c, a, b],
            &[c, a],
            &[b, [5000.0, 1.0, 1.0], a, c],
            &[a, [0.0; 3], c],
            &[b, c, a],
        ];
        let all = (0..).zip(moments).flat_map(|(at, seen)| seen.iter().map(move |own| (at, *own)));
        let all: Vec<_> = all.collect();
        let mut found = lanes(&stream(&all));
        found.sort_by(|a, b| a[0].total_cmp(&b[0]));
        // Zeros are in the first lane, which is A's.
        let of_a = vec![1000.0, 1000.0, 1000.0, 1000.0, 1000.0, 0.0, 1000.0];
        assert_eq!(found, [of_a, vec![1001.0; 6], vec![1100.0; 4], vec![5000.0]]);
        // Every reading is in one lane.
        assert_eq!(found.iter().map(Vec::len).sum::<usize>(), all.len());
    }
}
