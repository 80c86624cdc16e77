//! What the sessions before one said, for the one to be learnt on top of (`[input] pool = "growing"`).
//!
//! It follows from those sessions in their order, the robot file, the settings of training and the version, as the estimate of the last of
//! them does, and is named after that. The lake keeps it of the last two sessions; where it has none, it is made again from the last
//! session that it has, or from the first: whether it was there changes no result, only the time that the next one takes.

use super::RunError;
use super::estimated::Estimator;
use super::joined::{Joiner, Sessions};
use crate::io::tables::outcome::JoinedSession;
use crate::manifest::RunKey;
use crate::pipeline::configuration::SessionFiles;
use crate::pipeline::stages::{self, Estimate, Held, Learning, Learnt};

/// What the lake keeps is that of so many last sessions: a night that is done again needs what the one before it said.
const KEPT: usize = 2;

impl Estimator<'_> {
    /// The estimate of the session of a piece of work on top of those before it, and what it leaves for the next.
    pub(super) fn on_top(&self, sessions: Sessions) -> Result<Estimate, RunError> {
        let keys = self.chain(&sessions);
        let before = self.before(&sessions, &keys)?;
        let Sessions {
            earlier,
            training,
            test,
            ..
        } = sessions;
        let both = (training, test);
        let (estimate, learnt) = self.learnt(both, &earlier, before.as_ref())?;
        self.keep(&keys, &learnt)?;
        Ok(estimate)
    }

    /// What the sessions before the last said; `None` where there are none.
    fn before(&self, sessions: &Sessions, keys: &[RunKey]) -> Result<Option<Learnt>, RunError> {
        let earlier = &sessions.earlier;
        let kept = (1..=earlier.len()).rev().find_map(|count| {
            let learnt = self.kept(&keys[count - 1])?;
            Some((count, Some(learnt)))
        });
        let (done, mut before) = kept.unwrap_or((0, None));
        for place in done..earlier.len() {
            tracing::info!(
                "session {}: {} is learnt for it, session {} of {} before it",
                self.joiner.work.session,
                earlier[place].name,
                place + 1,
                earlier.len()
            );
            let both = (vec![self.joined(&earlier[place])?], Vec::new());
            let learnt = self.learnt(both, &earlier[..place], before.as_ref());
            let (_, learnt) = learnt.map_err(|error| error.of(&earlier[place]))?;
            self.keep(&keys[..=place], &learnt)?;
            before = Some(learnt);
        }
        Ok(before)
    }

    /// A session on top of what those before it said, and all of them again with the sizes of now where these have moved.
    fn learnt(
        &self,
        both: (Vec<JoinedSession>, Vec<JoinedSession>),
        earlier: &[SessionFiles],
        before: Option<&Learnt>,
    ) -> Result<(Estimate, Learnt), RunError> {
        let (estimate, learnt) = self.once(both.clone(), (before, None))?;
        let Some(held) = learnt.stale() else {
            return Ok((estimate, learnt));
        };
        tracing::info!(
            "session {}: sessions differ by much more than the first ones showed: {} sessions are learnt again",
            both.0.last().map_or("", |own| &own.name),
            earlier.len() + 1
        );
        let mut before = None;
        for files in earlier {
            let both = (vec![self.joined(files)?], Vec::new());
            let again = self.once(both, (before.as_ref(), Some(&held)));
            before = Some(again.map_err(|error| error.of(files))?.1);
        }
        self.once(both, (before.as_ref(), Some(&held)))
    }

    fn once(
        &self,
        both: (Vec<JoinedSession>, Vec<JoinedSession>),
        (before, held): (Option<&Learnt>, Option<&Held>),
    ) -> Result<(Estimate, Learnt), RunError> {
        let name = both
            .0
            .last()
            .map_or_else(String::new, |own| own.name.clone());
        let Joiner {
            configuration,
            progress,
            ..
        } = self.joiner;
        let (arm, settings) = (&configuration.arm, &configuration.stages);
        let learning = Learning::after(before, held);
        let from = (None, Some(&learning));
        let estimate = stages::estimate(arm, both, from, settings, *progress)?;
        let learnt = estimate.learnt().cloned();
        let learnt = learnt.ok_or(RunError::NotLearnt { session: name })?;
        Ok((estimate, learnt))
    }

    fn joined(&self, files: &SessionFiles) -> Result<JoinedSession, RunError> {
        let one = self.joiner.one(files, None);
        let (session, _) = one.map_err(|error| error.of(files))?;
        Ok(session)
    }

    /// The estimates of the first session, of the first two, and so on.
    fn chain(&self, sessions: &Sessions) -> Vec<RunKey> {
        let names = sessions.earlier.iter().map(|files| &files.name);
        let names = names.chain(sessions.training.iter().map(|own| &own.name));
        let counted = (1..).zip(names);
        let key = |(count, name): (usize, &String)| {
            self.work_with(name, &sessions.made_of[..count]).key()
        };
        counted.map(key).collect()
    }

    fn kept(&self, key: &RunKey) -> Option<Learnt> {
        Learnt::unpacked(&self.joiner.lake.learnt(key)?)
    }

    /// Keeps what the last session of `chain` leaves for the next; a lake that it cannot be written to is told of.
    fn keep(&self, chain: &[RunKey], learnt: &Learnt) -> Result<(), RunError> {
        let Some((own, before)) = chain.split_last() else {
            return Ok(());
        };
        let lake = self.joiner.lake;
        let packed = learnt.packed().map_err(|source| RunError::NotPacked {
            session: own.session.clone(),
            source,
        })?;
        let gone = before.len().checked_sub(KEPT).map(|place| &before[place]);
        let kept = lake.put_learnt(own, &packed);
        let kept = kept.and_then(|()| gone.map_or(Ok(()), |gone| lake.remove_learnt(gone)));
        if let Err(error) = kept {
            tracing::warn!(
                "session {}: what it leaves for the next session is not kept, which will take longer: {error}",
                own.session
            );
        }
        Ok(())
    }
}
