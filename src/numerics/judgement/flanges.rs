//! Sessions with several targets: the one reading of each station that errors of one tool point are stated by.
//!
//! All readings train the models and have residuals. What follows from one point with one orientation (grids, the table, raw commands,
//! driven sessions, ISO 9283, the tool tip, semivariograms) asks a station for its one reading, which is derived here
//! ([`crate::fit::flange`]) by the targets' places as base + target fitted them. Sessions with one target stay as they are.

use std::collections::{BTreeMap, BTreeSet};

use super::observed::{Observed, observations};
use super::{JoinedSession, SeveralTargets, ShownFlange};
use super::{StageError, StageSettings};
use crate::fit::flange::{self, OneReading};
use crate::fit::frames::MeasuredFlange;
use crate::fit::{Frames, Models, Noise, Observation, TargetId};
use crate::join::Station;
use crate::kinematics::Arm;
use crate::report::locate::LocateTarget;

/// Sessions whose stations have at most one reading each.
#[derive(Debug)]
pub(super) struct Flanges {
    pub(super) training: Vec<JoinedSession>,
    pub(super) test: Vec<JoinedSession>,
    /// All readings of each test session.
    pub(super) seen: Vec<Vec<Observation>>,
    /// What the stations show, for the record.
    pub(super) targets: SeveralTargets,
    /// The uncertainties of the one readings.
    pub(super) noise: Noise,
}

impl Flanges {
    /// The one reading of each station; the observations get the orientations that several targets show.
    pub(super) fn new(
        arm: &Arm,
        training: Vec<JoinedSession>,
        test: Vec<JoinedSession>,
        observed: &mut Observed,
        models: &Models,
        settings: &StageSettings,
    ) -> Result<Self, StageError> {
        let frames = &models.base_target.frames;
        let targets = frames.iter().map(|own| own.targets().len()).max();
        if let (Some(targets @ 2..), LocateTarget::Own) = (targets, settings.locate.target) {
            return Err(StageError::OwnTargets { targets });
        }
        // An unseen session has the targets that the first session of the training read, in their places there.
        let known = observed.of_session(0).map(|(own, _)| own.target).collect();
        let test: Vec<JoinedSession> =
            test.into_iter().map(|session| of_targets(session, &known)).collect();
        let mut seen: Vec<_> =
            test.iter().map(|session| places(observations(arm, 0, session, settings))).collect();
        let mut derived = Derived::default();
        let own = training.into_iter().zip(frames);
        let training: Vec<JoinedSession> =
            own.map(|(session, frames)| derived.session(session, frames, settings)).collect();
        let own = test.into_iter();
        // An unseen session has its targets in the places of the latest that trained.
        let latest = &frames[models.latest()];
        let test: Vec<JoinedSession> =
            own.map(|session| derived.session(session, latest, settings)).collect();
        for (place, session) in training.iter().enumerate() {
            let own = observed.all.iter_mut();
            add_flanges(own.filter(|o| o.session == place), session, &frames[place]);
        }
        for (seen, session) in seen.iter_mut().zip(&test) {
            add_flanges(seen.iter_mut(), session, latest);
        }
        Ok(Self {
            noise: flange::noise_of_poses(&settings.noise, &derived.orientations_rad),
            targets: SeveralTargets {
                names: settings.fit.target_names.clone(),
                sessions: derived.shown,
            },
            training,
            test,
            seen,
        })
    }
}

/// A session that judges, with its readings of these targets alone: nothing predicts the places of others.
fn of_targets(mut session: JoinedSession, known: &BTreeSet<TargetId>) -> JoinedSession {
    for station in &mut session.joined.stations {
        station.readings.retain(|reading| known.contains(&reading.target));
    }
    session
}

#[derive(Default)]
struct Derived {
    shown: Vec<ShownFlange>,
    /// Standard uncertainty of each derived orientation, rad.
    orientations_rad: Vec<f64>,
}

/// The observations of places, by which sessions judge.
fn places(mut observations: Vec<Observation>) -> Vec<Observation> {
    observations.retain(|own| own.point().is_some());
    observations
}

impl Derived {
    /// The session with one reading for each station; as it is where it has one target.
    fn session(
        &mut self,
        mut session: JoinedSession,
        frames: &Frames,
        settings: &StageSettings,
    ) -> JoinedSession {
        if !frames.has_several_targets() {
            return session;
        }
        let mut shown = ShownFlange { session: session.name.clone(), ..ShownFlange::default() };
        // What stands for several readings has the sizes of what these state in it.
        let noise = settings.noise.with_stated(&std::mem::take(&mut session.stated_sizes));
        let stations = session.joined.stations.iter_mut();
        for station in stations.filter(|station| !station.measured().is_empty()) {
            let one = OneReading::of(station, frames, &noise);
            match &one {
                Some(OneReading::Pose(_, sd_rad)) => {
                    shown.poses += 1;
                    self.orientations_rad.push(*sd_rad);
                }
                Some(OneReading::Point(_)) => shown.points += 1,
                None => shown.neither += 1,
            }
            let lengths = station.readings.iter();
            let lengths = lengths.filter(|own| own.value.kind().is_length()).cloned();
            let one = one.iter().map(|one| one.reading().clone());
            station.readings = one.chain(lengths).collect();
        }
        self.shown.push(shown);
        session
    }
}

/// Gives the main target's observations the orientations of the session's one readings.
fn add_flanges<'o>(
    observations: impl Iterator<Item = &'o mut Observation>,
    session: &JoinedSession,
    frames: &Frames,
) {
    if !frames.has_several_targets() {
        return;
    }
    let places = frames.places();
    let turn = |station: &Station| Some((station.number, station.one_reading()?.orientation()?));
    let turns: BTreeMap<usize, _> = session.joined.stations.iter().filter_map(turn).collect();
    for observation in observations.filter(|own| own.target == TargetId::MAIN) {
        observation.flange = turns.get(&observation.station).map(|orientation| MeasuredFlange {
            orientation: *orientation,
            places: places.clone(),
        });
    }
}
