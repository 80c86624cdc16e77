//! The planned session: the poses to measure, their purposes, their order, and the promise.

use std::num::NonZeroUsize;
use std::ops::Range;

use super::compare::{Designs, Kind, left_at};
use super::order::{Revisits, Visit, visiting_order, with_repeats};
use super::outcomes::{Outcomes, RobotOutcome};
use super::robots::stations;
use super::settings::PlanSettings;
use super::steps::test_poses;
use super::{PlanError, Trial, line_of_sight};
use crate::kinematics::Arm;
use crate::simulate::{Commanded, Ingredient, Stream};

/// The design of the session's own poses.
pub const KIND: Kind = Kind::GreedyVariance;
pub const LEAST_POSES: usize = 10;
/// Fewest poses that determine the place of a known arm, even if the beam misses one of them.
pub const LEAST_KNOWN_POSES: usize = 5;
/// Number of early poses that a drift check visits again.
const DRIFT_POSES: usize = 2;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// The arm is identified on it.
    Identify,
    /// It takes no part in the fit and verifies the promise.
    Verify,
    /// The pose of an earlier visit again, for the drift of the base; the arm is also identified on it.
    DriftCheck { of: usize },
}

#[derive(Debug, Clone, PartialEq)]
pub struct PlannedVisit {
    pub purpose: Purpose,
    /// The target's pose in the base frame and the nominal arm's angles there.
    pub command: Commanded,
    /// Place in the order in which the design chose it, and the model's variance over the region after it, mm²; `None` for
    /// visits that the design did not choose.
    pub choice: Option<(usize, f64)>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Session {
    pub visits: Vec<PlannedVisit>,
}

impl Session {
    /// The first `poses` of the variance design, fresh verification poses, and drift checks, in order of short travel.
    pub fn new(trial: &Trial<'_>, designs: &Designs, poses: usize) -> Result<Self, PlanError> {
        let (arm, settings) = (trial.arm, trial.settings);
        let choices = designs.by_variance.iter().take(poses).enumerate();
        let mut visits: Vec<PlannedVisit> = choices
            .map(|(place, choice)| PlannedVisit {
                purpose: Purpose::Identify,
                command: designs.candidates.0[choice.candidate].clone(),
                choice: Some((place, choice.left_mm2)),
            })
            .collect();
        let mut stream = Stream::new(settings.seed, Ingredient::Verify);
        let suits = |joints: &[f64]| line_of_sight::verdict(arm, joints, &settings.constraints);
        let count = settings.verify_poses;
        let (fresh, _) = trial.placer.random(&settings.region, count, &mut stream, &suits)?;
        visits.extend(fresh.into_iter().map(|command| PlannedVisit {
            purpose: Purpose::Verify,
            command,
            choice: None,
        }));
        Ok(Self::ordered(arm, &visits, settings))
    }

    fn ordered(arm: &Arm, visits: &[PlannedVisit], settings: &PlanSettings) -> Self {
        let joints: Vec<Vec<f64>> = visits.iter().map(|v| v.command.joints.clone()).collect();
        let speed = settings.population.motion.speed_rad_s;
        let speeds: Vec<f64> = arm.joints().iter().map(|own| speed * own.per_radian()).collect();
        let order = visiting_order(&joints, &settings.home, &speeds);
        // Drift is checked on identification poses: verification poses are measured once.
        let (early, rest): (Vec<usize>, Vec<usize>) = {
            let identify = |&place: &usize| visits[place].purpose == Purpose::Identify;
            let early: Vec<usize> =
                order.iter().copied().filter(identify).take(DRIFT_POSES).collect();
            let rest = order.into_iter().filter(|place| !early.contains(place)).collect();
            (early, rest)
        };
        let order = [early, rest].concat();
        let revisits = Revisits {
            repeat_every: None,
            drift_every: NonZeroUsize::new(settings.drift_check_every),
            drift_poses: DRIFT_POSES,
        };
        let all = with_repeats(&order, &revisits);
        let first = |pose: usize| all.iter().position(|visit| *visit == Visit::Pose(pose));
        let planned = |visit: &Visit| match *visit {
            Visit::Pose(pose) => visits[pose].clone(),
            Visit::Repeat { of } | Visit::DriftCheck { of } => PlannedVisit {
                purpose: Purpose::DriftCheck {
                    of: first(of).expect("a pose is visited before it is visited again"),
                },
                choice: None,
                ..visits[of].clone()
            },
        };
        Self { visits: all.iter().map(planned).collect() }
    }

    /// Number of visits whose purpose `is` accepts.
    pub fn count(&self, is: impl Fn(Purpose) -> bool) -> usize {
        self.visits.iter().filter(|visit| is(visit.purpose)).count()
    }
}

/// The outcomes of the session on robots that took no part in choosing it.
pub fn promise(trial: &Trial<'_>, session: &Session, pool: &[Commanded]) -> Outcomes {
    let settings = trial.settings;
    let first = settings.robots.max(settings.whole_model_robots);
    let fresh = first..first + settings.whole_model_robots;
    Outcomes::of(tried(trial, session, pool, fresh).iter(), settings.robots_meet)
}

/// The session on these robots of the plan's population: each measures all of it, is identified on all except the
/// verification poses, and is judged at fresh poses in another session.
pub fn tried(
    trial: &Trial<'_>,
    session: &Session,
    pool: &[Commanded],
    robots: Range<usize>,
) -> Vec<RobotOutcome> {
    let settings = trial.settings;
    let commands: Vec<Commanded> = session.visits.iter().map(|v| v.command.clone()).collect();
    trial.each_robot("robots for the promise", robots, |robot, number| {
        let measured = stations(robot.session(&commands)).into_iter().zip(&session.visits);
        let learnt = measured.filter(|(_, visit)| visit.purpose != Purpose::Verify);
        let training: Vec<_> = learnt.map(|(station, _)| station).collect();
        let tests = test_poses(pool, settings, number);
        match robot.fit(&training, settings, &settings.full) {
            Ok(fitted) => left_at(robot, &fitted, &tests, settings),
            Err(error) => RobotOutcome::NoFit(error),
        }
    })
}
