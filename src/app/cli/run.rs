//! `posegrid run`: every session found or named, through all stages, into the lake. The lake is locked (`alone`);
//! pieces of work run on `--jobs` threads (`work`), and whatever goes wrong with one stays with it; a line for each
//! session, ten for each new result, and the totals are the summary (`summary`).
//!
//! Where the summary cannot be written, the work is still done and the exit code is 1. A first SIGINT or SIGTERM ends
//! the pieces under way and starts no other (`stop`); a second one ends the process.

mod alone;
mod json;
mod stop;
mod summary;
mod work;

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::thread;

use clap::{Args, ValueEnum};
use rayon::ThreadPoolBuilder;

use super::messages::{self, Printable};
use super::progress::Bars;
use super::streams::Undelivered;
use super::{BAD_USAGE, DONE, NO_RESULT, history};
use crate::files::store::Place;
use crate::io::lake::{ESTIMATES, GRIDS, JOINED, Lake, LakeError, Stage};
use crate::pipeline::configuration::Overrides;
use crate::pipeline::fleet::Fleet;
use crate::pipeline::run::Known;
use alone::Turn;
use stop::Stop;

pub use summary::work;

/// The most sessions that are worked on at once where the command says nothing: each needs memory of its own.
const MOST_JOBS: NonZeroUsize = NonZeroUsize::new(4).unwrap();

/// Make every table and page of every session: the whole way from two logs to a compensation table.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
  posegrid run pipelines/quickstart.toml
  posegrid run pipelines/ur10-random.toml ur10-random-a --test ur10-random-b
  posegrid run pipelines/ur10-random.toml --until session
  posegrid run pipelines/ur10-random.toml --from estimate
  posegrid run fleet.toml --robot kr210-07 --jobs 4
  posegrid run pipelines/quickstart.toml --format json | jq '.sessions[] | {session, verdict, bound_mm}'

A pipeline file of several robots ([[robots]], or the table that [input] robots names) is worked off robot by robot, each with
its own robot file, settings and sessions; what is wrong with one stays with it. Its sessions are named ROBOT/SESSION here.

What ingest and join give of a session is published by itself, and taken from the lake by every later run with the same
files and the same settings of ingest and join, whatever comes after: a larger pool reads no log again. What the fit
trains is published likewise: another tolerance, other steps or another session that judges train nothing. So is what the nodes of
every step answer at held-out stations: another tolerance places none of them again.
--until session, estimate and table stop behind these; --from estimate, table and report start there, and need no log.

A session whose files have the sizes, and the tags or times, that they had when its run was told last is not even opened: the lake's
index says so (LAKE/.index, which may be removed). --fresh digests it all the same.

