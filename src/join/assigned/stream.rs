//! A log's readings of several reflectors that do not name them → stations with readings of each.
//!
//! 1. Stationary stretches of the readings that follow each other with the stated distances among them are one *visit* of the arm:
//!    its reflectors, measured one after another.
//! 2. The visits' middles take the place of one target's dwells: the patterns of moves and the nominal arm decide the clocks
//!    ([`super::super::decide`]).
//! 3. Each stretch belongs to the arm's dwell that its middle is in, and [`super::assign`] finds the targets.
//! 4. The readings of each target become stations as those of any further target do ([`super::super::others`]); those of stretches
//!    without a target are rejected.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::{Point3, Vector3};

use super::{PointTarget, Stated, StationAssignment, StationPoints, ambiguous_words, assign};
use crate::ingest::{Poses, PosesError, TargetReadings};
use crate::join::dwell::{ArmDwell, TargetDwell};
use crate::join::observe::Observation;
use crate::join::others::nearest;
use crate::join::reading::Assigned;
use crate::join::readings::Readings;
use crate::join::{JoinError, JoinReject, JoinSettings, SAME_REACH};
use crate::units::{ClockModel, Stamp, Tracker};

/// Standard uncertainties of a stated distance within which two stretches agree with it.
const AGREES: f64 = 3.0;
/// Allowance of a distance for the readings, mm.
const READ_MM: f64 = 1.0;

/// Rows of readings, in order.
#[derive(Debug)]
pub(in crate::join) struct Part<'a> {
    all: &'a dyn Poses<Tracker>,
    rows: Vec<Range<usize>>,
    /// Number of rows before each range.
    before: Vec<usize>,
    count: usize,
}

impl<'a> Part<'a> {
    fn new(all: &'a dyn Poses<Tracker>, rows: Vec<Range<usize>>) -> Self {
        let mut count = 0;
        let before = rows.iter().map(|own| {
            let before = count;
            count += own.len();
            before
        });
        let before = before.collect();
        Self {
            all,
            rows,
            before,
            count,
        }
    }

    /// The range that a row is in, and its place there; the end of the last for a row beyond them.
    fn find(&self, row: usize) -> Option<(usize, usize)> {
        let range = self.before.partition_point(|before| *before <= row);
        let range = range.checked_sub(1)?;
        Some((range, self.rows[range].start + (row - self.before[range])))
    }
}

impl Poses<Tracker> for Part<'_> {
    fn count(&self) -> usize {
        self.count
    }

    fn read(&self, rows: Range<usize>) -> Result<TargetReadings, PosesError> {
        let mut read = self.all.read(0..0)?;
        let mut row = rows.start;
        while row < rows.end {
            let Some((range, at)) = self.find(row) else {
                break;
            };
            let end = self.rows[range].end.min(at + (rows.end - row));
            // A row that does not exist is the storage's own error.
            append(&mut read, self.all.read(at..end.max(at + 1))?);
            row += (end - at).max(1);
        }
        Ok(read)
    }

    fn stamp(&self, row: usize) -> Result<Stamp<Tracker>, PosesError> {
        let (_, at) = self.find(row).unwrap_or((0, usize::MAX));
        self.all.stamp(at)
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
            None => spots.push(Spot {
                stretches: vec![stretch],
                position,
            }),
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
    pub(in crate::join) left_out: Vec<(Range<usize>, String)>,
    /// Rows of all stretches that are of a target.
    pub(in crate::join) assigned_rows: Vec<Range<usize>>,
    /// By the arm's dwell the distances by which its readings were assigned.
    pub(in crate::join) assigned: BTreeMap<usize, Assigned>,
    /// The arm's dwells whose readings are ambiguous.
    pub(in crate::join) ambiguous: Vec<usize>,
}

