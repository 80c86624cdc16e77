//! The references of a session are followed, and their motion is taken out of the readings of its targets. Rows of a table (`join::tabled`)
//! and readings of logs (`join::logged_references`) become the same looks.
//!
//! References on the base show it and are taken where they tell all six motions; otherwise those on the floor, which show the
//! instrument, where they do. A reading stays out where the motion at its station is not known: between the looks around a bump,
//! at a station where all references were elsewhere, and in the smaller parts of a session that nothing ties to its largest.
//!
//! Lengths stay as they are. Floor references show the instrument of places, which reads no lengths. Beside references on the base
//! only instruments that stand on the base too are allowed: in its frame they do not move. One on the floor would, by as much as the
//! base, and its anchor would need a place at each station.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use super::references::{Event, Followed, Look, Motion, ReferenceId, follow};
use super::{RejectCode, RowItem, RowReject, Value};
use crate::geometry::upper;
use crate::ingest::StandsOn;
use crate::units::NS_PER_S;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReferenceCourse {
    pub on: StandsOn,
    pub names: Arc<[String]>,
    pub followed: Followed,
    /// The looks of the course, in order of time.
    pub looks: Vec<LookAt>,
    pub is_taken_out: bool,
    /// Whether the looks have times; otherwise they count as a second apart.
    pub is_timed: bool,
    /// Whether they were read in logs, whose looks have numbers in the place of lines.
    pub is_logged: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct LookAt {
    /// Line in the table, from 1; the number of the look in logs, from 1.
    pub line: u64,
    pub at_ns: i64,
    /// Number of the station; `None` of a row between stations.
    pub station: Option<usize>,
    pub seen: usize,
}

/// How often and where in a session a stated reference was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReadReference {
    pub name: String,
    pub on: StandsOn,
    pub looks: usize,
    /// The first and the last station at or beside which it was read; `None` where it never was.
    pub between: Option<[usize; 2]>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RowReference {
    pub reference: ReferenceId,
    pub line: u64,
    pub position: Point3<f64>,
}

/// One row that references may have been read in, or one look of logs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stop<'a> {
    /// Place of the station among the rows; `None` between stations.
    pub row: Option<usize>,
    pub line: u64,
    pub at_ns: i64,
    pub references: &'a [RowReference],
}

/// The origin of the looks of a session.
#[derive(Debug, Clone, Copy)]
pub(super) struct Origin {
    pub is_timed: bool,
    pub is_logged: bool,
}

impl ReferenceCourse {
    /// A look in words: its line in a table, its station or number in logs.
    pub fn place_of(&self, look: usize) -> String {
        let at = &self.looks[look];
        match (self.is_logged, at.station) {
            (false, _) => format!("line {}", at.line),
            (true, Some(station)) => format!("station {station}"),
            (true, None) => format!("look {}, between stations", at.line),
        }
    }
}

/// Whether an instrument can have read a reference there, in its own frame: none reads within 20 mm or beyond a kilometre, where references in
/// another unit seem to stand. One within a millimetre of the origin may define the frame.
pub fn can_be_read(position: &Point3<f64>) -> bool {
    let away_mm = position.coords.norm();
    away_mm <= 1.0 || (20.0..1e6).contains(&away_mm)
}

