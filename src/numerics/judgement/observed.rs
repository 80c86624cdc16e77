//! Observations of the training sessions, with the fold that holds each out.

use nalgebra::Point3;

use super::JoinedSession;
use super::StageSettings;
use crate::fit::visits::{self, Dwell};
use crate::fit::{self, Observation, commanded};
use crate::kinematics::Arm;
use crate::units::WallTime;

/// Observations of all training sessions, with the fold that holds each out.
#[derive(Debug)]
pub(super) struct Observed {
    pub(super) all: Vec<Observation>,
    pub(super) folds: Vec<usize>,
}

impl Observed {
    pub(super) fn new(arm: &Arm, training: &[JoinedSession], settings: &StageSettings) -> Self {
        let all = observations_of(arm, training, settings);
        // Blocks are cut by the position of the nominal flange.
        let flange = |own: &Observation| arm.chain().nominal(&own.axes).translation.vector.into();
        let positions: Vec<Point3<f64>> = all.iter().map(flange).collect();
        // A pose is at the place of its first visit, in whichever session, so that no block separates its visits.
        let places = visits::poses(&dwells(training));
        let positions: Vec<Point3<f64>> = places.iter().map(|&first| positions[first]).collect();
        let folds = settings.fit.blocks.folds(&positions);
        Self { all, folds }
    }

    pub(super) fn of_session(&self, session: usize) -> impl Iterator<Item = (&Observation, usize)> {
        self.all.iter().zip(self.folds.iter().copied()).filter(move |(o, _)| o.session == session)
    }

    pub(super) fn own(&self, session: usize) -> Vec<Observation> {
        self.of_session(session).map(|(o, _)| o.clone()).collect()
    }

    /// The observations of all other sessions, with the sessions numbered again.
    pub(super) fn without_session(&self, session: usize) -> Vec<Observation> {
        let renumbered = self.all.iter().filter(|o| o.session != session).map(|o| Observation {
            session: o.session - usize::from(o.session > session),
            ..o.clone()
        });
        renumbered.collect()
    }

    pub(super) fn without(&self, fold: usize) -> Vec<Observation> {
        let kept = self.all.iter().zip(&self.folds).filter(|(_, own)| **own != fold);
        kept.map(|(observation, _)| observation.clone()).collect()
    }
}

/// The observations of all these sessions, numbered from 0.
pub(super) fn observations_of<'s>(
    arm: &Arm,
    sessions: impl IntoIterator<Item = &'s JoinedSession>,
    settings: &StageSettings,
) -> Vec<Observation> {
    let numbered = sessions.into_iter().enumerate();
    numbered.flat_map(|(place, session)| observations(arm, place, session, settings)).collect()
}

/// The dwells of the observations of all sessions, in their order.
fn dwells(training: &[JoinedSession]) -> Vec<Dwell<'_>> {
    training.iter().flat_map(dwells_of).collect()
}

fn dwells_of(session: &JoinedSession) -> impl Iterator<Item = Dwell<'_>> {
    let commanded = &session.commanded;
    let stations = &session.joined.stations;
    let dwells = commanded::dwells(stations, &commanded.poses, commanded.trust, &commanded.counted);
    let readings = stations.iter().map(|station| station.measured().len());
    let measured = dwells.into_iter().zip(readings);
    measured.flat_map(|(dwell, readings)| std::iter::repeat_n(dwell, readings))
}

pub(super) fn observations(
    arm: &Arm,
    place: usize,
    session: &JoinedSession,
    settings: &StageSettings,
) -> Vec<Observation> {
    let stations = &session.joined.stations;
    let noise = settings.noise.with_stated(&session.stated_sizes);
    let mut observations = fit::observations(place, stations, arm, &noise);
    fit::add_commands(&mut observations, stations, &session.commanded);
    let day = session.started().map(WallTime::day);
    for observation in &mut observations {
        observation.day = day;
        // What was carried over a knock drifts all the same.
        observation.follows_references &= session.joined.knocks.is_empty();
    }
    observations
}
