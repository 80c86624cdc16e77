//! Steps of a clock that only both logs together show: a jump of one clock looks like a pause of its log.
//!
//! 1. Blocks of the target's dwells are placed among the arm's ([`super::pattern`]), each with an offset of its own, and base and target are
//!    fitted to each block: the instrument may have been knocked between them. Where a block does not agree with the nominal arm, they are
//!    those of the block that agrees best.
//! 2. The offsets that the dwells have one after the other are those with the most pairs near the arm, where a change of the offset costs
//!    as much as [`CHANGE`] pairs (Viterbi).
//! 3. A change that explains more pairs than one offset does, and by more than chance, is a step: the arm's dwells behind it are moved by
//!    it. What is left of it, the edges of the dwells tell.
//! 4. A step that leaves all dwells paired is shorter than they are: their edges alone tell it.

use serde::{Deserialize, Serialize};

use super::JoinError;
use super::decide::{Decision, decide, reading};
use super::dwell::ArmDwell;
use super::observe::Observation;
use super::pattern::{Dwells, Pair, Relation, Ruler, block_offsets, overlaps};
use super::placement::{Placement, ReadingAtFlange};
use crate::figures::median;
use crate::units::{Controller, NS_PER_S, Stamp, WallTime, round_ns};

/// Pairs that a change of the offset has to explain.
const CHANGE: usize = 6;
/// Pairs by which offsets that change have to explain more than one alone.
const GAIN: usize = 12;
/// Pairs on each side of a change that tell what is left of it.
const BESIDE: usize = 20;
/// Smaller changes are drift, s.
const LEAST_S: f64 = 0.25;
/// Least step in median differences of the offset from one pair to the next, where all dwells are paired.
const SCATTERS: f64 = 6.0;
/// Share of the dwells that are paired where nothing has to be explained.
const ENOUGH: f64 = 0.95;
/// Reach of support, in median distances of the best block, and its limits, mm.
const REACH: f64 = 6.0;
const REACH_MM: (f64, f64) = (2.0, 10.0);

/// A step of one of the clocks in the middle of a session.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ClockStep {
    /// The first station behind it, and the last moment of the one before it.
    pub station: usize,
    pub at: Stamp<Controller>,
    /// By how much more the tracker is ahead behind it, s.
    pub by_s: f64,
}

impl ClockStep {
    pub fn words(&self) -> String {
        // A clock that is set back was found in the order of its log.
        let (clock, by_s) =
            if self.by_s < 0.0 { ("controller", -self.by_s) } else { ("tracker", self.by_s) };
        let at = WallTime::of_clock_ns(self.at.ns())
            .map_or_else(String::new, |at| format!(", behind {at} UTC of the controller's clock"));
        format!(
            "the {clock}'s clock stepped by {by_s:+.3} s before station {}{at}: the step is taken out where the logs are joined",
            self.station
        )
    }
}

/// A change of the offset between the clocks.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Change {
    /// The first dwell of the arm behind it.
    arm: usize,
    /// By how much more the tracker is ahead behind it, s.
    by_s: f64,
}

/// The decision on a session's clocks; where one of them stepped, the dwells of the arm behind the step are moved by it.
pub(super) fn decided(
    seen: &mut Observation,
    gate_mm: f64,
) -> Result<(Decision, Vec<ClockStep>), JoinError> {
    let alone = decide(seen.dwells(), gate_mm);
    let pairs = alone.as_ref().map_or(0, |own| own.support.len());
    let most = seen.arm.len().min(seen.dwells().target.len());
    let mut changes = match &alone {
        // A step shorter than a dwell leaves all of them paired.
        Ok(own) if pairs as f64 >= ENOUGH * most as f64 => short(seen.dwells(), &own.support),
        _ => changes(seen.dwells(), pairs),
    };
    if changes.is_empty() {
        return Ok((alone?, Vec::new()));
    }
    let before = seen.arm.clone();
    take_out(&changes, &mut seen.arm);
    let Ok(first) = decide(seen.dwells(), gate_mm) else {
        seen.arm = before;
        return Ok((alone?, Vec::new()));
    };
    let left = left(&changes, seen.dwells(), &first.support);
    take_out(&left, &mut seen.arm);
    for (change, left) in changes.iter_mut().zip(&left) {
        change.by_s += left.by_s;
    }
    let step = |change: &Change| ClockStep {
        station: change.arm,
        at: before[change.arm.saturating_sub(1)].end,
        by_s: change.by_s,
    };
    Ok((decide(seen.dwells(), gate_mm)?, changes.iter().map(step).collect()))
}

