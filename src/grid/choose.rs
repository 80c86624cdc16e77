//! The tolerance, the verdict of a step, and the choice among steps.

use serde::{Deserialize, Serialize};

use super::{GridError, Interpolation, Judged, Judgement, Source, Verdict};
use crate::figures::{Counted, Coverage, least_count};

/// The `[tolerance]` section of a pipeline file.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Tolerance {
    /// What a position error may be, mm.
    pub mm: f64,
    /// Share of positions that have to be within it.
    pub share: f64,
    /// How sure one has to be of that.
    pub confidence: f64,
}

impl Tolerance {
    /// The coverage that bounds are asked for.
    pub const fn coverage(&self) -> Coverage {
        Coverage {
            share: self.share,
            confidence: self.confidence,
        }
    }

    /// The verdict of a bound on as many poses: `bound + guard ≤ tolerance`.
    ///
    /// ```
    /// use posegrid::figures::PoseErrors;
    /// use posegrid::grid::{Tolerance, Verdict};
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

/// Which row was chosen, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// Place among the judged rows.
    pub row: usize,
    /// Whether the tolerance is met, and shown to be.
    pub verdict: Verdict,
    /// The choice in words.
    pub words: String,
}

/// The largest step whose bound, and that of all smaller steps of its source and interpolation, is within the tolerance;
/// where none is, the row with the least bound; where none has a bound, the one with the least local-cell error.
pub fn choose(judged: &[Judged]) -> Result<Choice, GridError> {
    if let Some(row) = largest_that_holds(judged) {
        let words = format!(
            "{}: the largest step that holds, with all smaller ones{}",
            named(&judged[row]),
            cost(&judged[row])
        );
        return Ok(Choice {
            row,
            verdict: Verdict::Meets,
            words,
        });
    }
    let tables = || {
        judged
            .iter()
            .enumerate()
            .filter(|(_, row)| row.judgement == Judgement::Table)
    };
    let least = tables().filter_map(|(place, row)| Some((place, row.bound?)));
    if let Some((row, bound)) = least.min_by(|a, b| a.1.total_cmp(&b.1)) {
        let words = format!(
            "no step meets the tolerance; {} comes nearest with a bound of {bound:.3} mm{}",
            named(&judged[row]),
            cost(&judged[row])
        );
        return Ok(Choice {
            row,
            verdict: Verdict::DoesNotMeet,
            words,
        });
    }
    let row = best_by_local_cell(judged).ok_or_else(|| GridError::NoTable {
        reason: reasons(judged),
    })?;
    let verdict = judged[row].verdict.clone();
    let words = format!(
        "no step could be shown to meet the tolerance; {} has the least error in local cells",
        named(&judged[row])
    );
    Ok(Choice {
        row,
        verdict,
        words,
    })
}

/// What the grid costs beside the model without one, and whether it helps at all, in words.
fn cost(row: &Judged) -> String {
    if row.held_out.is_no_help() {
        return "; a grid does not help here: on held-out stations it leaves no less than was there".to_owned();
    }
    match row.held_out.excess() {
        Some((excess, error)) if excess > error => {
            format!("; it leaves {excess:.3} ± {error:.3} mm more than the model without a grid")
        }
        _ => String::new(),
    }
}

fn named(row: &Judged) -> String {
    format!(
        "{} mm, nodes {}, {}",
        row.step_mm,
        row.source.name(),
        row.interpolation.name()
    )
}

/// The largest holding step over all families (source × interpolation); the smaller bound where two are as large.
fn largest_that_holds(judged: &[Judged]) -> Option<usize> {
    let families = families(judged);
    let best_of = |family: &(Source, Interpolation)| {
        let mut rows: Vec<usize> = tables_of(judged, *family);
        rows.sort_by(|&a, &b| judged[a].step_mm.total_cmp(&judged[b].step_mm));
        // A step that is no multiple of a measured pitch is no step of this family; others have to hold without gap.
        let rows = rows.into_iter().filter(|&row| judged[row].nodes > 0);
        rows.take_while(|&row| judged[row].verdict == Verdict::Meets)
            .last()
    };
    let order = |&a: &usize, &b: &usize| {
        let step = judged[a].step_mm.total_cmp(&judged[b].step_mm);
        step.then_with(|| {
            judged[b]
                .bound
                .unwrap_or(f64::INFINITY)
                .total_cmp(&judged[a].bound.unwrap_or(f64::INFINITY))
        })
    };
    families.iter().filter_map(best_of).max_by(order)
}

