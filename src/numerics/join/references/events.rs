//! What is neither noise nor drift: bumps, shocks, strays and references that were moved, by significance.
//!
//! Every look is tested for every event against the walk without it. The most significant event is taken in, with others that
//! are half as significant and elsewhere, and everything is found anew, until none is left: each is so rare under the walk that
//! a session has a false one with the chance [`CHANCE`].

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

use nalgebra::{Matrix3, Vector3};

use super::walk::{Course, Ratios};
use super::{ReferenceId, Surprise, Work};

/// Chance of a false event in a session.
const CHANCE: f64 = 1e-3;
/// Looks on both sides of an event taken in where no other is taken in at once.
const ROOM: usize = 5;
/// Readings on each side of a reference's move at least.
const FEWEST: usize = 4;

#[derive(Debug, Default)]
pub(super) struct Events {
    pub all: Vec<Surprise>,
    sorted: BTreeSet<Surprise>,
    /// First looks of each reference in a new place.
    moved: BTreeMap<ReferenceId, BTreeSet<usize>>,
}

impl Events {
    fn take(&mut self, event: Surprise) {
        self.all.push(event);
        self.sorted.insert(event);
        if let Surprise::Moved(look, reference) = event {
            self.moved.entry(reference).or_default().insert(look);
        }
    }

    pub fn contains(&self, event: Surprise) -> bool {
        self.sorted.contains(&event)
    }

    /// The place of a reference at a look: the reference, and the look from which it is there.
    pub fn place_of(&self, reference: ReferenceId, look: usize) -> (ReferenceId, usize) {
        let last = self.moved.get(&reference).and_then(|looks| looks.range(..=look).next_back());
        (reference, last.copied().unwrap_or(0))
    }
}

/// A candidate: the event, its look, and minus the logarithm of its chance.
type Candidate = (Surprise, f64);

/// The residual of a reading: the look, the residual, mm, and its share of the noise's covariance.
type Left = (usize, Vector3<f64>, Matrix3<f64>);

/// Adds events to `work` until none is significant.
pub(super) fn find(work: &mut Work<'_>, ratios: Ratios, noise_mm2: f64) {
    let readings: usize = work.looks.iter().map(|look| look.seen.len()).sum();
    let tests = (2 * work.looks.len() + 2 * readings).max(1) as f64;
    let enough = (tests / CHANCE).ln();
    // More events than a quarter of the looks are no exceptions.
    let most = work.looks.len() / 4;
    while work.events.all.len() < most {
        let course = work.settle(ratios);
        let all = candidates(work, &course, noise_mm2);
        let significant = all.into_iter().filter(|(_, chance)| *chance > enough);
        let mut significant: Vec<Candidate> = significant.collect();
        significant.sort_by(|a, b| b.1.total_cmp(&a.1));
        let Some((_, largest)) = significant.first().copied() else { return };
        let mut taken: Vec<usize> = Vec::new();
        for (event, chance) in significant {
            let is_apart = taken.iter().all(|look| look.abs_diff(event.look()) > ROOM);
            // A bump changes every test of the session; what is left when it is taken in is seen then.
            let is_local = matches!(event, Surprise::Shock(_) | Surprise::Stray(..));
            let is_first = taken.is_empty();
            if is_first || (is_local && is_apart && chance > largest / 2.0) {
                taken.push(event.look());
                work.events.take(event);
            }
        }
    }
}

impl Surprise {
    pub(super) const fn look(&self) -> usize {
        match self {
            Self::Jump(look) | Self::Shock(look) | Self::Stray(look, _) | Self::Moved(look, _) => {
                *look
            }
        }
    }
}

