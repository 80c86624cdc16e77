//! Pieces of work on threads: a pool goes on without a session that cannot be used.

use std::num::NonZeroUsize;
use std::panic::{self, AssertUnwindSafe};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use super::Until;
use super::stop::{Stop, Stoppable};
use crate::cli::messages::Printable;
use crate::cli::progress::Bars;
use crate::pipeline::configuration::{POOLED, SetAside, Why, WorkPiece};
use crate::pipeline::fleet::FleetPiece;
use crate::pipeline::run::{Done, Known, RunError, StageDone, run_piece, stage_piece};
use crate::progress::Progress;

#[derive(Debug)]
pub enum Ending {
    Done(Box<Done>),
    /// With the result of a stage, which was all that was asked for.
    OfStage(StageDone),
    Failed(Failure),
    Stopped,
    NotStarted,
}

#[derive(Debug)]
pub struct Failure {
    pub reason: String,
    /// The session that caused it; `None` where no single one did.
    pub session: Option<String>,
}

/// What all pieces of a batch have in common.
pub struct Batch<'a> {
    /// The last stage; `None` for the whole way to verdict, tables and page.
    pub until: Option<Until>,
    pub known: &'a Known,
    pub bars: &'a Bars,
    pub stop: &'a Stop,
}

/// A piece's ending, and the sessions that it left out.
type Ended = (Ending, Vec<SetAside>);

impl Batch<'_> {
    /// Does all pieces, `jobs` at once, until an end is asked for: endings in the order of the pieces, and the sessions that
    /// pools left out.
    pub fn all(
        &self,
        pieces: &[FleetPiece<'_>],
        jobs: NonZeroUsize,
    ) -> (Vec<Ending>, Vec<SetAside>) {
        if self.until.is_none() {
            self.known.gather(pieces.iter().filter_map(|own| self.known.state(*own)));
        }
        let next = AtomicUsize::new(0);
        let work = || {
            let mut own = Vec::new();
            loop {
                let place = next.fetch_add(1, Ordering::Relaxed);
                let Some(piece) = pieces.get(place) else { return own };
                own.push((place, self.pooled(place, *piece)));
            }
        };
        let mut ended: Vec<(usize, Ended)> = thread::scope(|scope| {
            let workers = jobs.get().min(pieces.len());
            let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
            let joined = |worker: thread::ScopedJoinHandle<'_, _>| worker.join();
            let joined = workers.into_iter().map(joined);
            joined.flat_map(|own| own.expect("a piece's panic is caught")).collect()
        });
        ended.sort_by_key(|(place, _)| *place);
        let (endings, without): (Vec<_>, Vec<_>) =
            ended.into_iter().map(|(_, ended)| ended).unzip();
        (endings, without.concat())
    }

    /// Does one piece, again without each session that turns out to be bad, as long as others are left to learn from.
    fn pooled(&self, place: usize, whole: FleetPiece<'_>) -> Ended {
        let mut piece = whole.piece.clone();
        let mut without: Vec<SetAside> = Vec::new();
        loop {
            let left = FleetPiece { piece: &piece, ..whole };
            match self.one(left) {
                Ending::Failed(Failure { reason, session: Some(bad) })
                    if can_spare(&piece, &bad) =>
                {
                    tracing::warn!(session = whole.label(), "going on without {}", Printable(&bad));
                    piece.training.retain(|files| files.name != bad);
                    let why = Why::Bad(format!("{reason}; the pool learns without it"));
                    without.push(SetAside { session: whole.label_of(&bad), why, before: place });
                }
                ending => {
                    // A piece of a single session learns from the sessions before it, each of which has a piece and a line of
                    without.retain(|_| piece.session == POOLED);
                    return (ending, without);
                }
            }
        }
    }

    /// Does one piece, unless an end was asked for.
    fn one(&self, own: FleetPiece<'_>) -> Ending {
        let stop = self.stop;
        if stop.asked() {
            return Ending::NotStarted;
        }
        let session = Printable(&own.label()).to_string();
        let progress = &self.bars.of(&session);
        let progress = Stoppable { progress, stop };
        let attempt = AssertUnwindSafe(|| self.attempt(own, &progress));
        let failure = match panic::catch_unwind(attempt) {
            Ok(Ok(ending)) => return ending,
            Ok(Err(error)) => {
                Failure { reason: error.to_string(), session: error.session().map(str::to_owned) }
            }
            // Whichever thread of the piece unwound first, the reason is that an end was asked for.
            Err(_) if stop.asked() => {
                tracing::warn!(session, "ended by {}", stop.name());
                return Ending::Stopped;
            }
            Err(_) => Failure {
                reason: "a defect of posegrid, logged above; please report it".to_owned(),
                session: None,
            },
        };
        if !self.bars.show_results() {
            tracing::error!(session, "{}", failure.reason);
        }
        Ending::Failed(failure)
    }

    fn attempt(&self, own: FleetPiece<'_>, progress: &dyn Progress) -> Result<Ending, RunError> {
        if let Some(until) = self.until {
            return stage_piece(own, until.stage(), progress).map(Ending::OfStage);
        }
        let state = self.known.state(own);
        if let Some(done) = state.as_deref().and_then(|state| self.known.told(state)) {
            return Ok(Ending::Done(Box::new(done)));
        }
        let done = run_piece(own, progress)?;
        self.known.keep(state.as_deref(), own, &done);
        Ok(Ending::Done(Box::new(done)))
    }
}

/// Whether a piece still has a session to learn from without this one.
fn can_spare(piece: &WorkPiece, session: &str) -> bool {
    let learnt = piece.training.iter().any(|files| files.name == session);
    learnt && piece.training.len() > 1 && piece.session != session
}
