//! Reference reflectors: points on the floor or on the robot's base that should not move. What their readings move together is
//! the motion of the instrument, or of the base, and it is taken out of the readings of the target.
//!
//! 1. `shape`: the places of the references among each other; whether they tell rotations (three that are not in line).
//! 2. `walk`: their common motion as a random walk with shocks, with its covariance at every look.
//! 3. `sizes`: noise, walk and shocks by likelihood, from a robust start.
//! 4. `events`: what is none of these, one after another by its significance: a bump (the walk jumps), a shock at one look,
//!    a stray reading, a reference that was moved.
//!
//! A bump ends a part of the session. Where the references tell all six motions, the parts are carried into one frame; where they
//! do not, nothing ties the parts together ([`Followed::is_bridged`]).

mod events;
mod sample;
mod shape;
mod sizes;
mod walk;

use std::collections::BTreeMap;

use nalgebra::{
    Isometry3, Matrix3, Matrix3x6, Matrix6, Point3, Translation3, UnitQuaternion, Vector3, Vector6,
};
use serde::{Deserialize, Serialize};

use events::Events;
use shape::{Shape, State, Turned};
use walk::{Course, Moves, Ratios};

/// A reference's index among those of its session, from 0.
#[derive(
    Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub struct ReferenceId(pub usize);

/// One look at the references: a moment, and the places where those that were measured stood.
#[derive(Debug, Clone, PartialEq)]
pub struct Look {
    pub at_s: f64,
    /// The references measured and their positions in the instrument's frame, mm; none of them twice.
    pub seen: Vec<(ReferenceId, Point3<f64>)>,
}

/// The motion of references in the instrument's frame since the session's first look.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    pub moved: Isometry3<f64>,
    /// The middle of the references, where the shift of `covariance` is, at first, mm.
    pub middle: Point3<f64>,
    /// Covariance of shift (mm) and rotation vector (rad) at the middle, along the instrument's axes.
    pub covariance: Matrix6<f64>,
    /// The part of the session, from 0: a bump begins a new one.
    pub part: usize,
}

