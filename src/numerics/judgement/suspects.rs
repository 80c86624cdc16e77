//! Wrong readings are taken out of the sessions before anything is fitted to them.

use super::JoinedSession;
use super::observed::observations_of;
use super::{StageError, StageSettings};
use crate::fit::suspects::Check;
use crate::fit::{mislabelled, wrong_lengths, wrong_orientations};
use crate::kinematics::Arm;

/// Takes wrong readings out of the sessions, each with its reason; an error where targets are swapped throughout one.
pub(super) fn leave_out(
    arm: &Arm,
    training: &mut [JoinedSession],
    test: &mut [JoinedSession],
    settings: &StageSettings,
) -> Result<(), StageError> {
    for check in [mislabelled::check as Check, wrong_orientations::check] {
        leave_out_by(check, arm, training, &mut [], settings)?;
        if !test.is_empty() {
            leave_out_by(check, arm, training, test, settings)?;
        }
    }
    leave_out_by(wrong_lengths::check, arm, training, &mut [], settings)
}

/// Takes them out of the sessions that judge, or, without any, out of those that train: what trains does not depend on judges.
fn leave_out_by(
    check: Check,
    arm: &Arm,
    training: &mut [JoinedSession],
    test: &mut [JoinedSession],
    settings: &StageSettings,
) -> Result<(), StageError> {
    let first = if test.is_empty() { 0 } else { training.len() };
    let mut sessions: Vec<&mut JoinedSession> = training.iter_mut().chain(test).collect();
    let seen = observations_of(arm, sessions.iter().map(|own| &**own), settings);
    let suspects = check(arm, &seen, sessions.len(), &settings.fit, &settings.noise);
    let suspects = suspects.map_err(|own| StageError::SwappedTargets {
        session: sessions[own.session].name.clone(),
        swap: own.swap.words(|target| target.name(&settings.fit.target_names)),
        against: own.against.to_string(),
    })?;
    for own in suspects.iter().filter(|own| own.session >= first) {
        own.take_out(&mut sessions[own.session].joined);
    }
    Ok(())
}
