//! Grids of an estimate as work of their own: what steps answer at held-out stations is taken from the lake, or found and published for
//! later runs.
//!
//! Their name follows from the estimate, the settings that training and grids read
//! ([`grids_settings`](crate::pipeline::keys::grids_settings)) and the version. Runs that differ in tolerance, in the rule that chooses, in
//! figures or in the sessions that only judge start from the same grids.

use super::RunError;
use crate::grid::StepAnswers;
use crate::io::lake::{GRIDS, Lake};
use crate::io::tables::PublishError;
use crate::io::tables::grids;
use crate::io::tables::stage_results::NotRestored;
use crate::judgement::Outcome;
use crate::judgement::{self, Estimate};
use crate::manifest::{RunKey, Work};
use crate::pipeline::configuration::Configuration;
use crate::progress::Progress;

/// Where grids are made.
pub(super) struct Gridder<'a> {
    pub(super) configuration: &'a Configuration,
    pub(super) lake: &'a Lake,
    /// Grids as work of their own.
    pub(super) work: Work,
}

impl<'a> Gridder<'a> {
    /// Where the grids of an estimate are made.
    pub(super) fn of(configuration: &'a Configuration, lake: &'a Lake, estimate: &RunKey) -> Self {
        let settings = configuration.grids_settings.clone();
        let RunKey { robot, session, run } = estimate;
        Self { configuration, lake, work: grids::work(robot, session, run, settings) }
    }

    /// Whether the lake has them.
    pub(super) fn is_there(&self) -> Result<bool, RunError> {
        Ok(self.lake.has(GRIDS, &self.work.key())?)
    }

    /// All results that follow from an estimate, its grids from the lake where it has them; it has them afterwards.
    pub(super) fn outcome(
        &self,
        estimate: Estimate,
        progress: &dyn Progress,
    ) -> Result<Outcome<'a>, RunError> {
        let known = self.before()?;
        let outcome = judgement::results(&self.configuration.arm, estimate, known, progress)?;
        self.publish(&outcome.grids.answers)?;
        Ok(outcome)
    }

    /// The steps that the lake has; `None` where they have to be found.
    fn before(&self) -> Result<Option<Vec<StepAnswers>>, RunError> {
        let is_all_there_is = self.configuration.from_grids;
        let key = self.work.key();
        if !self.is_there()? {
            let (session, what) = (key.session, "grids");
            let none = RunError::NoResult { session, what, from: "report", until: "table" };
            return if is_all_there_is { Err(none) } else { Ok(None) };
        }
        match grids::restored(self.lake, &key) {
            Ok(steps) => Ok(Some(steps)),
            Err(source) if is_all_there_is => Err(unread(key, source)),
            Err(source) => {
                tracing::warn!("{}; they are made again", unread(key, source));
                Ok(None)
            }
        }
    }

    /// Publishes the steps and what they answer, unless the lake has them.
    fn publish(&self, steps: &[StepAnswers]) -> Result<(), PublishError> {
        let key = self.work.key();
        let Some(mut open) = self.lake.start_in(GRIDS, &key)? else {
            return Ok(());
        };
        open.publish(&grids::errors(steps, &key)?)?;
        let row = grids::table(steps, &self.work, open.written())?;
        open.commit(&row)?;
        Ok(())
    }
}

fn unread(key: RunKey, source: NotRestored) -> RunError {
    RunError::Unread {
        session: key.session,
        what: format!("the grids {}", key.run),
        source: Box::new(source),
        advice: "; run it without --from report",
    }
}
