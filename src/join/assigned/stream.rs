//! A log's readings of several reflectors that do not name them → stations with readings of each.
//!
//! 1. Stationary stretches of the readings that follow each other with the stated distances among them are one *visit* of the arm:
//!    its reflectors, measured one after another. Where several are measured at once, the stretches are those of all lanes
//!    ([`super::lanes`]).
//! 2. The visits' middles take the place of one target's dwells: the patterns of moves and the nominal arm decide the clocks
//!    ([`super::super::decide`]).
//! 3. Each stretch belongs to the arm's dwell that its middle is in, and [`super::assign`] finds the targets.
//! 4. The readings of each target become stations as those of any further target do ([`super::super::others`]); those of stretches
//!    without a target are rejected.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::{Point3, Vector3};

use super::lanes::Lane;
use super::{PointTarget, Stated, StationAssignment, StationPoints, ambiguous_words, assign};
use crate::ingest::{Poses, PosesError, TargetReadings};
use crate::join::dwell::{ArmDwell, TargetDwell};
use crate::join::observe::Observation;
use crate::join::others::nearest;
use crate::join::pattern::Pair;
use crate::join::reading::Assigned;
use crate::join::readings::Readings;
use crate::join::{JoinError, JoinReject, JoinSettings, SAME_REACH};
use crate::units::{ClockModel, Stamp, Tracker};

/// Standard uncertainties of a stated distance within which two stretches agree with it.
const AGREES: f64 = 3.0;
/// Allowance of a distance for the readings, mm.
const READ_MM: f64 = 1.0;

/// Rows of a lane.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::join) struct LaneRows {
    /// The lane.
    pub(in crate::join) lane: usize,
    /// Its rows.
    pub(in crate::join) rows: Range<usize>,
}

/// The dwells of targets in lanes, in order of time.
#[derive(Debug)]
pub(in crate::join) struct LaneDwells<'d> {
    pub(in crate::join) dwells: &'d [TargetDwell],
    /// The lane of each dwell, and its place among the dwells of that lane.
    pub(in crate::join) places: Vec<(usize, usize)>,
}

/// Rows of readings, in order of time.
#[derive(Debug)]
pub(in crate::join) struct Part<'a> {
    lanes: &'a [Lane<'a>],
    rows: Vec<LaneRows>,
    /// Number of rows before each range.
    before: Vec<usize>,
    count: usize,
}

impl<'a> Part<'a> {
    fn new(lanes: &'a [Lane<'a>], rows: Vec<LaneRows>) -> Self {
        let mut count = 0;
        let before = rows.iter().map(|own| {
            let before = count;
            count += own.rows.len();
            before
        });
        let before = before.collect();
        Self { lanes, rows, before, count }
    }

    /// The range that a row is in, and its place in the lane.
    fn find(&self, row: usize) -> Option<(usize, usize)> {
        let range = self.before.partition_point(|before| *before <= row);
        let range = range.checked_sub(1)?;
        let start = self.rows[range].rows.start;
        Some((range, start + (row - self.before[range])))
    }
}

impl Poses<Tracker> for Part<'_> {
    fn count(&self) -> usize {
        self.count
    }

    fn read(&self, rows: Range<usize>) -> Result<TargetReadings, PosesError> {
        let mut read = self.lanes[0].read(0..0)?;
        let mut row = rows.start;
        while row < rows.end {
            let Some((range, at)) = self.find(row) else {
                break;
            };
            let own = &self.rows[range];
            let end = own.rows.end.min(at + (rows.end - row));
            // A row that does not exist is the storage's own error.
            append(&mut read, self.lanes[own.lane].read(at..end.max(at + 1))?);
            row += (end - at).max(1);
        }
        Ok(read)
    }

    fn stamp(&self, row: usize) -> Result<Stamp<Tracker>, PosesError> {
        match self.find(row) {
            Some((range, at)) => self.lanes[self.rows[range].lane].stamp(at),
            None => self.lanes[0].stamp(usize::MAX),
        }
    }
}

