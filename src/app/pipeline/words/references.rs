//! What the references of the sessions showed, as lines for a person.

mod silent;

use std::collections::BTreeSet;

use crate::join::moved::{Elsewhere, Knock};
use crate::join::references::{Event, Followed, Motion};
use crate::join::tabled::ReferenceCourse;
use crate::join::{ClockStep, Joined, REPEATED};
use crate::judgement::{JoinedSession, Outcome};
use crate::pipeline::damage::NOTHING;
use crate::units::{NS_PER_S, SLIDE_MM_PER_RAD};

/// One line for each set of references: how many there are, how far they moved, and how well that is known.
pub(in crate::pipeline) fn followed(outcome: &Outcome<'_>) -> Vec<String> {
    each(outcome).map(|(session, course)| format!("{}: {}", session.name, line(course))).collect()
}

/// Bumps and moved references, moves that no reference tells, and references that were not read or in a part of a session only: somebody has to look at them.
/// Of those by less than `least_mm` there is the number.
pub(in crate::pipeline) fn warned(outcome: &Outcome<'_>, least_mm: f64) -> Vec<String> {
    let sessions = || outcome.training.iter().chain(&outcome.test);
    let of_course = |(session, course): (&JoinedSession, &ReferenceCourse)| {
        let events = course.followed.events.iter().filter(|event| !is_of_a_bump(course, event));
        let (small, large): (Vec<&Event>, Vec<&Event>) =
            events.partition(|event| size_mm(event).is_some_and(|mm| mm < least_mm));
        let words = large.into_iter().filter_map(|event| warning(course, event));
        let largest = small.iter().filter_map(|event| size_mm(event)).max_by(f64::total_cmp);
        let largest = largest.filter(|mm| *mm >= NOTHING);
        let small = largest.map(|mm| {
            format!(
                "{} moves of references on the {} of at most {mm:.3} mm are less than the tolerance notices ({least_mm:.3} mm)",
                small.len(),
                course.on.word()
            )
        });
        words.chain(small).map(|words| format!("{}: {words}", session.name)).collect::<Vec<_>>()
    };
    let silent = sessions().flat_map(|session| {
        let words = silent::warned(&session.joined);
        let elsewhere = session.joined.elsewhere.iter().map(Elsewhere::words);
        let steps = session.joined.clock.steps.iter().map(ClockStep::words);
        let knocks = session.joined.knocks.iter().map(Knock::words);
        let named =
            elsewhere.chain(steps).chain(knocks).chain(repeated(&session.joined)).chain(words);
        named.map(|words| format!("{}: {words}", session.name)).collect::<Vec<_>>()
    });
    each(outcome).flat_map(of_course).chain(silent).collect()
}

/// A remark on readings that were logged again while the beam was lost; `None` without any.
fn repeated(joined: &Joined) -> Option<String> {
    let readings = joined.rejects.iter().filter(|own| own.reason == REPEATED);
    let readings: u64 = readings.map(|own| own.readings).sum();
    (readings > 0).then(|| {
        format!("{readings} readings are the one before them again while the arm moved: the beam was lost, and they are left out")
    })
}

fn each<'o>(
    outcome: &'o Outcome<'_>,
) -> impl Iterator<Item = (&'o JoinedSession, &'o ReferenceCourse)> {
    let sessions = outcome.training.iter().chain(&outcome.test);
    sessions.flat_map(|session| session.joined.references.iter().map(move |own| (session, own)))
}

