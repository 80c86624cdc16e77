//! The promise of a sampling plan, compared with the session that was measured by it.
//!
//! The plan's id is in the pipeline file (`[report] plan`) or in the logs (metadata record `session`, key `plan`); the plan
//! itself is in the lake. The session's errors at the verification poses are those of models that did not see them: the
//! full error model from commands alone, blocks held out.

use super::planning::SESSION;
use crate::io::lake::{Lake, LakeError};
use crate::io::rows::Row as _;
use crate::io::tables::sampling_plan::{VisitRow, promise};
use crate::judgement::{JoinedSession, Outcome};
use crate::manifest::RunKey;
use crate::report::promise::{PlanPromise, PromiseKept, Verified};
use crate::report::{Model, ResidualSet, Split};

/// The outcome of a plan's promise.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Promised {
    NoPlan,
    /// The lake has no such plan.
    Unknown(String),
    NoErrors(String),
    /// It was compared with the session.
    Held(PlanPromise, Box<PromiseKept>),
}

impl Promised {
    /// The outcome in one line for a person; `None` without a plan.
    pub(super) fn words(&self) -> Option<String> {
        match self {
            Self::NoPlan => None,
            Self::Unknown(plan) => Some(format!(
                "plan {plan}: the lake has no such plan of this robot, so its promise is not compared with the session"
            )),
            Self::NoErrors(plan) => Some(format!(
                "plan {plan}: no model gave errors of stations it did not see, so its promise is not compared with anything"
            )),
            Self::Held(promise, kept) => Some(promise.words(kept)),
        }
    }
}

/// Compares the promise that the last training session was measured by with its stations.
pub(super) fn held(
    named: Option<&String>,
    outcome: &Outcome<'_>,
    lake: &Lake,
    robot: &str,
) -> Result<Promised, LakeError> {
    let Some(session) = outcome.training.last() else { return Ok(Promised::NoPlan) };
    let Some(plan) = named.or(session.sampling_plan.as_ref()) else { return Ok(Promised::NoPlan) };
    let key = RunKey::new(robot, SESSION, plan);
    if !lake.exists(&key)? || !lake.has("sampling_plan", &key)? {
        return Ok(Promised::Unknown(plan.clone()));
    }
    let promise = promise(&key, VisitRow::read(&lake.read("sampling_plan", &key)?));
    Ok(match errors(outcome, session) {
        Some(set) => {
            let kept = promise.held_against(&verified(set, session));
            Promised::Held(promise, Box::new(kept))
        }
        None => Promised::NoErrors(plan.clone()),
    })
}

/// Errors of the session's stations by a model that did not see them, from commands where they are known.
fn errors<'o>(outcome: &'o Outcome<'_>, session: &JoinedSession) -> Option<&'o ResidualSet> {
    Model::judging().find_map(|(model, angles)| {
        outcome.residuals.iter().find(|set| {
            let subject = &set.subject;
            (subject.model, subject.angles, subject.split) == (model, angles, Split::Blocks)
                && subject.of_session == session.name
        })
    })
}

fn verified(set: &ResidualSet, session: &JoinedSession) -> Vec<Verified> {
    let stations = &session.joined.stations;
    let joints = |number: usize| {
        let station = stations.iter().find(|station| station.number == number);
        station.map(|station| station.joints.clone())
    };
    let verified = set.residuals.iter().filter(|own| own.is_of_main()).filter_map(|residual| {
        let (joints, left_mm) = (joints(residual.station)?, residual.residual.norm());
        Some(Verified { joints, pose: residual.pose, left_mm })
    });
    verified.collect()
}
