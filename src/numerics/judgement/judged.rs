//! Models compared with the stations that judge them.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::JoinedSession;
use super::observed::Observed;
use super::{StageError, StageSettings};
use crate::fit::same_arm::NotOneArm;
use crate::fit::{
    self, ErrorFrame, FitError, FramePair, Frames, Models, Observation, Purpose, TrainingSettings,
    holdout,
};
use crate::grid::GridStation;
use crate::join::SeveralSources;
use crate::kinematics::Arm;
use crate::progress::Progress;
use crate::report::evaluate::{self, Stations};
use crate::report::locate::{Locate, LocateTarget, Located, Locator};
use crate::report::{ResidualSet, Split, unseen};

pub(super) const fn training_settings(settings: &StageSettings) -> TrainingSettings<'_> {
    TrainingSettings {
        fit: &settings.fit,
        full: &settings.full,
        up: settings.up,
        purpose: Purpose::Published,
    }
}

/// Observations of the trainings that are under way at a time: each takes some 100 KB for six joints.
const SIDE_BY_SIDE: usize = 12_000;

/// Work on each place, as many at a time as [`SIDE_BY_SIDE`] allows trainings of so many observations: one that ends lets the next begin,
/// until one fails. Results in the order of places; of the places that fail the first, before which all were begun.
fn side_by_side<T: Send, E: Send>(
    places: usize,
    observations: usize,
    work: impl Fn(usize) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let most = (SIDE_BY_SIDE / observations.max(1)).max(1);
    // Rounds of one size: a last one alone would leave cores idle.
    let rounds = places.div_ceil(most).max(1);
    let at_once = places.div_ceil(rounds);
    let next = AtomicUsize::new(0);
    let lane = |_| {
        let mut done = Vec::new();
        loop {
            let place = next.fetch_add(1, Ordering::Relaxed);
            if place >= places {
                return done;
            }
            let own = work(place);
            if own.is_err() {
                next.fetch_max(places, Ordering::Relaxed);
            }
            done.push((place, own));
        }
    };
    let lanes = (0..at_once).into_par_iter().with_max_len(1).map(lane);
    let mut done: Vec<(usize, Result<T, E>)> = lanes.flatten_iter().collect();
    done.sort_by_key(|(place, _)| *place);
    done.into_iter().map(|(_, done)| done).collect()
}

/// The models of all stations, which `check` has to take, and those of every fold that holds a station out, in fold order.
pub(super) fn train(
    arm: &Arm,
    observed: &Observed,
    sessions: usize,
    settings: &TrainingSettings<'_>,
    check: impl Fn(&Models) -> Result<(), NotOneArm> + Sync,
    progress: &dyn Progress,
) -> Result<(Models, Vec<Option<Models>>), StageError> {
    progress.begin("folds", holdout::FOLDS as u64);
    let whole = || {
        let models = fit::models::train(arm, &observed.all, sessions, settings)?;
        check(&models)?;
        Ok(models)
    };
    let judges = TrainingSettings { purpose: Purpose::Judges, ..*settings };
    let of_fold = |fold: usize| {
        let is_needed = observed.folds.contains(&fold);
        let train = || fit::models::train(arm, &observed.without(fold), sessions, &judges);
        let models = is_needed.then(train);
        progress.advance(1);
        Ok(models.transpose()?)
    };
    // One training alone leaves a core idle now and then, so that of all stations goes beside the first folds.
    let one = |place: usize| match place.checked_sub(1) {
        None => whole().map(Some),
        Some(fold) => of_fold(fold),
    };
    let trained: Result<Vec<_>, StageError> =
        side_by_side(1 + holdout::FOLDS, observed.all.len(), one);
    progress.end();
    let mut trained = trained?.into_iter();
    Ok((trained.next().flatten().expect("all stations are needed"), trained.collect()))
}