fn append(to: &mut TargetReadings, more: TargetReadings) {
    fn column<T>(to: &mut Option<Vec<T>>, more: Option<Vec<T>>) {
        match (to, more) {
            (Some(to), Some(more)) => to.extend(more),
            (to, more) => *to = to.take().or(more),
        }
    }
    to.stamps.extend(more.stamps);
    to.positions.extend(more.positions);
    column(&mut to.orientations, more.orientations);
    column(&mut to.covariances, more.covariances);
}

/// Stretches that are one reflector during one dwell of the arm: a beam lost in between breaks a stretch in two.
#[derive(Debug, Clone)]
struct Spot {
    stretches: Vec<usize>,
    position: Vector3<f64>,
}

/// The spots of stretches in order of time; those closer together than `same_mm` are one.
fn spots(dwells: &[TargetDwell], stretches: &[usize], same_mm: f64) -> Vec<Spot> {
    let mut spots: Vec<Spot> = Vec::new();
    for &stretch in stretches {
        let position = dwells[stretch].position;
        let same = |own: &&mut Spot| (own.position - position).norm() <= same_mm;
        match spots.iter_mut().find(same) {
            Some(own) => own.stretches.push(stretch),
            None => spots.push(Spot { stretches: vec![stretch], position }),
        }
    }
    spots
}

/// The visits of the arm that the stretches show: as dwells of the middle of their reflectors, those with most of them.
pub(in crate::join) fn visits(
    dwells: &[TargetDwell],
    stated: &Stated,
    same_mm: f64,
) -> Vec<TargetDwell> {
    let mut visits: Vec<Vec<usize>> = Vec::new();
    for stretch in 0..dwells.len() {
        if let Some(last) = visits.last_mut() {
            last.push(stretch);
            if agrees(&spots(dwells, last, same_mm), stated) {
                continue;
            }
            last.pop();
        }
        visits.push(vec![stretch]);
    }
    let sizes = visits.iter().map(|own| spots(dwells, own, same_mm).len());
    let sizes: Vec<usize> = sizes.collect();
    let most = sizes.iter().copied().max().unwrap_or(0);
    let whole = sizes.iter().filter(|size| **size == most).count();
    let enough = 3 * whole >= visits.len();
    let used = visits.iter().zip(sizes);
    used.filter(|(_, size)| !enough || *size == most)
        .map(|(own, _)| middle(dwells, own, same_mm))
        .collect()
}

/// A visit as one dwell: from its first stretch to its last, at the middle of its spots.
fn middle(dwells: &[TargetDwell], visit: &[usize], same_mm: f64) -> TargetDwell {
    let (first, last) = (&dwells[visit[0]], &dwells[visit[visit.len() - 1]]);
    let spots = spots(dwells, visit, same_mm);
    let sum: Vector3<f64> = spots.iter().map(|spot| spot.position).sum();
    let mut whole = first.clone();
    whole.stretch.last = last.stretch.last;
    whole.end = last.end;
    whole.span.end_s = last.span.end_s;
    whole.span.left_s = last.span.left_s;
    whole.position = sum / spots.len() as f64;
    whole
}

/// Whether spots can be of different targets by the stated distances.
fn agrees(spots: &[Spot], stated: &Stated) -> bool {
    fn go(spots: &[Spot], stated: &Stated, targets: &mut Vec<usize>) -> bool {
        let at = targets.len();
        let Some(spot) = spots.get(at) else {
            return true;
        };
        (0..stated.count()).any(|target| {
            let fits = !targets.contains(&target)
                && targets.iter().zip(spots).all(|(other, of)| {
                    let Some((mm, sd_mm)) = stated.distance(target, *other) else {
                        return true;
                    };
                    let read_mm = (spot.position - of.position).norm();
                    (read_mm - mm).abs() <= AGREES.mul_add(sd_mm, READ_MM)
                });
            if !fits {
                return false;
            }
            targets.push(target);
            let found = go(spots, stated, targets);
            targets.pop();
            found
        })
    }
    go(spots, stated, &mut Vec::new())
}

