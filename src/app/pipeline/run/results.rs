//! Results of stages that later runs start from: each is taken from the lake, or made and published.
//!
//! A result is named by what it follows from, its settings and the version. A session as joined follows from its files, an estimate from
//! the sessions as joined that train and the robot file, grids from their estimate. Runs that differ in what comes behind a stage start
//! from the same result, whatever pipeline file they are of.

use super::inputs::is_of_session;
use super::session::SessionSource;
use super::{Result, RunError, StageDone, work};
use crate::files::table::Table;
use crate::io::lake::{ESTIMATES, GRIDS, JOINED, Lake, OpenRun, Stage};
use crate::io::tables::stage_results::NotRestored;
use crate::io::tables::{PublishError, estimates, grids, joined_sessions};
use crate::judgement::{self, Estimate, JoinedSession, Outcome, StageError};
use crate::manifest::{Input, ROBOT, RunKey, Work, Written};
use crate::pipeline::configuration::{Configuration, Recorded, SessionFiles, WorkPiece};
use crate::pipeline::fleet::FleetPiece;
use crate::progress::Progress;

/// Where the stages of a piece of work take their results from, and publish them.
pub(super) struct Results<'a> {
    pub(super) configuration: &'a Configuration,
    /// The work of the piece, with the inputs of all its sessions.
    pub(super) work: Work,
    pub(super) lake: Lake,
    pub(super) progress: &'a dyn Progress,
}

/// A result with its name in the lake.
pub(super) struct Found<T> {
    pub(super) value: T,
    pub(super) key: RunKey,
    pub(super) already_there: bool,
}

/// The sessions of a piece of work as joined.
pub(super) struct Sessions {
    pub(super) training: Vec<JoinedSession>,
    pub(super) test: Vec<JoinedSession>,
    /// The name of each in the lake, in that order.
    pub(super) made_of: Vec<RunKey>,
}

impl<'a> Results<'a> {
    pub(super) fn of(own: FleetPiece<'a>, progress: &'a dyn Progress) -> Result<Self> {
        let FleetPiece { configuration, piece, .. } = own;
        let lake = Lake::at(&configuration.lake)?;
        Ok(Self { configuration, work: work(configuration, piece)?, lake, progress })
    }

    /// Every session as joined; decoded samples of logs are written to `run`, where there is one.
    pub(super) fn sessions(
        &self,
        piece: &WorkPiece,
        mut run: Option<&mut OpenRun<'_>>,
    ) -> Result<Sessions> {
        let mut made_of = Vec::new();
        let mut joined = |files: &SessionFiles| {
            let found = self.session(files, run.as_deref_mut())?;
            made_of.push(found.key);
            Ok(found.value)
        };
        let training = piece.training.iter().map(&mut joined).collect::<Result<Vec<_>>>()?;
        let test = piece.test.iter().map(&mut joined).collect::<Result<Vec<_>>>()?;
        Ok(Sessions { training, test, made_of })
    }

    /// One session as joined. Commands and the check of the set-up follow from its stations, and are found anew.
    pub(super) fn session(
        &self,
        files: &SessionFiles,
        run: Option<&mut OpenRun<'_>>,
    ) -> Result<Found<JoinedSession>> {
        self.joined(files, run).map_err(|error| error.of(files))
    }

    fn joined(
        &self,
        files: &SessionFiles,
        run: Option<&mut OpenRun<'_>>,
    ) -> Result<Found<JoinedSession>> {
        let is_own =
            |input: &&Input| input.name == ROBOT || is_of_session(&input.name, &files.name);
        let inputs = self.work.inputs.iter().filter(is_own).cloned().collect();
        let settings = self.configuration.join_settings.clone();
        let work = joined_sessions::work(&self.work.robot, &files.name, inputs, settings);
        let source = SessionSource { configuration: self.configuration, files };
        let is_only = matches!(files.recorded, Recorded::Joined(_));
        let known = self.known(JOINED, &work, is_only, |key| {
            // Decoded samples are published from the logs alone.
            if self.configuration.file.output.logs && !is_only {
                return Ok(None);
            }
            let restored =
                joined_sessions::restored(&self.lake, key).map_err(unread(JOINED, key))?;
            source.of_joined(restored).map(Some)
        })?;
        known.or_make(|key| {
            let session = source.joined(run, self.progress)?;
            let readings = joined_sessions::readings(&session, key)?.table;
            let row = |written: &[Written]| joined_sessions::table(&session, &work, written);
            self.publish(JOINED, key, &readings, row)?;
            Ok(session)
        })
    }

