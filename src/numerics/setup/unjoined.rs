//! Logs that cannot be joined: which change of the set-up makes them agree.

use std::cmp::Reverse;

use rayon::prelude::*;

use super::agreement::Agreement;
use super::evidence::{Dwelt, Evidence};
use super::hypotheses::{self, Alternatives};
use super::search::{Finding, Search};
use super::set_up::SetUp;
use crate::join::supposed::{Bases, Matched, Supposed};

/// Dwells are first matched with a gate this many times wider: one link that is far off leaves the pattern of moves as it is.
const WIDER: f64 = 10.0;
/// The most ways to pair the dwells that are held against the mistakes.
const MOST_TRIED: usize = 6;

/// The change under which the dwells of both logs agree; `None` where no usual mistake explains why they do not.
pub fn explain(
    stated: &SetUp,
    supposed: &Supposed,
    alternatives: &Alternatives,
    gate_mm: f64,
) -> Option<Finding> {
    let under = |set_up: &SetUp, bases, gate_mm: f64| {
        supposed.under(bases, |joints| set_up.flange(joints), &set_up.reading_map, gate_mm)
    };
    let mistakes = hypotheses::of_the_join(stated, alternatives);
    let found = |pairs: &Vec<Matched>| {
        let evidence = evidence(pairs);
        Search::of(stated, Agreement::of(stated, &evidence), &evidence, alternatives).named()
    };
    // A move in mid session beside a mistake is rare, and asks twice as much.
    let found = [Bases::One, Bases::Two].into_iter().find_map(|bases| {
        // Each is a search of its own for the clocks' offset.
        let tried = mistakes.par_iter().filter_map(|one| under(&one.set_up, bases, gate_mm));
        let tried: Vec<Vec<Matched>> = tried.collect();
        let wider = under(stated, bases, WIDER * gate_mm);
        let mut matched: Vec<Vec<Matched>> = wider.into_iter().chain(tried).collect();
        // A few dwells, or dwells in a plane, agree with wrong set-ups: most pairs first, of equally many in the order of hypotheses.
        matched.sort_by_key(|pairs| Reverse(pairs.len()));
        matched.iter().take(MOST_TRIED).find_map(found)
    });
    found.map(|finding| Finding { is_grave: true, ..finding })
}

fn evidence(matched: &[Matched]) -> Evidence {
    let dwelt = |pair: &Matched| Dwelt {
        reported: pair.joints.clone(),
        measured: pair.measured,
        orientation: None,
        command: None,
    };
    Evidence::spread(matched.iter().map(dwelt).collect())
}