fn line(course: &ReferenceCourse) -> String {
    let followed = &course.followed;
    let turns = if followed.tells_turns {
        "which tell rotations"
    } else {
        "which tell no rotations (three that are not in line do)"
    };
    let taken = if course.is_taken_out { "; this motion is taken out of the readings" } else { "" };
    let (shift_mm, turn_rad) = farthest(followed);
    let strays =
        followed.events.iter().filter(|event| matches!(event, Event::Stray { .. })).count();
    let shocks =
        followed.events.iter().filter(|event| matches!(event, Event::Shock { .. })).count();
    format!(
        "{} references on the {}, {turns}: at most {shift_mm:.3} mm and {:.3} mrad from where they were first, read to {:.3} mm; {strays} \
         stray readings and {shocks} stations at which all were elsewhere left out{taken}",
        followed.places.len(),
        course.on.word(),
        1e3 * turn_rad,
        followed.sizes.reading_mm,
    )
}

/// The farthest shift of the middle and the largest rotation since the first look, apart from shocks.
fn farthest(followed: &Followed) -> (f64, f64) {
    let is_shock = |look: usize| {
        let mut events = followed.events.iter();
        events.any(|event| matches!(event, Event::Shock { look: own, .. } if *own == look))
    };
    let motions = followed.motions.iter().enumerate().filter(|(look, _)| !is_shock(*look));
    let of = |motion: &Motion| {
        let shift = motion.moved.transform_point(&motion.middle) - motion.middle;
        (shift.norm(), motion.moved.rotation.angle())
    };
    motions
        .map(|(_, motion)| of(motion))
        .fold((0.0, 0.0), |(shift, turn), own| (f64::max(shift, own.0), f64::max(turn, own.1)))
}

/// How far an event moved references, a turn as at a metre, mm; `None` of one that is no move.
fn size_mm(event: &Event) -> Option<f64> {
    match *event {
        Event::Bump { shift_mm, turn_rad, .. } => Some(shift_mm.max(SLIDE_MM_PER_RAD * turn_rad)),
        Event::Moved { by_mm, .. } => Some(by_mm),
        Event::Shock { .. } | Event::Stray { .. } => None,
    }
}

/// Whether a move of one reference is how a bump turned the instrument, of which the references tell no rotation.
fn is_of_a_bump(course: &ReferenceCourse, event: &Event) -> bool {
    let Event::Moved { look, .. } = event else { return false };
    let is_bump = |own: &Event| matches!(own, Event::Bump { before, .. } if before == look);
    !course.followed.tells_turns && course.followed.events.iter().any(is_bump)
}

fn warning(course: &ReferenceCourse, event: &Event) -> Option<String> {
    match *event {
        Event::Bump { after, before, shift_mm, turn_rad } => {
            let turned = format!(" and {:.2} mrad", 1e3 * turn_rad);
            let turned = if course.followed.tells_turns { turned } else { String::new() };
            let places = course.followed.places.iter();
            let references: BTreeSet<_> = places.map(|own| own.reference).collect();
            let tied = if course.followed.is_bridged() {
                "the references tie both parts of the session together"
            } else if references.len() == 1 {
                "or the one reference was: a second tells which. Only the larger of the two parts is used"
            } else {
                "two parts of the session have nothing in common; only the larger is used"
            };
            let (from, to) = (moment(course, after), moment(course, before));
            Some(format!(
                "{} was bumped between {from} and {to}: {shift_mm:.3} mm{turned} at the references; {tied}",
                course.on.moves(),
            ))
        }
        Event::Moved { look, reference, by_mm } => Some(format!(
            "reference {:?} was moved by {by_mm:.2} mm among the others before {}: it counts as a new one from there",
            course.names[reference.0],
            moment(course, look),
        )),
        Event::Shock { .. } | Event::Stray { .. } => None,
    }
}

/// A look by its station, line or number, with its time where there are times.
fn moment(course: &ReferenceCourse, look: usize) -> String {
    let at = &course.looks[look];
    let place = match at.station.filter(|_| !course.is_logged) {
        Some(station) => format!("station {station} (line {})", at.line),
        None => course.place_of(look),
    };
    if !course.is_timed {
        return place;
    }
    let since_s = (at.at_ns - course.looks[0].at_ns) as f64 / NS_PER_S;
    format!("{place}, {:.1} min after the first", since_s / 60.0)
}