/// The changes of the offset in a session; `pairs` are explained by one offset alone.
fn changes(dwells: Dwells, pairs: usize) -> Vec<Change> {
    let offsets = block_offsets(dwells, &Ruler::at_flange(dwells));
    let placed = offsets.iter().map(|(rows, offset_s)| {
        let block = Dwells { target: &dwells.target[rows.clone()], ..dwells };
        let placed = near(block, *offset_s);
        let placement = Placement::fit(&placed)?;
        let median_mm = placement.median_mm(&placed);
        (2 * placed.len() >= block.target.len()).then_some((median_mm, placement))
    });
    let placed: Vec<Option<(f64, Placement)>> = placed.collect();
    let best = placed.iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0));
    let Some((median_mm, best)) = best else { return Vec::new() };
    let reach_mm = (REACH * median_mm).clamp(REACH_MM.0, REACH_MM.1);
    let offsets: Vec<f64> = offsets.into_iter().map(|(_, offset_s)| offset_s).collect();
    let supported = offsets.iter().zip(&placed).map(|(&offset_s, placed)| {
        let near = placed.as_ref().filter(|(median_mm, _)| *median_mm <= reach_mm);
        supported(dwells, offset_s, near.map_or(best, |(_, placement)| placement), reach_mm)
    });
    let supported: Vec<Vec<Option<Pair>>> = supported.collect();
    let path = best_path(&supported, dwells.target.len()).into_iter().enumerate();
    let explained = path.filter_map(|(target, own)| Some((own, supported[own][target]?)));
    let explained: Vec<(usize, Pair)> = explained.collect();
    let half = dwells.arm.len().min(dwells.target.len()) / 2;
    if explained.len() < (pairs + GAIN).max(half) {
        return Vec::new();
    }
    let change = |pair: &[(usize, Pair)]| {
        let [(before, _), (own, first)] = [pair[0], pair[1]];
        let by_s = offsets[own] - offsets[before];
        (by_s.abs() >= LEAST_S).then_some(Change { arm: first.arm, by_s })
    };
    explained.windows(2).filter_map(change).collect()
}

fn near(dwells: Dwells, offset_s: f64) -> Vec<ReadingAtFlange> {
    let pairs = overlaps(dwells, Relation { offset_s, drift: 0.0 });
    pairs.iter().map(|&pair| reading(dwells, pair)).collect()
}

/// For each dwell of the target the pair that agrees with the arm under an offset.
fn supported(
    dwells: Dwells,
    offset_s: f64,
    placement: &Placement,
    reach_mm: f64,
) -> Vec<Option<Pair>> {
    let mut found = vec![None; dwells.target.len()];
    for pair in overlaps(dwells, Relation { offset_s, drift: 0.0 }) {
        if placement.distance_mm(&reading(dwells, pair)) <= reach_mm {
            found[pair.target] = Some(pair);
        }
    }
    found
}

