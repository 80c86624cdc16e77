//! The decision: candidate clock relations → the one under which the arm agrees with the measured positions of the target.
//!
//! Each candidate pairs dwells by time; base and target are fitted to those pairs ([`Placement`]), and pairs whose
//! residual is within the reach support it. The reach is the same for all candidates: six times the
//! smallest median residual of any candidate with half of the pairs. The candidate with the most support wins; one
//! that is as good in both support and residual makes the session ambiguous, and the join reports an error.

use std::ops::Range;

use super::JoinError;
use super::MIN_PAIRS;
use super::average::median;
use super::moved::explains;
use super::pattern::{Dwells, Pair, Relation, Ruler, SAME_S, overlaps, relations};
use super::placement::{Placement, ReadingAtFlange};

/// The most pairs to which base and target are fitted, spread over the session: nine unknowns need no more.
const FIT_PAIRS: usize = 250;
/// Reach of support, in median residuals.
const REACH: f64 = 6.0;
/// Least reach, mm: no nominal arm agrees with a tracker better than this.
const LEAST_REACH_MM: f64 = 0.5;
/// A rival of this share of the winner's support and at most so many times its residual explains the session as well.
const RIVAL_SUPPORT: f64 = 0.98;
const RIVAL_RESIDUAL: f64 = 2.0;

#[derive(Debug, Clone)]
pub struct Decision {
    pub relation: Relation,
    pub support: Vec<Pair>,
    pub placement: Placement,
    pub median_mm: f64,
    pub tried: usize,
    pub rival_support: usize,
}

struct Candidate {
    relation: Relation,
    pairs: Vec<Pair>,
    placement: Placement,
    distances_mm: Vec<f64>,
    median_mm: f64,
}

/// The chosen clock relation, or the reason why none can be chosen. Where no placement holds for most of the session, it is that of the
/// half of the target's dwells under which the others agree with the arm once the base is placed anew ([`super::moved`]).
pub fn decide(dwells: Dwells, gate_mm: f64) -> Result<Decision, JoinError> {
    decide_as_one(dwells, gate_mm).or_else(|error| match error {
        JoinError::NoCommonPattern { .. } => by_half(dwells, gate_mm).ok_or(error),
        _ => Err(error),
    })
}

/// The decision by the half of the target's dwells that has more support, if it explains the session.
pub(super) fn by_half(dwells: Dwells, gate_mm: f64) -> Option<Decision> {
    let middle = dwells.target.len() / 2;
    let halves = [0..middle, middle..dwells.target.len()];
    let of_half = |rows: Range<usize>| {
        let half = Dwells { arm: dwells.arm, target: &dwells.target[rows.clone()] };
        let mut decision = decide_as_one(half, gate_mm).ok()?;
        decision.support.iter_mut().for_each(|pair| pair.target += rows.start);
        let pairs = overlaps(dwells, decision.relation);
        let readings = pairs.iter().map(|&pair| reading(dwells, pair));
        let readings: Vec<ReadingAtFlange> = readings.collect();
        explains(&readings, &decision.placement, gate_mm).then_some(decision)
    };
    let found = halves.into_iter().filter_map(of_half);
    // Of equal halves the first.
    found.reduce(|a, b| if b.support.len() > a.support.len() { b } else { a })
}

/// The clock relation under which one placement holds for most of the session, or the reason why none can be chosen.
pub(super) fn decide_as_one(dwells: Dwells, gate_mm: f64) -> Result<Decision, JoinError> {
    let coarse = ranked(candidates(dwells, &Ruler::at_flange(dwells)), gate_mm);
    let Some(first) = coarse.first() else { return Err(no_common_pattern(dwells, gate_mm, None)) };
    // Even under a shift by one row of a grid the target's position on the flange is found right, and with it moves are
    // distinguished to millimetres: the right shift may be missing among the coarse candidates.
    let at_target =
        Ruler::at_target(dwells, first.candidate.placement.target_mm, first.candidate.median_mm);
    let coarse = coarse.into_iter().map(|ranked| ranked.candidate);
    let all = merged(candidates(dwells, &at_target), coarse, dwells.session_middle_s());
    let tried = all.len();
    let mut ranked = ranked(all, gate_mm).into_iter();
    let winner = ranked.next();
    // An offset that differs by less than the dwells are long, and pairs them alike, is none that explains the logs otherwise.
    let rival = winner.as_ref().and_then(|winner| ranked.find(|own| !own.pairs_as(winner)));
    match winner {
        Some(winner)
            if winner.support >= MIN_PAIRS
                && 2 * winner.support >= winner.candidate.pairs.len() =>
        {
            if let Some(rival) = &rival {
                refuse_equal(&winner, rival)?;
            }
            Ok(winner.decision(tried, rival.map_or(0, |rival| rival.support)))
        }
        best => Err(no_common_pattern(dwells, gate_mm, best.as_ref())),
    }
}