fn families(judged: &[Judged]) -> Vec<(Source, Interpolation)> {
    let mut families: Vec<_> = judged
        .iter()
        .map(|row| (row.source, row.interpolation))
        .collect();
    families.sort_unstable();
    families.dedup();
    families
}

fn tables_of(judged: &[Judged], family: (Source, Interpolation)) -> Vec<usize> {
    let of_family = |row: &Judged| {
        row.judgement == Judgement::Table && (row.source, row.interpolation) == family
    };
    (0..judged.len())
        .filter(|&place| of_family(&judged[place]))
        .collect()
}

/// The table row of the model whose local cells leave the least error, among those that have a node.
fn best_by_local_cell(judged: &[Judged]) -> Option<usize> {
    let table_of = |local: &Judged| {
        judged.iter().position(|row| {
            row.judgement == Judgement::Table
                && row.source == Source::Model
                && row.interpolation == local.interpolation
                && row.step_mm.total_cmp(&local.step_mm).is_eq()
                && row.nodes > row.refused_nodes.values().sum::<usize>()
        })
    };
    let local = judged
        .iter()
        .filter(|row| row.judgement == Judgement::LocalCell);
    local
        .filter_map(|row| Some((table_of(row)?, row.figures?.p95)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(table, _)| table)
}

fn reasons(judged: &[Judged]) -> String {
    let mut reasons: Vec<&str> = judged
        .iter()
        .filter_map(|row| match &row.verdict {
            Verdict::NotShown(reason) => Some(reason.as_str()),
            Verdict::Meets | Verdict::DoesNotMeet => None,
        })
        .collect();
    reasons.sort_unstable();
    reasons.dedup();
    reasons.join("; ")
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use super::*;
    use crate::figures::{Figures, PoseErrors};
    use crate::grid::HeldOut;

    /// A table row of `n` held-out stations that all keep the same error.
    fn row(step_mm: f64, left_mm: f64, uncorrected_mm: f64, n: usize) -> Judged {
        let tolerance = Tolerance {
            mm: 0.5,
            share: 0.95,
            confidence: 0.95,
        };
        let norms = vec![left_mm; n];
        let mut by_pose = PoseErrors::default();
        (0..n).for_each(|pose| by_pose.add(pose, pose, 0, left_mm));
        let bound = by_pose.bound(tolerance.coverage());
        Judged {
            step_mm,
            source: Source::Model,
            interpolation: Interpolation::Trilinear,
            judgement: Judgement::Table,
            of_test: None,
            nodes: 8,
            refused_nodes: BTreeMap::new(),
            cells: 1,
            refused_cells: BTreeMap::new(),
            figures: Figures::of(&norms),
            bound,
            bound_of_session: bound,
            verdict: tolerance.verdict(bound, by_pose.counted(), 0.0),
            held_out: HeldOut {
                uncorrected: vec![uncorrected_mm; n],
                direct: vec![0.1; n],
                norms,
                by_pose,
                blocks: BTreeSet::from([0]),
                ..HeldOut::default()
            },
            chosen: false,
        }
    }

    #[test]
    fn the_largest_step_that_holds_without_a_gap_is_chosen() {
        // 300 mm holds by itself, but 200 mm below it does not.
        let judged = [
            row(100.0, 0.3, 1.0, 100),
            row(200.0, 0.6, 1.0, 100),
            row(300.0, 0.4, 1.0, 100),
        ];
        let choice = choose(&judged).expect("rows");
        assert_eq!((choice.row, choice.verdict), (0, Verdict::Meets));
        assert!(
            choice
                .words
                .contains("0.200 ± 0.000 mm more than the model"),
            "{}",
            choice.words
        );
    }

    #[test]
    fn none_meets_it_and_no_help_are_answers_in_words() {
        let choice = choose(&[row(100.0, 0.9, 0.8, 100)]).expect("a row");
        assert_eq!(choice.verdict, Verdict::DoesNotMeet);
        assert!(
            choice.words.contains("no step meets the tolerance"),
            "{}",
            choice.words
        );
        assert!(
            choice.words.contains("a grid does not help here"),
            "{}",
            choice.words
        );
    }

    #[test]
    fn too_few_stations_show_nothing() {
        let verdict = row(100.0, 0.1, 1.0, 58).verdict;
        assert!(
            matches!(verdict, Verdict::NotShown(reason) if reason.contains("58 poses held out; 59 poses are needed"))
        );
    }
}
