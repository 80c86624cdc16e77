//! The pattern of moves: dwells of arm and target → the few clock relations under which the two logs agree.
//!
//! No prior on the clocks is needed. Over some dozen dwells in a row any drift is negligible, so one offset decides them:
//! 1. blocks of target dwells are laid on every place of the arm's dwells (start on start, middle on middle, end on end);
//! 2. a place is scored by how many dwells then overlap *and* how well the lengths of the moves agree: the distance
//!    the target moved against the distance between nominal flanges, which needs neither base nor target;
//! 3. the best places of each block grow outwards to the whole log, their offset and drift refitted as they grow;
//! 4. the relations with the best scores over the whole log are passed on; geometry decides between them.

use std::ops::Range;

use nalgebra::{Point3, Vector3};

use super::average::median;
use super::dwell::{ArmDwell, Span, TargetDwell};

/// Dwells in a block: enough for its moves to be unique, few enough for drift not to matter.
const BLOCK_DWELLS: usize = 40;
const BLOCKS: usize = 4;
/// Blocks, and places of each, in which the offset may differ.
const MANY_BLOCKS: usize = 16;
const BEST_PLACES: usize = 3;
/// The most places of a block that are grown, and the most relations that are passed on.
const PLACES_PER_BLOCK: usize = 64;
const RELATIONS: usize = 16;
/// Relations closer than this in the middle of the session are the same, s.
pub const SAME_S: f64 = 0.1;
/// Moves are compared between neighbours, and between dwells further apart where those repeat (a grid's rows).
const LAGS: [usize; 2] = [1, 5];
/// Prior standard deviation of the drift: oscillators are within 100 ppm.
const DRIFT_PRIOR: f64 = 1e-4;
/// Standard deviation of the offset from one pair of dwells, s.
const PAIR_S: f64 = 0.05;

/// The relation of seconds since the first stamp of each log: `tracker = controller + offset + drift · controller`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relation {
    pub offset_s: f64,
    pub drift: f64,
}

impl Relation {
    pub fn to_tracker(self, controller_s: f64) -> f64 {
        self.drift.mul_add(controller_s, controller_s + self.offset_s)
    }

    /// Time by which the tracker is ahead at controller seconds, s.
    pub(super) fn ahead_s(self, controller_s: f64) -> f64 {
        self.drift.mul_add(controller_s, self.offset_s)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pair {
    pub arm: usize,
    pub target: usize,
}

#[derive(Debug, Clone, Copy)]
pub struct Dwells<'a> {
    pub arm: &'a [ArmDwell],
    pub target: &'a [TargetDwell],
}

impl Dwells<'_> {
    /// Middle of the controller's log, s.
    pub(super) fn session_middle_s(&self) -> f64 {
        self.arm.last().map_or(0.0, |dwell| dwell.span.end_s / 2.0)
    }
}

/// The comparison of the lengths of moves.
#[derive(Debug, Clone)]
pub struct Ruler {
    points: Vec<Vector3<f64>>,
    /// Moves whose lengths differ by this or more do not agree at all, mm.
    tolerance_mm: f64,
}

impl Ruler {
    /// The comparison at the flange: the target may be some hundred mm from it, so the tolerance is half of a usual move.
    pub fn at_flange(dwells: Dwells) -> Self {
        Self {
            points: dwells.arm.iter().map(|dwell| dwell.flange.translation.vector).collect(),
            tolerance_mm: 0.5 * usual_move_mm(dwells.target),
        }
    }

    /// The comparison at the target, once roughly known at the flange: only the nominal arm's error (`median_mm`) remains.
    pub fn at_target(dwells: Dwells, target_mm: Vector3<f64>, median_mm: f64) -> Self {
        let point = |dwell: &ArmDwell| (dwell.flange * Point3::from(target_mm)).coords;
        let coarse_mm = 0.5 * usual_move_mm(dwells.target);
        Self {
            points: dwells.arm.iter().map(point).collect(),
            tolerance_mm: (8.0 * median_mm).clamp(5.0_f64.min(coarse_mm), coarse_mm),
        }
    }
}

/// The relations under which the logs agree best, best first.
pub(super) fn relations(dwells: Dwells, ruler: &Ruler) -> Vec<Relation> {
    let session_middle_s = dwells.session_middle_s();
    let mut grown: Vec<(f64, Relation)> = Vec::new();
    for block in blocks(dwells.target.len(), BLOCK_DWELLS, BLOCKS) {
        for offset_s in places(dwells, block.clone(), ruler) {
            // Another block has grown to this place already.
            let here_s = dwells.target[block.start].span.start_s - offset_s;
            let known = |(_, relation): &(f64, Relation)| {
                (relation.ahead_s(here_s) - offset_s).abs() < SAME_S / 2.0
            };
            if grown.iter().any(known) {
                continue;
            }
            let relation = grow(dwells, block.clone(), offset_s);
            grown.push((agreement(dwells, &overlaps(dwells, relation), ruler), relation));
        }
    }
    best_distinct(grown, RELATIONS, |relation| relation.ahead_s(session_middle_s))
}

