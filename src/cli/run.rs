//! `posegrid run`: every session found or named, through all stages, into the lake.

use std::fmt::Write as _;
use std::num::NonZeroUsize;
use std::panic::{self, AssertUnwindSafe};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use clap::Args;

use super::messages::{self, Printable};
use super::progress::Bars;
use super::{BAD_USAGE, DONE, NO_RESULT, NOT_MET};
use crate::grid::Verdict;
use crate::io::lake::Lake;
use crate::io::store::Place;
use crate::pipeline::plan::{Overrides, Plan, WorkPiece};
use crate::pipeline::run::{Done, run_piece};

/// Make every table and page of every session: the whole way from two logs to a compensation table.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
  posegrid run pipelines/quickstart.toml
  posegrid run pipelines/ur10-random.toml ur10-random-a --test ur10-random-b

Work that the lake has already is not done again: a run's name follows from its inputs, settings and version.
An interrupted run leaves nothing half done: run it again.")]
pub struct RunArgs {
    /// The pipeline file
    pub pipeline: PathBuf,
    /// Sessions to learn from, instead of those that the pipeline file names or finds
    #[arg(value_name = "SESSION")]
    pub sessions: Vec<String>,
    /// A session that only judges, instead of those that the pipeline file names; may be given several times
    #[arg(long, value_name = "SESSION")]
    pub test: Vec<String>,
    /// The folder of the published tables, instead of the pipeline file's
    #[arg(long, value_name = "DIR")]
    pub lake: Option<PathBuf>,
    /// Sessions worked on at once; each uses every core, so more than one helps where single ones leave cores idle
    #[arg(long, value_name = "N", default_value = "1")]
    pub jobs: NonZeroUsize,
    /// List the work, and do none
    #[arg(long)]
    pub dry_run: bool,
}

/// How one piece of work ended.
#[derive(Debug)]
enum Ending {
    /// With a result.
    Done(Done),
    /// Without one: why.
    Failed(String),
}

/// Runs the pipeline; gives the exit code.
pub fn run(args: &RunArgs, bars: &Bars) -> u8 {
    let overrides = Overrides {
        sessions: args.sessions.clone(),
        test: args.test.clone(),
        lake: args.lake.clone(),
    };
    let plan = match Plan::load(&args.pipeline, &overrides) {
        Ok(plan) => plan,
        Err(error) => {
            tracing::error!("{error}");
            return if error.is_worth_a_retry() {
                NO_RESULT
            } else {
                BAD_USAGE
            };
        }
    };
    for left in &plan.left_out {
        tracing::warn!("{} is no session: {}", Printable(&left.folder), left.reason);
    }
    for remark in &plan.remarks {
        tracing::info!("{remark}");
    }
    if args.dry_run {
        messages::result(work(&plan));
        return DONE;
    }
    let lake = match Lake::at(&plan.lake) {
        Ok(lake) => lake,
        Err(error) => {
            tracing::error!("{}", Printable(&error.to_string()));
            return NO_RESULT;
        }
    };
    clean(&lake);
    let endings = all(&plan, args.jobs, bars);
    messages::result(summary(&plan, &endings));
    exit_code(&endings)
}

/// Removes what killed runs left under temporary names; where that fails, the lake is as sound as before.
fn clean(lake: &Lake) {
    match lake.clean() {
        Ok(removed) if removed.is_empty() => {}
        Ok(removed) => tracing::info!(
            "removed {} unfinished files that killed runs left in the lake",
            removed.len()
        ),
        Err(error) => tracing::warn!("{error}"),
    }
}

/// The pieces of work in words.
pub fn work(plan: &Plan) -> String {
    let names = |sessions: &[crate::pipeline::plan::SessionFiles]| {
        let names: Vec<_> = sessions
            .iter()
            .map(|s| Printable(&s.name).to_string())
            .collect();
        names.join(", ")
    };
    let mut text = String::new();
    for piece in &plan.pieces {
        let session = Printable(&piece.session);
        write!(text, "{session}: learns from {}", names(&piece.training)).expect("a string");
        if !piece.test.is_empty() {
            write!(text, "; judged on {}", names(&piece.test)).expect("a string");
        }
        text.push('\n');
    }
    text
}

/// Does all pieces, `jobs` at once; endings in the order of the pieces.
fn all(plan: &Plan, jobs: NonZeroUsize, bars: &Bars) -> Vec<Ending> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut own = Vec::new();
        loop {
            let place = next.fetch_add(1, Ordering::Relaxed);
            let Some(piece) = plan.pieces.get(place) else {
                return own;
            };
            own.push((place, one(plan, piece, bars)));
        }
    };
    let mut endings: Vec<(usize, Ending)> = thread::scope(|scope| {
        let workers = jobs.get().min(plan.pieces.len());
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        let ended = |worker: thread::ScopedJoinHandle<'_, _>| worker.join();
        let ended = workers.into_iter().map(ended);
        ended
            .flat_map(|own| own.expect("a piece's panic is caught"))
            .collect()
    });
    endings.sort_by_key(|(place, _)| *place);
    endings.into_iter().map(|(_, ending)| ending).collect()
}

