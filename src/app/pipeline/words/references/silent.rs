//! References that the pipeline file states and that were not read, or in a part of the session only: what is not found without them,
//! and what to do.

use crate::ingest::StandsOn;
use crate::join::Joined;
use crate::join::tabled::{ReadReference, ReferenceCourse};

/// A stretch without readings is named where it has more than this share of the session's stations.
const SHARE: f64 = 0.1;
/// It has at least so many stations.
const LEAST: usize = 3;
/// References that are needed for rotations.
const FOR_TURNS: usize = 3;

/// The references of one session that are silent, or silent in a part of it.
pub(super) fn warned(joined: &Joined) -> Vec<String> {
    let sets = [StandsOn::Base, StandsOn::Floor].map(|on| Set::of(joined, on));
    sets.into_iter().flatten().flat_map(|set| set.warned()).collect()
}

/// The references of a session on the base or on the floor.
struct Set<'a> {
    on: StandsOn,
    all: Vec<&'a ReadReference>,
    /// Their course; `None` where too few readings of them are there to follow.
    course: Option<&'a ReferenceCourse>,
    /// Number of the session's stations.
    stations: usize,
}

impl<'a> Set<'a> {
    /// `None` where none is stated.
    fn of(joined: &'a Joined, on: StandsOn) -> Option<Self> {
        let all = joined.read_references.iter().filter(|own| own.on == on);
        let all: Vec<&ReadReference> = all.collect();
        let course = joined.references.iter().find(|own| own.on == on);
        (!all.is_empty()).then_some(Self { on, all, course, stations: joined.stations.len() })
    }

    fn warned(&self) -> Vec<String> {
        if self.course.is_none() {
            return vec![self.never()];
        }
        let silent = self.all.iter().filter(|own| own.looks == 0);
        let silent: Vec<&str> = silent.map(|own| own.name.as_str()).collect();
        let silent = (!silent.is_empty()).then(|| self.silent(&silent));
        let whole = self.ends(self.between());
        let parts: Vec<String> = if whole.is_empty() {
            self.all.iter().filter_map(|own| self.part_of(own)).collect()
        } else {
            whole.iter().map(|end| self.carried_on(*end)).collect()
        };
        silent.into_iter().chain(parts).collect()
    }

    /// The first and the last station at which any was read.
    fn between(&self) -> Option<[usize; 2]> {
        let read = self.all.iter().filter_map(|own| own.between);
        read.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
    }

    /// The ends of the session that are long and outside of `between`.
    fn ends(&self, between: Option<[usize; 2]>) -> Vec<End> {
        let Some([first, last]) = between else { return Vec::new() };
        let stations = self.stations.saturating_sub(last + 1);
        let far = self.stations.saturating_sub(1);
        let ends = [
            End { is_before: true, stations: first, edge: first, far: 0 },
            End { is_before: false, stations, edge: last, far },
        ];
        let is_long =
            |end: &End| end.stations >= LEAST && end.stations as f64 > SHARE * self.stations as f64;
        ends.into_iter().filter(is_long).collect()
    }

    /// None of the set can be followed.
    fn never(&self) -> String {
        let looks = self.all.iter().map(|own| own.looks).max().unwrap_or(0);
        let names: Vec<&str> = self.all.iter().map(|own| own.name.as_str()).collect();
        format!(
            "{} on the {} {} {} in this session: drift and bumps of {} are not found, and all readings count as if nothing had moved; \
             read {} before the first station, after the last and every ten to twenty stations, check names, topics and columns, or \
             take {} out of the pipeline file",
            quoted(&names),
            self.on.word(),
            have(names.len()),
            if looks == 0 { "no reading" } else { "readings at one look only" },
            self.on.moves(),
            them(names.len()),
            them(names.len()),
        )
    }

    /// Some of a set that is followed have no reading.
    fn silent(&self, silent: &[&str]) -> String {
        let others = self.all.len() - silent.len();
        let tells_turns = self.course.is_some_and(|own| own.followed.tells_turns);
        let left = if tells_turns {
            format!("the other {others} tell all six motions without it")
        } else {
            format!(
                "the other {others} tell no rotations, which three that are not in line do: a rotation of {} stays in the readings, and \
                 a bump leaves only the larger part of the session",
                self.on.moves()
            )
        };
        format!(
            "{} on the {} {} no reading in this session: {left}; check names, topics and columns, or take {} out of the pipeline file",
            quoted(silent),
            self.on.word(),
            have(silent.len()),
            them(silent.len()),
        )
    }