/// The best offsets of many blocks of target dwells, each for itself, s.
pub(super) fn block_offsets(dwells: Dwells, ruler: &Ruler) -> Vec<(Range<usize>, f64)> {
    let length = BLOCK_DWELLS.min(dwells.target.len() / 4).max(2 * super::MIN_PAIRS);
    let best = blocks(dwells.target.len(), length, MANY_BLOCKS).into_iter().flat_map(|block| {
        let offsets = places(dwells, block.clone(), ruler).into_iter().take(BEST_PLACES);
        offsets.map(move |offset_s| (block.clone(), offset_s))
    });
    best.collect()
}

/// Blocks of target dwells, spread evenly over the log.
fn blocks(targets: usize, length: usize, count: usize) -> Vec<Range<usize>> {
    let length = targets.min(length);
    let free = targets - length;
    let count = if free == 0 { 1 } else { count };
    let mut firsts: Vec<usize> = (0..count).map(|k| free * k / (count - 1).max(1)).collect();
    firsts.dedup();
    firsts.into_iter().map(|first| first..first + length).collect()
}

/// The offsets (s) under which the block agrees best with the arm's dwells, best first.
fn places(dwells: Dwells, block: Range<usize>, ruler: &Ruler) -> Vec<f64> {
    let part = Dwells { target: &dwells.target[block], ..dwells };
    let ends = [0, part.target.len() / 2, part.target.len() - 1];
    let least = (part.target.len().min(part.arm.len()) / 2).max(super::MIN_PAIRS);
    let mut scored = Vec::new();
    for anchor in ends.map(|index| &part.target[index].span) {
        for dwell in dwells.arm {
            for offset_s in alignments(&dwell.span, anchor) {
                let pairs = overlaps(part, Relation { offset_s, drift: 0.0 });
                if pairs.len() >= least {
                    scored.push((agreement(part, &pairs, ruler), offset_s));
                }
            }
        }
    }
    best_distinct(scored, PLACES_PER_BLOCK, |&offset_s| offset_s)
}

/// Offsets that align starts, middles or ends of two spans, without near repeats, s.
fn alignments(arm: &Span, target: &Span) -> impl Iterator<Item = f64> {
    let start = target.arrival_s() - arm.arrival_s();
    let end = target.departure_s() - arm.departure_s();
    let spread = (start - end).abs() > SAME_S / 2.0;
    let middle = f64::midpoint(start, end);
    [Some(middle), spread.then_some(start), spread.then_some(end)].into_iter().flatten()
}

/// The best scored items that are [`SAME_S`] or more apart, best first; none that scored below half of the best.
fn best_distinct<T>(mut scored: Vec<(f64, T)>, most: usize, at_s: impl Fn(&T) -> f64) -> Vec<T> {
    scored.sort_by(|a, b| b.0.total_cmp(&a.0).then(at_s(&a.1).total_cmp(&at_s(&b.1))));
    let mut chosen: Vec<T> = Vec::new();
    let least = scored.first().map_or(0.0, |(best, _)| best / 2.0);
    for (score, candidate) in scored {
        if chosen.len() == most || score < least {
            break;
        }
        if chosen.iter().all(|other| (at_s(other) - at_s(&candidate)).abs() > SAME_S) {
            chosen.push(candidate);
        }
    }
    chosen
}

/// The pairs of dwells that overlap by more than half of the shorter one; each dwell is in at most one pair.
pub(super) fn overlaps(dwells: Dwells, relation: Relation) -> Vec<Pair> {
    let mut pairs: Vec<Pair> = Vec::new();
    let Some(first) = dwells.target.first() else { return pairs };
    let end_s = |dwell: &ArmDwell| relation.to_tracker(dwell.span.end_s);
    let mut arm = dwells.arm.partition_point(|dwell| end_s(dwell) < first.span.start_s);
    let mut target = 0;
    while let (Some(a), Some(t)) = (dwells.arm.get(arm), dwells.target.get(target)) {
        let (start_s, end_s) = (relation.to_tracker(a.span.start_s), end_s(a));
        let common = end_s.min(t.span.end_s) - start_s.max(t.span.start_s);
        let shorter = (end_s - start_s).min(t.span.end_s - t.span.start_s);
        let taken = pairs.last().is_some_and(|p| p.arm == arm || p.target == target);
        if common > shorter / 2.0 && !taken {
            pairs.push(Pair { arm, target });
        }
        if end_s < t.span.end_s {
            arm += 1;
        } else {
            target += 1;
        }
    }
    pairs
}