Work that the lake has already is not done again: a run's name follows from its inputs, settings and version, and the same
work gives the same bytes. Of a session's runs the one that was asked for last is current. No option repeats work: published files are never rewritten. `posegrid verify` recomputes it and
compares; --lake with another folder makes a second copy.
A session whose log has no end and changed lately ([input] settle_s), or that lacks one side, waits for a later run
and changes no exit code. One batch works on a lake at a time: another one says which and exits with 1, or waits
with --wait.
A first SIGINT or SIGTERM (Ctrl-C) ends what is under way and exits with 130 or 143, a second one ends at once.
However a run ends, it leaves nothing half done: run it again.")]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of the command")]
pub struct RunArgs {
    /// The pipeline file
    pub pipeline: PathBuf,
    /// Sessions to learn from, instead of those that the pipeline file names or finds
    #[arg(value_name = "SESSION")]
    pub sessions: Vec<String>,
    /// Work on this robot of the pipeline file alone; may be given several times
    #[arg(long, value_name = "NAME")]
    pub robot: Vec<String>,
    /// A session that is only judged, instead of those that the pipeline file names; may be given several times
    #[arg(long, value_name = "SESSION")]
    pub test: Vec<String>,
    /// The folder of the published tables, instead of the pipeline file's
    #[arg(long, value_name = "DIR")]
    pub lake: Option<PathBuf>,
    /// Sessions worked on at once; as many as the machine has cores, but four at most, where it is not given. Each uses every core
    /// that others leave idle, and memory of its own; 1 keeps all work on one core
    #[arg(long, value_name = "N")]
    pub jobs: Option<NonZeroUsize>,
    /// Stop after this stage: what it gives is published for later runs
    #[arg(long, value_name = "STAGE")]
    pub until: Option<Until>,
    /// Start with this stage, from what the lake has of the stages before it: no log or table of stations is read
    #[arg(long, value_name = "STAGE")]
    pub from: Option<Since>,
    /// Wait while another batch has the lake, instead of giving up
    #[arg(long)]
    pub wait: bool,
    /// Digest every session again, whatever the index of finished work says of its files' sizes and times
    #[arg(long)]
    pub fresh: bool,
    /// List the work, and do none
    #[arg(long)]
    pub dry_run: bool,
    /// Format of the summary
    #[arg(long, value_enum, default_value_t = Format::Text, conflicts_with = "dry_run")]
    pub format: Format,
    /// Print every figure of each session below its summary of ten lines
    #[arg(long)]
    pub verbose: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// For people
    Text,
    /// For programs: one document, with verdict, bound, means, run and page of every session
    Json,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Until {
    /// Ingest and join: dwells and readings of each session
    Session,
    /// The fit: models on all stations, and without each fold
    Estimate,
    /// Grids: nodes of every step, and what they answer at held-out stations
    Table,
}

impl Until {
    const fn stage(self) -> Stage {
        match self {
            Self::Session => JOINED,
            Self::Estimate => ESTIMATES,
            Self::Table => GRIDS,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Since {
    /// The fit and all that follows, from sessions as joined
    Estimate,
    /// Grids, table, figures and page, from estimates
    Table,
    /// Table, figures and page, from grids
    Report,
}

pub fn run(args: &RunArgs, bars: &Bars) -> u8 {
    if jobs(args) == NonZeroUsize::MIN {
        // No parallel work precedes this one, so the pool of threads is not there yet.
        let _ = ThreadPoolBuilder::new().num_threads(1).build_global();
    }
    let overrides = Overrides {
        robot: None,
        sessions: args.sessions.clone(),
        test: args.test.clone(),
        lake: args.lake.clone(),
        from_joined: args.from.is_some(),
        from_estimates: matches!(args.from, Some(Since::Table | Since::Report)),
        from_grids: args.from == Some(Since::Report),
    };
    let fleet = match Fleet::load(&args.pipeline, &args.robot, &overrides) {
        Ok(fleet) => fleet,
        Err(error) => {
            tracing::error!("{}", Printable(&error.to_string()));
            return if error.is_worth_a_retry() { NO_RESULT } else { BAD_USAGE };
        }
    };
    let fleet = match args.until {
        Some(Until::Session) => fleet.each_session(),
        Some(Until::Estimate | Until::Table) | None => fleet,
    };
    tell(&fleet);
    if args.dry_run {
        return messages::last_result(work(&fleet), DONE, bars);
    }
    batch(&fleet, args, bars).unwrap_or_else(|error| {
        tracing::error!("{}", Printable(&error.to_string()));
        NO_RESULT
    })
}

fn tell(fleet: &Fleet) {
    for left in &fleet.left_out {
        tracing::warn!("{} is no session: {}", Printable(&left.name), left.reason);
    }
    for remark in &fleet.remarks {
        tracing::info!("{}", Printable(remark));
    }
}

fn batch(fleet: &Fleet, args: &RunArgs, bars: &Bars) -> Result<u8, LakeError> {
    let stop = match Stop::on_signals() {
        Ok(stop) => stop,
        Err(error) => {
            tracing::error!("cannot listen for signals: {error}");
            return Ok(NO_RESULT);
        }
    };
    let lake = Lake::at(&fleet.lake)?;
    let by = format!("run {}", near(&Place::of(&args.pipeline)));
    let _lock = match alone::turn(&lake, &by, args.wait, &stop) {
        Turn::Ours(lock) => lock,
        Turn::NotOurs => return Ok(stop.exit_code().unwrap_or(NO_RESULT)),
    };
    clean(&lake);
    let known = if args.fresh { Known::nothing(lake) } else { Known::read(lake)? };
    let pieces = fleet.pieces();
    let batch = work::Batch { until: args.until, known: &known, bars, stop: &stop };
    let (endings, without) = batch.all(&pieces, jobs(args));
    if let Err(error) = known.write() {
        tracing::warn!(
            "the index of finished work cannot be kept, the next batch digests every session: {}",
            Printable(&error.to_string())
        );
    }
    if stop.exit_code().is_none() && has_stale_pages(&known.lake, &endings) {
        history::refresh_pages(&known.lake, bars);
    }
    let mut set_aside = [fleet.set_aside.clone(), without].concat();
    set_aside.sort_by_key(|aside| aside.before);
    let code = summary::exit_code(&endings, &set_aside, &stop);
    let summary = match args.format {
        Format::Text => summary::summary(fleet, &endings, &set_aside, args.until, args.verbose),
        Format::Json => json::document(fleet, &endings, &set_aside, code)?,
    };
    let written = messages::result(summary, bars);
    Ok(after_summary(code, written, &stop))
}

/// Whether the pages of all nights lack what a batch did; on object storage no browser follows their links.
fn has_stale_pages(lake: &Lake, endings: &[work::Ending]) -> bool {
    let has_result = || endings.iter().any(|own| matches!(own, work::Ending::Done(_)));
    let is_current = |own: &work::Ending| match own {
        work::Ending::Done(done) => !done.already_there || done.took_place.is_some(),
        _ => false,
    };
    let is_new = || endings.iter().any(is_current);
    lake.folder().is_some() && (is_new() || has_result() && !lake.has_pages())
}

fn jobs(args: &RunArgs) -> NonZeroUsize {
    let cores = || thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    args.jobs.unwrap_or_else(|| cores().min(MOST_JOBS))
}

/// The exit code of a batch whose work gives `code`; the work is done whether or not its summary was written.
fn after_summary(code: u8, written: Result<(), Undelivered>, stop: &Stop) -> u8 {
    let by_signal = stop.exit_code() == Some(code);
    match written {
        Err(Undelivered::Refused) => {
            tracing::error!(
                "the summary could not be written, the published files are complete; run again to see it"
            );
            if by_signal { code } else { NO_RESULT }
        }
        Ok(()) | Err(Undelivered::ReaderGone) => code,
    }
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

/// A place relative to the working folder, where it is inside it.
pub fn near(place: &Place) -> Place {
    let here = std::env::current_dir().and_then(|here| here.canonicalize());
    let path = place.as_path();
    let inside = path.and_then(|path| path.strip_prefix(here.ok()?).ok());
    inside.map_or_else(|| place.clone(), Place::of)
}
