//! A plan compared with the session while it is measured: the promise of the stations so far, and the poses to measure
//! next.
//!
//! Inputs: the plan in the lake, the logs so far of a session of the pipeline file's `[input]`. Output: [`SoFar`]; nothing
//! is published, since the session is not complete.
//! 1. The logs are read and joined by the code of `run`.
//! 2. Stations are matched with planned poses; verification poses take no part.
//! 3. The full error model of the others, started from the known arm where the plan has one, gives the promise
//!    ([`enough`]).

use std::path::Path;

use nalgebra::Isometry3;
use thiserror::Error;

use super::{Planning, Result, SESSION};
use crate::fit::full::FullModel;
use crate::fit::{self, FitError, Observation, Purpose, SourceId, TrainingSettings};
use crate::io::lake::Lake;
use crate::io::rows::Row as _;
use crate::io::tables::sampling_plan::{VisitPurpose, VisitRow};
use crate::join::{Pairing, Station};
use crate::judgement::{JoinedSession, StageSettings};
use crate::manifest::RunKey;
use crate::pipeline::configuration::{Configuration, Overrides};
use crate::pipeline::run;
use crate::plan::enough::{self, Next};
use crate::plan::{Outcomes, Placer, compare};
use crate::progress::Progress;
use crate::report::promise::is_same_pose;

/// The state of a session that is being measured.
#[derive(Debug)]
pub struct SoFar {
    pub plan: RunKey,
    /// Number of measured stations that take part.
    pub identify: usize,
    /// Number of stations at verification poses: they take no part.
    pub verify: usize,
    pub unmeasured: usize,
    pub planned: usize,
    /// The promise if no more poses were measured.
    pub promise: Outcomes,
    /// Names of planned poses to measure next; empty where the stations are enough.
    pub next: Vec<String>,
    /// Whether those are expected to be enough.
    pub next_are_enough: bool,
}

/// The reason why a session cannot be compared with its plan.
#[derive(Debug, Error)]
pub enum SoFarError {
    #[error(
        "the lake {lake} has no plan {run} of this pipeline file: make it first with `posegrid plan`, without --measured"
    )]
    NotPlanned { lake: String, run: String },
    #[error("session {session}: {source}; measure more poses")]
    Fit { session: String, source: FitError },
    #[error(
        "session {session}: there is no full error model of it, the only model that states its own uncertainty: set [fit.full] enabled = true"
    )]
    NoModel { session: String },
}

impl Planning {
    /// Compares the stations so far of `session` with the plan that the pipeline file at `path` makes.
    pub fn so_far(&self, path: &Path, session: &str, progress: &dyn Progress) -> Result<SoFar> {
        let key = RunKey::new(&self.work.robot, SESSION, &self.work.key().run);
        let lake = Lake::at(&self.lake)?;
        if !lake.exists(&key)? {
            let (lake, run) = (self.lake.to_string(), key.run);
            return Err(Box::new(SoFarError::NotPlanned { lake, run }).into());
        }
        let poses = VisitRow::read(&lake.read("sampling_plan", &key)?);
        let (joined, stages) = self.read_session(path, session, progress)?;
        let stations = &joined.joined.stations;
        let counted = self.arm.counted();
        let is_verify = |station: &Station| {
            let own =
                poses.iter().find(|pose| is_same_pose(&pose.joints_rad, &station.joints, &counted));
            own.is_some_and(|pose| pose.purpose == VisitPurpose::Verify)
        };
        let measured = |station: &&Station| station.pairing == Pairing::Paired;
        let verify = stations.iter().filter(measured).filter(|s| is_verify(s)).count();
        let taken: Vec<Station> = stations.iter().filter(|s| !is_verify(s)).cloned().collect();
        let model = self.model_of(&joined, &taken, &stages)?;
        let placer = Placer::new(&self.arm, &self.settings)?;
        let region = compare::region_axes(&self.arm, &placer, &self.settings)?;
        let promise = enough::promised(&model, 0, &region, &self.settings);
        let planned = || poses.iter().filter(|pose| pose.purpose == VisitPurpose::Identify);
        let is_left = |pose: &&VisitRow| {
            !stations.iter().any(|s| is_same_pose(&pose.joints_rad, &s.joints, &counted))
        };
        let left: Vec<&VisitRow> = planned().filter(is_left).collect();
        let next = self.next(&model, &region, &left, &promise);
        let identify = taken.iter().filter(measured).count();
        Ok(SoFar {
            plan: key,
            identify,
            verify,
            unmeasured: stations.len() - identify - verify,
            planned: planned().count(),
            promise,
            next: next.poses.iter().map(|&place| left[place].target.clone()).collect(),
            next_are_enough: next.are_enough,
        })
    }

