//! Readings of references in the tracker's log → looks by the controller's clock, followed as those of a table are; their motion is
//! taken out of the stations' readings.
//!
//! 1. A look is everything that is read of references during a dwell of the arm or within a second of it; between dwells, everything of
//!    the same half minute since the last one. References do not move with the arm, so its motion does not matter to them.
//! 2. In a look the readings of each reference become one mean, without outliers. A reference that moved meanwhile is left out.
//! 3. The courses are those of [`super::tabled`]; readings of stations whose motion is not known are left out.
//!
//! The clocks are found before, from targets alone, so references have no part in the search of their shift.

pub(super) mod bumps;

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use super::average::{kept, robust_sigma};
use super::courses::{Origin, RowReference, Stop, can_be_read, courses, read, taken_out, undo};
use super::readings::pieces;
use super::references::ReferenceId;
use super::{
    JoinError, JoinReject, JoinSettings, Joined, ReferenceReadings, RejectCode, Station, Unmeasured,
};
use crate::figures::median;
use crate::units::{ClockModel, Stamp, Tracker};

/// Longest look between dwells, ns.
const LOOK_NS: i64 = 30_000_000_000;
/// Readings this near to a dwell are of its look, ns: its edges are found to less.
const NEAR_NS: i64 = 1_000_000_000;
/// Of fewer readings than this in a look none is an outlier.
const FEW: usize = 5;
/// Readings that agree within this never scatter, mm: instruments write whole micrometres.
const RESOLUTION_MM: f64 = 2e-3;
const NOWHERE: &str = "where no instrument reads anything: is the unit right?";

/// When a reading was taken: during the dwell of a station, or in a half minute after one (before the first: counted back from it).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum When {
    At(usize),
    Between(usize, i64),
}

#[derive(Debug, Clone)]
struct Run {
    reference: ReferenceId,
    when: When,
    start: Stamp<Tracker>,
    end: Stamp<Tracker>,
    used: u64,
    position: Point3<f64>,
    /// Standard deviation of a reading by the median absolute deviation, mm: the largest of the axes.
    scatter_mm: f64,
}

/// The session with its references followed and their motion taken out of the readings of its stations.
pub(super) fn followed(
    mut joined: Joined,
    references: &[ReferenceReadings],
    settings: &JoinSettings,
) -> Result<Joined, JoinError> {
    if references.is_empty() {
        return Ok(joined);
    }
    let looking = Looking::new(&joined.stations, &joined.clock.model, settings);
    let mut runs = Vec::new();
    for (place, own) in references.iter().enumerate() {
        let (found, rejects) = looking.runs(ReferenceId(place), own)?;
        runs.extend(found);
        joined.rejects.extend(rejects);
    }
    let names: Vec<_> = references.iter().map(|own| (own.name.clone(), own.on)).collect();
    let looks = looks(&joined.stations, &joined.clock.model, &runs);
    let stops: Vec<Stop<'_>> = (1..).zip(&looks).map(|(line, own)| own.stop(line)).collect();
    let origin = Origin { is_timed: true, is_logged: true };
    joined.read_references = read(&stops, &names);
    let (mut courses, rejects) = courses(&stops, &names, origin);
    let left_out = rejects.into_iter().filter_map(|reject| {
        let run = runs.get(usize::try_from(reject.line).ok()?.checked_sub(1)?)?;
        Some(run.reject(reject.code, reject.reason))
    });
    joined.rejects.extend(left_out);
    let stations = &joined.stations;
    let measured = |number: usize| !stations[number].readings.is_empty();
    for (number, motion) in taken_out(&mut courses, measured) {
        match motion {
            Ok(motion) => {
                let readings = joined.stations[number].readings.iter_mut();
                readings.for_each(|own| undo(&mut own.value, &motion));
            }
            Err(reason) => {
                joined.take_out(number, Unmeasured::InstrumentMoved, &reason, |_| true);
            }
        }
    }
    joined.references = courses;
    Ok(joined)
}

/// The dwells by the tracker's clock, which readings of references are sorted by.
struct Looking<'a> {
    dwells: Vec<(Stamp<Tracker>, Stamp<Tracker>)>,
    look_ns: i64,
    settings: &'a JoinSettings,
}

