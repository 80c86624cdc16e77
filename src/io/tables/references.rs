//! `references`: places of the reference reflectors among each other and in the base frame; `reference_motion`: how they moved
//! together, look by look.

use nalgebra::Point3;

use crate::ingest::StandsOn;
use crate::join::SourceId;
use crate::join::references::{Event, Motion, Place};
use crate::join::tabled::ReferenceCourse;
use crate::judgement::{JoinedSession, Outcome};
use crate::report::Model;
use crate::rows::{row, words};

row! {
    pub struct ReferenceRow of "references" {
        of_session: String,
        reference: String,
        from_line: u64,
        stands_on: StandsOn,
        at as [x_mm, y_mm, z_mm]: [f64; 3],
        sd_mm: f64,
        in_base as [base: point]: Option<[f64; 3]>,
        readings: usize,
        left_out: usize,
        scatter_mm: f64,
        moved_by_mm: Option<f64>,
    }
}

row! {
    pub struct MotionRow of "reference_motion" {
        stands_on: StandsOn,
        line: u64,
        station: Option<usize>,
        at_ns: i64,
        seen: usize,
        part: usize,
        event: Option<MotionEvent>,
        shift_mm as [shift: point]: [f64; 3],
        turn_rad as [turn_x_rad, turn_y_rad, turn_z_rad]: [f64; 3],
        covariance: Vec<f64>,
        middle as point: [f64; 3],
        tells_turns: bool,
        is_taken_out: bool,
    }
}

words! {
    pub enum MotionEvent {
        /// All references jumped together since the look before.
        Bump: "bump",
        /// All references were elsewhere together at this look alone.
        Shock: "shock",
    }
    StandsOn { Base: "base", Floor: "floor" }
}

/// The places of all references of the run's sessions.
pub fn places(outcome: &Outcome<'_>) -> Vec<ReferenceRow> {
    let geometric = outcome.calibrations.iter().find(|(model, _)| *model == Model::Geometric);
    let training = outcome.training.iter().enumerate();
    let training = training.flat_map(|(place, session)| {
        let frames = geometric.and_then(|(_, own)| own.frames.get(place));
        let base = frames.map(|own| own.tracker_from_base(SourceId::ONLY).isometry().inverse());
        of_session(session, move |at| base.map(|base| base.transform_point(at)))
    });
    let test = outcome.test.iter().flat_map(|session| of_session(session, |_| None));
    let mut rows: Vec<ReferenceRow> = training.chain(test).collect();
    rows.sort_by(|a, b| {
        let key =
            |row: &ReferenceRow| (row.of_session.clone(), row.reference.clone(), row.from_line);
        key(a).cmp(&key(b))
    });
    rows
}

fn of_session(
    session: &JoinedSession,
    in_base: impl Fn(&Point3<f64>) -> Option<Point3<f64>>,
) -> Vec<ReferenceRow> {
    let row = |course: &ReferenceCourse, own: &Place| ReferenceRow {
        of_session: session.name.clone(),
        reference: course.names[own.reference.0].clone(),
        from_line: course.looks[own.from].line,
        stands_on: course.on,
        at: own.position.coords.into(),
        sd_mm: own.sd_mm,
        in_base: in_base(&own.position).map(|at| at.coords.into()),
        readings: own.readings,
        left_out: strays(course, own),
        scatter_mm: own.scatter_mm,
        moved_by_mm: moved_by(course, own),
    };
    let courses = session.joined.references.iter();
    courses
        .flat_map(|course| course.followed.places.iter().map(move |own| row(course, own)))
        .collect()
}

/// Stray readings of a reference while it was in a place.
fn strays(course: &ReferenceCourse, own: &Place) -> usize {
    let places = course.followed.places.iter();
    let next = places.filter(|other| other.reference == own.reference && other.from > own.from);
    let until = next.map(|other| other.from).min().unwrap_or(usize::MAX);
    let events = course.followed.events.iter();
    let is_own = |event: &&Event| {
        matches!(event, Event::Stray { look, reference, .. }
            if *reference == own.reference && (own.from..until).contains(look))
    };
    events.filter(is_own).count()
}

fn moved_by(course: &ReferenceCourse, own: &Place) -> Option<f64> {
    let mut events = course.followed.events.iter();
    events.find_map(|event| match *event {
        Event::Moved { look, reference, by_mm } => {
            (reference == own.reference && look == own.from).then_some(by_mm)
        }
        _ => None,
    })
}

pub fn motions(session: &JoinedSession) -> Vec<MotionRow> {
    let courses = session.joined.references.iter();
    courses.flat_map(|course| (0..course.looks.len()).map(|look| motion(course, look))).collect()
}

fn motion(course: &ReferenceCourse, look: usize) -> MotionRow {
    let (at, own): (_, &Motion) = (&course.looks[look], &course.followed.motions[look]);
    let middle = own.middle;
    let lower = (0..6).flat_map(|row| (0..=row).map(move |column| own.covariance[(row, column)]));
    MotionRow {
        stands_on: course.on,
        line: at.line,
        station: at.station,
        at_ns: at.at_ns,
        seen: at.seen,
        part: own.part,
        event: event(course, look),
        shift_mm: (own.moved.transform_point(&middle) - middle).into(),
        turn_rad: own.moved.rotation.scaled_axis().into(),
        covariance: lower.collect(),
        middle: middle.coords.into(),
        tells_turns: course.followed.tells_turns,
        is_taken_out: course.is_taken_out,
    }
}

fn event(course: &ReferenceCourse, look: usize) -> Option<MotionEvent> {
    let mut events = course.followed.events.iter();
    events.find_map(|event| match event {
        Event::Bump { before, .. } => (*before == look).then_some(MotionEvent::Bump),
        Event::Shock { look: own, .. } => (*own == look).then_some(MotionEvent::Shock),
        Event::Stray { .. } | Event::Moved { .. } => None,
    })
}
