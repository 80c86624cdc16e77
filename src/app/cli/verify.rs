//! `posegrid verify`: past runs recomputed and compared with what they claim. Exit codes: 0 all the same; 3 a mismatch;
//! 1 something could not be recomputed by the pipeline files given; 2 bad usage, or no such lake or run. 3 outranks 1.

mod files;
mod words;

use std::collections::BTreeSet;
use std::num::NonZeroUsize;
use std::panic::{self, AssertUnwindSafe};
use std::path::PathBuf;

use clap::Args;

use super::messages::{self, Printable};
use super::progress::Bars;
use super::streams::Undelivered;
use super::{BAD_USAGE, DONE, NO_RESULT, NOT_MET, READER_GONE};
use crate::files::store::Place;
use crate::io::lake::Lake;
use crate::pipeline::verify::{
    PastRun, Register, Selected, Selection, Sought, StageVerified, StageVerifier, Verdict,
    Verified, VerifyError, account, clean, select, verify,
};
use crate::progress::Progress;

/// Recompute what past runs claim: their files, their inputs, and every value of every table.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
  posegrid verify lake --pipeline pipelines/quickstart.toml
  posegrid verify lake --pipeline cell3.toml --pipeline cell4.toml --sample 10 --seed 2026
  posegrid verify lake --pipeline cell3.toml 2026-11-09

For each run: its row in runs against its own digest, its file and the rows that replaced it; the digest of every file it
wrote; the sessions as joined and the estimate that it started from, and the runs that it depends on, such as the one whose
table drove its session; the digests of its inputs, found through
the pipeline file, and its settings; and where these are the same, the run recomputed into a temporary folder and compared,
bytes first, then values. Numbers are the same value up to 1e-9 of the larger. The
lake is only read. A run that another replaced, and of which only its row in `runs` is left, counts as removed.

Every file under the lake is counted: of a run whose row names it, the lake's own (.lock, .history, .index, compact), temporary, of a run
without a row, or foreign. With RUN or SESSION, those in the folders of these sessions.

A change of the newest rows, which no later row has the digest of, shows against row_digest of table runs, kept elsewhere.

A sample is the N runs whose BLAKE3 of SEED/RUN comes first. There is no choice by date: a run carries none, as the same
work gives the same bytes on any day; name the sessions of a month instead.

Exit codes: 0 all the same, or removed; 3 something is altered, differs or does not belong; 1 some run could not be
recomputed by the pipeline files given; 2 bad usage, or no such lake, run or pipeline file. 3 outranks 1. Without --pipeline
nothing is recomputed: 0 where every digest is as it was, and the last line says of how many runs that is all.")]
pub struct VerifyArgs {
    /// The folder of the published tables
    pub lake: PathBuf,
    /// Runs or sessions, instead of all made by the pipeline files
    #[arg(value_name = "RUN|SESSION")]
    pub names: Vec<String>,
    /// A pipeline file that made runs; may be given several times. Without any, digests alone are checked
    #[arg(long, value_name = "PIPELINE")]
    pub pipeline: Vec<PathBuf>,
    /// Verify only this many of the runs
    #[arg(long, value_name = "N")]
    pub sample: Option<NonZeroUsize>,
    /// Seed of the sample
    #[arg(long, value_name = "SEED", default_value = "0", requires = "sample")]
    pub seed: u64,
}

pub fn run(args: &VerifyArgs, bars: &Bars) -> u8 {
    match checked(args, bars) {
        Ok(code) => code,
        Err(Ended::Unusable(error)) => {
            tracing::error!("{}", Printable(&error.to_string()));
            BAD_USAGE
        }
        // Some runs were not verified.
        Err(Ended::Undelivered(Undelivered::ReaderGone)) => READER_GONE,
        Err(Ended::Undelivered(undelivered)) => undelivered.exit_code(),
    }
}

/// The reason why a verification ended early; no run is recomputed whose verdict could not be printed.
enum Ended {
    Unusable(VerifyError),
    Undelivered(Undelivered),
}

impl From<Undelivered> for Ended {
    fn from(undelivered: Undelivered) -> Self {
        Self::Undelivered(undelivered)
    }
}

fn checked(args: &VerifyArgs, bars: &Bars) -> Result<u8, Ended> {
    let selection = Selection {
        pipelines: args.pipeline.clone(),
        names: args.names.clone(),
        sample: args.sample.map(NonZeroUsize::get),
        seed: args.seed,
    };
    let lake = Lake::at(&Place::of(&args.lake)).map_err(|error| Ended::Unusable(error.into()))?;
    let selected = select(&lake, &selection).map_err(Ended::Unusable)?;
    clean();
    let mut sought = Sought::new(&args.pipeline);
    let (verdicts, shown) = all(&selected, &mut sought, &lake, bars)?;
    let stages = all_stages(&lake, &mut sought, &shown, args, bars)?;
    let account = account(&lake, &selected, &args.names).map_err(Ended::Unusable)?;
    let lines = files::lines(&account, args.names.is_empty());
    let belongs = !account.is_mismatch() && !stages.iter().any(StageVerified::is_mismatch);
    messages::result(format!("\n{}", lines.join("\n")), bars)?;
    let asked = !args.pipeline.is_empty();
    messages::result(words::summary(&verdicts, &selected, asked), bars)?;
    Ok(exit_code(&verdicts, belongs, asked))
}

