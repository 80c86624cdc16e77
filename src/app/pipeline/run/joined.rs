//! Ingest and join of a session as work of its own: its result is taken from the lake, or made from the session's files and published for
//! later runs.
//!
//! Its name follows from the session's files, the settings of ingest and join ([`join_settings`](crate::pipeline::keys::join_settings))
//! and the version. Runs that differ in what comes after the join start from the same result, whatever pipeline file they are of. Commands
//! and the check of the set-up follow from its stations, and are found anew.

use super::estimated::Estimator;
use super::inputs::is_of_session;
use super::session::{of_joined, session};
use super::{RunError, SessionDone};
use crate::io::lake::{JOINED, Lake, OpenRun};
use crate::io::tables::PublishError;
use crate::io::tables::joined_sessions;
use crate::io::tables::stage_results::NotRestored;
use crate::judgement::JoinedSession;
use crate::manifest::{Input, ROBOT, RunKey, Work};
use crate::pipeline::configuration::{Configuration, Recorded, SessionFiles, WorkPiece};
use crate::progress::Progress;

/// The sessions of a piece of work as joined.
pub(super) struct Sessions {
    /// Those that train.
    pub(super) training: Vec<JoinedSession>,
    /// Those that only judge.
    pub(super) test: Vec<JoinedSession>,
    /// The name of each in the lake, in that order.
    pub(super) made_of: Vec<RunKey>,
}

/// Where sessions are joined.
pub(super) struct Joiner<'a> {
    pub(super) configuration: &'a Configuration,
    /// The work of the piece, with the inputs of all its sessions.
    pub(super) work: &'a Work,
    pub(super) lake: &'a Lake,
    pub(super) progress: &'a dyn Progress,
}

impl<'a> Joiner<'a> {
    /// Where the estimates of these sessions are made.
    pub(super) const fn estimator(&'a self) -> Estimator<'a> {
        Estimator { joiner: self }
    }

    /// Every session of a piece of work; decoded samples of logs are written to `run`, where there is one.
    pub(super) fn all(
        &self,
        piece: &WorkPiece,
        mut run: Option<&mut OpenRun<'_>>,
    ) -> Result<Sessions, RunError> {
        let mut made_of = Vec::new();
        let mut joined = |files: &SessionFiles| {
            let one = self.one(files, run.as_deref_mut());
            let (session, key) = one.map_err(|error| error.of(files))?;
            made_of.push(key);
            Ok(session)
        };
        let training = piece.training.iter().map(&mut joined);
        let training = training.collect::<Result<Vec<_>, RunError>>()?;
        let test = piece.test.iter().map(&mut joined);
        let test = test.collect::<Result<Vec<_>, RunError>>()?;
        Ok(Sessions { training, test, made_of })
    }

    /// One session for later runs, in words.
    pub(super) fn made(&self, files: &SessionFiles) -> Result<SessionDone, RunError> {
        let already_there = self.lake.has(JOINED, &self.work_of(files).key())?;
        let (session, key) = self.one(files, None)?;
        Ok(SessionDone {
            session: key.session,
            run: key.run,
            already_there,
            paired: session.joined.paired(),
            dwells: session.joined.stations.len(),
        })
    }

    /// One session and its name in the lake.
    pub(super) fn one(
        &self,
        files: &SessionFiles,
        run: Option<&mut OpenRun<'_>>,
    ) -> Result<(JoinedSession, RunKey), RunError> {
        let own = self.work_of(files);
        let key = own.key();
        let session = if let Some(session) = self.before(files, &key)? {
            session
        } else {
            let session = session(self.configuration, files, run, self.progress)?;
            self.publish(&own, &session)?;
            session
        };
        Ok((session, key))
    }

    /// Ingest and join of one session as work of its own.
    fn work_of(&self, files: &SessionFiles) -> Work {
        let is_own =
            |input: &&Input| input.name == ROBOT || is_of_session(&input.name, &files.name);
        joined_sessions::work(
            &self.work.robot,
            &files.name,
            self.work.inputs.iter().filter(is_own).cloned().collect(),
            self.configuration.join_settings.clone(),
        )
    }

    /// A session that the lake has as joined; `None` where it has to be read. Decoded samples are published from the logs alone.
    fn before(
        &self,
        files: &SessionFiles,
        key: &RunKey,
    ) -> Result<Option<JoinedSession>, RunError> {
        let is_all_there_is = matches!(files.recorded, Recorded::Joined(_));
        if !is_all_there_is && (self.configuration.logs || !self.lake.has(JOINED, key)?) {
            return Ok(None);
        }
        match joined_sessions::restored(self.lake, key) {
            Ok(restored) => of_joined(self.configuration, files, restored).map(Some),
            Err(source) if is_all_there_is => Err(unreadable(files, key, source)),
            Err(source) => {
                let error = unreadable(files, key, source);
                tracing::warn!("{error}; its files are read again");
                Ok(None)
            }
        }
    }

    /// Publishes a session as joined, unless the lake has it.
    fn publish(&self, work: &Work, session: &JoinedSession) -> Result<(), PublishError> {
        let key = work.key();
        let Some(mut open) = self.lake.start_in(JOINED, &key)? else {
            return Ok(());
        };
        open.publish(&joined_sessions::readings(session, &key)?.table)?;
        let row = joined_sessions::table(session, work, open.written())?;
        open.commit(&row)?;
        Ok(())
    }
}

fn unreadable(files: &SessionFiles, key: &RunKey, source: NotRestored) -> RunError {
    RunError::Unread {
        session: files.name.clone(),
        what: format!("its result of ingest and join in the lake, {},", key.run),
        source: Box::new(source),
        advice: "",
    }
}
