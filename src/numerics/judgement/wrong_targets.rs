//! Readings under the name of another target: left out before anything is fitted, each with its reason.

use super::JoinedSession;
use super::observed::observations_of;
use super::{StageError, StageSettings};
use crate::fit::TargetId;
use crate::fit::mislabelled::{self, Checked, Mislabelled, SwappedThroughout, Wrong};
use crate::join::{JoinReject, Pairing, Reading, Station, Unmeasured};
use crate::kinematics::Arm;

/// Takes readings that are not of the target they name out of the sessions; an error where targets are swapped throughout one.
pub(super) fn leave_out(
    arm: &Arm,
    training: &mut [JoinedSession],
    test: &mut [JoinedSession],
    settings: &StageSettings,
) -> Result<(), StageError> {
    leave_out_beside(arm, training, &mut [], settings)?;
    if test.is_empty() {
        return Ok(());
    }
    leave_out_beside(arm, training, test, settings)
}

/// Takes them out of the sessions that judge, or, without any, out of those that train: what trains does not depend on judges.
fn leave_out_beside(
    arm: &Arm,
    training: &mut [JoinedSession],
    test: &mut [JoinedSession],
    settings: &StageSettings,
) -> Result<(), StageError> {
    let first = if test.is_empty() { 0 } else { training.len() };
    let mut sessions: Vec<&mut JoinedSession> = training.iter_mut().chain(test).collect();
    if !sessions.iter().any(|session| has_several_targets(session)) {
        return Ok(());
    }
    let seen = observations_of(arm, sessions.iter().map(|own| &**own), settings);
    let Checked { stations, throughout } =
        mislabelled::check(arm, &seen, sessions.len(), &settings.fit);
    let name = |target: TargetId| target.name(&settings.fit.target_names);
    if let Some(SwappedThroughout { session, swap, against }) = throughout {
        return Err(StageError::SwappedTargets {
            session: sessions[session].name.clone(),
            swap: swap.words(name),
            against: against.to_string(),
        });
    }
    for own in stations.iter().filter(|own| own.session >= first) {
        let left = Left {
            station: own.station,
            reason: reason(own, name),
            otherwise: Unmeasured::WrongTarget,
        };
        take_out(sessions[own.session], &left, |reading| match &own.wrong {
            Wrong::Far { target, .. } => reading.target == *target,
            Wrong::Swapped(_) | Wrong::Disagree { .. } => true,
        });
    }
    Ok(())
}

fn has_several_targets(session: &JoinedSession) -> bool {
    let mut readings = session.joined.stations.iter().flat_map(Station::measured);
    readings.any(|reading| reading.target != TargetId::MAIN)
}

/// Readings of a station that are left out.
pub(super) struct Left {
    pub(super) station: usize,
    pub(super) reason: String,
    /// The reason why a station without another reading is not measured.
    pub(super) otherwise: Unmeasured,
}

/// Takes the readings of a station for which `is_wrong` is true out of a session; they are counted and named as rejects.
pub(super) fn take_out(
    session: &mut JoinedSession,
    own: &Left,
    is_wrong: impl Fn(&Reading) -> bool,
) {
    let joined = &mut session.joined;
    let stations = joined.stations.iter_mut();
    let is_it = |station: &&mut Station| station.number == own.station;
    let Some(station) = stations.into_iter().find(is_it) else {
        return;
    };
    let (wrong, kept): (Vec<Reading>, Vec<Reading>) =
        station.readings.drain(..).partition(is_wrong);
    if kept.is_empty() {
        station.pairing = Pairing::Unmeasured(own.otherwise);
    }
    station.readings = kept;
    for reading in wrong {
        let samples = reading.kept as u64;
        joined.counts.kept = joined.counts.kept.saturating_sub(samples);
        joined.counts.unpaired += samples;
        joined.rejects.push(JoinReject {
            start: reading.first,
            end: reading.last,
            readings: samples,
            is_of_reference: false,
            reason: own.reason.clone(),
        });
    }
}

fn reason(own: &Mislabelled, name: impl Fn(TargetId) -> String) -> String {
    let station = own.station;
    match &own.wrong {
        Wrong::Swapped(swap) => format!(
            "swapped targets: the readings of station {station} are of other targets than they name: {}",
            swap.words(name)
        ),
        Wrong::Far { target, away_mm, nearest: (nearest, mm) } => format!(
            "wrong target: a reading of station {station} is {away_mm:.1} mm from where {} is, and {mm:.1} mm from the nearest, {}",
            name(*target),
            name(*nearest)
        ),
        Wrong::Disagree { given_mm } => format!(
            "wrong target: the readings of station {station} disagree by {given_mm:.2} mm with the places of their targets, under any names"
        ),
    }
}
