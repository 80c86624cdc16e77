//! Tests on one comparison: what parts explain together, and which parts suffice.

use super::{Finding, Hypothesis};
use crate::history::compare::{ChiSquare, Comparison};

/// Probability, over all other parts, that one is named in addition to the part that moved.
const ADDS: f64 = 0.01;
/// Twice the logarithm of the likelihood ratio that distinguishes two parts.
const DISTINGUISHED: f64 = 6.0;
const MOST_PARTS: usize = 4;

pub(super) struct TestOfAll<'c> {
    pub(super) comparison: &'c Comparison,
    pub(super) hypotheses: &'c [Hypothesis],
}

impl TestOfAll<'_> {
    fn places(&self, parts: &[Hypothesis]) -> Vec<usize> {
        self.comparison.places(|column| parts.iter().any(|part| part.has(column)))
    }

    pub(super) fn explains(&self, parts: &[Hypothesis]) -> ChiSquare {
        self.comparison.explained(&self.places(parts)).test
    }

    fn single(&self) -> impl Iterator<Item = Hypothesis> + '_ {
        self.hypotheses.iter().copied().filter(|hypothesis| *hypothesis != Hypothesis::Anything)
    }

    pub(super) fn moved(&self) -> Finding {
        let mut surely = Vec::new();
        while surely.len() < MOST_PARTS {
            let one_of = self.candidates(&surely);
            if !one_of.is_empty() {
                return Finding::Moved { surely, one_of };
            }
            let Some(next) = self.most(&surely) else { break };
            surely.push(next);
        }
        Finding::Moved { surely: Vec::new(), one_of: vec![Hypothesis::Anything] }
    }

    /// The hypothesis that explains most in addition to `surely`, with a penalty of two per degree of freedom (Akaike).
    fn most(&self, surely: &[Hypothesis]) -> Option<Hypothesis> {
        let gain = |hypothesis: Hypothesis| {
            let test = self.explains(&with(surely, hypothesis));
            (test.statistic - 2.0 * test.freedom as f64, hypothesis)
        };
        let gains = self.single().filter(|hypothesis| !surely.contains(hypothesis)).map(gain);
        gains
            .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)))
            .map(|(_, hypothesis)| hypothesis)
    }

    /// The likeliest of the hypotheses that, with `surely`, leave nothing significant for others to explain.
    fn candidates(&self, surely: &[Hypothesis]) -> Vec<Hypothesis> {
        let others = self.single().filter(|hypothesis| !surely.contains(hypothesis));
        let enough = others.filter(|hypothesis| self.suffices(&with(surely, *hypothesis)));
        let scored = enough.map(|hypothesis| {
            let test = self.explains(&with(surely, hypothesis));
            (hypothesis, test.statistic - test.freedom as f64)
        });
        let scored: Vec<(Hypothesis, f64)> = scored.collect();
        let best = scored.iter().map(|(_, score)| *score).fold(f64::NEG_INFINITY, f64::max);
        let near = scored.iter().filter(|(_, score)| *score >= best - DISTINGUISHED);
        let near: Vec<Hypothesis> = near.map(|(hypothesis, _)| *hypothesis).collect();
        let smallest =
            |large: &Hypothesis| !near.iter().any(|small| self.is_within(*small, *large));
        near.iter().copied().filter(smallest).collect()
    }

    fn is_within(&self, small: Hypothesis, large: Hypothesis) -> bool {
        let (places, around) = (self.places(&[small]), self.places(&[large]));
        places.len() < around.len() && places.iter().all(|place| around.contains(place))
    }

    fn suffices(&self, parts: &[Hypothesis]) -> bool {
        let alone = self.explains(parts);
        let limit = ADDS / self.hypotheses.len() as f64;
        let adds = |&hypothesis: &Hypothesis| {
            let both = self.explains(&with(parts, hypothesis));
            alone.remainder(both).p_value() < limit
        };
        !self.hypotheses.iter().any(adds)
    }
}

fn with(parts: &[Hypothesis], another: Hypothesis) -> Vec<Hypothesis> {
    parts.iter().copied().chain([another]).collect()
}