    pub(super) fn estimate(&self, sessions: Sessions) -> Result<Found<Estimate>> {
        let Self { configuration, progress, .. } = self;
        let (arm, settings) = (&configuration.arm, &configuration.stages);
        let targets = &settings.fit.target_names;
        let robot = self.work.inputs.iter().find(|input| input.name == ROBOT);
        let training = &sessions.made_of[..sessions.training.len()];
        let inputs = estimates::inputs(
            robot.map_or("", |robot| robot.digest.as_str()),
            training.iter().map(|own| (&own.session, &own.run)),
        );
        let stage_settings = configuration.estimate_settings.clone();
        let work = estimates::work(&self.work.robot, &self.work.session, inputs, stage_settings);
        let known = self.known(ESTIMATES, &work, configuration.from_estimates, |key| {
            let stored = estimates::restored(&self.lake, key, targets);
            let stored = Some(stored.map_err(unread(ESTIMATES, key))?);
            let both = (sessions.training.clone(), sessions.test.clone());
            Ok(Some(judgement::estimate(arm, both, stored, settings, *progress)?))
        })?;
        known.or_make(|key| {
            let both = (sessions.training, sessions.test);
            let estimate = judgement::estimate(arm, both, None, settings, *progress)?;
            let residuals = estimates::residuals(&estimate.residuals, targets, key)?;
            let row = |written: &[Written]| estimates::table(&estimate.stored(), &work, written);
            self.publish(ESTIMATES, key, &residuals, row)?;
            Ok(estimate)
        })
    }

    /// All results that follow from an estimate, under the name of its grids.
    pub(super) fn outcome(&self, estimate: Found<Estimate>) -> Result<Found<Outcome<'a>>> {
        let RunKey { robot, session, run } = &estimate.key;
        let work = grids::work(robot, session, run, self.configuration.grids_settings.clone());
        let known = self.known(GRIDS, &work, self.configuration.from_grids, |key| {
            let steps = grids::restored(&self.lake, key).map_err(unread(GRIDS, key))?;
            Ok(Some(steps))
        })?;
        let Found { value: steps, key, already_there } = known;
        let arm = &self.configuration.arm;
        let value = judgement::results(arm, estimate.value, steps, self.progress)?;
        if !already_there {
            let steps = &value.grids.answers;
            let errors = grids::errors(steps, &key)?;
            self.publish(GRIDS, &key, &errors, |written| grids::table(steps, &work, written))?;
        }
        Ok(Found { value, key, already_there })
    }

    /// A result that the lake has, unless it cannot be used and may be made again; an error where it `is_only` taken from there.
    fn known<T>(
        &self,
        stage: Stage,
        work: &Work,
        is_only: bool,
        read: impl FnOnce(&RunKey) -> Result<Option<T>>,
    ) -> Result<Found<Option<T>>> {
        let key = work.key();
        let already_there = self.lake.has(stage.rows, &key)?;
        if is_only && !already_there {
            return Err(RunError::NoResult { session: key.session, what: stage.names[0] });
        }
        let value = match already_there.then(|| read(&key)).transpose() {
            Err(error @ (RunError::Unread { .. } | RunError::Stage(StageError::Stored(_))))
                if !is_only =>
            {
                tracing::warn!("{error}; it is made again");
                None
            }
            read => read?.flatten(),
        };
        Ok(Found { value, key, already_there })
    }

    fn publish(
        &self,
        stage: Stage,
        key: &RunKey,
        table: &Table,
        row: impl FnOnce(&[Written]) -> Result<Table, PublishError>,
    ) -> Result<(), PublishError> {
        if let Some(mut open) = self.lake.start_in(stage.rows, key)? {
            open.publish(table)?;
            let row = row(open.written())?;
            open.commit(&row)?;
        }
        Ok(())
    }
}

impl<T> Found<T> {
    pub(super) fn done(&self, stage: Stage, words: String) -> StageDone {
        StageDone { stage, run: self.key.run.clone(), already_there: self.already_there, words }
    }
}

impl<T> Found<Option<T>> {
    fn or_make(self, make: impl FnOnce(&RunKey) -> Result<T>) -> Result<Found<T>> {
        let Self { value, key, already_there } = self;
        let value = value.map_or_else(|| make(&key), Ok)?;
        Ok(Found { value, key, already_there })
    }
}

fn unread(stage: Stage, key: &RunKey) -> impl FnOnce(NotRestored) -> RunError + use<'_> {
    move |source| RunError::Unread {
        session: key.session.clone(),
        what: format!("the {} {}", stage.names[0], key.run),
        source: Box::new(source),
    }
}