fn candidates(dwells: Dwells, ruler: &Ruler) -> Vec<Candidate> {
    let fitted = |relation| Candidate::of(dwells, relation);
    relations(dwells, ruler).into_iter().filter_map(fitted).collect()
}

/// The candidates of both rulers, each relation once.
fn merged(
    mut candidates: Vec<Candidate>,
    others: impl Iterator<Item = Candidate>,
    middle_s: f64,
) -> Vec<Candidate> {
    for other in others {
        let ahead_s = other.relation.ahead_s(middle_s);
        if candidates.iter().all(|c| (c.relation.ahead_s(middle_s) - ahead_s).abs() > SAME_S) {
            candidates.push(other);
        }
    }
    candidates
}

/// The candidates with their support, the best first.
fn ranked(candidates: Vec<Candidate>, gate_mm: f64) -> Vec<Ranked> {
    let most = candidates.iter().map(|c| c.pairs.len()).max().unwrap_or(0);
    let usual = candidates.iter().filter(|c| 2 * c.pairs.len() >= most);
    let least_median = usual.map(|c| c.median_mm).fold(f64::INFINITY, f64::min);
    let reach_mm = (REACH * least_median).max(LEAST_REACH_MM).min(gate_mm);
    let supported = |candidate: Candidate| {
        let near = candidate.distances_mm.iter().filter(|&&distance| distance <= reach_mm);
        Ranked { support: near.count(), reach_mm, candidate }
    };
    let mut ranked: Vec<Ranked> = candidates.into_iter().map(supported).collect();
    ranked.sort_by(|a, b| {
        let nearer = a.candidate.median_mm.total_cmp(&b.candidate.median_mm);
        b.support.cmp(&a.support).then(nearer)
    });
    ranked
}

fn no_common_pattern(dwells: Dwells, gate_mm: f64, best: Option<&Ranked>) -> JoinError {
    JoinError::NoCommonPattern {
        arm_dwells: dwells.arm.len(),
        target_dwells: dwells.target.len(),
        pairs: best.map_or(0, |best| best.support),
        needed: MIN_PAIRS,
        median_mm: best.map(|best| best.candidate.median_mm),
        gate_mm,
    }
}

fn refuse_equal(winner: &Ranked, rival: &Ranked) -> Result<(), JoinError> {
    let as_many = rival.support as f64 >= RIVAL_SUPPORT * winner.support as f64;
    let as_near = rival.candidate.median_mm <= RIVAL_RESIDUAL * winner.candidate.median_mm;
    if as_many && as_near {
        return Err(JoinError::AmbiguousShift {
            first_s: winner.candidate.relation.offset_s,
            first_pairs: winner.support,
            first_mm: winner.candidate.median_mm,
            second_s: rival.candidate.relation.offset_s,
            second_pairs: rival.support,
            second_mm: rival.candidate.median_mm,
        });
    }
    Ok(())
}

/// The flange and the measured position of a pair, for the fit of a placement.
pub fn reading(dwells: Dwells, pair: Pair) -> ReadingAtFlange {
    ReadingAtFlange {
        flange: dwells.arm[pair.arm].flange,
        attained: dwells.target[pair.target].position,
    }
}

impl Candidate {
    fn of(dwells: Dwells, relation: Relation) -> Option<Self> {
        let pairs = overlaps(dwells, relation);
        let readings: Vec<ReadingAtFlange> =
            pairs.iter().map(|&pair| reading(dwells, pair)).collect();
        if readings.len() < MIN_PAIRS {
            return None;
        }
        let stride = readings.len().div_ceil(FIT_PAIRS);
        let spread: Vec<ReadingAtFlange> = readings.iter().copied().step_by(stride).collect();
        let placement = Placement::fit(&spread)?;
        let distances_mm: Vec<f64> = readings.iter().map(|s| placement.distance_mm(s)).collect();
        let median_mm = median(&mut distances_mm.clone());
        Some(Self { relation, pairs, placement, distances_mm, median_mm })
    }
}

/// A candidate and the number of its pairs within the common reach.
struct Ranked {
    support: usize,
    reach_mm: f64,
    candidate: Candidate,
}

impl Ranked {
    /// Whether most of its pairs are those of another.
    fn pairs_as(&self, other: &Self) -> bool {
        let [own, others] = [self, other].map(|ranked| &ranked.candidate.pairs);
        let is_theirs = |pair: &&Pair| {
            let place = others.binary_search_by_key(&pair.arm, |other| other.arm);
            place.is_ok_and(|place| others[place] == **pair)
        };
        2 * own.iter().filter(is_theirs).count() > own.len()
    }

    fn decision(self, tried: usize, rival_support: usize) -> Decision {
        let Candidate { relation, pairs, placement, distances_mm, median_mm } = self.candidate;
        let near = pairs.into_iter().zip(distances_mm);
        let near = near.filter(|(_, distance_mm)| *distance_mm <= self.reach_mm);
        let support = near.map(|(pair, _)| pair).collect();
        Decision { relation, support, placement, median_mm, tried, rival_support }
    }
}
