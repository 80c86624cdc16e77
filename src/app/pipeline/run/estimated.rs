//! The estimate of a piece of work as work of its own: what is trained is taken from the lake, or trained and published for later runs.
//!
//! Its name follows from the sessions as joined that train, the robot file, the settings that training reads
//! ([`estimate_settings`](crate::pipeline::keys::estimate_settings)) and the version. Runs that differ in steps, tolerance, figures or in
//! the sessions that only judge start from the same estimate.

use super::joined::{Joiner, Sessions};
use super::{EstimateDone, RunError};
use crate::io::lake::ESTIMATES;
use crate::io::tables::PublishError;
use crate::io::tables::estimates;
use crate::judgement::{self, Estimate, StageError};
use crate::manifest::{ROBOT, RunKey, Work};

/// Where estimates are made.
pub(super) struct Estimator<'a> {
    /// Where the sessions of the piece are joined.
    pub(super) joiner: &'a Joiner<'a>,
}

impl Estimator<'_> {
    /// The estimate of these sessions, and its name in the lake.
    pub(super) fn estimate(&self, sessions: Sessions) -> Result<(Estimate, RunKey), RunError> {
        let own = self.work_of(&sessions);
        let key = own.key();
        if let Some(estimate) = self.stored(&sessions, &key)? {
            return Ok((estimate, key));
        }
        let Joiner { configuration, progress, .. } = self.joiner;
        let both = (sessions.training, sessions.test);
        let (arm, settings) = (&configuration.arm, &configuration.stages);
        let estimate = judgement::estimate(arm, both, None, settings, *progress)?;
        self.publish(&own, &estimate)?;
        Ok((estimate, key))
    }

    /// The estimate for later runs, in words.
    pub(super) fn made(&self, sessions: Sessions) -> Result<EstimateDone, RunError> {
        let already_there = self.joiner.lake.has(ESTIMATES, &self.work_of(&sessions).key())?;
        let (estimate, key) = self.estimate(sessions)?;
        Ok(EstimateDone {
            session: key.session,
            run: key.run,
            already_there,
            observations: estimate.observations(),
            misfit_mm: estimate.misfit_mm(),
        })
    }

    /// The estimate as work of its own.
    fn work_of(&self, sessions: &Sessions) -> Work {
        let Joiner { configuration, work, .. } = self.joiner;
        let robot = work.inputs.iter().find(|input| input.name == ROBOT);
        let digest = robot.map_or("", |robot| robot.digest.as_str());
        let training = &sessions.made_of[..sessions.training.len()];
        let training = training.iter().map(|own| (&own.session, &own.run));
        estimates::work(
            &work.robot,
            &work.session,
            estimates::inputs(digest, training),
            configuration.estimate_settings.clone(),
        )
    }

    /// An estimate that the lake has; `None` where it has to be trained.
    fn stored(&self, sessions: &Sessions, key: &RunKey) -> Result<Option<Estimate>, RunError> {
        let configuration = self.joiner.configuration;
        let is_all_there_is = configuration.from_estimates;
        if !self.joiner.lake.has(ESTIMATES, key)? {
            let (session, what) = (key.session.clone(), "estimate");
            let none = RunError::NoResult { session, what, from: "table", until: "estimate" };
            return if is_all_there_is { Err(none) } else { Ok(None) };
        }
        match self.restored(sessions, key) {
            Ok(estimate) => Ok(Some(estimate)),
            Err(RunError::Unread { .. } | RunError::Stage(StageError::Stored(_)))
                if !is_all_there_is =>
            {
                tracing::warn!(
                    "session {}: the estimate {} cannot be used; it is trained again",
                    key.session,
                    key.run
                );
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    fn restored(&self, sessions: &Sessions, key: &RunKey) -> Result<Estimate, RunError> {
        let unread = |source| RunError::Unread {
            session: key.session.clone(),
            what: format!("the estimate {}", key.run),
            source: Box::new(source),
            advice: "; run it without --from table",
        };
        let Joiner { configuration, lake, progress, .. } = self.joiner;
        let settings = &configuration.stages;
        let targets = &settings.fit.target_names;
        let stored = estimates::restored(lake, key, targets).map_err(unread)?;
        let both = (sessions.training.clone(), sessions.test.clone());
        let arm = &configuration.arm;
        Ok(judgement::estimate(arm, both, Some(stored), settings, *progress)?)
    }

    /// Publishes what was trained, and the errors that it leaves, unless the lake has it.
    fn publish(&self, work: &Work, estimate: &Estimate) -> Result<(), PublishError> {
        let key = work.key();
        let Some(mut open) = self.joiner.lake.start_in(ESTIMATES, &key)? else {
            return Ok(());
        };
        let targets = &self.joiner.configuration.stages.fit.target_names;
        open.publish(&estimates::residuals(estimate.residuals(), targets, &key)?)?;
        let row = estimates::table(&estimate.stored(), work, open.written())?;
        open.commit(&row)?;
        Ok(())
    }
}
