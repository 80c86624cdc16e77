//! `posegrid verify`: past runs recomputed and held against what they claim.
//!
//! Exit codes: 0 all the same; 3 a mismatch; 1 something could not be computed again; 2 bad usage, or no such lake or run.
//! 1 outranks 3.

mod words;

use std::fmt::Write as _;
use std::num::NonZeroUsize;
use std::panic::{self, AssertUnwindSafe};
use std::path::PathBuf;

use clap::Args;

use super::messages::{self, Printable};
use super::progress::Bars;
use super::streams::Undelivered;
use super::{BAD_USAGE, DONE, NO_RESULT, NOT_MET};
use crate::io::lake::Lake;
use crate::io::store::Place;
use crate::pipeline::verify::{
    PastRun, Register, Selected, Selection, Verdict, Verified, VerifyError, clean, select, verify,
};
use crate::progress::Progress;

/// Recompute what past runs claim: their files, their inputs, and every value of every table.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
  posegrid verify lake --pipeline pipelines/quickstart.toml
  posegrid verify lake --pipeline cell3.toml --pipeline cell4.toml --sample 10 --seed 2026
  posegrid verify lake --pipeline cell3.toml 2026-11-09

For each run: the digest of every file it wrote; the other runs that it rests on, as the one whose table drove its session;
the digests of its inputs, found through the pipeline file, and its settings; and where these are the same, the run computed
again into a temporary folder and compared, bytes first, then values. Numbers are the same value up to 1e-9 of the larger. The
lake is only read. A run that another took the place of, and of which no file is left but its row in `runs`, counts as removed.

A sample is the N runs whose BLAKE3 of SEED/RUN comes first. There is no choice by date: a run carries none, as the same
work gives the same bytes on any day; name the sessions of a month instead.

Exit codes: 0 all the same, or removed; 3 something is altered or differs; 1 some run could not be computed again; 2 bad usage, or no
such lake, run or pipeline file. 1 outranks 3.")]
pub struct VerifyArgs {
    /// The folder of the published tables
    pub lake: PathBuf,
    /// Runs or sessions, instead of all by the pipeline files
    #[arg(value_name = "RUN|SESSION")]
    pub names: Vec<String>,
    /// A pipeline file that runs are by; may be given several times. Without any, digests alone are checked
    #[arg(long, value_name = "PIPELINE")]
    pub pipeline: Vec<PathBuf>,
    /// Only so many of the runs
    #[arg(long, value_name = "N")]
    pub sample: Option<NonZeroUsize>,
    /// Which sample
    #[arg(long, value_name = "SEED", default_value = "0", requires = "sample")]
    pub seed: u64,
}

/// Verifies runs; gives the exit code.
pub fn run(args: &VerifyArgs, bars: &Bars) -> u8 {
    let selection = Selection {
        pipelines: args.pipeline.clone(),
        names: args.names.clone(),
        sample: args.sample.map(NonZeroUsize::get),
        seed: args.seed,
    };
    let lake = Lake::at(&Place::of(&args.lake));
    let selected = lake
        .map_err(VerifyError::from)
        .and_then(|lake| Ok((select(&lake, &selection)?, lake)));
    let (selected, lake) = match selected {
        Ok(selected) => selected,
        Err(error) => {
            tracing::error!("{}", Printable(&error.to_string()));
            return BAD_USAGE;
        }
    };
    clean();
    told(&selected, &lake, bars).unwrap_or_else(Undelivered::exit_code)
}

/// As far as somebody reads it: no run is computed again whose verdict nobody would hear.
fn told(selected: &Selected, lake: &Lake, bars: &Bars) -> Result<u8, Undelivered> {
    let verdicts = all(selected, lake, bars)?;
    messages::result(words::summary(&verdicts, selected), bars)?;
    Ok(exit_code(&verdicts))
}

/// Verifies run after run, each of which uses every core, and tells each as soon as it is done.
fn all(selected: &Selected, lake: &Lake, bars: &Bars) -> Result<Vec<Verdict>, Undelivered> {
    let progress = bars.of("verify");
    progress.begin("runs", selected.runs.len() as u64);
    let mut verdicts = Vec::new();
    for run in &selected.runs {
        let (verdict, text) = one(run, &selected.register, lake, bars);
        messages::result(text, bars)?;
        verdicts.push(verdict);
        progress.advance(1);
    }
    progress.end();
    Ok(verdicts)
}

/// Verifies one run; whatever goes wrong with it stays with it.
fn one(run: &PastRun, register: &Register, lake: &Lake, bars: &Bars) -> (Verdict, String) {
    let claim = match &run.claim {
        Ok(claim) => claim,
        Err(reason) => {
            let verdict = Verdict::NotRecomputed(reason.clone());
            let text = words::line(&run.place.display().to_string(), &verdict);
            return (verdict, text);
        }
    };
    let progress = bars.of(&Printable(&claim.key.session).to_string());
    let attempt = AssertUnwindSafe(|| verify(run, claim, register, lake, &progress));
    if let Ok(verified) = panic::catch_unwind(attempt) {
        let verdict = verified.verdict();
        let text = paragraph(&verified, &verdict);
        return (verdict, text);
    }
    let reason = "a defect of posegrid, told above; please report it".to_owned();
    let verdict = Verdict::NotRecomputed(reason);
    let text = words::line(&words::name(&claim.key), &verdict);
    (verdict, text)
}

fn paragraph(verified: &Verified, verdict: &Verdict) -> String {
    let mut text = words::line(&words::name(&verified.claim.key), verdict);
    for detail in words::details(verified) {
        write!(text, "\n  {}", Printable(&detail)).expect("a string");
    }
    text
}

fn exit_code(verdicts: &[Verdict]) -> u8 {
    if verdicts.iter().any(Verdict::is_open) {
        NO_RESULT
    } else if verdicts.iter().any(Verdict::is_mismatch) {
        NOT_MET
    } else {
        DONE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_that_could_not_be_computed_outranks_a_mismatch() {
        let same = Verdict::SameValues { largest: 1e-12 };
        let open = Verdict::NotRecomputed("no log".to_owned());
        assert_eq!(exit_code(&[Verdict::Same, same.clone()]), 0);
        assert_eq!(exit_code(&[same, Verdict::InputsAltered]), 3);
        assert_eq!(exit_code(&[Verdict::Differs, open]), 1);
        assert_eq!(exit_code(&[Verdict::InputsMissing]), 1);
    }
}
