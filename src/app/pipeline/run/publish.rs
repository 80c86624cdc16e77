//! The results of a piece of work → its tables, its page and its row of `runs`, which makes the run exist.

use crate::grid::Table;
use crate::io::lake::{Commit, OpenRun};
use crate::io::tables::counts::counts;
use crate::io::tables::runs::{self, Ending};
use crate::io::tables::{PublishContext, PublishError, RunRows, SessionRows, ending};
use crate::judgement::Outcome;
use crate::manifest::Work;
use crate::page::{self, About, Statements};
use crate::pipeline::history::session::Kept;
use crate::pipeline::summary::stated;

/// Writes every table of a run, its page, what the history keeps of it, and then its row of `runs`. Its table `logs`, if any, was written and kept
/// before.
pub fn publish(
    outcome: &Outcome<'_>,
    rows: RunRows,
    context: &PublishContext<'_>,
    mut run: OpenRun<'_>,
    work: &Work,
    said: &Statements,
) -> Result<Commit, PublishError> {
    let key = run.key.clone();
    run.publish_kept()?;
    let sessions = outcome.training.iter().chain(&outcome.test);
    let sessions: Vec<SessionRows> = sessions
        .map(|session| SessionRows::of(session, context.arm, &key.of_session(&session.name)))
        .collect::<Result<_, _>>()?;
    let of_sessions = sessions.iter().flat_map(SessionRows::tables);
    for table in of_sessions.chain(rows.tables()) {
        run.publish(table)?;
    }
    let of_sessions = sessions.iter().flat_map(SessionRows::tables);
    let kept = Kept::of_run(work, of_sessions.chain(rows.tables()), run.written());
    let counts = counts(outcome);
    let about = About {
        stated: stated(outcome, context.arm),
        work,
        tolerance: context.tolerance,
        choice: &outcome.grids.choice.words,
        verdict: &outcome.verdict,
        frame: &outcome.frame,
        bounds: outcome.grids.table.as_ref().map(corners),
        counts: &counts,
        written: run.written(),
        said,
    };
    let html = page::html(&page::content(rows, sessions, &about));
    run.publish_page(&html)?;
    let warnings = Some(said.all_warnings());
    let ending = Ending { warnings, ..ending(outcome, context) };
    let row = runs::table(work, &counts, run.written(), &ending)?;
    if let Some(kept) = kept {
        kept.write(run.lake, &key)?;
    }
    Ok(run.commit(&row)?)
}

/// Least and largest coordinates of a table's nodes, base frame, mm.
fn corners(table: &Table) -> [[f64; 3]; 2] {
    let lattice = &table.lattice;
    let last = lattice.node_count().saturating_sub(1);
    [0, last].map(|node| lattice.position(node).into())
}

#[cfg(test)]
mod tests;
