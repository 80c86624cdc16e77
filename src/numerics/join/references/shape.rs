//! The places of references among each other, and what a reading says of their common motion.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Matrix3x6, Point3, Rotation3, Vector3};

use super::events::Events;
use super::walk::Moves;
use super::{Look, ReferenceId, Surprise};
use crate::join::average::median;

/// References are in line when their spread beside the line is below this share of the spread along it.
const IN_LINE: f64 = 0.05;

/// The places of references in the frame of the first look, and the middle that they turn about.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shape {
    /// Each place with the reference and the first look in it, in order.
    pub places: BTreeMap<(ReferenceId, usize), Vector3<f64>>,
    pub middle: Vector3<f64>,
    /// Root mean square distance from the middle, mm; 1 where all are in one place.
    pub radius_mm: f64,
    pub moves: Moves,
}

/// Shift (mm) and rotation vector (rad) of the middle at a look.
pub(super) type State = (Vector3<f64>, Vector3<f64>);

impl Shape {
    /// The shape by the medians of the readings, as if nothing moved.
    pub fn still(looks: &[Look]) -> Self {
        let mut seen: BTreeMap<ReferenceId, Vec<Vector3<f64>>> = BTreeMap::new();
        for (reference, at) in looks.iter().flat_map(|look| &look.seen) {
            seen.entry(*reference).or_default().push(at.coords);
        }
        let places: BTreeMap<_, _> =
            seen.into_iter().map(|(reference, all)| ((reference, 0), middle(&all))).collect();
        let count = places.len().max(1) as f64;
        let middle = places.values().sum::<Vector3<f64>>() / count;
        let squares: f64 = places.values().map(|at| (at - middle).norm_squared()).sum();
        let radius_mm = (squares / count).sqrt();
        Self {
            moves: moves(places.values(), &middle),
            places,
            middle,
            radius_mm: if radius_mm > 0.0 { radius_mm } else { 1.0 },
        }
    }

    /// The places as means of the readings with the motion undone; middle and radius stay.
    pub fn settled(&self, looks: &[Look], events: &Events, states: &[State]) -> Self {
        let mut sums: BTreeMap<(ReferenceId, usize), (Vector3<f64>, f64)> = BTreeMap::new();
        for (i, look) in looks.iter().enumerate() {
            let turn_back = Rotation3::new(states[i].1).inverse();
            for (reference, at) in used(i, look, events) {
                let own = sums.entry(events.place_of(reference, i)).or_default();
                own.0 += self.middle + turn_back * (at.coords - self.middle - states[i].0);
                own.1 += 1.0;
            }
        }
        Self {
            places: sums.into_iter().map(|(key, (sum, count))| (key, sum / count)).collect(),
            ..self.clone()
        }
    }

    /// A rotation's size, 0 where rotations are not told.
    pub fn turns(&self, size: f64) -> f64 {
        match self.moves {
            Moves::Shifts => 0.0,
            Moves::ShiftsAndTurns => size,
        }
    }

    /// A position measured at a state, with the motion undone.
    pub fn undone(&self, at: &Point3<f64>, (shift, turn): &State) -> Vector3<f64> {
        let away = at.coords - self.middle - shift;
        self.middle + Rotation3::new(*turn).inverse() * away
    }

    /// The rows of a reading of a place: `H`, and the reading less what does not depend on the state, both about a state.
    pub fn row(
        &self,
        place: &Vector3<f64>,
        at: &Point3<f64>,
        about: &Turned,
    ) -> (Matrix3x6<f64>, Vector3<f64>) {
        let mut row = Matrix3x6::zeros();
        row.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        let arm = about.rotation * (place - self.middle);
        let mut free = at.coords - self.middle - arm;
        if self.moves == Moves::ShiftsAndTurns {
            let turned = -arm.cross_matrix() * about.jacobian;
            free += turned * about.turn;
            row.fixed_view_mut::<3, 3>(0, 3).copy_from(&(turned / self.radius_mm));
        }
        (row, free)
    }
}

/// The rotation of a state, and what rows are made of.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turned {
    turn: Vector3<f64>,
    rotation: Rotation3<f64>,
    jacobian: Matrix3<f64>,
}

impl Turned {
    pub fn of((_, turn): &State) -> Self {
        Self { turn: *turn, rotation: Rotation3::new(*turn), jacobian: left_jacobian(turn) }
    }
}

/// The readings of a look that are no strays.
pub(super) fn used<'a>(
    i: usize,
    look: &'a Look,
    events: &'a Events,
) -> impl Iterator<Item = (ReferenceId, &'a Point3<f64>)> {
    let seen = look.seen.iter().map(|(reference, at)| (*reference, at));
    seen.filter(move |(reference, _)| !events.contains(Surprise::Stray(i, *reference)))
}

/// Whether places tell rotations: at least three that are not in line.
fn moves<'p>(
    places: impl ExactSizeIterator<Item = &'p Vector3<f64>>,
    middle: &Vector3<f64>,
) -> Moves {
    if places.len() < 3 {
        return Moves::Shifts;
    }
    let spread = places.fold(Matrix3::zeros(), |sum, at| {
        let away = at - middle;
        sum + away * away.transpose()
    });
    let mut along: Vec<f64> = spread.symmetric_eigenvalues().iter().copied().collect();
    along.sort_by(f64::total_cmp);
    if along[1].max(0.0).sqrt() > IN_LINE * along[2].max(0.0).sqrt() {
        Moves::ShiftsAndTurns
    } else {
        Moves::Shifts
    }
}

/// `∂ exp(ω) v / ∂ω = −[exp(ω) v]× J(ω)`: J to the second order, which is enough below a tenth of a radian.
fn left_jacobian(turn: &Vector3<f64>) -> Matrix3<f64> {
    let cross = turn.cross_matrix();
    Matrix3::identity() + cross * 0.5 + cross * cross / 6.0
}

fn middle(all: &[Vector3<f64>]) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| median(&mut all.iter().map(|at| at[axis]).collect::<Vec<f64>>()))
}
