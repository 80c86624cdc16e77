//! Bumps of the instrument that are larger than the join's gate: found by the references alone, before targets are joined.
//!
//! Behind a bump of a tenth of a metre or of degrees no reading agrees with the arm as it is placed before it, and the join would leave
//! those readings out as another reflector's. References need neither the arm nor the controller's clock to tell it:
//!
//! 1. their readings become looks of a second to half a minute by the tracker's clock, which are followed as any others ([`follow`]);
//! 2. a bump among them ends a part of the session; its moment is narrowed down by the readings beside it;
//! 3. where the references tell all six motions, the readings of targets are joined as if it had not been, and then carried back, so
//!    that the motion is taken out of them as any other is ([`super::followed`]);
//! 4. where they do not, only the readings of the larger part are joined: nothing ties both together.
//!
//! Smaller bumps need none of this: the join pairs across them.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Quaternion, UnitQuaternion};

use super::{LOOK_NS, Looking, NEAR_NS, Run, When};
use crate::figures::median;
use crate::ingest::{Poses, PosesError, StandsOn, TargetReadings};
use crate::join::readings::{Readings, Seen, is_measurement};
use crate::join::references::{Event, Followed, Look, Motion, ReferenceId, follow};
use crate::join::{
    JoinError, JoinInput, JoinReject, JoinSettings, Joined, Pairing, ReferenceReadings, RejectCode,
    Unmeasured, Value,
};
use crate::units::{NS_PER_S, Stamp, Tracker};

/// The join pairs across a bump that moves targets by less than this share of its gate: what the nominal arm is off by needs the rest.
const SHARE_OF_GATE: f64 = 1.0 / 3.0;
/// Looks of a session, unless they would be shorter than a second or longer than half a minute.
const LOOKS: i64 = 256;
/// Readings of the target by which the size of a bump is told, spread over the session.
const TOLD_BY: usize = 200;

/// The readings of the targets as they are joined.
#[derive(Debug)]
pub(in crate::join) struct Targets<'a> {
    /// Those of the main target, or of all that are not named.
    pub(in crate::join) main: Box<dyn Poses<Tracker> + 'a>,
    pub(in crate::join) others: Vec<Box<dyn Poses<Tracker> + 'a>>,
    parts: Arc<[Part]>,
    rejects: Vec<JoinReject>,
}

#[derive(Debug, Clone, PartialEq)]
struct Part {
    from: Stamp<Tracker>,
    /// From where something stood in the session's first part to where it stands now.
    moved: Isometry3<f64>,
    is_used: bool,
}

impl<'a> Targets<'a> {
    /// The readings of targets, carried across bumps that are too large for the join.
    pub(in crate::join) fn of(
        input: &'a JoinInput,
        settings: &JoinSettings,
    ) -> Result<Self, JoinError> {
        let parts: Arc<[Part]> = parts(input, settings)?.into();
        let mut rejects = Vec::new();
        let mut carried = |own: &'a dyn Poses<Tracker>| {
            let rows = used_rows(own, &parts)?;
            rejects.extend(left_out(own, &rows)?);
            let carried = WithoutBumps { own, rows, parts: Arc::clone(&parts) };
            Ok(Box::new(carried) as Box<dyn Poses<Tracker> + 'a>)
        };
        let main = carried(&*input.readings)?;
        let others: Result<_, JoinError> = input.others.iter().map(|own| carried(&**own)).collect();
        Ok(Self { main, others: others?, parts, rejects })
    }

    /// What was joined, with the readings of its stations as the instrument took them, and with those that were not joined.
    pub(in crate::join) fn restored(&self, mut joined: Joined) -> Joined {
        if self.parts.len() < 2 {
            return joined;
        }
        for station in &mut joined.stations {
            for reading in &mut station.readings {
                moved_by(&mut reading.value, &part_of(&self.parts, reading.first).moved);
            }
            let middle = station.start.plus_ns(station.end.since_ns(station.start) / 2);
            let part = part_of(&self.parts, joined.clock.model.to_tracker(middle));
            if station.readings.is_empty() && !part.is_used {
                station.pairing = Pairing::Unmeasured(Unmeasured::InstrumentMoved);
            }
        }
        joined.counts.unpaired += self.rejects.iter().map(|own| own.readings).sum::<u64>();
        joined.rejects.extend(self.rejects.iter().cloned());
        joined
    }
}