    /// The whole set was read in a part of the session.
    fn carried_on(&self, end: End) -> String {
        let sd_mm = |station: usize| self.course.and_then(|course| sd_mm(course, station));
        let grows = sd_mm(end.edge).zip(sd_mm(end.far));
        let grows = grows.map_or_else(String::new, |(edge, far)| {
            format!(
                ", with a standard deviation at the references of {edge:.3} mm there and {far:.3} mm at the far end"
            )
        });
        let looks = self
            .course
            .map_or(0, |course| course.looks.iter().filter(|look| look.seen > 0).count());
        format!(
            "references on the {} were read at {looks} looks, {}: drift of {} at the {} stations {} is carried on from there{grows}, and a \
             bump there is not found; read them {} too",
            self.on.word(),
            end.words(self.stations),
            self.on.moves(),
            end.stations,
            end.side(),
            end.when(),
        )
    }

    /// A reference that was read in a part of the session only, beside others.
    fn part_of(&self, own: &ReadReference) -> Option<String> {
        let end = *self.ends(own.between).first()?;
        let is_read_there = |other: &&&ReadReference| {
            other.between.is_some() && self.ends(other.between).is_empty()
        };
        let others = self.all.iter().filter(is_read_there).count();
        let follows = if others >= FOR_TURNS {
            format!("the other {others} tell the motion there")
        } else {
            let (stations, side, when) = (end.stations, end.side(), end.when());
            format!(
                "the {others} left there tell no rotation: at the {stations} stations {side} it is carried on with growing covariance, \
                 and what a bump turns there is not found; read it {when} too"
            )
        };
        let (on, ends) = (self.on.word(), end.words(self.stations));
        let ReadReference { name, looks, .. } = own;
        Some(format!("reference {name:?} on the {on} was read at {looks} looks, {ends}: {follows}"))
    }
}

/// An end of a session without readings of references.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct End {
    /// Whether it is the begin of the session.
    is_before: bool,
    /// Number of its stations.
    stations: usize,
    /// The station at which readings begin or end, from 0.
    edge: usize,
    /// The station that is furthest from them, from 0.
    far: usize,
}

impl End {
    fn words(self, stations: usize) -> String {
        let side = if self.is_before { "before" } else { "behind" };
        format!("none of them {side} station {} of {stations}", self.edge)
    }

    const fn side(self) -> &'static str {
        if self.is_before { "before it" } else { "behind it" }
    }

    const fn when(self) -> &'static str {
        if self.is_before { "before the first station" } else { "after the last station" }
    }
}

/// Standard deviation per axis of the motion of the references' middle at a station, mm.
fn sd_mm(course: &ReferenceCourse, station: usize) -> Option<f64> {
    let look = course.looks.iter().position(|own| own.station == Some(station))?;
    let covariance = &course.followed.motions.get(look)?.covariance;
    let shift = covariance.fixed_view::<3, 3>(0, 0);
    Some((shift.trace() / 3.0).max(0.0).sqrt())
}

fn quoted(names: &[&str]) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("{name:?}")).collect();
    match &quoted[..] {
        [one] => format!("reference {one}"),
        several => format!("references {}", several.join(", ")),
    }
}

const fn have(count: usize) -> &'static str {
    if count == 1 { "has" } else { "have" }
}