/// An event of the references that is neither noise nor drift.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Event {
    /// All of them jumped together between two looks: the instrument was bumped, or the base.
    Bump {
        after: usize,
        before: usize,
        shift_mm: f64,
        /// Rotation, rad; 0 where rotations are not told.
        turn_rad: f64,
    },
    /// All of them were elsewhere together at one look.
    Shock {
        look: usize,
        /// Shift of the references' middle from the look before, mm.
        shift_mm: f64,
        /// Rotation, rad; 0 where rotations are not told.
        turn_rad: f64,
    },
    /// One reading is of another reflector, or wrong: it is left out.
    Stray { look: usize, reference: ReferenceId, away_mm: f64 },
    /// One reference was moved among the others; from this look on it counts as a new one.
    Moved { look: usize, reference: ReferenceId, by_mm: f64 },
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Place {
    pub reference: ReferenceId,
    pub from: usize,
    pub position: Point3<f64>,
    /// Standard deviation per axis of the place among the others, mm.
    pub sd_mm: f64,
    pub readings: usize,
    pub scatter_mm: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sizes {
    pub reading_mm: f64,
    /// Of the walk's shift over a second, per axis, mm.
    pub walk_mm: f64,
    /// Of the walk's rotation over a second, per axis, rad; 0 where rotations are not told.
    pub walk_rad: f64,
    /// Of the shift at one look, per axis, mm.
    pub shock_mm: f64,
    /// Of the rotation at one look, per axis, rad; 0 where rotations are not told.
    pub shock_rad: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Followed {
    pub motions: Vec<Motion>,
    pub places: Vec<Place>,
    pub events: Vec<Event>,
    pub sizes: Sizes,
    pub tells_turns: bool,
}

impl Followed {
    /// Whether the parts of the session are tied together: there is one, or the references tell all six motions.
    pub fn is_bridged(&self) -> bool {
        self.tells_turns || self.motions.iter().all(|motion| motion.part == 0)
    }
}

impl Event {
    pub const fn look(&self) -> usize {
        match self {
            Self::Bump { before, .. } => *before,
            Self::Shock { look, .. } | Self::Stray { look, .. } | Self::Moved { look, .. } => *look,
        }
    }
}

impl Motion {
    /// A position measured now, in the instrument's frame of the first look, mm.
    pub fn undone(&self, position: &Point3<f64>) -> Point3<f64> {
        self.moved.inverse_transform_point(position)
    }

    /// Covariance that the motion's own uncertainty gives a position measured now, in the frame of the first look, mm².
    pub fn covariance_at(&self, position: &Point3<f64>) -> Matrix3<f64> {
        let arm = position - self.moved.transform_point(&self.middle);
        let mut by_motion = Matrix3x6::zeros();
        by_motion.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        let turned = -arm.cross_matrix();
        by_motion.fixed_view_mut::<3, 3>(0, 3).copy_from(&turned);
        let now = by_motion * self.covariance * by_motion.transpose();
        let back = self.moved.rotation.inverse().to_rotation_matrix();
        back * now * back.inverse()
    }
}

/// Follows a set of references; `None` where fewer than two looks saw any.
pub fn follow(looks: &[Look]) -> Option<Followed> {
    if looks.iter().filter(|look| !look.seen.is_empty()).count() < 2 {
        return None;
    }
    let robust = sizes::robust(looks);
    // Events by robust sizes, sizes by likelihood without those events, and events anew by those sizes.
    let mut first = Work::new(looks);
    events::find(&mut first, robust.ratios, robust.noise_mm2);
    first.settle(robust.ratios);
    let likely = first.likely(robust.ratios);
    let noise_mm2 = first.settle(likely).noise_mm2;
    let mut work = Work::new(looks);
    events::find(&mut work, likely, noise_mm2);
    let ratios = work.likely(likely);
    let course = work.settle(ratios);
    Some(work.followed(&course, ratios))
}

/// A set of references while it is followed.
struct Work<'a> {
    looks: &'a [Look],
    shape: Shape,
    events: Events,
    /// The state at each look, which rotations are linear around.
    states: Vec<State>,
    /// Room for what the readings of each look say, and for the filter's steps.
    told: Vec<walk::Look>,
    steps: Vec<walk::Step>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Surprise {
    /// The walk jumps before the look.
    Jump(usize),
    /// A shock at the look.
    Shock(usize),
    /// A reading of a reference at a look.
    Stray(usize, ReferenceId),
    /// A reference is in a new place from a look on.
    Moved(usize, ReferenceId),
}

const ROUNDS: usize = 4;
/// States that change by less than this have settled, mm.
const SETTLED_MM: f64 = 1e-8;

impl<'a> Work<'a> {
    fn new(looks: &'a [Look]) -> Self {
        Self {
            shape: Shape::still(looks),
            looks,
            events: Events::default(),
            states: vec![(Vector3::zeros(), Vector3::zeros()); looks.len()],
            told: Vec::new(),
            steps: Vec::new(),
        }
    }

    /// The used readings of a look as rows: the reference, what the state does to it, and the rest of it.
    fn rows(
        &self,
        i: usize,
        look: &'a Look,
    ) -> impl Iterator<Item = (ReferenceId, Matrix3x6<f64>, Vector3<f64>)> {
        let about = Turned::of(&self.states[i]);
        shape::used(i, look, &self.events).filter_map(move |(reference, at)| {
            let place = self.shape.places.get(&self.events.place_of(reference, i))?;
            let (row, y) = self.shape.row(place, at, &about);
            Some((reference, row, y))
        })
    }

    /// Finds what the readings of each look say of the state there.
    fn tell(&mut self) {
        let mut told = std::mem::take(&mut self.told);
        told.clear();
        told.extend(self.looks.iter().enumerate().map(|(i, look)| self.told_by(i, look)));
        self.told = told;
    }

    fn told_by(&self, i: usize, look: &'a Look) -> walk::Look {
        let mut told = walk::Look {
            at_s: look.at_s,
            information: Matrix6::zeros(),
            score: Vector6::zeros(),
            squares: 0.0,
            rows: 0,
            looks: 1.0,
            jumps: self.events.contains(Surprise::Jump(i)),
            shaken: self.events.contains(Surprise::Shock(i)),
        };
        for (_, row, y) in self.rows(i, look) {
            told.information += row.transpose() * row;
            told.score += row.transpose() * y;
            told.squares += y.norm_squared();
            told.rows += 3;
        }
        told
    }

    /// Finds states and places in turn, until both agree.
    fn settle(&mut self, ratios: Ratios) -> Course {
        let moves = self.shape.moves;
        for _ in 0..ROUNDS {
            self.tell();
            let found = walk::states(&self.told, ratios, moves, &mut self.steps);
            let is_settled = self.take_states(&found);
            self.shape = self.shape.settled(self.looks, &self.events, &self.states);
            if is_settled {
                break;
            }
        }
        self.tell();
        walk::course(&self.told, ratios, moves, &mut self.steps)
    }

    /// Takes states with rotations in mm as those to be linear around; whether none of them changed.
    fn take_states(&mut self, found: &[Vector6<f64>]) -> bool {
        let radius = self.shape.radius_mm;
        let mut change_mm: f64 = 0.0;
        for (own, found) in self.states.iter_mut().zip(found) {
            let (shift, turn) = (found.fixed_rows::<3>(0), found.fixed_rows::<3>(3) / radius);
            change_mm = change_mm.max((own.0 - shift).amax());
            change_mm = change_mm.max((own.1 - turn).amax() * radius);
            *own = (shift.into_owned(), turn);
        }
        change_mm < SETTLED_MM
    }

    /// The sizes of greatest likelihood with the events found.
    fn likely(&mut self, start: Ratios) -> Ratios {
        let several = self.shape.places.len() > 1;
        self.tell();
        sizes::likely(&self.told, start, self.shape.moves, several)
    }

    /// The result, in the frame of the first look.
    fn followed(&self, course: &Course, ratios: Ratios) -> Followed {
        let noise_mm2 = course.noise_mm2;
        let pose = |state: &State| {
            let about = Translation3::from(self.shape.middle);
            let turn = UnitQuaternion::from_scaled_axis(state.1);
            Translation3::from(state.0) * about * turn * about.inverse()
        };
        let first = pose(&self.states[0]);
        let middle = first.transform_point(&Point3::from(self.shape.middle));
        let mut part = 0;
        let motions = self.states.iter().zip(&course.states).enumerate();
        let motions = motions.map(|(i, (state, (_, covariance)))| {
            part += usize::from(self.events.contains(Surprise::Jump(i)));
            Motion {
                moved: pose(state) * first.inverse(),
                middle,
                covariance: self.in_radians(covariance) * noise_mm2,
                part,
            }
        });
        let motions: Vec<Motion> = motions.collect();
        let size = |ratio: f64| (ratio * noise_mm2).sqrt();
        let radius = self.shape.radius_mm;
        let mut events: Vec<Event> =
            self.events.all.iter().map(|event| self.event(event, &motions)).collect();
        events.sort_by_key(Event::look);
        Followed {
            places: self.places(&first, noise_mm2),
            events,
            sizes: Sizes {
                reading_mm: noise_mm2.sqrt(),
                walk_mm: size(ratios.walk[0]),
                walk_rad: self.shape.turns(size(ratios.walk[1]) / radius),
                shock_mm: size(ratios.shock[0]),
                shock_rad: self.shape.turns(size(ratios.shock[1]) / radius),
            },
            tells_turns: self.shape.moves == Moves::ShiftsAndTurns,
            motions,
        }
    }

    /// A covariance of shift and rotation, from the rotation in mm at the radius to rad.
    fn in_radians(&self, covariance: &Matrix6<f64>) -> Matrix6<f64> {
        let unit = |i: usize| {
            if i < 3 { 1.0 } else { self.shape.radius_mm.recip() }
        };
        Matrix6::from_fn(|row, column| covariance[(row, column)] * unit(row) * unit(column))
    }

    fn places(&self, first: &Isometry3<f64>, noise_mm2: f64) -> Vec<Place> {
        let mut used: BTreeMap<(ReferenceId, usize), (usize, f64)> = BTreeMap::new();
        for (i, look) in self.looks.iter().enumerate() {
            for (reference, at) in shape::used(i, look, &self.events) {
                let key = self.events.place_of(reference, i);
                let undone = self.shape.undone(at, &self.states[i]);
                let place = self.shape.places.get(&key);
                let away = place.map_or(0.0, |place| (undone - place).norm_squared());
                let own = used.entry(key).or_default();
                *own = (own.0 + 1, own.1 + away);
            }
        }
        let place = |(key, at): (&(ReferenceId, usize), &Vector3<f64>)| {
            let (readings, squares) = used.get(key).copied().unwrap_or_default();
            let count = readings.max(1) as f64;
            Place {
                reference: key.0,
                from: key.1,
                position: first.transform_point(&Point3::from(*at)),
                sd_mm: (noise_mm2 / count).sqrt(),
                readings,
                scatter_mm: (squares / count).sqrt(),
            }
        };
        self.shape.places.iter().map(place).collect()
    }

    fn event(&self, event: &Surprise, motions: &[Motion]) -> Event {
        match *event {
            Surprise::Jump(before) => {
                let earlier = (0..before).rev().find(|&look| !self.looks[look].seen.is_empty());
                let after = earlier.unwrap_or(0);
                let (shift_mm, turn_rad) = apart(&motions[after], &motions[before]);
                Event::Bump { after, before, shift_mm, turn_rad }
            }
            Surprise::Shock(look) => {
                let (shift_mm, turn_rad) = apart(&motions[look.saturating_sub(1)], &motions[look]);
                Event::Shock { look, shift_mm, turn_rad }
            }
            Surprise::Stray(look, reference) => {
                Event::Stray { look, reference, away_mm: self.away_mm(look, reference) }
            }
            Surprise::Moved(look, reference) => {
                Event::Moved { look, reference, by_mm: self.moved_mm(look, reference) }
            }
        }
    }

    fn away_mm(&self, look: usize, reference: ReferenceId) -> f64 {
        let mut seen = self.looks[look].seen.iter();
        let at = seen.find(|(own, _)| *own == reference).map(|(_, at)| at);
        let place = self.shape.places.get(&self.events.place_of(reference, look));
        let (Some(at), Some(place)) = (at, place) else { return 0.0 };
        (self.shape.undone(at, &self.states[look]) - place).norm()
    }

    fn moved_mm(&self, look: usize, reference: ReferenceId) -> f64 {
        let places = &self.shape.places;
        let before = look.checked_sub(1).map(|before| self.events.place_of(reference, before));
        let before = before.and_then(|key| places.get(&key));
        let after = places.get(&(reference, look));
        before.zip(after).map_or(0.0, |(before, after)| (after - before).norm())
    }
}

fn apart(a: &Motion, b: &Motion) -> (f64, f64) {
    let by = a.moved.inverse() * b.moved;
    let shift = b.moved.transform_point(&b.middle) - a.moved.transform_point(&a.middle);
    (shift.norm(), by.rotation.angle())
}

#[cfg(test)]
mod tests;