fn part_of(parts: &[Part], at: Stamp<Tracker>) -> &Part {
    let begun = parts.partition_point(|part| part.from <= at);
    &parts[begun.saturating_sub(1)]
}

/// Takes a value read by the instrument in its first place to one read from where it stands now.
fn moved_by(value: &mut Value, by: &Isometry3<f64>) {
    if let Some(point) = value.point_mut() {
        point.position = by * point.position;
    }
    if let Value::Pose(_, turn) = value {
        turn.orientation = by.rotation * turn.orientation;
    }
}

/// Rows of the parts that are joined; all where every part is.
fn used_rows(own: &dyn Poses<Tracker>, parts: &[Part]) -> Result<Range<usize>, JoinError> {
    let used = parts.iter().position(|part| part.is_used);
    let Some(used) = used.filter(|_| parts.iter().any(|part| !part.is_used)) else {
        return Ok(0..own.count());
    };
    let first = match used {
        0 => 0,
        _ => own.count_while(&|at| at < parts[used].from)?,
    };
    let end = match parts.get(used + 1) {
        Some(next) => own.count_while(&|at| at < next.from)?,
        None => own.count(),
    };
    Ok(first..end.max(first))
}

/// Rows beside those that are joined, as rejects.
fn left_out(own: &dyn Poses<Tracker>, used: &Range<usize>) -> Result<Vec<JoinReject>, JoinError> {
    let beside = [0..used.start, used.end..own.count()];
    let rejects = beside.into_iter().filter(|rows| !rows.is_empty());
    let reject = |rows: Range<usize>| {
        Ok(JoinReject {
            start: own.stamp(rows.start)?,
            end: own.stamp(rows.end - 1)?,
            readings: rows.len() as u64,
            is_of_reference: false,
            code: RejectCode::MOVED,
            reason: "instrument_moved: the instrument or the base was bumped by more than the join can pair across, and the references do \
                     not tell how it turned: only the larger part of the session is joined; three references that are not in line tell it"
                .to_owned(),
        })
    };
    rejects.map(reject).collect()
}

/// Readings without the bumps before them, and of the parts that are joined alone.
#[derive(Debug)]
struct WithoutBumps<'a> {
    own: &'a dyn Poses<Tracker>,
    rows: Range<usize>,
    parts: Arc<[Part]>,
}

impl Poses<Tracker> for WithoutBumps<'_> {
    fn count(&self) -> usize {
        self.rows.len()
    }

    fn read(&self, rows: Range<usize>) -> Result<TargetReadings, PosesError> {
        let first = self.rows.start;
        let mut read = self.own.read(rows.start + first..rows.end + first)?;
        if self.parts.len() < 2 {
            return Ok(read);
        }
        let back = |at: &Stamp<Tracker>| part_of(&self.parts, *at).moved.inverse();
        for (at, position) in read.stamps.iter().zip(&mut read.positions) {
            if is_measurement(position) {
                *position = (back(at) * Point3::from(*position)).into();
            }
        }
        for (at, turn) in read.stamps.iter().zip(read.orientations.iter_mut().flatten()) {
            *turn = turned(&back(at).rotation, *turn);
        }
        Ok(read)
    }

    fn stamp(&self, row: usize) -> Result<Stamp<Tracker>, PosesError> {
        self.own.stamp(row + self.rows.start)
    }
}

fn turned(by: &UnitQuaternion<f64>, [x, y, z, w]: [f64; 4]) -> [f64; 4] {
    (by.quaternion() * Quaternion::new(w, x, y, z)).coords.into()
}

