//! Logs that cannot be joined: which change of the set-up makes them agree.

use super::agreement::Agreement;
use super::evidence::{Dwelt, Evidence};
use super::hypotheses::{self, Alternatives};
use super::search::{self, Finding, named};
use super::set_up::SetUp;
use crate::join::supposed::{Matched, Supposed};

/// Dwells are first matched with a gate this many times wider: one link that is far off leaves the pattern of moves as it is.
const WIDER: f64 = 10.0;

/// The change under which the dwells of both logs agree; `None` where no usual mistake explains why they do not.
pub fn explain(
    stated: &SetUp,
    supposed: &Supposed,
    alternatives: &Alternatives,
    gate_mm: f64,
) -> Option<Finding> {
    let under = |set_up: &SetUp, gate_mm: f64| {
        let matched =
            supposed.under(|joints| set_up.flange(joints), set_up.reading_scale, gate_mm)?;
        Some(evidence(&matched))
    };
    let found = |evidence: &Evidence| {
        let all = search::all(stated, evidence, alternatives);
        let found = named(&Agreement::of(stated, evidence), evidence, &all);
        found.map(|finding| Finding { is_grave: true, ..finding })
    };
    let wide = under(stated, WIDER * gate_mm);
    if let Some(finding) = wide.as_ref().and_then(&found).filter(|finding| finding.explains_all) {
        return Some(finding);
    }
    let tried = hypotheses::of_the_join(stated, alternatives);
    let matched = tried.iter().filter_map(|hypothesis| under(&hypothesis.set_up, gate_mm));
    // Of equally many pairs the first, so that the order of hypotheses decides.
    let best = matched.fold(None, |best: Option<Evidence>, evidence| match best {
        Some(best) if best.stations.len() >= evidence.stations.len() => Some(best),
        _ => Some(evidence),
    });
    found(&best?)
}

fn evidence(matched: &[Matched]) -> Evidence {
    let dwelt = |pair: &Matched| Dwelt {
        reported: pair.joints.clone(),
        measured: pair.measured,
        command: None,
    };
    Evidence::spread(matched.iter().map(dwelt).collect())
}
