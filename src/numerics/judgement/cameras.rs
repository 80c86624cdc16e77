//! Sessions of a camera: flipped views of the target are left out, and the size of the camera's noise is estimated.

use super::JoinedSession;
use super::observed::observations_of;
use super::wrong_targets::{Left, take_out};
use super::{StageError, StageSettings};
use crate::fit::camera_size::{self, CameraSize};
use crate::fit::flips::{self, Flipped};
use crate::fit::{self, Freedom, Observation, SourceId, Uncertainty};
use crate::join::Unmeasured;
use crate::kinematics::Arm;

/// Takes flipped views of planar targets out of the sessions, each with its reason.
pub(super) fn leave_out_flips(
    arm: &Arm,
    training: &mut [JoinedSession],
    test: &mut [JoinedSession],
    settings: &StageSettings,
) {
    if !is_of_camera(settings) || !settings.noise.takes_orientations() {
        return;
    }
    leave_out_beside(arm, training, &mut [], settings);
    if !test.is_empty() {
        leave_out_beside(arm, training, test, settings);
    }
}

/// Takes flipped views out of the sessions that judge, or, without any, out of those that train: what trains does not depend on judges.
fn leave_out_beside(
    arm: &Arm,
    training: &mut [JoinedSession],
    test: &mut [JoinedSession],
    settings: &StageSettings,
) {
    let first = if test.is_empty() { 0 } else { training.len() };
    let mut sessions: Vec<&mut JoinedSession> = training.iter_mut().chain(test).collect();
    let seen = observations_of(arm, sessions.iter().map(|own| &**own), settings);
    let flipped = flips::check(arm, &seen, sessions.len(), &settings.fit, &settings.noise);
    for own in flipped.iter().filter(|own| seen[own.place].session >= first) {
        let Observation { session, station, target, source, .. } = seen[own.place];
        let left = Left {
            station,
            reason: Flipped::reason(own, station),
            otherwise: Unmeasured::FlippedView,
        };
        take_out(sessions[session], &left, |reading| {
            (reading.target, reading.source) == (target, source)
        });
    }
}

/// The size of the camera's noise in the sessions that train, and the settings with it; those of other instruments as they are.
pub(super) fn sized(
    arm: &Arm,
    training: &[JoinedSession],
    settings: &StageSettings,
) -> Result<(StageSettings, Option<CameraSize>), StageError> {
    let mut settings = settings.clone();
    if !is_of_camera(&settings) {
        return Ok((settings, None));
    }
    let seen = observations_of(arm, training, &settings);
    let geometric = fit::identify(arm, &seen, training.len(), Freedom::Geometry, &settings.fit)?;
    let found = camera_size::found(arm, &seen, &geometric, SourceId::ONLY);
    if let (Some(found), Some(source)) = (found, settings.noise.sources.first_mut())
        && let Uncertainty::Camera(camera) = &mut source.uncertainty
    {
        camera.size = found.size;
    }
    Ok((settings, found))
}

fn is_of_camera(settings: &StageSettings) -> bool {
    let mut sources = settings.noise.sources.iter();
    sources.any(|source| source.uncertainty.camera().is_some())
}