/// Agreement of the moves between `pairs`: the sum of one for each move of equal length in both logs, less where they differ.
fn agreement(dwells: Dwells, pairs: &[Pair], ruler: &Ruler) -> f64 {
    let moves = |lag: usize| pairs.iter().zip(pairs.iter().skip(lag));
    let arm = |pair: &Pair| ruler.points[pair.arm];
    let target = |pair: &Pair| dwells.target[pair.target].position;
    let length = |from: Vector3<f64>, to: Vector3<f64>| (to - from).norm();
    let agree = |(from, to): (&Pair, &Pair)| {
        let difference = length(arm(from), arm(to)) - length(target(from), target(to));
        (1.0 - difference.abs() / ruler.tolerance_mm).max(0.0)
    };
    LAGS.iter().map(|&lag| moves(lag).map(agree).sum::<f64>()).sum()
}

/// The median length of the target's moves, mm; at least one.
fn usual_move_mm(targets: &[TargetDwell]) -> f64 {
    let mut lengths: Vec<f64> =
        targets.windows(2).map(|pair| (pair[1].position - pair[0].position).norm()).collect();
    median(&mut lengths).max(1.0)
}

/// Extends a block's offset to the whole log: pairs within a reach that doubles, offset and drift refitted each time.
fn grow(dwells: Dwells, block: Range<usize>, offset_s: f64) -> Relation {
    let target_s = |index: usize| dwells.target[index].span.middle_s();
    let centre_s = f64::midpoint(target_s(block.start), target_s(block.end - 1)) - offset_s;
    let mut reach_s = (target_s(block.end - 1) - target_s(block.start)).max(1.0);
    let whole_s = dwells.arm.last().map_or(0.0, |dwell| dwell.span.end_s);
    let mut relation = Relation { offset_s, drift: 0.0 };
    loop {
        let lags: Vec<(f64, f64)> = overlaps(dwells, relation)
            .iter()
            .map(|&pair| lag(dwells, pair))
            .filter(|(at_s, _)| (at_s - centre_s).abs() <= reach_s)
            .collect();
        relation = refit(&lags, centre_s, relation);
        if reach_s > 2.0 * whole_s {
            return relation;
        }
        reach_s *= 2.0;
    }
}

/// Controller time of a pair (s) and the time by which the tracker is ahead there (s), from the edges seen in both logs.
fn lag(dwells: Dwells, pair: Pair) -> (f64, f64) {
    let (arm, target) = (&dwells.arm[pair.arm].span, &dwells.target[pair.target].span);
    let edge = |arm: Option<f64>, target: Option<f64>| Some((arm?, target? - arm?));
    let arrived = edge(arm.arrived_s, target.arrived_s);
    match (arrived, edge(arm.left_s, target.left_s)) {
        (Some(a), Some(b)) => (f64::midpoint(a.0, b.0), f64::midpoint(a.1, b.1)),
        (Some(one), None) | (None, Some(one)) => one,
        (None, None) => (arm.middle_s(), target.middle_s() - arm.middle_s()),
    }
}

/// Offset and drift by least squares about `centre_s`, with Huber weights and the drift's prior.
fn refit(lags: &[(f64, f64)], centre_s: f64, before: Relation) -> Relation {
    let residual = |lag: &(f64, f64), relation: Relation| lag.1 - relation.ahead_s(lag.0);
    let mut relation = before;
    for _ in 0..3 {
        let mut sizes: Vec<f64> = lags.iter().map(|lag| residual(lag, relation).abs()).collect();
        let scale_s = (1.5 * median(&mut sizes)).max(1e-3);
        let weight =
            |lag: &(f64, f64)| (scale_s / residual(lag, relation).abs().max(1e-9)).min(1.0);
        // The prior row `drift = 0`, weighted like the pairs.
        let (mut s0, mut s1, mut s2) = (0.0, 0.0, (PAIR_S / DRIFT_PRIOR).powi(2));
        let (mut r0, mut r1) = (0.0, 0.0);
        for lag in lags {
            let (w, at_s) = (weight(lag), lag.0 - centre_s);
            s0 += w;
            s1 += w * at_s;
            s2 += w * at_s * at_s;
            r0 += w * lag.1;
            r1 += w * at_s * lag.1;
        }
        let determinant = s0 * s2 - s1 * s1;
        if determinant <= 0.0 {
            return before;
        }
        let drift = (s0 * r1 - s1 * r0) / determinant;
        let centre_ahead_s = (s2 * r0 - s1 * r1) / determinant;
        relation = Relation { offset_s: centre_ahead_s - drift * centre_s, drift };
    }
    relation
}
