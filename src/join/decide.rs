//! The decision: candidate clock relations → the one under which the arm can have been where the target was seen.
//!
//! Each candidate pairs dwells by time; base and target are fitted to those pairs ([`Placement`]), and the pairs whose
//! residual is within reach of the nominal arm's error support it. The reach is one for all candidates: six times the
//! smallest median residual of any candidate with half of the pairs. The candidate with the most support wins; one
//! that is as good in both support and residual makes the session ambiguous, and nothing is guessed.

use super::JoinError;
use super::dwell::median;
use super::pattern::{Dwells, MIN_PAIRS, Pair, Relation, overlaps, relations};
use super::placement::{Placement, Sighting};

/// Reach of support, in median residuals.
const REACH: f64 = 6.0;
/// No nominal arm and no tracker agree better than this, mm: a reach below it would split hairs.
const LEAST_REACH_MM: f64 = 0.5;
/// A rival with this share of the winner's support and a residual no worse than this many times the winner's
/// explains the session as well.
const RIVAL_SUPPORT: f64 = 0.98;
const RIVAL_RESIDUAL: f64 = 2.0;

/// The relation that geometry chose.
#[derive(Debug, Clone)]
pub struct Decision {
    /// The clock relation, still rough.
    pub relation: Relation,
    /// Pairs that support it.
    pub support: Vec<Pair>,
    /// Base and target, rough.
    pub placement: Placement,
    /// Median distance of the supporting pairs from the nominal arm, mm.
    pub median_mm: f64,
    /// How many relations were tried.
    pub tried: usize,
    /// Support of the runner-up.
    pub rival_support: usize,
}

struct Candidate {
    relation: Relation,
    pairs: Vec<Pair>,
    placement: Placement,
    distances_mm: Vec<f64>,
    median_mm: f64,
}

/// Chooses the clock relation, or says why none can be chosen.
pub fn decide(dwells: Dwells, gate_mm: f64) -> Result<Decision, JoinError> {
    let candidates: Vec<Candidate> = relations(dwells)
        .into_iter()
        .filter_map(|relation| Candidate::of(dwells, relation))
        .collect();
    let most = candidates.iter().map(|c| c.pairs.len()).max().unwrap_or(0);
    let least_median = candidates
        .iter()
        .filter(|c| 2 * c.pairs.len() >= most)
        .map(|c| c.median_mm)
        .fold(f64::INFINITY, f64::min);
    let reach_mm = (REACH * least_median).max(LEAST_REACH_MM).min(gate_mm);
    let mut ranked: Vec<(usize, Candidate)> = candidates
        .into_iter()
        .map(|c| (c.support(reach_mm), c))
        .collect();
    ranked.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.median_mm.total_cmp(&b.1.median_mm)));
    let tried = ranked.len();
    let mut ranked = ranked.into_iter();
    let winner = ranked.next();
    let rival = ranked.next();
    match winner {
        Some((support, winner)) if support >= MIN_PAIRS && 2 * support >= winner.pairs.len() => {
            if let Some((rival_support, rival)) = &rival {
                refuse_equal(support, &winner, *rival_support, rival)?;
            }
            Ok(winner.decision(reach_mm, tried, rival.map_or(0, |(support, _)| support)))
        }
        other => Err(JoinError::NoCommonPattern {
            arm_dwells: dwells.arm.len(),
            target_dwells: dwells.target.len(),
            pairs: other.as_ref().map_or(0, |(support, _)| *support),
            needed: MIN_PAIRS,
            median_mm: other.map(|(_, candidate)| candidate.median_mm),
            gate_mm,
        }),
    }
}

fn refuse_equal(
    support: usize,
    winner: &Candidate,
    rival_support: usize,
    rival: &Candidate,
) -> Result<(), JoinError> {
    let as_many = rival_support as f64 >= RIVAL_SUPPORT * support as f64;
    let as_near = rival.median_mm <= RIVAL_RESIDUAL * winner.median_mm;
    if as_many && as_near {
        return Err(JoinError::AmbiguousShift {
            first_s: winner.relation.offset_s,
            first_pairs: support,
            first_mm: winner.median_mm,
            second_s: rival.relation.offset_s,
            second_pairs: rival_support,
            second_mm: rival.median_mm,
        });
    }
    Ok(())
}

/// What the pair's dwells say of the placement.
pub fn sighting(dwells: Dwells, pair: Pair) -> Sighting {
    Sighting {
        flange: dwells.arm[pair.arm].flange,
        attained: dwells.target[pair.target].position,
    }
}

impl Candidate {
    fn of(dwells: Dwells, relation: Relation) -> Option<Self> {
        let pairs = overlaps(dwells, relation);
        let sightings: Vec<Sighting> = pairs.iter().map(|&pair| sighting(dwells, pair)).collect();
        if sightings.len() < MIN_PAIRS {
            return None;
        }
        let placement = Placement::fit(&sightings)?;
        let distances_mm: Vec<f64> = sightings.iter().map(|s| placement.distance_mm(s)).collect();
        let median_mm = median(&mut distances_mm.clone());
        Some(Self {
            relation,
            pairs,
            placement,
            distances_mm,
            median_mm,
        })
    }

    fn support(&self, reach_mm: f64) -> usize {
        self.distances_mm
            .iter()
            .filter(|&&distance| distance <= reach_mm)
            .count()
    }

    fn decision(self, reach_mm: f64, tried: usize, rival_support: usize) -> Decision {
        let near = self.pairs.iter().zip(&self.distances_mm);
        Decision {
            support: near
                .filter(|&(_, &distance)| distance <= reach_mm)
                .map(|(&pair, _)| pair)
                .collect(),
            relation: self.relation,
            placement: self.placement,
            median_mm: self.median_mm,
            tried,
            rival_support,
        }
    }
}