/// Every event that could be, with minus the logarithm of its chance; strays first, as they explain least.
fn candidates(work: &Work<'_>, course: &Course, noise_mm2: f64) -> Vec<Candidate> {
    let left = residuals(work, course);
    let mut all = Vec::new();
    for (reference, own) in &left {
        all.extend(own.iter().map(|(look, residual, share)| {
            let (squares, freedom) = squared(residual, share);
            (Surprise::Stray(*look, *reference), rarity(squares / noise_mm2, freedom))
        }));
    }
    let seen = |look: &usize| !work.looks[*look].seen.is_empty();
    let new = |event: &Surprise| !work.events.contains(*event);
    for look in (0..work.looks.len()).filter(seen) {
        let (squares, freedom) = course.shocks[look];
        all.push((Surprise::Shock(look), rarity(squares / noise_mm2, freedom)));
    }
    let first = (0..work.looks.len()).find(seen).unwrap_or(0);
    for look in (first + 1..work.looks.len()).filter(seen) {
        let (squares, freedom) = course.jumps[look];
        all.push((Surprise::Jump(look), rarity(squares / noise_mm2, freedom)));
    }
    if left.len() > 1 {
        for (reference, own) in &left {
            all.extend(moved(*reference, own, noise_mm2));
        }
    }
    all.retain(|(event, _)| new(event));
    all
}

/// What each used reading leaves, by reference.
fn residuals(work: &Work<'_>, course: &Course) -> BTreeMap<ReferenceId, Vec<Left>> {
    let mut all: BTreeMap<ReferenceId, Vec<Left>> = BTreeMap::new();
    for (i, look) in work.looks.iter().enumerate() {
        let (state, covariance) = &course.states[i];
        for (reference, row, y) in work.rows(i, look) {
            let share = Matrix3::identity() - row * covariance * row.transpose();
            all.entry(reference).or_default().push((i, y - row * state, share));
        }
    }
    all
}

/// The most significant move of a reference to a new place, by the sums of its residuals before and after; `None` where there are
/// too few. Sums of residuals are a bridge between the two ends, as the place is their mean.
fn moved(reference: ReferenceId, own: &[Left], noise_mm2: f64) -> Option<Candidate> {
    let count = own.len();
    if count < 2 * FEWEST {
        return None;
    }
    let whole: Vector3<f64> = own.iter().map(|(_, residual, _)| residual).sum();
    let share = own.iter().map(|(_, _, share)| share).sum::<Matrix3<f64>>() / count as f64;
    let mut before = Vector3::zeros();
    let mut best: Option<Candidate> = None;
    for (place, (_, residual, _)) in own.iter().enumerate().take(count - FEWEST) {
        before += residual;
        let (earlier, later) = (place + 1, count - place - 1);
        if earlier < FEWEST {
            continue;
        }
        let bridge = before - whole * (earlier as f64 / count as f64);
        let (squares, freedom) = squared(&bridge, &share);
        let spread = earlier as f64 * later as f64 / count as f64;
        let chance = rarity(squares / spread / noise_mm2, freedom);
        if best.is_none_or(|(_, other)| chance > other) {
            best = Some((Surprise::Moved(own[place + 1].0, reference), chance));
        }
    }
    best
}

/// `rᵀ S⁻¹ r` over the directions that S knows, and their number.
fn squared(residual: &Vector3<f64>, share: &Matrix3<f64>) -> (f64, usize) {
    const KNOWN: f64 = 1e-3;
    const SURELY_KNOWN: f64 = 0.03;
    // The least eigenvalue is at least the determinant over the square of half of the trace.
    let least = share.determinant() / (share.trace() / 2.0).powi(2);
    if let Some(inverse) = share.try_inverse().filter(|_| least > SURELY_KNOWN) {
        return (residual.dot(&(inverse * residual)), 3);
    }
    let eigen = ((share + share.transpose()) * 0.5).symmetric_eigen();
    let known = (0..3).filter(|&i| eigen.eigenvalues[i] > KNOWN);
    known.fold((0.0, 0), |(sum, count), i| {
        let along = eigen.eigenvectors.column(i).dot(residual);
        (sum + along * along / eigen.eigenvalues[i], count + 1)
    })
}

/// Minus the logarithm of the chance that χ² of so many degrees of freedom is as large, far out in its tail.
fn rarity(squares: f64, freedom: usize) -> f64 {
    let half = squares / 2.0;
    let gamma = match freedom {
        0 => return 0.0,
        1 => PI.sqrt(),
        2 | 4 => 1.0,
        3 => PI.sqrt() / 2.0,
        5 => 0.75 * PI.sqrt(),
        _ => 2.0,
    };
    if half <= freedom as f64 {
        return 0.0;
    }
    half - (freedom as f64 / 2.0 - 1.0) * half.ln() + f64::ln(gamma)
}