/// Every session of a pool judged by the models of all the others, its base and target refitted; but those before a repair, whose arm is not
/// that of now. None where the settings ask for none, and with several targets: a session left out has a mounting of its own, of which one
/// target alone can be found.
pub(super) fn sessions_left_out(
    arm: &Arm,
    models: &Models,
    observed: &Observed,
    training: &[JoinedSession],
    settings: &StageSettings,
    progress: &dyn Progress,
) -> Result<Vec<ResidualSet>, FitError> {
    let several_targets = models.base_target.frames.iter().any(Frames::has_several_targets);
    if training.len() < 2 || !settings.leave_sessions_out || several_targets {
        return Ok(Vec::new());
    }
    let locate = settings.locate;
    let others = training.len() - 1;
    let settings = &TrainingSettings { purpose: Purpose::Judges, ..training_settings(settings) };
    let of_now: Vec<usize> =
        (0..training.len()).filter(|&place| is_of_now(observed, place, settings)).collect();
    progress.begin("sessions left out", of_now.len() as u64);
    let judge = |nth: usize| {
        let place = of_now[nth];
        let train = observed.without_session(place);
        let models = fit::models::train(arm, &train, others, settings)?;
        let own = observed.own(place);
        let stations = Stations { session: &training[place].name, observations: &own };
        progress.advance(1);
        Ok(judged_apart(arm, &models, stations, settings, locate)?)
    };
    let judged: Result<Vec<_>, FitError> = side_by_side(of_now.len(), observed.all.len(), judge);
    progress.end();
    Ok(judged?.into_iter().flatten().collect())
}

/// A session judged by models that never saw it, with a mounting of its own: base and target are found from some of its stations.
fn judged_apart(
    arm: &Arm,
    models: &Models,
    stations: Stations<'_>,
    settings: &TrainingSettings<'_>,
    locate: Locate,
) -> Result<Vec<ResidualSet>, SeveralSources> {
    let locate = Locate { target: LocateTarget::Own, ..locate };
    let locator = Locator::new(models, arm, locate, settings);
    let located = locator.located(models, stations.observations);
    unseen::unseen_session(models, stations, &locator, &located)
}

/// Whether no repair of a joint was still to come in a session.
fn is_of_now(observed: &Observed, session: usize, settings: &TrainingSettings<'_>) -> bool {
    let mut own = observed.of_session(session);
    let day = own.next().and_then(|(observation, _)| observation.day);
    let mut repairs = settings.full.repaired.iter();
    !repairs.any(|repair| day.is_some_and(|day| repair.is_to_come(day)))
}

pub(super) struct Judged<'j> {
    pub(super) observed: &'j Observed,
    pub(super) models: &'j Models,
    pub(super) folds: &'j [Option<Models>],
    pub(super) training: &'j [JoinedSession],
}

impl Judged<'_> {
    /// The ways in which stations that train judge models: in training, and held out in blocks.
    pub(super) fn residuals(&self) -> Vec<ResidualSet> {
        let mut residuals = self.own_sessions();
        residuals.extend(self.blocks());
        residuals
    }

    /// The residuals at the stations that trained, with the weight of each.
    fn own_sessions(&self) -> Vec<ResidualSet> {
        let of = |(place, session): (usize, &JoinedSession)| {
            let own = self.observed.own(place);
            let stations = Stations { session: &session.name, observations: &own };
            let mut sets = evaluate::own_session(self.models, stations, Split::None, None);
            let first = self.observed.all.partition_point(|o| o.session < place);
            for set in &mut sets {
                let model = self.models.get(set.subject.model);
                let weights = model.map_or(&[][..], |model| model.weights());
                // Lengths have no residual of a position.
                let weighed = weights.iter().zip(&self.observed.all).skip(first);
                let own = weighed.filter(|(_, o)| o.point().is_some()).map(|(weight, _)| weight);
                for (residual, weight) in set.residuals.iter_mut().zip(own) {
                    residual.weight = Some(*weight);
                }
            }
            sets
        };
        self.training.par_iter().enumerate().flat_map_iter(of).collect()
    }

    /// Every station judged once, by the models of the fold that held it out.
    fn blocks(&self) -> Vec<ResidualSet> {
        let held_out = |place: usize| {
            let folds = self.folds.iter().enumerate();
            folds.filter_map(move |(fold, models)| Some((place, fold, models.as_ref()?)))
        };
        let parts: Vec<_> = (0..self.training.len()).flat_map(held_out).collect();
        let judged = parts.par_iter().map(|&(place, fold, models)| {
            let own = self.observed.of_session(place).filter(|(_, of)| *of == fold);
            let own: Vec<_> = own.map(|(o, _)| o.clone()).collect();
            let stations = Stations { session: &self.training[place].name, observations: &own };
            evaluate::own_session(models, stations, Split::Blocks, Some(fold))
        });
        let mut sets: Vec<ResidualSet> = Vec::new();
        for set in judged.collect::<Vec<_>>().into_iter().flatten() {
            merge(&mut sets, set);
        }
        sets
    }
}