impl<'a> Looking<'a> {
    fn new(stations: &[Station], clock: &ClockModel, settings: &'a JoinSettings) -> Self {
        let dwells = stations.iter();
        let dwells = dwells.map(|own| (clock.to_tracker(own.start), clock.to_tracker(own.end)));
        Self { dwells: dwells.collect(), look_ns: LOOK_NS, settings }
    }

    fn when(&self, at: Stamp<Tracker>) -> When {
        let begun = self.dwells.partition_point(|(start, _)| *start <= at);
        let last = begun.checked_sub(1).and_then(|last| self.dwells.get(last));
        let behind_ns = last.map(|(_, end)| at.since_ns(*end).max(0));
        let before_ns = self.dwells.get(begun).map(|(start, _)| start.since_ns(at));
        let near = |away_ns: Option<i64>| away_ns.filter(|away_ns| *away_ns <= NEAR_NS);
        match (near(behind_ns), near(before_ns)) {
            (Some(behind), before) if before.is_none_or(|before| behind <= before) => {
                When::At(begun - 1)
            }
            (_, Some(_)) => When::At(begun),
            (_, None) => {
                let before = -(before_ns.unwrap_or(0) / self.look_ns) - 1;
                When::Between(begun, behind_ns.map_or(before, |own_ns| own_ns / self.look_ns))
            }
        }
    }

    /// The readings of a reference, look by look, and those left out.
    fn runs(
        &self,
        reference: ReferenceId,
        own: &ReferenceReadings,
    ) -> Result<(Vec<Run>, Vec<JoinReject>), JoinError> {
        let mad_factor = self.settings.mad_factor;
        let mut gathering = Gathering { reference, mad_factor, ..Gathering::default() };
        for seen in pieces(&*own.readings) {
            let seen = seen?;
            for row in seen.rows.clone() {
                let at = seen.stamp(row);
                if !seen.is_measured(row) {
                    gathering.missing.add(at, 1);
                } else if can_be_read(&Point3::from(seen.position(row))) {
                    gathering.take(self.when(at), at, seen.position(row));
                } else {
                    gathering.nowhere.add(at, 1);
                }
            }
        }
        Ok(gathering.finish(&own.name))
    }
}

#[derive(Debug, Default)]
struct LeftOut {
    span: Option<(Stamp<Tracker>, Stamp<Tracker>)>,
    readings: u64,
}

impl LeftOut {
    fn add(&mut self, at: Stamp<Tracker>, readings: u64) {
        let first = self.span.map_or(at, |(first, _)| first);
        self.span = Some((first, at));
        self.readings += readings;
    }

    fn reject(&self, code: RejectCode, reason: String) -> Option<JoinReject> {
        let (start, end) = self.span.filter(|_| self.readings > 0)?;
        let readings = self.readings;
        Some(JoinReject { start, end, readings, is_of_reference: true, code, reason })
    }
}

/// The readings of a reference while they are sorted into looks.
#[derive(Default)]
struct Gathering {
    reference: ReferenceId,
    mad_factor: f64,
    now: Option<When>,
    stamps: Vec<Stamp<Tracker>>,
    positions: Vec<[f64; 3]>,
    runs: Vec<Run>,
    outliers: LeftOut,
    missing: LeftOut,
    nowhere: LeftOut,
}

impl Gathering {
    fn take(&mut self, when: When, at: Stamp<Tracker>, position: [f64; 3]) {
        if self.now != Some(when) {
            self.close();
            self.now = Some(when);
        }
        self.stamps.push(at);
        self.positions.push(position);
    }

    fn close(&mut self) {
        let (Some(when), [start, ..], [.., end]) = (self.now, &self.stamps[..], &self.stamps[..])
        else {
            return;
        };
        let scatter_mm = scatter_mm(&self.positions);
        let keep = if self.positions.len() < FEW {
            vec![true; self.positions.len()]
        } else {
            kept(&self.positions, self.mad_factor, [scatter_mm; 3])
        };
        let used = self.positions.iter().zip(&keep).filter(|(_, keep)| **keep);
        let used: Vec<Vector3<f64>> = used.map(|(own, _)| Vector3::from(*own)).collect();
        self.runs.push(Run {
            reference: self.reference,
            when,
            start: *start,
            end: *end,
            used: used.len() as u64,
            position: Point3::from(used.iter().sum::<Vector3<f64>>() / used.len() as f64),
            scatter_mm,
        });
        for (at, _) in self.stamps.iter().zip(&keep).filter(|(_, keep)| !**keep) {
            self.outliers.add(*at, 1);
        }
        self.stamps.clear();
        self.positions.clear();
    }

