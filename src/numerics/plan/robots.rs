//! Simulated robots of the expected kind: each drawn, measured and fitted by the code of a real run.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};

use super::known::KnownArm;
use super::settings::PlanSettings;
use crate::fit::commanded::{CommandFrames, commanded};
use crate::fit::full::FullSettings;
use crate::fit::{self, ErrorFrame, FitError, Models, Observation, Purpose, TrainingSettings};
use crate::join::{Pairing, Station};
use crate::kinematics::Arm;
use crate::simulate::{ArmErrors, Commanded, Ingredient, SimulateSettings, Stream, Visit, visits};

#[derive(Debug, Clone)]
pub struct Robot<'a> {
    arm: &'a Arm,
    cell: SimulateSettings,
    errors: ArmErrors,
    known: Option<Arc<KnownArm>>,
    sessions: Stream,
}

#[derive(Debug)]
pub struct Fitted<'a> {
    pub models: Models,
    pub error_frame: ErrorFrame<'a>,
}

impl<'a> Robot<'a> {
    /// Robot `number` of the plan's population.
    pub fn draw(arm: &'a Arm, settings: &PlanSettings, number: usize) -> Self {
        let mut sessions = Stream::new(settings.seed, Ingredient::Robots);
        let seed = (0..=number).fold(0, |_, _| sessions.bits());
        let mut cell =
            SimulateSettings { seed, home: settings.home.clone(), ..settings.population.clone() };
        let known = settings.known.clone();
        Self {
            arm,
            errors: match &known {
                Some(known) => known.draw(&mut cell),
                None => ArmErrors::draw(arm, &cell),
            },
            known,
            sessions: Stream::new(seed, Ingredient::Robots),
            cell,
        }
    }

    pub fn session(&mut self, poses: &[Commanded]) -> Vec<Visit> {
        let session = SimulateSettings { seed: self.sessions.bits(), ..self.cell.clone() };
        let mut visits = visits(self.arm, &session, &self.errors, poses);
        if let Some(known) = &self.known {
            known.scatter(&mut visits, session.seed);
        }
        visits
    }

    /// Measures `poses` and fits the models of `full` to them.
    pub fn fitted(
        &mut self,
        poses: &[Commanded],
        settings: &PlanSettings,
        full: &FullSettings,
    ) -> Result<Fitted<'a>, FitError> {
        let stations: Vec<Station> = stations(self.session(poses));
        self.fit(&stations, settings, full)
    }

    /// The models and the error reference frame of measured stations.
    pub fn fit(
        &self,
        stations: &[Station],
        settings: &PlanSettings,
        full: &FullSettings,
    ) -> Result<Fitted<'a>, FitError> {
        let models = self.models(&observations(self.arm, stations, settings), settings, full)?;
        let error_frame = ErrorFrame::new(
            self.arm,
            models.base_target.frames[0].main()?,
            Some(settings.flange_from_target),
            settings.noise.takes_orientations(),
        );
        Ok(Fitted { models, error_frame })
    }
}

impl Robot<'_> {
    /// The models of one session; where the arm is known, the full error model continues from it.
    fn models(
        &self,
        observations: &[Observation],
        settings: &PlanSettings,
        full: &FullSettings,
    ) -> Result<Models, FitError> {
        let known = self.known.as_ref().filter(|_| full.enabled);
        let geometry_alone = FullSettings { enabled: false, ..full.clone() };
        let train = TrainingSettings {
            fit: &settings.fit,
            full: if known.is_some() { &geometry_alone } else { full },
            up: settings.up,
            purpose: Purpose::Judges,
        };
        let mut models = fit::models::train(self.arm, observations, 1, &train)?;
        if let Some(known) = known {
            models.full = known.learned(self.arm, observations, &models.base_target.frames[0]);
        }
        Ok(models)
    }
}

pub fn stations(visits: Vec<Visit>) -> Vec<Station> {
    visits.into_iter().map(|visit| visit.station).collect()
}

/// Stations in the form of the fit, with their settling errors.
fn observations(arm: &Arm, stations: &[Station], settings: &PlanSettings) -> Vec<Observation> {
    let frames = CommandFrames {
        base_from_command: Isometry3::identity(),
        flange_from_tool: Some(settings.flange_from_target),
    };
    let mut observations = fit::observations(0, stations, arm, &settings.noise);
    fit::add_commands(&mut observations, stations, &commanded(stations, arm, &frames));
    observations
}

impl Fitted<'_> {
    /// Errors of the tool point at measured stations in the error reference frame, in the base frame, mm, each with its station's number.
    pub fn errors(&self, stations: &[Station]) -> Vec<(usize, Vector3<f64>)> {
        stations
            .iter()
            .filter(|station| station.pairing == Pairing::Paired)
            .filter_map(|station| {
                let command = station.command.as_ref()?.position;
                Some((station.number, self.error_frame.tool_error(station, &command)?))
            })
            .collect()
    }

    /// The true errors at visits: free of the tracker's noise.
    pub fn true_errors(&self, visits: &[Visit], settings: &PlanSettings) -> Vec<Vector3<f64>> {
        let perfect: Vec<Station> =
            visits.iter().map(|visit| visit.perfect(&settings.population)).collect();
        self.errors(&perfect).into_iter().map(|(_, error)| error).collect()
    }
}
