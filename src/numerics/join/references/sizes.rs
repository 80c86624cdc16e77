//! Sizes of noise, walk and shocks: from medians that strays and bumps do not move, and then by likelihood.

use std::collections::BTreeMap;

use nalgebra::Point3;

use super::sample::{self, sample};
use super::walk::{self, Moves, Ratios};
use super::{Look, ReferenceId};
use crate::join::average::{SIGMA_PER_MAD, median};

/// Looks between the two whose difference shows the walk.
const FAR: usize = 20;
/// In sessions of more looks than a sample has also this share of them, as a walk that is slow shows only so far apart.
const FARTHER: usize = 50;
/// Least ratio of a variance to the noise's: below it, nothing can be seen of it.
const LEAST: f64 = 1e-6;
const MOST: f64 = 1e6;
/// Noise below this is taken as this, mm: no instrument reads finer.
const FINEST_MM: f64 = 1e-4;
/// Sweeps over the sizes, each found alone.
const SWEEPS: usize = 3;
/// Width at which the search of one size ends, powers of ten.
const WIDTH: f64 = 0.05;

/// Variance of the noise, mm², and ratios of the others to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Robust {
    pub noise_mm2: f64,
    pub ratios: Ratios,
}

/// The sizes by medians: noise from distances between references, which no common motion changes; shocks from what coordinates
/// differ more from one look to the next; the walk from how much more they differ after many.
pub(super) fn robust(looks: &[Look]) -> Robust {
    let each = by_reference(looks);
    let next = differences(&each, 1);
    let coordinates = variance(next.iter().map(|(_, by)| *by)) / 2.0;
    let noise = between(looks).map_or(coordinates, |distances| distances / 4.0);
    let noise_mm2 = noise.max(FINEST_MM * FINEST_MM);
    let shock = if each.len() > 1 { coordinates - noise } else { 0.0 };
    let next_s = middle(next.iter().map(|(s, _)| *s));
    let walk_by = |apart: usize| {
        let far = differences(&each, apart);
        let walked = variance(far.iter().map(|(_, by)| *by)) / 2.0 - coordinates;
        let seconds = middle(far.iter().map(|(s, _)| *s)) - next_s;
        if seconds > 0.0 { 2.0 * walked / seconds } else { 0.0 }
    };
    let is_long = looks.len() > sample::ALL;
    let farther = is_long.then(|| walk_by(looks.len() / FARTHER));
    let walk = walk_by(FAR).max(farther.unwrap_or(0.0));
    let ratio = |variance: f64| (variance / noise_mm2).clamp(LEAST, MOST);
    Robust { noise_mm2, ratios: Ratios { walk: [ratio(walk); 2], shock: [ratio(shock); 2] } }
}

/// The ratios of greatest likelihood, one after another from a start; of very many looks by a sample of them. The references of a single place do not tell a shock from
/// noise.
pub(super) fn likely(looks: &[walk::Look], start: Ratios, moves: Moves, several: bool) -> Ratios {
    let turns = moves == Moves::ShiftsAndTurns;
    let free = [(true, 0), (turns, 1), (several, 2), (several && turns, 3)];
    let looks = &*sample(looks, moves);
    let mut logs = logs(start);
    for _ in 0..SWEEPS {
        for (_, place) in free.iter().filter(|(is_free, _)| *is_free) {
            let at = |log: f64| {
                let mut tried = logs;
                tried[*place] = log;
                walk::deviance(looks, ratios(tried), moves)
            };
            logs[*place] = least(at, [LEAST.log10(), MOST.log10()], logs[*place]);
        }
    }
    ratios(logs)
}

fn logs(Ratios { walk, shock }: Ratios) -> [f64; 4] {
    [walk[0], walk[1], shock[0], shock[1]].map(|ratio| ratio.max(LEAST).log10())
}

fn ratios(logs: [f64; 4]) -> Ratios {
    // The least is none at all.
    let [a, b, c, d] =
        logs.map(|log| 10_f64.powf(log)).map(|ratio| if ratio > 2.0 * LEAST { ratio } else { 0.0 });
    Ratios { walk: [a, b], shock: [c, d] }
}

/// The place of the least value of `of` between two ends, by golden sections from two decades around the start, or from the whole
/// where the least is at an end of those.
fn least(of: impl Fn(f64) -> f64, [low, high]: [f64; 2], start: f64) -> f64 {
    let near = [(start - 2.0).max(low), (start + 2.0).min(high)];
    let found = golden(&of, near);
    let at_end = (found - near[0] < 2.0 * WIDTH && near[0] > low)
        || (near[1] - found < 2.0 * WIDTH && near[1] < high);
    if at_end { golden(&of, [low, high]) } else { found }
}

fn golden(of: &impl Fn(f64) -> f64, [mut low, mut high]: [f64; 2]) -> f64 {
    const SECTION: f64 = 0.618_033_988_749_894_9;
    let (mut left, mut right) = (high - SECTION * (high - low), low + SECTION * (high - low));
    let (mut at_left, mut at_right) = (of(left), of(right));
    while high - low > WIDTH {
        if at_left <= at_right {
            (high, right, at_right) = (right, left, at_left);
            left = high - SECTION * (high - low);
            at_left = of(left);
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = low + SECTION * (high - low);
            at_right = of(right);
        }
    }
    f64::midpoint(low, high)
}

fn by_reference(looks: &[Look]) -> Vec<Vec<(f64, Point3<f64>)>> {
    let mut each: BTreeMap<ReferenceId, Vec<(f64, Point3<f64>)>> = BTreeMap::new();
    for look in looks {
        for (reference, at) in &look.seen {
            each.entry(*reference).or_default().push((look.at_s, *at));
        }
    }
    each.into_values().collect()
}

/// Differences along each axis between readings that are `apart` looks of their reference apart, with the time between, s.
fn differences(each: &[Vec<(f64, Point3<f64>)>], apart: usize) -> Vec<(f64, f64)> {
    let of_one = |own: &Vec<(f64, Point3<f64>)>| {
        let apart = apart.min(own.len() / 2).max(1);
        let pairs = own.iter().zip(own.iter().skip(apart));
        let pairs = pairs
            .flat_map(|((s, a), (t, b))| (b - a).iter().map(|by| (t - s, *by)).collect::<Vec<_>>());
        pairs.collect::<Vec<_>>()
    };
    each.iter().flat_map(of_one).collect()
}

/// Variance of the change of distances between two references from one look at both to the next, mm²; `None` of too few.
fn between(looks: &[Look]) -> Option<f64> {
    const FEWEST: usize = 8;
    let mut distances: BTreeMap<(ReferenceId, ReferenceId), Vec<f64>> = BTreeMap::new();
    for look in looks {
        for (place, (a, at)) in look.seen.iter().enumerate() {
            for (b, other) in &look.seen[place + 1..] {
                distances.entry((*a.min(b), *a.max(b))).or_default().push((at - other).norm());
            }
        }
    }
    let changes = distances.values().flat_map(|own| own.windows(2).map(|two| two[1] - two[0]));
    let changes: Vec<f64> = changes.collect();
    (changes.len() >= FEWEST).then(|| variance(changes))
}

/// Variance of numbers around zero by the median of their magnitudes.
fn variance(all: impl IntoIterator<Item = f64>) -> f64 {
    (SIGMA_PER_MAD * middle(all.into_iter().map(f64::abs))).powi(2)
}

/// The median; 0 of none.
fn middle(all: impl IntoIterator<Item = f64>) -> f64 {
    median(&mut all.into_iter().collect::<Vec<f64>>())
}
