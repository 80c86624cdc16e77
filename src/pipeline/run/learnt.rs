//! What the sessions before one said, for the one to be learnt on top of (`[input] pool = "growing"`).
//!
//! It follows from those sessions in their order, the robot file, the settings of training and the version, as the estimate of the last of
//! them does, and is named after that. The lake keeps it of the last two sessions; where it has none, it is made again from the last
//! session that it has, or from the first: whether it was there changes no result, only the time that the next one takes.
//!
//! A session that cannot be learnt, as it is of another arm for one, is left out of those after it. The lake keeps that too, so that each
//! night does not find it again.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::estimated::Estimator;
use super::joined::{Joiner, Sessions};
use super::{RunError, lines};
use crate::io::tables::outcome::JoinedSession;
use crate::manifest::RunKey;
use crate::pipeline::configuration::{Recorded, SessionFiles};
use crate::pipeline::stages::{self, Estimate, Learning, Learnt};

/// A session that cannot be learnt on top of those before it.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Line {
    /// The estimate that it would have.
    estimate: String,
    session: String,
    reason: String,
}

fn by_estimate(text: &str) -> BTreeMap<String, Line> {
    lines::parsed(text, |line: &Line| &line.estimate)
}

/// What the lake keeps is that of so many last sessions: a night that is done again needs what the one before it said.
const KEPT: usize = 2;

impl Estimator<'_> {
    /// The estimate of the session of a piece of work on top of those before it, and what it leaves for the next.
    pub(super) fn on_top(&self, sessions: Sessions) -> Result<Estimate, RunError> {
        let keys = self.chain(&sessions);
        let before = self.before(&sessions, &keys)?;
        let Sessions { earlier, training, test, .. } = sessions;
        let both = (training, test);
        let (estimate, learnt) = self.learnt(both, &earlier, before.as_ref())?;
        self.keep(&keys, &learnt)?;
        Ok(estimate)
    }

    /// What the sessions before the last said; `None` where there are none.
    fn before(&self, sessions: &Sessions, keys: &[RunKey]) -> Result<Option<Learnt>, RunError> {
        let earlier = &sessions.earlier;
        // Those that cannot be joined are told of before anything is learnt.
        for files in earlier {
            if !matches!(files.recorded, Recorded::Joined(_)) {
                self.joined(files)?;
            }
        }
        let refused = by_estimate(&self.joiner.lake.refused_index(&self.joiner.work.robot));
        for (files, key) in earlier.iter().zip(keys) {
            if let Some(line) = refused.get(&key.run) {
                let reason = line.reason.clone();
                return Err(RunError::Refused { reason }.of(files));
            }
        }
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
            let (_, learnt) = learnt.map_err(|error| {
                self.refuse(&keys[place], &error);
                error.of(&earlier[place])
            })?;
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
        let (estimate, learnt) = self.once(both.clone(), &Learning::after(before))?;
        let Some(held) = learnt.stale() else {
            return Ok((estimate, learnt));
        };
        tracing::info!(
            "session {}: sessions differ by much more than the first ones showed: {} sessions are learnt again",
            both.0.last().map_or("", |own| &own.name),
            earlier.len() + 1
        );
        let mut again = None;
        for files in earlier {
            let both = (vec![self.joined(files)?], Vec::new());
            let learning = Learning::again(again.as_ref(), &held, None);
            let learnt = self.once(both, &learning);
            again = Some(learnt.map_err(|error| error.of(files))?.1);
        }
        self.once(both, &Learning::again(again.as_ref(), &held, before))
    }

    fn once(
        &self,
        both: (Vec<JoinedSession>, Vec<JoinedSession>),
        learning: &Learning,
    ) -> Result<(Estimate, Learnt), RunError> {
        let name = both.0.last().map_or_else(String::new, |own| own.name.clone());
        let Joiner { configuration, progress, .. } = self.joiner;
        let (arm, settings) = (&configuration.arm, &configuration.stages);
        let from = (None, Some(learning));
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

    /// Keeps that the last session of a chain cannot be learnt, where that is the session's fault.
    fn refuse(&self, key: &RunKey, error: &RunError) {
        if !matches!(error, RunError::Stage(_) | RunError::NotLearnt { .. }) {
            return;
        }
        let (lake, robot) = (self.joiner.lake, &self.joiner.work.robot);
        let mut all = by_estimate(&lake.refused_index(robot));
        let line = Line {
            estimate: key.run.clone(),
            session: key.session.clone(),
            reason: error.to_string(),
        };
        all.insert(line.estimate.clone(), line);
        if let Err(error) = lake.put_refused_index(robot, &lines::text(&all)) {
            tracing::warn!("session {}: {error}", key.session);
        }
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
        let packed = learnt
            .packed()
            .map_err(|source| RunError::NotPacked { session: own.session.clone(), source })?;
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
