//! Pieces of work on threads: whatever goes wrong with one stays with it, and a pool goes on without a session that cannot be
//! used.

use std::num::NonZeroUsize;
use std::panic::{self, AssertUnwindSafe};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use super::stop::{Stop, Stoppable};
use crate::cli::messages::Printable;
use crate::cli::progress::Bars;
use crate::pipeline::configuration::{Configuration, POOLED, SetAside, Why, WorkPiece};
use crate::pipeline::run::{Done, run_piece};

/// The ending of one piece of work.
#[derive(Debug)]
pub enum Ending {
    /// With a result.
    Done(Box<Done>),
    /// Without one.
    Failed(Failure),
    /// A signal ended it under way.
    Stopped,
    /// A signal came before it was begun.
    NotStarted,
}

/// Why a piece of work has no result.
#[derive(Debug)]
pub struct Failure {
    /// The reason as text.
    pub reason: String,
    /// The session that caused it; `None` where no single one did.
    pub session: Option<String>,
}

/// A piece's ending, and the sessions that it left out.
type Ended = (Ending, Vec<SetAside>);

/// Does all pieces, `jobs` at once, until an end is asked for: endings in the order of the pieces, and the sessions that
/// pools left out.
pub fn all(
    configuration: &Configuration,
    jobs: NonZeroUsize,
    bars: &Bars,
    stop: &Stop,
) -> (Vec<Ending>, Vec<SetAside>) {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut own = Vec::new();
        loop {
            let place = next.fetch_add(1, Ordering::Relaxed);
            let Some(piece) = configuration.pieces.get(place) else {
                return own;
            };
            own.push((place, pooled(configuration, place, piece, bars, stop)));
        }
    };
    let mut ended: Vec<(usize, Ended)> = thread::scope(|scope| {
        let workers = jobs.get().min(configuration.pieces.len());
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        let joined = |worker: thread::ScopedJoinHandle<'_, _>| worker.join();
        let joined = workers.into_iter().map(joined);
        joined
            .flat_map(|own| own.expect("a piece's panic is caught"))
            .collect()
    });
    ended.sort_by_key(|(place, _)| *place);
    let (endings, without): (Vec<_>, Vec<_>) = ended.into_iter().map(|(_, ended)| ended).unzip();
    (endings, without.concat())
}

/// Does one piece, again without each session that turns out to be bad, as long as others are left to learn from.
fn pooled(
    configuration: &Configuration,
    place: usize,
    piece: &WorkPiece,
    bars: &Bars,
    stop: &Stop,
) -> Ended {
    let mut piece = piece.clone();
    let mut without: Vec<SetAside> = Vec::new();
    loop {
        match one(configuration, &piece, bars, stop) {
            Ending::Failed(Failure {
                reason,
                session: Some(bad),
            }) if can_spare(&piece, &bad) => {
                tracing::warn!(
                    session = piece.session,
                    "going on without {}",
                    Printable(&bad)
                );
                piece.training.retain(|files| files.name != bad);
                let why = Why::Bad(format!("{reason}; the pool learns without it"));
                without.push(SetAside {
                    session: bad,
                    why,
                    before: place,
                });
            }
            ending => {
                // A piece of a single session learns from the sessions before it, each of which has a piece and a line of
                without.retain(|_| piece.session == POOLED);
                return (ending, without);
            }
        }
    }
}

/// Whether a piece still has a session to learn from without this one.
fn can_spare(piece: &WorkPiece, session: &str) -> bool {
    let learnt = piece.training.iter().any(|files| files.name == session);
    learnt && piece.training.len() > 1 && piece.session != session
}

/// Does one piece, unless an end was asked for.
fn one(configuration: &Configuration, piece: &WorkPiece, bars: &Bars, stop: &Stop) -> Ending {
    if stop.asked() {
        return Ending::NotStarted;
    }
    let session = Printable(&piece.session).to_string();
    let progress = &bars.of(&session);
    let progress = Stoppable { progress, stop };
    let attempt = AssertUnwindSafe(|| run_piece(configuration, piece, &progress));
    let failure = match panic::catch_unwind(attempt) {
        Ok(Ok(done)) => return Ending::Done(Box::new(done)),
        Ok(Err(error)) => Failure {
            reason: error.to_string(),
            session: error.session().map(str::to_owned),
        },
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
    tracing::error!(session, "{}", failure.reason);
    Ending::Failed(failure)
}
