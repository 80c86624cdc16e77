//! The verdict on a verified run, in one word and its reason.

use super::{Citation, FileOutcome, Output, Recomputed, Role, Verified};

/// The verdict on a verified run. If several hold, the first in this order counts: published files before inputs, and
/// inputs before the recomputed result.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    OutputsAltered,
    /// Its row in `runs` contradicts itself, its file or a later row.
    RowAltered,
    /// Its row in `runs` cannot be read, since its file is damaged: the reason.
    RowUnreadable(String),
    /// None of its files is there, and another run replaced it.
    Removed {
        superseded_by: String,
    },
    /// Files that the run wrote, and its row cites, are missing.
    OutputsMissing,
    /// Inputs are missing: it cannot be recomputed.
    InputsMissing,
    /// Inputs are not those that it read.
    InputsAltered,
    /// The pipeline file's settings are not those that it was computed with.
    SettingsDiffer,
    NotRecomputed(String),
    Differs,
    /// It is unchanged, but runs that it cites are missing.
    CitedMissing,
    /// Recomputed, it gives the same values in other bytes; the largest relative difference of two numbers.
    SameValues {
        /// Relative to the larger of both numbers.
        largest: f64,
    },
    Same,
}

impl Verdict {
    /// Whether the run could not be recomputed, for a reason that is no alteration.
    pub const fn is_open(&self) -> bool {
        matches!(self, Self::InputsMissing | Self::NotRecomputed(_))
    }

    /// Whether a part is shown to differ from the run's claim.
    pub const fn is_mismatch(&self) -> bool {
        matches!(
            self,
            Self::OutputsAltered
                | Self::RowAltered
                | Self::RowUnreadable(_)
                | Self::OutputsMissing
                | Self::InputsAltered
                | Self::SettingsDiffer
                | Self::Differs
                | Self::CitedMissing
        )
    }
}

pub(super) fn verdict(verified: &Verified) -> Verdict {
    let outputs = &verified.outputs;
    if outputs.iter().any(|own| !own.is_sound() && !own.is_missing()) {
        return Verdict::OutputsAltered;
    }
    if !verified.contradictions.is_empty() {
        return Verdict::RowAltered;
    }
    if outputs.iter().any(Output::is_missing) {
        return match &verified.superseded_by {
            Some(by) if outputs.iter().all(Output::is_missing) => {
                Verdict::Removed { superseded_by: by.clone() }
            }
            _ => Verdict::OutputsMissing,
        };
    }
    match &verified.recomputed {
        Recomputed::No(_) if !verified.inputs.is_empty() => Verdict::InputsMissing,
        Recomputed::No(reason) => Verdict::NotRecomputed(reason.clone()),
        Recomputed::OtherWork if !verified.inputs.is_empty() => Verdict::InputsAltered,
        Recomputed::OtherWork => Verdict::SettingsDiffer,
        Recomputed::Yes { others, .. } => {
            let outcomes: Vec<&FileOutcome> = others.iter().map(|file| &file.outcome).collect();
            of_citing(&outcomes, &verified.cited)
        }
    }
}

/// A page that was compared with a promise cannot be made without it; and a missing row changes which run counts as
/// current.
fn of_citing(outcomes: &[&FileOutcome], cited: &[Citation]) -> Verdict {
    let mut lost = cited.iter().filter(|cited| cited.is_lost());
    let is_page = |outcome: &&FileOutcome| matches!(outcome, FileOutcome::Page);
    let besides: Vec<&FileOutcome> = outcomes.iter().filter(|own| !is_page(own)).copied().collect();
    let has_page = besides.len() < outcomes.len();
    match of_files(&besides) {
        Verdict::Differs => Verdict::Differs,
        _ if has_page && lost.clone().any(|cited| cited.role != Role::Replaced) => {
            Verdict::CitedMissing
        }
        _ if has_page => Verdict::Differs,
        Verdict::Same | Verdict::SameValues { .. }
            if lost.any(|cited| cited.role == Role::Replaced) =>
        {
            Verdict::CitedMissing
        }
        verdict => verdict,
    }
}

fn of_files(outcomes: &[&FileOutcome]) -> Verdict {
    if outcomes.is_empty() {
        return Verdict::Same;
    }
    let mut largest = 0.0_f64;
    let mut unreadable = None;
    for outcome in outcomes {
        match outcome {
            FileOutcome::Values(comparison) => match comparison.same_values() {
                Some(own) => largest = largest.max(own),
                None => return Verdict::Differs,
            },
            FileOutcome::OnlyPublished | FileOutcome::OnlyComputed | FileOutcome::Page => {
                return Verdict::Differs;
            }
            FileOutcome::Unreadable(reason) => unreadable = Some(reason.clone()),
            FileOutcome::PageOfOtherBytes | FileOutcome::PageFromElsewhere => {}
        }
    }
    unreadable.map_or(Verdict::SameValues { largest }, Verdict::NotRecomputed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::verify::Left;

    fn citing(role: Role, left: Left) -> [Citation; 1] {
        let run = "b".to_owned();
        [Citation { role, run, left }]
    }

    #[test]
    fn what_is_cited_and_missing_explains_a_page_and_nothing_else() {
        let whole = || citing(Role::Drove, Left::Whole(None));
        let lost = || citing(Role::Drove, Left::Nothing);
        let (page, table) = (&FileOutcome::Page, &FileOutcome::OnlyPublished);
        assert_eq!(of_citing(&[page], &lost()), Verdict::CitedMissing);
        assert_eq!(of_citing(&[page], &whole()), Verdict::Differs);
        assert_eq!(of_citing(&[page, table], &lost()), Verdict::Differs);
        // Missing already when the run was made: its page states so, and is the same.
        assert_eq!(of_citing(&[], &lost()), Verdict::Same);
    }

    #[test]
    fn a_row_that_is_missing_is_reported_of_the_run_that_took_its_place() {
        let lost = citing(Role::Replaced, Left::Nothing);
        assert_eq!(of_citing(&[], &lost), Verdict::CitedMissing);
        let there = citing(Role::Replaced, Left::Whole(Some("c".to_owned())));
        assert_eq!(of_citing(&[], &there), Verdict::Same);
        assert_eq!(of_citing(&[&FileOutcome::OnlyComputed], &lost), Verdict::Differs);
    }
}