/// The parts of a session; one where no bump is too large for the join.
fn parts(input: &JoinInput, settings: &JoinSettings) -> Result<Vec<Part>, JoinError> {
    let first =
        Part { from: Stamp::from_ns(i64::MIN), moved: Isometry3::identity(), is_used: true };
    let Some(told) = BumpReferences::of(&input.references, settings)? else {
        return Ok(vec![first]);
    };
    let at = positions(&*input.readings)?;
    let bumps: Vec<(usize, usize)> = told.bumps().collect();
    let largest_mm = bumps.iter().map(|bump| told.moves_mm(*bump, &at));
    if largest_mm.fold(0.0, f64::max) <= SHARE_OF_GATE * settings.geometry_gate_mm {
        return Ok(vec![first]);
    }
    let mut parts = vec![first];
    for (after, before) in bumps {
        let from = told.moment(after, before, &input.references)?;
        parts.push(Part { from, moved: told.followed.motions[before].moved, is_used: true });
    }
    if !told.followed.tells_turns {
        keep_largest(&mut parts, &*input.readings, settings)?;
    }
    Ok(parts)
}

/// Leaves the part with the most dwells of the target as the only one that is joined; of equal parts the first.
fn keep_largest(
    parts: &mut [Part],
    readings: &dyn Poses<Tracker>,
    settings: &JoinSettings,
) -> Result<(), JoinError> {
    let readings = Readings::find(readings, settings)?;
    let mut dwells = vec![0_usize; parts.len()];
    for own in &readings.stationary.stretches {
        let at = Stamp::from_ns(own.start_ns);
        let begun = parts.partition_point(|part| part.from <= at);
        dwells[begun.saturating_sub(1)] += 1;
    }
    let most = dwells.iter().copied().max().unwrap_or(0);
    let largest = dwells.iter().position(|own| *own == most);
    for (place, part) in parts.iter_mut().enumerate() {
        part.is_used = Some(place) == largest;
    }
    Ok(())
}

/// Some positions of the target, spread over the session, mm.
fn positions(readings: &dyn Poses<Tracker>) -> Result<Vec<Point3<f64>>, JoinError> {
    let stride = readings.count().div_ceil(TOLD_BY).max(1);
    let mut all = Vec::new();
    for row in (0..readings.count()).step_by(stride) {
        let read = readings.read(row..row + 1)?;
        all.extend(read.positions.into_iter().filter(is_measurement).map(Point3::from));
    }
    Ok(all)
}

/// The references that tell bumps, followed by the tracker's clock.
struct BumpReferences {
    /// The readings of each look, in order of time.
    looks: Vec<Vec<Run>>,
    followed: Followed,
}

impl BumpReferences {
    /// Those on the base where they tell rotations, else those on the floor where they do, else those that there are.
    fn of(
        references: &[ReferenceReadings],
        settings: &JoinSettings,
    ) -> Result<Option<Self>, JoinError> {
        let mut found = Vec::new();
        for on in [StandsOn::Base, StandsOn::Floor] {
            found.extend(Self::on(on, references, settings)?);
        }
        let place = found.iter().position(|own| own.followed.tells_turns);
        Ok(found.into_iter().nth(place.unwrap_or(0)))
    }

    fn on(
        on: StandsOn,
        references: &[ReferenceReadings],
        settings: &JoinSettings,
    ) -> Result<Option<Self>, JoinError> {
        let own = references.iter().enumerate();
        let own = own.filter(|(_, own)| own.on == on && own.readings.count() > 0);
        let own: Vec<(usize, &ReferenceReadings)> = own.collect();
        let Some((first, last)) = span(&own)? else { return Ok(None) };
        // Looks since the first reading, which is in the place of a dwell.
        let looking = Looking {
            dwells: vec![(first, first)],
            look_ns: (last.since_ns(first) / LOOKS).clamp(NEAR_NS, LOOK_NS),
            settings,
        };
        let mut looks: BTreeMap<When, Vec<Run>> = BTreeMap::new();
        for (place, own) in own {
            let (runs, _) = looking.runs(ReferenceId(place), own)?;
            for run in runs {
                looks.entry(run.when).or_default().push(run);
            }
        }
        let looks: Vec<Vec<Run>> = looks.into_values().collect();
        let seen: Vec<Look> = looks.iter().map(|runs| look(runs, first)).collect();
        Ok(follow(&seen).map(|followed| Self { looks, followed }))
    }

