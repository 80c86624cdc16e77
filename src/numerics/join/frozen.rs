//! Readings that repeat the last one while the arm moves: some instruments log the last position until the beam is back.
//!
//! Equal readings within one dwell may be a quiet instrument's. A run of them that goes on while the nominal arm moves the target is of a
//! lost beam: from its first repetition to its end nothing was read.

use std::ops::Range;

use super::JoinError;
use super::dwell::ArmDwell;
use super::observe::{Observation, usual_scatter_mm};
use super::pattern::Relation;
use super::placement::Placement;
use super::readings::Readings;
use crate::ingest::{Poses, PosesError, TargetReadings};
use crate::units::{NS_PER_S, Stamp, Tracker};

/// A run that reaches this far into a motion is of a lost beam, s; before that an arm hardly moves. Where readings of a dwell scatter, any
/// run that reaches into one is.
const INTO_MOTION_S: f64 = 0.1;
const QUIET_MM: f64 = 1e-9;
/// A motion is one that moves the target by more than this, mm.
const MOVES_MM: f64 = 1.0;

/// The rows that repeat the reading before them, of all runs that span a motion of the arm.
pub(super) fn repeated(
    readings: &Readings<'_>,
    seen: &Observation,
    relation: Relation,
    placement: &Placement,
) -> Result<Vec<Range<usize>>, JoinError> {
    let is_quiet = usual_scatter_mm(&seen.target).iter().all(|&mm| mm < QUIET_MM);
    let into_s = if is_quiet { INTO_MOTION_S + seen.sampling_s[0] } else { 0.0 };
    let seconds = |stamp: Stamp<Tracker>| stamp.since_ns(seen.first_measured) as f64 / NS_PER_S;
    let moves = seen.arm.windows(2).filter(|pair| {
        let at = |dwell: &ArmDwell| placement.predict(&dwell.flange);
        (at(&pair[1]) - at(&pair[0])).norm() > MOVES_MM
    });
    let at_s = |own_s: f64| relation.to_tracker(own_s);
    let moves =
        moves.map(|pair| (at_s(pair[0].span.departure_s()), at_s(pair[1].span.arrival_s())));
    let moves: Vec<(f64, f64)> = moves.collect();
    let mut found = Vec::new();
    for rows in readings.equal() {
        let (start_s, end_s) =
            (seconds(readings.stamp(rows.start)?), seconds(readings.stamp(rows.end - 1)?));
        let from = moves.partition_point(|(_, arrived_s)| *arrived_s < start_s);
        let mut during = moves[from..].iter().take_while(|(left_s, _)| *left_s < end_s);
        if during.any(|(left_s, arrived_s)| end_s.min(*arrived_s) - start_s.max(*left_s) > into_s) {
            found.push(rows.start + 1..rows.end);
        }
    }
    Ok(found)
}

/// Readings with zeros, which count as missing, in some rows.
#[derive(Debug)]
pub(super) struct Without<'a> {
    pub own: &'a dyn Poses<Tracker>,
    pub rows: &'a [Range<usize>],
}

impl Poses<Tracker> for Without<'_> {
    fn count(&self) -> usize {
        self.own.count()
    }

    fn read(&self, rows: Range<usize>) -> Result<TargetReadings, PosesError> {
        let mut read = self.own.read(rows.clone())?;
        let from = self.rows.partition_point(|own| own.end <= rows.start);
        for own in self.rows[from..].iter().take_while(|own| own.start < rows.end) {
            for row in own.start.max(rows.start)..own.end.min(rows.end) {
                read.positions[row - rows.start] = [0.0; 3];
            }
        }
        Ok(read)
    }

    fn stamp(&self, row: usize) -> Result<Stamp<Tracker>, PosesError> {
        self.own.stamp(row)
    }
}