/// Verifies the results of stages by themselves, and prints what was found; `shown` are those that runs showed already.
fn all_stages(
    lake: &Lake,
    sought: &mut Sought,
    shown: &BTreeSet<String>,
    args: &VerifyArgs,
    bars: &Bars,
) -> Result<Vec<StageVerified>, Ended> {
    let progress = &bars.of("stages");
    let verifier = StageVerifier { lake, sought, names: &args.names, shown, progress };
    let mut all = Vec::new();
    let all_verified = verifier.all().map_err(|error| Ended::Unusable(error.into()))?;
    for (stage, verified) in all_verified {
        if !verified.is_empty() {
            messages::result(words::stage(stage, &verified, shown), bars)?;
        }
        all.extend(verified);
    }
    Ok(all)
}

/// Prints each verdict as soon as it is there; gives also the estimates and grids that runs showed.
fn all(
    selected: &Selected,
    sought: &mut Sought,
    lake: &Lake,
    bars: &Bars,
) -> Result<(Vec<Verdict>, BTreeSet<String>), Undelivered> {
    let progress = bars.of("verify");
    progress.begin("runs", selected.runs.len() as u64);
    let (mut verdicts, mut shown) = (Vec::new(), BTreeSet::new());
    for run in &selected.runs {
        let (verdict, of_stages, text) = one(run, &selected.register, sought, lake, bars);
        messages::result(text, bars)?;
        verdicts.push(verdict);
        shown.extend(of_stages);
        progress.advance(1);
    }
    progress.end();
    Ok((verdicts, shown))
}

/// Verifies one run; whatever goes wrong with it stays with it. Gives its verdict, the results of stages that it shows, and it in words.
fn one(
    run: &PastRun,
    register: &Register,
    sought: &mut Sought,
    lake: &Lake,
    bars: &Bars,
) -> (Verdict, Vec<String>, String) {
    let claim = match &run.claim {
        Ok(claim) => claim,
        Err(wrong) => {
            let verdict = wrong.verdict();
            let text = words::line(&run.place.display().to_string(), &verdict);
            return (verdict, Vec::new(), text);
        }
    };
    let progress = bars.of(&Printable(&claim.key.session).to_string());
    let attempt = AssertUnwindSafe(|| verify(run, claim, register, sought, lake, &progress));
    if let Ok(verified) = panic::catch_unwind(attempt) {
        let verdict = verified.verdict();
        let text = paragraph(&verified, &verdict);
        return (verdict, verified.shows().cloned().collect(), text);
    }
    let reason = "a defect of posegrid, logged above; please report it".to_owned();
    let verdict = Verdict::NotRecomputed(reason);
    let text = words::line(&words::name(&claim.key), &verdict);
    (verdict, Vec::new(), text)
}

fn paragraph(verified: &Verified, verdict: &Verdict) -> String {
    let details = words::details(verified).into_iter();
    let details = details.map(|detail| format!("\n  {}", Printable(&detail)));
    [words::line(&words::name(&verified.claim.key), verdict)].into_iter().chain(details).collect()
}

/// The exit code from the verdicts; `belongs` is whether everything in the lake belongs there, `asked` whether runs were to be
/// recomputed.
fn exit_code(verdicts: &[Verdict], belongs: bool, asked: bool) -> u8 {
    if !belongs || verdicts.iter().any(Verdict::is_mismatch) {
        NOT_MET
    } else if asked && verdicts.iter().any(Verdict::is_open) {
        NO_RESULT
    } else {
        DONE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mismatch_outranks_a_run_that_could_not_be_computed() {
        let same = Verdict::SameValues { largest: 1e-12 };
        let open = Verdict::NotRecomputed("no log".to_owned());
        assert_eq!(exit_code(&[Verdict::Same, same.clone()], true, true), 0);
        assert_eq!(exit_code(&[Verdict::Same], false, true), 3);
        assert_eq!(exit_code(&[same, Verdict::InputsAltered], true, true), 3);
        assert_eq!(exit_code(&[Verdict::Differs, open.clone()], true, true), 3);
        assert_eq!(exit_code(&[Verdict::InputsMissing], true, true), 1);
        assert_eq!(
            exit_code(std::slice::from_ref(&open), true, false),
            0,
            "nothing was to be recomputed"
        );
        assert_eq!(exit_code(&[open], false, false), 3);
    }
}
