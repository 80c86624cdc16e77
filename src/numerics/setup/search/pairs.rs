//! Two mistakes at once, where none alone explains everything.
//!
//! Each of the single changes that help most is taken as the stated set-up, and the mistakes of kind and moved frames are tried on
//! it, first on few stations. A pair that leaves nothing to explain there is held against all of them.

use std::collections::BTreeMap;

use super::{Explanation, Search};
use crate::setup::agreement::Agreement;
use crate::setup::evidence::Evidence;
use crate::setup::hypotheses::{Alternatives, Hypothesis, Sort};

/// Single changes that are built on, and the most of them that edit one key.
const FIRSTS: usize = 10;
const FIRSTS_OF_KEY: usize = 2;
/// Stations of the first round.
const STATIONS: usize = 40;
/// The most pairs that are held against all stations.
const MOST_HELD: usize = 12;

/// Pairs that leave nothing to explain; `singles` are the single changes as the logs agree with them.
pub(super) fn pairs(
    evidence: &Evidence,
    singles: &[Explanation],
    alternatives: &Alternatives,
) -> Vec<Explanation> {
    let few = evidence.thinned(STATIONS);
    let mut found: Vec<Explanation> =
        firsts(singles).into_iter().flat_map(|first| behind(first, &few, alternatives)).collect();
    found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    found.truncate(MOST_HELD);
    let held = found.into_iter().map(|pair| {
        let agreement = Agreement::of(&pair.hypothesis.set_up, evidence);
        let freedom = pair.cost - pair.agreement.cost();
        Explanation { cost: agreement.cost() + freedom, agreement, ..pair }
    });
    held.collect()
}

/// The single changes that help most, a few for each key.
fn firsts(singles: &[Explanation]) -> Vec<&Explanation> {
    let mut best: Vec<&Explanation> = singles.iter().collect();
    best.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let mut of_key: BTreeMap<&str, usize> = BTreeMap::new();
    best.retain(|own| {
        let count = of_key.entry(own.hypothesis.key()).or_default();
        *count += 1;
        *count <= FIRSTS_OF_KEY
    });
    best.truncate(FIRSTS);
    best
}

/// The pairs of a first change and another one behind it that leave nothing to explain.
fn behind(
    first: &Explanation,
    evidence: &Evidence,
    alternatives: &Alternatives,
) -> Vec<Explanation> {
    let stated = &first.hypothesis.set_up;
    let search = Search::of(stated, Agreement::of(stated, evidence), evidence, alternatives);
    let seconds = search.of_kind().into_iter().map(|second| search.explanation(second));
    let seconds = seconds.filter(|own| own.explains(&search.agreement));
    let pair = |second: Explanation| Explanation {
        cost: second.cost + first.hypothesis.sort.freedom(),
        hypothesis: both(&first.hypothesis, second.hypothesis),
        ..second
    };
    seconds.map(pair).collect()
}

/// Both changes as one. Of two edits of one key the second states what both make of it. The second is to be made first: it names the joints
/// as they are before the first renames them, or behind its own renaming.
fn both(first: &Hypothesis, second: Hypothesis) -> Hypothesis {
    let edit = if first.key() == second.key() {
        second.edit
    } else {
        format!("{}; and then {}", second.edit, first.edit)
    };
    let is_size = [first.sort, second.sort].contains(&Sort::Size);
    Hypothesis {
        mistake: format!("{}; and {}", first.mistake, second.mistake),
        edit,
        sort: if is_size { Sort::Size } else { Sort::Kind },
        is_pair: true,
        ..second
    }
}
