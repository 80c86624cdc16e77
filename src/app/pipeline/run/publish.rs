//! The results of a piece of work → its tables, its page and its row of `runs`, which makes the run exist.

use super::page::content;
use crate::io::lake::{Commit, OpenRun};
use crate::io::tables::runs::{self, Ending};
use crate::io::tables::{PublishContext, PublishError, RunRows, SessionRows, ending};
use crate::judgement::Outcome;
use crate::manifest::Work;
use crate::page::{self, Statements};
use crate::pipeline::history::session::Kept;

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
    let content = content(outcome, rows, sessions, context, work, run.written(), said);
    run.publish_page(&page::html(&content))?;
    let warnings = Some(said.all_warnings());
    let ending = Ending { warnings, ..ending(outcome, context) };
    let row = runs::table(work, &content.counts, run.written(), &ending)?;
    if let Some(kept) = kept {
        kept.write(run.lake, &key)?;
    }
    Ok(run.commit(&row)?)
}

#[cfg(test)]
mod tests;