/// Does one piece; whatever goes wrong with it stays with it.
fn one(plan: &Plan, piece: &WorkPiece, bars: &Bars) -> Ending {
    let session = Printable(&piece.session).to_string();
    let progress = bars.of(&session);
    let attempt = AssertUnwindSafe(|| run_piece(plan, piece, &progress));
    let reason = match panic::catch_unwind(attempt) {
        Ok(Ok(done)) => return Ending::Done(done),
        Ok(Err(error)) => error.to_string(),
        Err(_) => "a defect of posegrid, told above; please report it".to_owned(),
    };
    tracing::error!(session, "{reason}");
    Ending::Failed(reason)
}

/// What came out, session by session.
fn summary(plan: &Plan, endings: &[Ending]) -> String {
    let mut text = String::new();
    for (piece, ending) in plan.pieces.iter().zip(endings) {
        text += &paragraph(&piece.session, ending);
    }
    let count = |of: fn(&Ending) -> bool| endings.iter().filter(|ending| of(ending)).count();
    let failed = count(|ending| matches!(ending, Ending::Failed(_)));
    let met =
        count(|ending| matches!(ending, Ending::Done(done) if done.verdict == Verdict::Meets));
    writeln!(
        text,
        "{} of {} within {} mm, {failed} without a result",
        met,
        endings.len(),
        plan.stages.tolerance.mm
    )
    .expect("a string");
    text
}

fn paragraph(session: &str, ending: &Ending) -> String {
    let session = Printable(session);
    match ending {
        Ending::Failed(reason) => format!("{session}: no result: {}\n\n", Printable(reason)),
        Ending::Done(done) => {
            let known = if done.already_there {
                ", done before"
            } else {
                ""
            };
            let mut text = format!(
                "{session}: {} (run {}{known})\n",
                verdict(&done.verdict),
                done.run
            );
            for line in &done.rejected {
                writeln!(text, "  too much rejected: {}", Printable(line)).expect("a string");
            }
            for line in &done.words {
                writeln!(text, "  {}", Printable(line)).expect("a string");
            }
            if let Some(page) = &done.page {
                writeln!(text, "  page: {}", near(page).display()).expect("a string");
            }
            writeln!(text, "  tables: {}\n", near(&done.tables).display()).expect("a string");
            text
        }
    }
}

fn verdict(verdict: &Verdict) -> String {
    match verdict {
        Verdict::Meets => "within tolerance".to_owned(),
        Verdict::DoesNotMeet => "not within tolerance".to_owned(),
        Verdict::NotShown(reason) => format!("not shown to be within tolerance: {reason}"),
    }
}

/// A place as seen from the working folder, where it lies in it.
pub fn near(place: &Place) -> Place {
    let here = std::env::current_dir().and_then(|here| here.canonicalize());
    let path = place.as_path();
    let inside = path.and_then(|path| path.strip_prefix(here.ok()?).ok());
    inside.map_or_else(|| place.clone(), Place::of)
}

fn exit_code(endings: &[Ending]) -> u8 {
    let code = |ending: &Ending| match ending {
        Ending::Failed(_) => NO_RESULT,
        Ending::Done(done) if done.is_good() => DONE,
        Ending::Done(_) => NOT_MET,
    };
    let codes: Vec<u8> = endings.iter().map(code).collect();
    // A session without a result outranks one that misses its tolerance.
    let worst = [NO_RESULT, NOT_MET];
    worst
        .into_iter()
        .find(|code| codes.contains(code))
        .unwrap_or(DONE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn done(verdict: Verdict) -> Ending {
        Ending::Done(Done {
            session: "a".to_owned(),
            run: "00ff".to_owned(),
            already_there: true,
            verdict,
            rejected: Vec::new(),
            words: vec!["step 100 mm".to_owned(), "bad\u{1b}name".to_owned()],
            tables: Place::of("lake"),
            page: Some(Place::of("lake/report/r/a/00ff.html")),
        })
    }

    fn failed() -> Ending {
        Ending::Failed("no log".to_owned())
    }

    #[test]
    fn no_result_outranks_a_missed_tolerance() {
        let not_shown = || done(Verdict::NotShown("few".to_owned()));
        assert_eq!(exit_code(&[done(Verdict::Meets)]), 0);
        assert_eq!(exit_code(&[done(Verdict::Meets), not_shown()]), 3);
        assert_eq!(exit_code(&[done(Verdict::DoesNotMeet)]), 3);
        assert_eq!(exit_code(&[not_shown(), failed()]), 1);
        let Ending::Done(mut rejected) = done(Verdict::Meets) else {
            unreachable!("made here")
        };
        rejected.rejected.push("6 of 100 readings".to_owned());
        assert_eq!(exit_code(&[Ending::Done(rejected)]), 3);
    }

    #[test]
    fn a_paragraph_tells_the_verdict_the_words_and_where_the_tables_are() {
        let text = paragraph("a", &done(Verdict::DoesNotMeet));
        assert_eq!(
            text,
            "a: not within tolerance (run 00ff, done before)\n  step 100 mm\n  bad\\u{1b}name\n  page: lake/report/r/a/00ff.html\n  tables: lake\n\n"
        );
    }
}
