//! What verifying a run comes to, in one word and its reason.

use super::{FileOutcome, Recomputed, Verified};

/// What verifying a run comes to. Of several the first that holds, in this order: what is published before what it is
/// from, and that before what computing it again gave.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// Files that the run wrote are missing or changed.
    OutputsAltered,
    /// Its row in `runs` contradicts itself.
    RowAltered,
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
                | Self::InputsAltered
                | Self::SettingsDiffer
                | Self::Differs
        )
    }
}

pub(super) fn verdict(verified: &Verified) -> Verdict {
    if verified.outputs.iter().any(super::Output::is_altered) {
        return Verdict::OutputsAltered;
    }
    if !verified.contradictions.is_empty() {
        return Verdict::RowAltered;
    }
    match &verified.recomputed {
        Recomputed::No(_) if !verified.inputs.is_empty() => Verdict::InputsMissing,
        Recomputed::No(reason) => Verdict::NotRecomputed(reason.clone()),
        Recomputed::OtherWork if !verified.inputs.is_empty() => Verdict::InputsAltered,
        Recomputed::OtherWork => Verdict::SettingsDiffer,
        Recomputed::Yes { others, .. } if others.is_empty() => Verdict::Same,
        Recomputed::Yes { others, .. } => {
            let outcomes: Vec<&FileOutcome> = others.iter().map(|file| &file.outcome).collect();
            of_files(&outcomes)
        }
    }
}

fn of_files(outcomes: &[&FileOutcome]) -> Verdict {
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