/// The readings of each target by the clocks.
pub(in crate::join) fn by_target<'a>(
    all: &'a dyn Poses<Tracker>,
    readings: &Readings<'_>,
    (seen, dwells): (&Observation, &[TargetDwell]),
    clock: &ClockModel,
    stated: &Stated,
    settings: &JoinSettings,
) -> Result<ByTarget<'a>, JoinError> {
    let stations = spots_of_stations(&seen.arm, dwells, clock, readings.stationary().threshold);
    let points = seen
        .arm
        .iter()
        .zip(&stations)
        .map(|(arm, spots)| StationPoints {
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
    for rows in &mut found.rows {
        rows.sort_unstable_by_key(|own| own.start);
    }
    Ok(ByTarget {
        assigned_rows: found.rows.concat(),
        targets: found
            .rows
            .into_iter()
            .map(|rows| Part::new(all, rows))
            .collect(),
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

/// Rows of each target so far.
struct Found {
    rows: Vec<Vec<Range<usize>>>,
    left_out: Vec<(Range<usize>, String)>,
    assigned: BTreeMap<usize, Assigned>,
    ambiguous: Vec<usize>,
}

impl Found {
    fn take(
        &mut self,
        number: usize,
        spots: &[Spot],
        decided: StationAssignment,
        dwells: &[TargetDwell],
    ) {
        match decided {
            StationAssignment::Ambiguous(own) => {
                self.ambiguous.push(number);
                let reason = format!("unpaired: {}", ambiguous_words(&own));
                let rows = spots.iter().flat_map(|spot| rows_of(spot, dwells));
                self.left_out
                    .extend(rows.map(|rows| (rows, reason.clone())));
            }
            StationAssignment::Decided(targets, assigned) => {
                self.assigned.extend(assigned.map(|own| (number, own)));
                for (spot, target) in spots.iter().zip(targets) {
                    let rows = rows_of(spot, dwells);
                    match target {
                        PointTarget::Of(target) => self.rows[target].extend(rows),
                        PointTarget::OfNone(_) => {
                            let reason = target.why_none().unwrap_or_default();
                            let reason = format!("unpaired: {reason}");
                            self.left_out
                                .extend(rows.map(|rows| (rows, reason.clone())));
                        }
                    }
                }
            }
        }
    }
}

/// The rows of a spot; those between stretches that follow each other are of it too.
fn rows_of<'d>(spot: &'d Spot, dwells: &'d [TargetDwell]) -> impl Iterator<Item = Range<usize>> {
    let mut ranges: Vec<(usize, Range<usize>)> = Vec::new();
    for &place in &spot.stretches {
        let own = dwells[place].stretch;
        match ranges.last_mut() {
            Some((last, range)) if *last + 1 == place => {
                *last = place;
                range.end = own.last + 1;
            }
            _ => ranges.push((place, own.first..own.last + 1)),
        }
    }
    ranges.into_iter().map(|(_, range)| range)
}

/// The rejects of stretches without a target.
pub(in crate::join) fn rejects(
    left_out: &[(Range<usize>, String)],
    readings: &Readings<'_>,
) -> Result<Vec<JoinReject>, JoinError> {
    let reject = |(rows, reason): &(Range<usize>, String)| {
        Ok(JoinReject {
            start: readings.stamp(rows.start)?,
            end: readings.stamp(rows.end - 1)?,
            readings: rows.len() as u64,
            is_of_reference: false,
            reason: reason.clone(),
        })
    };
    left_out.iter().map(reject).collect()
}

/// The dwells of both logs with the first stretch of each visit as the target's, which shows how long the arm vibrates.
pub(in crate::join) fn firsts(visits: &Observation, dwells: &[TargetDwell]) -> Observation {
    let first = |visit: &TargetDwell| {
        let place = dwells.partition_point(|own| own.stretch.first < visit.stretch.first);
        dwells.get(place).unwrap_or(visit).clone()
    };
    Observation {
        target: visits.target.iter().map(first).collect(),
        ..visits.clone()
    }
}