    /// The looks on either side of each bump.
    fn bumps(&self) -> impl Iterator<Item = (usize, usize)> {
        self.followed.events.iter().filter_map(|event| match *event {
            Event::Bump { after, before, .. } => Some((after, before)),
            Event::Shock { .. } | Event::Stray { .. } | Event::Moved { .. } => None,
        })
    }

    /// How far a bump moves the references' middle or something at these positions, mm: the farther of both medians.
    fn moves_mm(&self, (after, before): (usize, usize), at: &[Point3<f64>]) -> f64 {
        let [after, before] = [after, before].map(|look| &self.followed.motions[look]);
        let by = before.moved * after.moved.inverse();
        let away_mm: Vec<f64> = at.iter().map(|at| (by * at - at).norm()).collect();
        let middle = |own: &Motion| own.moved.transform_point(&own.middle);
        let shift_mm = (middle(before) - middle(after)).norm();
        median(&away_mm).unwrap_or(0.0).max(shift_mm)
    }

    /// The moment of a bump between two looks: in the middle between the last reading that is nearer to where the references were before
    /// it and the first that is nearer to where they are behind it.
    fn moment(
        &self,
        after: usize,
        before: usize,
        references: &[ReferenceReadings],
    ) -> Result<Stamp<Tracker>, JoinError> {
        let ends = self.looks[after].iter().map(|run| run.end);
        let starts = self.looks[before].iter().map(|run| run.start);
        let (Some(mut last), Some(mut first)) = (ends.max(), starts.min()) else {
            return Ok(Stamp::from_ns(i64::MIN));
        };
        let (from, until) = (last, first);
        for (place, own) in references.iter().enumerate() {
            let Some(places) = self.places(ReferenceId(place), after, before) else { continue };
            let rows = between(&*own.readings, from, until)?;
            let seen = Seen { readings: own.readings.read(rows.clone())?, rows };
            for row in seen.measured() {
                let at = Point3::from(seen.position(row));
                let [before_mm, behind_mm] = places.map(|place| (at - place).norm());
                // A reading in flight is near to neither.
                if before_mm < behind_mm / 4.0 {
                    last = last.max(seen.stamp(row));
                } else if behind_mm < before_mm / 4.0 {
                    first = first.min(seen.stamp(row));
                }
            }
        }
        let (last, first) = if last <= first { (last, first) } else { (from, until) };
        Ok(last.plus_ns(first.since_ns(last) / 2))
    }

    /// Where a reference stands at two looks, mm; `None` where it is not of this set or has no place.
    fn places(&self, id: ReferenceId, after: usize, before: usize) -> Option<[Point3<f64>; 2]> {
        let mut own = self.followed.places.iter().filter(|own| own.reference == id);
        let place = own.rfind(|own| own.from <= after)?.position;
        Some([after, before].map(|look| self.followed.motions[look].moved * place))
    }
}

type Span = (Stamp<Tracker>, Stamp<Tracker>);

/// The first and the last moment of references; `None` without any.
fn span(references: &[(usize, &ReferenceReadings)]) -> Result<Option<Span>, JoinError> {
    let mut span: Option<Span> = None;
    for (_, own) in references {
        let ends = (own.readings.stamp(0)?, own.readings.stamp(own.readings.count() - 1)?);
        span = Some(span.map_or(ends, |(first, last)| (first.min(ends.0), last.max(ends.1))));
    }
    Ok(span)
}

/// The readings of a look, with its moment since the first reading.
fn look(runs: &[Run], first: Stamp<Tracker>) -> Look {
    let starts = runs.iter().map(|run| run.start.since_ns(first));
    let ends = runs.iter().map(|run| run.end.since_ns(first));
    let (start, end) = (starts.min().unwrap_or(0), ends.max().unwrap_or(0));
    let seen = runs.iter().map(|run| (run.reference, run.position));
    Look { at_s: i64::midpoint(start, end) as f64 / NS_PER_S, seen: seen.collect() }
}

/// Rows of readings from one moment to another.
fn between(
    readings: &dyn Poses<Tracker>,
    from: Stamp<Tracker>,
    until: Stamp<Tracker>,
) -> Result<Range<usize>, JoinError> {
    let first = readings.count_while(&|at| at < from)?;
    let end = readings.count_while(&|at| at <= until)?;
    Ok(first..end.max(first))
}