    /// The looks in which the reference stood still, and everything that was left out.
    fn finish(mut self, name: &str) -> (Vec<Run>, Vec<JoinReject>) {
        self.close();
        let scatters: Vec<f64> = self.runs.iter().map(|run| run.scatter_mm).collect();
        let usual_mm = median(&scatters).unwrap_or(0.0);
        let reach_mm = self.mad_factor * usual_mm.max(RESOLUTION_MM);
        let (still, moved): (Vec<Run>, Vec<Run>) =
            self.runs.into_iter().partition(|run| run.scatter_mm <= reach_mm);
        let left_out = [
            (self.missing, RejectCode::Missing, "without a measurement"),
            (self.nowhere, RejectCode::Outlier, NOWHERE),
            (self.outliers, RejectCode::Outlier, "far from the others of their look"),
        ];
        let left_out = left_out.into_iter();
        let left_out = left_out
            .filter_map(|(own, code, why)| own.reject(code, format!("reference {name:?}: {why}")));
        let moved = moved.iter().map(|run| {
            let reason = format!(
                "reference {name:?} moved while it was measured: its readings scatter by {:.3} mm, usually by {usual_mm:.3} mm",
                run.scatter_mm
            );
            run.reject(RejectCode::Moving, reason)
        });
        (still, left_out.chain(moved).collect())
    }
}

impl Run {
    /// The readings in its mean, left out for a reason.
    fn reject(&self, code: RejectCode, reason: String) -> JoinReject {
        let Self { start, end, used: readings, .. } = *self;
        JoinReject { start, end, readings, is_of_reference: true, code, reason }
    }

    /// Its mean as the reading of a look.
    fn row(&self, line: u64) -> RowReference {
        RowReference { reference: self.reference, line, position: self.position }
    }
}

/// Standard deviation of a reading by the median absolute deviation, mm: the largest of the axes.
fn scatter_mm(positions: &[[f64; 3]]) -> f64 {
    let of_axis = |axis: usize| {
        let mut values: Vec<f64> = positions.iter().map(|own| own[axis]).collect();
        robust_sigma(&mut values)
    };
    (0..3).map(of_axis).fold(0.0, f64::max)
}

/// A look: its moment by the controller's clock and its readings, one of a reference at most.
struct Look {
    station: Option<usize>,
    at_ns: i64,
    references: Vec<RowReference>,
}

/// All stations and the looks between them, in order of time; the line of a reading is the place of its run, from 1.
fn looks(stations: &[Station], clock: &ClockModel, runs: &[Run]) -> Vec<Look> {
    let mut by_when: BTreeMap<When, Vec<(u64, &Run)>> = BTreeMap::new();
    for (line, run) in (1..).zip(runs) {
        by_when.entry(run.when).or_default().push((line, run));
    }
    for station in stations {
        by_when.entry(When::At(station.number)).or_default();
    }
    let look = |(when, runs): (When, Vec<(u64, &Run)>)| {
        let (station, at_ns) = match when {
            When::At(place) => {
                (Some(place), i64::midpoint(stations[place].start.ns(), stations[place].end.ns()))
            }
            When::Between(..) => (None, between_ns(clock, &runs)),
        };
        let references = runs.iter().map(|(line, run)| run.row(*line)).collect();
        Look { station, at_ns, references }
    };
    let mut looks: Vec<Look> = by_when.into_iter().map(look).collect();
    looks.sort_by_key(|own| (own.at_ns, own.station));
    looks
}

/// The middle of the readings of a look between dwells by the controller's clock, ns.
fn between_ns(clock: &ClockModel, runs: &[(u64, &Run)]) -> i64 {
    let starts = runs.iter().map(|(_, run)| run.start.ns());
    let ends = runs.iter().map(|(_, run)| run.end.ns());
    let (start, end) = (starts.min().unwrap_or(0), ends.max().unwrap_or(0));
    clock.to_controller(Stamp::from_ns(i64::midpoint(start, end))).ns()
}

impl Look {
    /// The look as one that is followed, with its number from 1 in the place of a line.
    fn stop(&self, line: u64) -> Stop<'_> {
        Stop { row: self.station, line, at_ns: self.at_ns, references: &self.references }
    }
}