/// The readings of a log by target.
pub(in crate::join) struct ByTarget<'a> {
    /// The readings of each target.
    pub(in crate::join) targets: Vec<Part<'a>>,
    /// Stretches without a target, as rows, and why.
    pub(in crate::join) left_out: Vec<(LaneRows, String)>,
    /// Rows of all stretches that are of a target.
    pub(in crate::join) assigned_rows: Vec<LaneRows>,
    /// By the arm's dwell the distances by which its readings were assigned.
    pub(in crate::join) assigned: BTreeMap<usize, Assigned>,
    /// The arm's dwells whose readings are ambiguous.
    pub(in crate::join) ambiguous: Vec<usize>,
}

/// The readings of each target by the clocks.
pub(in crate::join) fn by_target<'a>(
    lanes: &'a [Lane<'a>],
    (seen, dwells): (&Observation, &LaneDwells<'_>),
    clock: &ClockModel,
    stated: &Stated,
    settings: &JoinSettings,
) -> Result<ByTarget<'a>, JoinError> {
    let stations = spots_of_stations(&seen.arm, dwells.dwells, clock, seen.stationary_mm);
    let points = seen.arm.iter().zip(&stations).map(|(arm, spots)| StationPoints {
        flange: arm.flange,
        points: spots.iter().map(|own| Point3::from(own.position)).collect(),
    });
    let points: Vec<StationPoints> = points.collect();
    let decided = assign(&points, stated, settings.geometry_gate_mm)?;
    let mut found = Found {
        rows: vec![Vec::new(); stated.count()],
        left_out: Vec::new(),
        assigned: BTreeMap::new(),
        ambiguous: Vec::new(),
    };
    for (number, (spots, decided)) in stations.iter().zip(decided).enumerate() {
        found.take(number, spots, decided, dwells);
    }
    let rows = std::mem::take(&mut found.rows).into_iter();
    let rows = rows.map(|own| found.one_at_a_time(own));
    let rows: Vec<Vec<LaneRows>> = rows.collect();
    Ok(ByTarget {
        assigned_rows: rows.concat(),
        targets: rows.into_iter().map(|rows| Part::new(lanes, rows)).collect(),
        left_out: found.left_out,
        assigned: found.assigned,
        ambiguous: found.ambiguous,
    })
}

/// The spots of each dwell of the arm.
fn spots_of_stations(
    arm: &[ArmDwell],
    dwells: &[TargetDwell],
    clock: &ClockModel,
    threshold_mm: f64,
) -> Vec<Vec<Spot>> {
    let mut stretches: Vec<Vec<usize>> = vec![Vec::new(); arm.len()];
    for (place, own) in dwells.iter().enumerate() {
        if let Some(number) = nearest(arm, clock, own) {
            stretches[number].push(place);
        }
    }
    let same_mm = SAME_REACH * threshold_mm;
    let of = |own: &Vec<usize>| spots(dwells, own, same_mm);
    stretches.iter().map(of).collect()
}

/// Rows with their first and last moments.
type Timed = (LaneRows, [Stamp<Tracker>; 2]);

/// Rows of each target so far.
struct Found {
    rows: Vec<Vec<Timed>>,
    left_out: Vec<(LaneRows, String)>,
    assigned: BTreeMap<usize, Assigned>,
    ambiguous: Vec<usize>,
}