/// How often and where each of `references` was read at `stops`, which are in order of time.
pub(super) fn read(stops: &[Stop<'_>], references: &[(String, StandsOn)]) -> Vec<ReadReference> {
    let named = references.iter().map(|(name, on)| ReadReference {
        name: name.clone(),
        on: *on,
        looks: 0,
        between: None,
    });
    let mut read: Vec<ReadReference> = named.collect();
    // A look between stations counts from the station before it, and at the start from the first.
    let mut station = 0;
    for stop in stops {
        station = stop.row.unwrap_or(station);
        let seen: BTreeSet<ReferenceId> = stop.references.iter().map(|own| own.reference).collect();
        for id in seen {
            let Some(own) = read.get_mut(id.0) else { continue };
            own.looks += 1;
            own.between = Some([own.between.map_or(station, |[first, _]| first), station]);
        }
    }
    read
}

/// The courses of references on the base and on the floor, and the readings left out. None is taken out of readings yet.
pub(super) fn courses(
    stops: &[Stop<'_>],
    references: &[(String, StandsOn)],
    origin: Origin,
) -> (Vec<ReferenceCourse>, Vec<RowReject>) {
    let names: Arc<[String]> = references.iter().map(|(name, _)| name.clone()).collect();
    let mut rejects = twice(stops, &names);
    let mut courses = Vec::new();
    for on in [StandsOn::Base, StandsOn::Floor] {
        let stands = |id: ReferenceId| references.get(id.0).is_some_and(|(_, own)| *own == on);
        let looks = looks(stops, stands);
        let Some(followed) = follow(&looks) else {
            rejects.extend(alone(stops, stands, on));
            continue;
        };
        let seen = looks.iter().map(|look| look.seen.len());
        let at = stops.iter().zip(seen).map(|(stop, seen)| LookAt {
            line: stop.line,
            at_ns: stop.at_ns,
            station: stop.row,
            seen,
        });
        let course = ReferenceCourse {
            on,
            names: Arc::clone(&names),
            looks: at.collect(),
            followed,
            is_taken_out: false,
            is_timed: origin.is_timed,
            is_logged: origin.is_logged,
        };
        rejects.extend(strays(&course, stops));
        courses.push(course);
    }
    (courses, rejects)
}

/// The motion of each station by the course that is taken out of the readings, which is marked; the reason where it is not known.
/// Empty without courses. `measured` is whether a station has readings of targets, which decides the larger part of a session.
pub(super) fn taken_out(
    courses: &mut [ReferenceCourse],
    measured: impl Fn(usize) -> bool,
) -> Vec<(usize, Result<Motion, String>)> {
    let taken = courses.iter().position(|own| own.followed.tells_turns).unwrap_or(0);
    let Some(course) = courses.get_mut(taken) else { return Vec::new() };
    course.is_taken_out = true;
    let main = main_part(course, measured);
    let at = course.looks.iter().enumerate();
    at.filter_map(|(look, at)| {
        let motion = unknown(course, look, main)
            .map_or_else(|| Ok(course.followed.motions[look].clone()), Err);
        Some((at.station?, motion))
    })
    .collect()
}

/// The looks at those references for which `stands` holds; of two readings of one reference in a row the first.
fn looks(stops: &[Stop<'_>], stands: impl Fn(ReferenceId) -> bool) -> Vec<Look> {
    let first_ns = stops.first().map_or(0, |stop| stop.at_ns);
    let look = |stop: &Stop<'_>| {
        let mut seen: BTreeMap<ReferenceId, _> = BTreeMap::new();
        for own in stop.references.iter().filter(|own| stands(own.reference)) {
            seen.entry(own.reference).or_insert(own.position);
        }
        Look { at_s: (stop.at_ns - first_ns) as f64 / NS_PER_S, seen: seen.into_iter().collect() }
    };
    stops.iter().map(look).collect()
}

/// Second readings of a reference in one look.
fn twice(stops: &[Stop<'_>], names: &[String]) -> Vec<RowReject> {
    let of_stop = |stop: &Stop<'_>| {
        let mut seen = BTreeMap::new();
        let mut again = Vec::new();
        for own in stop.references {
            let first = *seen.entry(own.reference).or_insert(own.line);
            if first != own.line {
                let name = &names[own.reference.0];
                let reason =
                    format!("reference {name:?} was read at line {first} of the same station");
                let code = RejectCode::Repeated;
                again.push(RowReject::of(RowItem::Reference, own.line, stop.row, code, reason));
            }
        }
        again
    };
    stops.iter().flat_map(of_stop).collect()
}

/// The readings of references that are too few to follow.
fn alone(stops: &[Stop<'_>], stands: impl Fn(ReferenceId) -> bool, on: StandsOn) -> Vec<RowReject> {
    let reason = format!(
        "references on the {} were read in one row only: there is no motion to follow",
        on.word()
    );
    let own = stops.iter().flat_map(|stop| stop.references.iter().map(move |own| (stop, own)));
    let own = own.filter(|(_, own)| stands(own.reference));
    own.map(|(stop, own)| {
        RowReject::of(RowItem::Reference, own.line, stop.row, RejectCode::Alone, reason.clone())
    })
    .collect()
}

/// The stray readings of a course, as rejects.
fn strays(course: &ReferenceCourse, stops: &[Stop<'_>]) -> Vec<RowReject> {
    let stray = |event: &Event| match *event {
        Event::Stray { look, reference, away_mm } => {
            let stop = &stops[look];
            let mut own = stop.references.iter();
            let own = own.find(|own| own.reference == reference);
            let reason = format!(
                "reference {:?} is {away_mm:.2} mm from where the others and its own readings put it",
                course.names[reference.0]
            );
            let line = own.map_or(stop.line, |own| own.line);
            Some(RowReject::of(RowItem::Reference, line, stop.row, RejectCode::Outlier, reason))
        }
        Event::Bump { .. } | Event::Shock { .. } | Event::Moved { .. } => None,
    };
    course.followed.events.iter().filter_map(stray).collect()
}

/// The part with the most measured stations, where the parts are not tied together.
fn main_part(course: &ReferenceCourse, measured: impl Fn(usize) -> bool) -> Option<usize> {
    if course.followed.is_bridged() {
        return None;
    }
    let mut stations: BTreeMap<usize, usize> = BTreeMap::new();
    let parts = course.looks.iter().zip(&course.followed.motions);
    for (_, motion) in parts.filter(|(look, _)| look.station.is_some_and(&measured)) {
        *stations.entry(motion.part).or_default() += 1;
    }
    // Of equal parts the first.
    let largest = stations.into_iter().max_by_key(|(part, count)| (*count, usize::MAX - part));
    largest.map(|(part, _)| part)
}

/// Why the motion at a look is not known; `None` where it is.
fn unknown(course: &ReferenceCourse, look: usize, main: Option<usize>) -> Option<String> {
    let what = course.on.moves();
    for event in &course.followed.events {
        match *event {
            Event::Bump { after, before, .. } if after < look && look < before => {
                return Some(format!(
                    "{what} was bumped between {} and {}, at which references were read: which side of it this station is \
                     on is not known",
                    course.place_of(after),
                    course.place_of(before)
                ));
            }
            Event::Shock { look: at, shift_mm, .. } if at == look => {
                return Some(format!(
                    "all references were elsewhere at this station alone, by {shift_mm:.2} mm: something moved while it was measured"
                ));
            }
            Event::Bump { .. }
            | Event::Shock { .. }
            | Event::Stray { .. }
            | Event::Moved { .. } => {}
        }
    }
    let part = course.followed.motions[look].part;
    main.filter(|main| *main != part).map(|_| {
        format!(
            "{what} was bumped, and the references do not tell how it turned: stations before and behind a bump have no frame in \
             common, and those of the larger part are kept; three references that are not in line tell it"
        )
    })
}

/// Takes a motion out of what was read.
pub(crate) fn undo(value: &mut Value, motion: &Motion) {
    let covariance = value.point().map(|point| motion.covariance_at(&point.position));
    if let Some(point) = value.point_mut() {
        point.position = motion.undone(&point.position);
        point.motion_covariance = covariance.map(|own| upper(&own));
    }
    if let Value::Pose(_, turn) = value {
        turn.orientation = motion.moved.rotation.inverse() * turn.orientation;
    }
}
