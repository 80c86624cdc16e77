//! Pieces of work on threads: whatever goes wrong with one stays with it.

use std::num::NonZeroUsize;
use std::panic::{self, AssertUnwindSafe};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use super::stop::{Stop, Stoppable};
use crate::cli::messages::Printable;
use crate::cli::progress::Bars;
use crate::pipeline::plan::{Plan, WorkPiece};
use crate::pipeline::run::{Done, run_piece};

/// How one piece of work ended.
#[derive(Debug)]
pub enum Ending {
    /// With a result.
    Done(Done),
    /// Without one: why.
    Failed(String),
    /// A signal ended it under way.
    Stopped,
    /// A signal came before it was begun.
    NotStarted,
}

/// Does all pieces, `jobs` at once, until an end is asked for; endings in the order of the pieces.
pub fn all(plan: &Plan, jobs: NonZeroUsize, bars: &Bars, stop: &Stop) -> Vec<Ending> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut own = Vec::new();
        loop {
            let place = next.fetch_add(1, Ordering::Relaxed);
            let Some(piece) = plan.pieces.get(place) else {
                return own;
            };
            own.push((place, one(plan, piece, bars, stop)));
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

/// Does one piece, unless an end was asked for.
fn one(plan: &Plan, piece: &WorkPiece, bars: &Bars, stop: &Stop) -> Ending {
    if stop.asked() {
        return Ending::NotStarted;
    }
    let session = Printable(&piece.session).to_string();
    let progress = &bars.of(&session);
    let progress = Stoppable { progress, stop };
    let attempt = AssertUnwindSafe(|| run_piece(plan, piece, &progress));
    let reason = match panic::catch_unwind(attempt) {
        Ok(Ok(done)) => return Ending::Done(done),
        Ok(Err(error)) => error.to_string(),
        // However a thread of the piece passed it on, it was unwound because an end was asked for.
        Err(_) if stop.asked() => {
            tracing::warn!(session, "ended by {}", stop.name());
            return Ending::Stopped;
        }
        Err(_) => "a defect of posegrid, told above; please report it".to_owned(),
    };
    tracing::error!(session, "{reason}");
    Ending::Failed(reason)
}