/// The models of a run, and what judges them.
#[derive(Clone, Copy)]
pub(super) struct Judges<'j> {
    pub(super) arm: &'j Arm,
    pub(super) models: &'j Models,
    /// The main frames of each training session by base + target.
    pub(super) frames: &'j [FramePair],
    pub(super) training: &'j [JoinedSession],
    pub(super) observed: &'j Observed,
    /// Sessions that only judge, and what finds their base and target.
    pub(super) test: &'j [TestSession<'j>],
    pub(super) locator: &'j Locator,
    /// The error reference frame of the last training session, which the table is for, and its stations.
    pub(super) error_frame: &'j ErrorFrame<'j>,
    pub(super) stations: &'j [GridStation],
    pub(super) settings: &'j StageSettings,
}

impl Judges<'_> {
    pub(super) fn own(&self) -> &JoinedSession {
        &self.training[self.last()]
    }

    /// Its place among those that train.
    pub(super) const fn last(&self) -> usize {
        self.training.len() - 1
    }
}

/// What finds base and target of the sessions that only judge.
pub(super) fn locator(
    test: &[JoinedSession],
    models: &Models,
    arm: &Arm,
    settings: &StageSettings,
) -> Locator {
    if test.is_empty() {
        return Locator::of_none(settings.locate);
    }
    Locator::new(models, arm, settings.locate, &training_settings(settings))
}

/// The ways in which sessions that only judge do so.
pub(super) fn unseen_sessions(
    models: &Models,
    test: &[TestSession<'_>],
    locator: &Locator,
) -> Result<Vec<ResidualSet>, SeveralSources> {
    let of = |test: &TestSession<'_>| {
        unseen::unseen_session(models, test.stations(), locator, &test.located)
    };
    let judged: Result<Vec<_>, SeveralSources> = test.iter().map(of).collect();
    Ok(judged?.into_iter().flatten().collect())
}

pub(super) struct TestSession<'s> {
    pub(super) session: &'s JoinedSession,
    pub(super) observations: Vec<Observation>,
    pub(super) located: Located,
}

impl<'s> TestSession<'s> {
    /// Sessions with their observations, and how their bases and targets are found for the arm of `models`.
    pub(super) fn all(
        sessions: &'s [JoinedSession],
        observed: Vec<Vec<Observation>>,
        models: &Models,
        locator: &Locator,
    ) -> Vec<Self> {
        let of = |(session, observations): (&'s JoinedSession, Vec<Observation>)| Self {
            located: locator.located(models, &observations),
            observations,
            session,
        };
        sessions.iter().zip(observed).map(of).collect()
    }

    pub(super) fn stations(&self) -> Stations<'_> {
        Stations { session: &self.session.name, observations: &self.observations }
    }

    /// The stations that find its base, by their numbers.
    pub(super) fn numbers(&self) -> BTreeSet<usize> {
        self.located.finders.iter().map(|&place| self.observations[place].station).collect()
    }
}

/// Adds residuals to the set of their subject, in station order.
pub(super) fn merge(sets: &mut Vec<ResidualSet>, set: ResidualSet) {
    match sets.iter_mut().find(|own| own.subject == set.subject) {
        None => sets.push(set),
        Some(own) => {
            own.residuals.extend(set.residuals);
            own.residuals.sort_by_key(|residual| residual.station);
        }
    }
}
