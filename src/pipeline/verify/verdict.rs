//! What verifying a run comes to, in one word and its reason.

use super::{Citation, FileOutcome, Output, Recomputed, Role, Verified};

/// What verifying a run comes to. Of several the first that holds, in this order: what is published before what it is
/// from, and that before what computing it again gave.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// Files that the run wrote are changed.
    OutputsAltered,
    /// Its row in `runs` contradicts itself, its file or a later row.
    RowAltered,
    /// Its row in `runs` cannot be read, as its file is damaged: why.
    RowUnreadable(String),
    /// None of its files is there, and another run took its place.
    Removed {
        /// That run.
        superseded_by: String,
    },
    /// Files that the run wrote, and its row cites, are missing.
    OutputsMissing,
    /// Inputs are missing: it cannot be computed again.
    InputsMissing,
    /// Inputs are not those that it read.
    InputsAltered,
    /// The pipeline file's settings are not those that it was computed with.
    SettingsDiffer,
    /// It could not be computed again: why.
    NotRecomputed(String),
    /// Computed again it gives other values.
    Differs,
    /// It is as it was, but runs that it cites are missing.
    CitedMissing,
    /// Computed again it gives the same values in other bytes; the largest relative difference of two numbers.
    SameValues {
        /// The larger of both numbers is 1.
        largest: f64,
    },
    /// Computed again it gives the same bytes.
    Same,
}

impl Verdict {
    /// Whether the run could not be computed again, through nothing that was altered.
    pub const fn is_open(&self) -> bool {
        matches!(self, Self::InputsMissing | Self::NotRecomputed(_))
    }

    /// Whether something is shown to be other than the run says.
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
    if outputs
        .iter()
        .any(|own| !own.is_sound() && !own.is_missing())
    {
        return Verdict::OutputsAltered;
    }
    if !verified.contradictions.is_empty() {
        return Verdict::RowAltered;
    }
    if outputs.iter().any(Output::is_missing) {
        return match &verified.superseded_by {
            Some(by) if outputs.iter().all(Output::is_missing) => Verdict::Removed {
                superseded_by: by.clone(),
            },
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

/// A page that was held against a promise cannot be made again without it; and a row that is missing misleads about others.
fn of_citing(outcomes: &[&FileOutcome], cited: &[Citation]) -> Verdict {
    let mut lost = cited.iter().filter(|cited| cited.is_lost());
    let is_page = |outcome: &&FileOutcome| matches!(outcome, FileOutcome::Page);
    let besides: Vec<&FileOutcome> = outcomes
        .iter()
        .filter(|own| !is_page(own))
        .copied()
        .collect();
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
    match unreadable {
        Some(reason) => Verdict::NotRecomputed(reason),
        None => Verdict::SameValues { largest },
    }
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
        // Never there when the run was made: its page says so, and is the same.
        assert_eq!(of_citing(&[], &lost()), Verdict::Same);
    }

    #[test]
    fn a_row_that_is_missing_is_reported_of_the_run_that_took_its_place() {
        let lost = citing(Role::Replaced, Left::Nothing);
        assert_eq!(of_citing(&[], &lost), Verdict::CitedMissing);
        let there = citing(Role::Replaced, Left::Whole(Some("c".to_owned())));
        assert_eq!(of_citing(&[], &there), Verdict::Same);
        assert_eq!(
            of_citing(&[&FileOutcome::OnlyComputed], &lost),
            Verdict::Differs
        );
    }
}