const fn them(count: usize) -> &'static str {
    if count == 1 { "it" } else { "them" }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};

    use super::*;
    use crate::join::references::{Look, ReferenceId, follow};
    use crate::join::tabled::LookAt;

    const STATIONS: usize = 90;

    fn read(name: &str, looks: usize, between: Option<[usize; 2]>) -> ReadReference {
        ReadReference { name: name.to_owned(), on: StandsOn::Floor, looks, between }
    }

    fn warned_of(all: &[ReadReference], course: Option<&ReferenceCourse>) -> Vec<String> {
        let set =
            Set { on: StandsOn::Floor, all: all.iter().collect(), course, stations: STATIONS };
        set.warned()
    }

    /// The places of three references at a station: they drift by a twentieth of a millimetre to and fro, read to a micrometre.
    fn places(station: usize) -> Vec<(ReferenceId, Point3<f64>)> {
        let along = 0.05 * (station as f64 / 7.0).sin();
        let noise = |id: usize| 1e-3 * (3.0 * station as f64 + 5.0 * id as f64).cos();
        let places = [[2000.0, 0.0, 300.0], [2150.0, 120.0, 300.0], [1950.0, 200.0, 420.0]];
        let place = |(id, at): (usize, [f64; 3])| {
            let moved = Vector3::new(along, noise(id), noise(id + 1));
            (ReferenceId(id), Point3::from(at) + moved)
        };
        places.into_iter().enumerate().map(place).collect()
    }

    /// Looks at stations 0, 10, … up to `last`.
    fn course(last: usize) -> ReferenceCourse {
        let is_read = |station: usize| station.is_multiple_of(10) && station <= last;
        let look = |station: usize| Look {
            at_s: 60.0 * station as f64,
            seen: if is_read(station) { places(station) } else { Vec::new() },
        };
        let looks: Vec<Look> = (0..STATIONS).map(look).collect();
        let at = looks.iter().enumerate().map(|(station, own)| LookAt {
            line: station as u64 + 1,
            at_ns: 60_000_000_000 * i64::try_from(station).expect("few stations"),
            station: Some(station),
            seen: own.seen.len(),
        });
        ReferenceCourse {
            on: StandsOn::Floor,
            names: ["F1", "F2", "F3"].map(str::to_owned).into(),
            looks: at.collect(),
            followed: follow(&looks).expect("looks"),
            is_taken_out: true,
            is_timed: true,
            is_logged: false,
        }
    }

    /// The only line, which has all of `parts`.
    fn assert_one(said: &[String], parts: &[&str]) {
        assert_eq!(said.len(), 1, "{said:?}");
        for part in parts {
            assert!(said[0].contains(part), "{part}: {said:?}");
        }
    }

    #[test]
    fn references_that_were_read_throughout_are_not_named() {
        let all = ["F1", "F2", "F3"].map(|name| read(name, 9, Some([0, 80])));
        assert_eq!(warned_of(&all, Some(&course(89))), [""; 0]);
    }

    #[test]
    fn a_set_without_readings_is_named_with_what_follows() {
        let said = warned_of(&[read("F1", 0, None), read("F2", 0, None)], None);
        let begins = "references \"F1\", \"F2\" on the floor have no reading in this session";
        assert_one(&said, &[begins, "drift and bumps of the instrument"]);
    }

    #[test]
    fn a_silent_reference_beside_others_is_named() {
        let all = [read("F1", 9, Some([0, 80])), read("F2", 9, Some([0, 80])), read("F4", 0, None)];
        let said = warned_of(&all, Some(&course(89)));
        assert_one(&said, &["reference \"F4\" on the floor has no reading"]);
    }

    #[test]
    fn what_is_carried_on_is_named_with_its_growing_standard_deviation() {
        let course = course(40);
        let all = ["F1", "F2", "F3"].map(|name| read(name, 5, Some([0, 40])));
        let said = warned_of(&all, Some(&course));
        let [edge, far] = [40, 89].map(|station| sd_mm(&course, station).expect("a look"));
        assert!(far > 2.0 * edge, "{edge} {far}");
        let grows = format!("of {edge:.3} mm there and {far:.3} mm at the far end");
        let parts = [
            "at 5 looks",
            "behind station 40 of 90",
            "the 49 stations behind it",
            "a bump there is not found",
            &grows,
        ];
        assert_one(&said, &parts);
    }

    #[test]
    fn one_of_three_that_falls_silent_leaves_rotations_unknown() {
        let all = [
            read("F1", 9, Some([0, 80])),
            read("F2", 9, Some([0, 80])),
            read("F3", 3, Some([0, 20])),
        ];
        let said = warned_of(&all, Some(&course(89)));
        assert_one(&said, &["\"F3\"", "the 2 left there tell no rotation"]);
    }
}
