//! What the library gives to whoever calls it: kinematics, the join, fits, grids, reports, tables.

#[path = "../common/mod.rs"]
mod common;

mod backlash;
mod cameras;
mod covariances;
mod coverage;
mod dense;
mod driven;
mod fit;
mod full_model;
mod full_model_bad_input;
mod identified_arm;
mod inverse;
mod join;
mod kinds;
mod kinematics;
mod knocks;
mod locate;
mod measured_tables;
mod plan;
mod pools;
mod reach;
mod reflectors;
mod scale;
mod setup;
mod simulate;
mod slides;
mod stages;
mod tables;
mod tool_tip;

use posegrid::judgement::{JoinedSession, Outcome, StageError, StageSettings, estimate, results};
use posegrid::kinematics::Arm;
use posegrid::progress::Quiet;

/// All results that follow from joined sessions.
fn judged<'a>(
    arm: &'a Arm,
    training: Vec<JoinedSession>,
    test: Vec<JoinedSession>,
    settings: &StageSettings,
) -> Result<Outcome<'a>, StageError> {
    results(arm, estimate(arm, (training, test), None, settings, &Quiet)?, None, &Quiet)
}
