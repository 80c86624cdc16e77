//! The tolerance, the verdict of a step, and the choice among steps.
//!
//! Two rules choose, and both choices are reported; `[grid] choose` sets which of them is published:
//! - *within*: model nodes cost nothing, so the largest step that is hardly worse than the model itself;
//! - *fewest-nodes*: the largest step that holds with all smaller ones, as where each node costs a measurement.

mod rules;

use serde::{Deserialize, Serialize};

pub use rules::WITHIN_MM;

use super::settings::{GridSettings, Rule};
use super::{Judged, Verdict};
use crate::figures::{Counted, Coverage, least_count};

/// The `[tolerance]` section of a pipeline file.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Tolerance {
    /// Largest allowed position error, mm.
    pub mm: f64,
    /// Share of positions that have to be within it.
    pub share: f64,
    pub confidence: f64,
}

impl Tolerance {
    pub const fn coverage(&self) -> Coverage {
        Coverage { share: self.share, confidence: self.confidence }
    }

    /// The verdict on a bound that counts so many poses: `bound + guard ≤ tolerance`.
    ///
    /// ```
    /// use posegrid_base::figures::PoseErrors;
    /// use posegrid_numerics::grid::{Tolerance, Verdict};
    ///
    /// let tolerance = Tolerance { mm: 0.5, share: 0.95, confidence: 0.95 };
    /// let mut errors = PoseErrors::default();
    /// for pose in 0..60 {
    ///     errors.add(pose, 0, 0, 0.005 * pose as f64);
    /// }
    /// let bound = errors.bound(tolerance.coverage());
    /// let verdict = |guard_mm| tolerance.verdict(bound, errors.counted(), guard_mm);
    /// assert_eq!(verdict(0.05), Verdict::Meets);
    /// assert_eq!(verdict(0.25), Verdict::DoesNotMeet);
    /// ```
    pub fn verdict(&self, bound: Option<f64>, counted: Counted, guard_mm: f64) -> Verdict {
        match bound {
            Some(bound) if bound + guard_mm <= self.mm => Verdict::Meets,
            Some(_) => Verdict::DoesNotMeet,
            None => Verdict::NotShown(format!(
                "{counted} held out; {:.0} poses are needed for {} % with {} % confidence",
                least_count(self.coverage()),
                100.0 * self.share,
                100.0 * self.confidence
            )),
        }
    }
}

/// The least change of an arm or its surroundings that matters to a tolerance, mm: the uncertainty U of one measured error, which a
/// verdict sets aside, but a tenth of the tolerance at least and a third at most, the ratios between which metrology wants the
/// uncertainty of a measurement and its tolerance.
pub fn notices_mm(tolerance_mm: f64, guard_mm: f64) -> f64 {
    guard_mm.max(tolerance_mm / 10.0).min(tolerance_mm / 3.0)
}

#[derive(Debug, Clone, PartialEq)]
pub struct Picked {
    /// Index among the judged rows.
    pub row: usize,
    /// The reason for this row, as text.
    pub words: String,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// Index of the published table among the judged rows; `None` where no step gives a table.
    pub row: Option<usize>,
    /// Whether the tolerance is met, and shown to be.
    pub verdict: Verdict,
    pub words: String,
    /// The choice of [`Rule::Within`]; `None` where no step gives a table.
    pub within: Option<Picked>,
    /// The choice of [`Rule::FewestNodes`]; `None` where no step gives a table.
    pub fewest_nodes: Option<Picked>,
}

/// The choices of both rules among the judged rows, and the row that is published.
pub(super) fn choose(judged: &[Judged], settings: &GridSettings) -> Choice {
    let within = rules::within(judged, settings.within);
    let fewest_nodes = rules::fewest_nodes(judged);
    let published = match settings.choose {
        Rule::Within => within.clone(),
        Rule::FewestNodes => fewest_nodes.clone(),
    };
    let (row, verdict, words) = if let Some(picked) = published {
        (Some(picked.row), judged[picked.row].verdict.clone(), picked.words)
    } else {
        let words = format!("no step gives a table: {}", reasons(judged));
        (None, Verdict::NotShown(words.clone()), words)
    };
    Choice { row, verdict, words, within, fewest_nodes }
}

/// Why rows are not shown, each reason once.
fn reasons(judged: &[Judged]) -> String {
    let reason = |row: &Judged| match &row.verdict {
        Verdict::NotShown(reason) => {
            Some(format!("{} mm, nodes {}: {reason}", row.step_mm, row.source.name()))
        }
        Verdict::Meets | Verdict::DoesNotMeet => None,
    };
    let mut reasons: Vec<String> = Vec::new();
    for reason in judged.iter().filter_map(reason) {
        if !reasons.contains(&reason) {
            reasons.push(reason);
        }
    }
    reasons.join("; ")
}

#[cfg(test)]
mod tests;