/// For each dwell the place of its offset, on the path with the most support less the cost of its changes.
fn best_path(supported: &[Vec<Option<Pair>>], dwells: usize) -> Vec<usize> {
    let mut scores = vec![0_usize; supported.len()];
    let mut from: Vec<Vec<usize>> = Vec::with_capacity(dwells);
    let gains = |dwell: usize| supported.iter().map(move |own| usize::from(own[dwell].is_some()));
    for dwell in 0..dwells {
        let best = (0..scores.len()).rev().max_by_key(|&own| scores[own]).unwrap_or(0);
        let changed = scores[best].saturating_sub(CHANGE);
        let mut came = Vec::with_capacity(scores.len());
        for ((own, score), gain) in scores.iter_mut().enumerate().zip(gains(dwell)) {
            came.push(if *score >= changed { own } else { best });
            *score = (*score).max(changed) + gain;
        }
        from.push(came);
    }
    let mut own = (0..scores.len()).rev().max_by_key(|&own| scores[own]).unwrap_or(0);
    let mut path = vec![0; dwells];
    for dwell in (0..dwells).rev() {
        path[dwell] = own;
        own = from[dwell][own];
    }
    path
}

/// Moves the dwells of the arm behind each change by it, as if the clocks had not stepped.
fn take_out(changes: &[Change], arm: &mut [ArmDwell]) {
    for change in changes {
        for dwell in &mut arm[change.arm..] {
            let by_ns = round_ns(change.by_s * NS_PER_S);
            dwell.span = dwell.span.later(change.by_s);
            (dwell.start, dwell.end) = (dwell.start.plus_ns(by_ns), dwell.end.plus_ns(by_ns));
        }
    }
}

/// The step that the edges of paired dwells show: the largest change of the offset beside the drift of the session.
fn short(dwells: Dwells, pairs: &[Pair]) -> Vec<Change> {
    let seen =
        pairs.iter().map(|&pair| [dwells.arm[pair.arm].span.middle_s(), ahead_s(dwells, pair)]);
    let seen: Vec<[f64; 2]> = seen.collect();
    // A step is in few of these stretches.
    let slopes = seen.iter().zip(seen.iter().skip(BESIDE / 2));
    let slopes = slopes.map(|(first, last)| (last[1] - first[1]) / (last[0] - first[0]));
    let drift = median(&slopes.collect::<Vec<_>>());
    let next = seen.windows(2).map(|pair| (pair[1][1] - pair[0][1]).abs());
    let scatter_s = median(&next.collect::<Vec<_>>());
    let (Some(drift), Some(scatter_s)) = (drift, scatter_s) else { return Vec::new() };
    let level_s: Vec<f64> = seen.iter().map(|[at_s, ahead_s]| ahead_s - drift * at_s).collect();
    let between = |own: &[f64]| {
        let (before, behind) = own.split_at(BESIDE);
        (behind.iter().sum::<f64>() - before.iter().sum::<f64>()) / BESIDE as f64
    };
    let by_s = level_s.windows(2 * BESIDE).map(between);
    let changes = by_s.zip(pairs.iter().skip(BESIDE));
    let changes = changes.map(|(by_s, pair)| Change { arm: pair.arm, by_s });
    let largest = changes.max_by(|a, b| a.by_s.abs().total_cmp(&b.by_s.abs()));
    let is_step = |own: &Change| own.by_s.abs() >= LEAST_S.max(SCATTERS * scatter_s);
    largest.into_iter().filter(is_step).collect()
}

/// By how much the tracker's clock is ahead in a pair, s.
fn ahead_s(dwells: Dwells, pair: Pair) -> f64 {
    dwells.target[pair.target].span.middle_s() - dwells.arm[pair.arm].span.middle_s()
}

/// What is left of each change once it is taken out: by how much more the tracker is ahead in the pairs next behind it than in those next
/// before it, s. Over so few the clocks do not drift.
fn left(changes: &[Change], dwells: Dwells, pairs: &[Pair]) -> Vec<Change> {
    let usual_s = |pairs: &[Pair]| {
        let ahead: Vec<f64> = pairs.iter().map(|&pair| ahead_s(dwells, pair)).collect();
        median(&ahead).unwrap_or(0.0)
    };
    let of_change = |change: &Change| {
        let at = pairs.partition_point(|pair| pair.arm < change.arm);
        let before = &pairs[at.saturating_sub(BESIDE)..at];
        let behind = &pairs[at..pairs.len().min(at + BESIDE)];
        Change { by_s: usual_s(behind) - usual_s(before), ..*change }
    };
    changes.iter().map(of_change).collect()
}
