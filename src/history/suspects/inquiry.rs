//! Questions to one comparison: what parts explain together, and which suffice.

use super::{Finding, Suspect};
use crate::history::compare::{ChiSquare, Comparison};

/// Probability that a part is said to have moved beside the one that did, over all others.
const ADDS: f64 = 0.01;
/// Twice the logarithm of the factor by which a part has to be likelier than another to be told apart from it.
const TOLD_APART: f64 = 6.0;
/// Parts that can be named at once.
const MOST_PARTS: usize = 4;

/// Questions to one comparison.
pub(super) struct Inquiry<'c> {
    comparison: &'c Comparison,
    suspects: &'c [Suspect],
}

impl<'c> Inquiry<'c> {
    pub(super) const fn new(comparison: &'c Comparison, suspects: &'c [Suspect]) -> Self {
        Self {
            comparison,
            suspects,
        }
    }

    fn places(&self, parts: &[Suspect]) -> Vec<usize> {
        self.comparison
            .places(|column| parts.iter().any(|part| part.has(column)))
    }

    pub(super) fn explains(&self, parts: &[Suspect]) -> ChiSquare {
        self.comparison.explained(&self.places(parts)).test
    }

    fn single(&self) -> impl Iterator<Item = Suspect> + '_ {
        let single = |suspect: &Suspect| *suspect != Suspect::Anything;
        self.suspects.iter().copied().filter(single)
    }

    /// What moved, given that something did.
    pub(super) fn moved(&self) -> Finding {
        let mut surely = Vec::new();
        while surely.len() < MOST_PARTS {
            let one_of = self.candidates(&surely);
            if !one_of.is_empty() {
                return Finding::Moved { surely, one_of };
            }
            let Some(next) = self.most(&surely) else {
                break;
            };
            surely.push(next);
        }
        Finding::Moved {
            surely: Vec::new(),
            one_of: vec![Suspect::Anything],
        }
    }

    /// The suspect that explains most beside `surely`, each degree of freedom counted as two (Akaike).
    fn most(&self, surely: &[Suspect]) -> Option<Suspect> {
        let gain = |suspect: Suspect| {
            let test = self.explains(&with(surely, suspect));
            (test.statistic - 2.0 * test.freedom as f64, suspect)
        };
        let others = self.single().filter(|suspect| !surely.contains(suspect));
        let gains = others.map(gain);
        gains
            .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)))
            .map(|(_, suspect)| suspect)
    }

    /// The suspects that, with `surely`, leave nothing for others to explain, the likeliest of them.
    fn candidates(&self, surely: &[Suspect]) -> Vec<Suspect> {
        let others = self.single().filter(|suspect| !surely.contains(suspect));
        let enough = others.filter(|suspect| self.suffices(&with(surely, *suspect)));
        let scored = enough.map(|suspect| {
            let test = self.explains(&with(surely, suspect));
            (suspect, test.statistic - test.freedom as f64)
        });
        let scored: Vec<(Suspect, f64)> = scored.collect();
        let best = scored.iter().map(|(_, score)| *score);
        let best = best.fold(f64::NEG_INFINITY, f64::max);
        let near = scored
            .iter()
            .filter(|(_, score)| *score >= best - TOLD_APART);
        let near: Vec<Suspect> = near.map(|(suspect, _)| *suspect).collect();
        let smallest = |large: &Suspect| !near.iter().any(|small| self.is_within(*small, *large));
        near.iter().copied().filter(smallest).collect()
    }

    fn is_within(&self, small: Suspect, large: Suspect) -> bool {
        let (places, around) = (self.places(&[small]), self.places(&[large]));
        places.len() < around.len() && places.iter().all(|place| around.contains(place))
    }

    fn suffices(&self, parts: &[Suspect]) -> bool {
        let alone = self.explains(parts);
        let limit = ADDS / self.suspects.len() as f64;
        let adds = |&suspect: &Suspect| {
            let both = self.explains(&with(parts, suspect));
            alone.remainder(both).p_value() < limit
        };
        !self.suspects.iter().any(adds)
    }
}

fn with(parts: &[Suspect], another: Suspect) -> Vec<Suspect> {
    parts.iter().copied().chain([another]).collect()
}
