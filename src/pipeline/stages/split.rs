//! Models trained on some stations and compared with others: what a benchmark judges.
//!
//! Unlike [`super::estimate`](super::estimate()) nothing is held out here besides: the split says what tests.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Point3;

use super::estimate::{prepared, training_settings};
use super::observed::{flange_position, observations, observations_of};
use super::{StageError, StageSettings};
use crate::fit::{self, Models, Observation, SourceId, TargetId, TrainingSettings};
use crate::io::tables::outcome::JoinedSession;
use crate::join::{Pairing, Unmeasured};
use crate::kinematics::Arm;
use crate::progress::Progress;
use crate::report::evaluate::{self, Stations};
use crate::report::locate::{Locate, Located, Locator};
use crate::report::{Angles, BaseRefit, Model, ResidualSet, Split, unseen};

/// Station numbers by session.
pub(in crate::pipeline) type Parts = BTreeMap<String, BTreeSet<usize>>;

/// A station that tests, or that finds the base.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::pipeline) struct Tested {
    /// Its session.
    pub session: String,
    /// Its observation.
    pub observation: Observation,
    /// The nominal flange in the base frame, mm.
    pub flange: Point3<f64>,
}

/// The stations of a split.
#[derive(Debug)]
pub(in crate::pipeline) struct Divided {
    /// Those that train.
    pub train: Vec<Observation>,
    /// Those that test or find the base, by session and number.
    pub test: Vec<Tested>,
    sessions: Vec<String>,
    settings: StageSettings,
}

/// Divides the stations of sessions: `train` learn, `test` do not.
pub(in crate::pipeline) fn divide(
    arm: &Arm,
    sessions: &[JoinedSession],
    (train, test): (&Parts, &Parts),
    settings: &StageSettings,
) -> Result<Divided, StageError> {
    let (mut training, mut testing) = (chosen(sessions, train), chosen(sessions, test));
    let prepared = prepared(arm, (&mut training, &mut testing), settings)?;
    let settings = prepared.settings;
    let names: Vec<String> = training.iter().map(|own| own.name.clone()).collect();
    let of = |session: &JoinedSession| {
        let place = names.iter().position(|own| *own == session.name);
        let own = observations(arm, place.unwrap_or(0), session, &settings);
        let name = session.name.clone();
        own.into_iter().map(move |observation| Tested {
            session: name.clone(),
            flange: flange_position(arm, &observation),
            observation,
        })
    };
    Ok(Divided {
        train: observations_of(arm, &training, &settings),
        test: testing.iter().flat_map(of).collect(),
        sessions: names,
        settings,
    })
}

/// The sessions named, with their readings at the stations named alone.
fn chosen(sessions: &[JoinedSession], parts: &Parts) -> Vec<JoinedSession> {
    let of = |session: &JoinedSession| {
        let numbers = parts.get(&session.name)?;
        let mut own = session.clone();
        for station in &mut own.joined.stations {
            if !numbers.contains(&station.number) && station.pairing == Pairing::Paired {
                station.pairing = Pairing::Unmeasured(Unmeasured::NoReadings);
                station.readings.clear();
            }
        }
        Some(own)
    };
    sessions.iter().filter_map(of).collect()
}

impl Divided {
    /// Whether every reading is of a place of one target: what a benchmark compares.
    pub fn is_of_one_target(&self) -> bool {
        let tested = self.test.iter().map(|own| &own.observation);
        let mut all = self.train.iter().chain(tested);
        all.all(|own| {
            own.point().is_some() && own.target == TargetId::MAIN && own.source == SourceId::ONLY
        })
    }

    /// Errors of each model at the test stations, in their order, in the base frame.
    pub fn compared(
        &self,
        arm: &Arm,
        progress: &dyn Progress,
    ) -> Result<Vec<(Model, Angles, ResidualSet)>, StageError> {
        let train = TrainingSettings { rivals: true, ..training_settings(&self.settings) };
        let models = fit::models::train_all(arm, &self.train, self.sessions.len(), &train)?;
        progress.advance(1);
        let mut found: BTreeMap<(Model, Angles), ResidualSet> = BTreeMap::new();
        let mut names: Vec<&str> = self.test.iter().map(|own| &*own.session).collect();
        names.dedup();
        for name in &names {
            for set in self.of_session(&models, arm, name)? {
                let subject = &set.subject;
                let own = found.entry((subject.model, subject.angles));
                own.and_modify(|all| all.residuals.extend(set.residuals.clone())).or_insert(set);
            }
        }
        // A model without predictions in one of the sessions is judged in none.
        let found = found.into_iter();
        let whole = found.filter(|(_, set)| set.residuals.len() == self.test.len());
        Ok(whole.map(|((model, angles), set)| (model, angles, set)).collect())
    }

    /// Errors in one test session: of one that trained with its own frames, of another with those of the first that trained.
    fn of_session(
        &self,
        models: &Models,
        arm: &Arm,
        name: &str,
    ) -> Result<Vec<ResidualSet>, StageError> {
        let own = self.test.iter().filter(|own| own.session == name);
        let own: Vec<Observation> = own.map(|own| own.observation.clone()).collect();
        let stations = Stations { session: name, observations: &own };
        if self.sessions.iter().any(|own| own == name) {
            return Ok(evaluate::own_session(models, stations, Split::Blocks, None));
        }
        let train = training_settings(&self.settings);
        let locator = Locator::new(models, arm, Locate::default(), &train);
        let mut sets = unseen::unseen_session(models, stations, &locator, &Located::default())?;
        sets.retain(|set| set.subject.base_refit == BaseRefit::None);
        Ok(sets)
    }
}