impl Found {
    fn take(
        &mut self,
        number: usize,
        spots: &[Spot],
        decided: StationAssignment,
        dwells: &LaneDwells<'_>,
    ) {
        match decided {
            StationAssignment::Ambiguous(own) => {
                self.ambiguous.push(number);
                let reason = format!("unpaired: {}", ambiguous_words(&own));
                for spot in spots {
                    self.leave_out(spot, dwells, &reason);
                }
            }
            StationAssignment::Decided(targets, assigned) => {
                self.assigned.extend(assigned.map(|own| (number, own)));
                for (spot, target) in spots.iter().zip(targets) {
                    match target {
                        PointTarget::Of(target) => self.rows[target].extend(rows_of(spot, dwells)),
                        PointTarget::OfNone(_) => {
                            let reason = target.why_none().unwrap_or_default();
                            self.leave_out(spot, dwells, &format!("unpaired: {reason}"));
                        }
                    }
                }
            }
        }
    }

    fn leave_out(&mut self, spot: &Spot, dwells: &LaneDwells<'_>, reason: &str) {
        let rows = rows_of(spot, dwells).into_iter();
        self.left_out.extend(rows.map(|(rows, _)| (rows, reason.to_owned())));
    }

    /// The rows of a target in order of time; of rows of the same time in two lanes the first stay.
    fn one_at_a_time(&mut self, mut rows: Vec<Timed>) -> Vec<LaneRows> {
        rows.sort_by_key(|(own, [first, _])| (*first, own.lane));
        let mut kept: Vec<LaneRows> = Vec::with_capacity(rows.len());
        let mut until = None;
        for (own, [first, last]) in rows {
            if until.is_some_and(|until| first <= until) {
                let reason = "unpaired: of the same place and time as another reading";
                self.left_out.push((own, reason.to_owned()));
            } else {
                until = Some(last);
                kept.push(own);
            }
        }
        kept
    }
}

/// The rows of a spot; those between stretches of a lane that follow each other are of it too.
fn rows_of(spot: &Spot, dwells: &LaneDwells<'_>) -> Vec<Timed> {
    let mut ranges: Vec<(usize, Timed)> = Vec::new();
    for &stretch in &spot.stretches {
        let (own, (lane, place)) = (&dwells.dwells[stretch], dwells.places[stretch]);
        let before = ranges.iter_mut().rev();
        let mut before = before.filter(|(_, (rows, _))| rows.lane == lane);
        match before.next() {
            Some((last, (range, [_, end]))) if *last + 1 == place => {
                *last = place;
                range.rows.end = own.stretch.last + 1;
                *end = own.end;
            }
            _ => {
                let rows = LaneRows { lane, rows: own.stretch.first..own.stretch.last + 1 };
                ranges.push((place, (rows, [own.start, own.end])));
            }
        }
    }
    ranges.into_iter().map(|(_, timed)| timed).collect()
}

/// The rejects of stretches without a target.
pub(in crate::join) fn rejects(
    left_out: &[(LaneRows, String)],
    readings: &[Readings<'_>],
) -> Result<Vec<JoinReject>, JoinError> {
    let reject = |(own, reason): &(LaneRows, String)| {
        let readings = &readings[own.lane];
        Ok(JoinReject {
            start: readings.stamp(own.rows.start)?,
            end: readings.stamp(own.rows.end - 1)?,
            readings: own.rows.len() as u64,
            is_of_reference: false,
            reason: reason.clone(),
        })
    };
    left_out.iter().map(reject).collect()
}

/// The dwells of both logs with the first stretch of each visit in a lane, whose dwells these are, as the target's: it shows how long the
/// arm vibrates. Pairs of visits without one are left out.
pub(in crate::join) fn firsts(
    visits: &Observation,
    pairs: &[Pair],
    dwells: &[&TargetDwell],
) -> (Observation, Vec<Pair>) {
    let (mut target, mut kept) = (Vec::new(), Vec::new());
    for pair in pairs {
        let visit = &visits.target[pair.target];
        let place = dwells.partition_point(|own| own.start < visit.start);
        if let Some(first) = dwells.get(place).filter(|own| own.start <= visit.end) {
            kept.push(Pair { target: target.len(), ..*pair });
            target.push((*first).clone());
        }
    }
    let seen = Observation { target, ..visits.clone() };
    (seen, kept)
}