    /// The session, and the settings of its own stages: it may have more targets and instruments than are planned for.
    fn read_session(
        &self,
        path: &Path,
        session: &str,
        progress: &dyn Progress,
    ) -> Result<(JoinedSession, StageSettings)> {
        let overrides = Overrides {
            robot: Some(self.work.robot.clone()),
            sessions: vec![session.to_owned()],
            lake: Some(self.lake.named()),
            ..Overrides::default()
        };
        let configuration = Configuration::load(path, &overrides)?;
        let files = configuration.pieces.iter().flat_map(|piece| &piece.training).next();
        let files = files.expect("a configuration of one session has its files");
        let source = run::SessionSource { configuration: &configuration, files };
        let joined = source.joined(None, progress).map_err(Box::new)?;
        Ok((joined, configuration.stages))
    }

    /// The full error model of the stations that take part.
    fn model_of(
        &self,
        joined: &JoinedSession,
        stations: &[Station],
        stages: &StageSettings,
    ) -> Result<FullModel> {
        let numbers = |number: usize| stations.iter().any(|station| station.number == number);
        let mut observations = fit::observations(0, stations, &self.arm, &stages.noise);
        fit::add_commands(&mut observations, &joined.joined.stations, &joined.commanded);
        observations.retain(|observation| numbers(observation.station));
        let found = self
            .trained(&observations, stages)
            .map_err(|source| Box::new(SoFarError::Fit { session: joined.name.clone(), source }))?;
        found.ok_or_else(|| Box::new(SoFarError::NoModel { session: joined.name.clone() }).into())
    }

    fn trained(
        &self,
        observations: &[Observation],
        stages: &StageSettings,
    ) -> Result<Option<FullModel>, FitError> {
        let settings = &self.settings;
        let (fit, full, up) = (&stages.fit, &settings.full, settings.up);
        let train = TrainingSettings { fit, full, up, purpose: Purpose::Judges };
        let Some(known) = &settings.known else {
            return Ok(fit::models::train(&self.arm, observations, 1, &train)?.full);
        };
        let found = &fit::start::frames(&self.arm, observations, 1, &stages.fit)?[0];
        Ok(known.learned_from_all(&self.arm, observations, found, &train))
    }

    /// The poses to measure next, from the planned poses that are left.
    fn next(
        &self,
        model: &FullModel,
        region: &[Vec<f64>],
        left: &[&VisitRow],
        promise: &Outcomes,
    ) -> Next {
        let none = Next { poses: Vec::new(), are_enough: promise.holds() };
        let Some(promised_mm) = promise.bound_mm.filter(|_| !promise.holds()) else { return none };
        let base = *model.fitted_frames()[0].tracker_from_base(SourceId::ONLY);
        let at_flange: Isometry3<f64> = self.settings.flange_from_target;
        let candidate = |pose: &&VisitRow| {
            let target = self.arm.flange(&pose.joints_rad).isometry() * at_flange;
            let position = base.isometry() * nalgebra::Point3::from(target.translation.vector);
            compare::candidate(&self.arm, &pose.joints_rad, position, model, &self.settings)
        };
        let candidates: Vec<_> = left.iter().map(candidate).collect();
        enough::next(model, region, &candidates, promised_mm, &self.settings)
    }
}
