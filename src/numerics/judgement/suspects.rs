//! Wrong readings: under the name of another target, of a planar target seen flipped, or of a length that cannot be. They are left out
//! before anything is fitted, each with its reason.

use super::observed::observations_of;
use super::sizes::is_of_camera;
use super::{JoinedSession, StageError, StageSettings, lengths};
use crate::fit::flips::{self, Flipped};
use crate::fit::mislabelled::{self, Checked, Mislabelled, SwappedThroughout, Wrong};
use crate::fit::wrong_lengths::{self, WrongLength};
use crate::fit::{Observation, SourceId, TargetId};
use crate::join::{JoinReject, Pairing, Reading, Station, Unmeasured};
use crate::kinematics::Arm;

/// Readings of a station that are left out.
struct Suspect {
    session: usize,
    station: usize,
    /// The instrument, and the target; those of all where there is none.
    source: Option<SourceId>,
    target: Option<TargetId>,
    reason: String,
    /// The reason why a station without another reading is not measured.
    otherwise: Unmeasured,
}

/// The suspects among the observations of sessions of these names.
type Found = Result<Vec<Suspect>, StageError>;

/// Takes wrong readings out of the sessions; an error where targets are swapped throughout one.
pub(super) fn leave_out(
    arm: &Arm,
    training: &mut [JoinedSession],
    test: &mut [JoinedSession],
    settings: &StageSettings,
) -> Result<(), StageError> {
    let mislabelled = |seen: &[Observation], names: &[String]| {
        let checked = mislabelled::check(arm, seen, names.len(), &settings.fit);
        mislabelled_among(checked, names, settings)
    };
    everywhere(arm, training, test, settings, mislabelled)?;
    if is_of_camera(settings) && settings.noise.takes_orientations() {
        everywhere(arm, training, test, settings, |seen, names| {
            let found = flips::check(arm, seen, names.len(), &settings.fit, &settings.noise);
            let flipped = |own: &Flipped| {
                let reason = own.reason(seen[own.place].station);
                Suspect::reading(&seen[own.place], reason, Unmeasured::FlippedView)
            };
            Ok(found.iter().map(flipped).collect())
        })?;
    }
    beside(arm, training, &mut [], settings, |seen, names| {
        if seen.iter().all(|own| own.measured.length().is_none()) {
            return Ok(Vec::new());
        }
        let wrong = |own: &WrongLength| {
            let seen = &seen[own.place];
            let reason = own.reason(&lengths::name(seen.source, settings), seen.station);
            Suspect::reading(seen, reason, Unmeasured::WrongTarget)
        };
        let found = wrong_lengths::check(arm, seen, names.len(), &settings.fit);
        Ok(found.iter().map(wrong).collect())
    })
}

/// Takes the suspects out of the sessions that train, and then, beside these, of those that judge: what trains does not depend on judges.
fn everywhere(
    arm: &Arm,
    training: &mut [JoinedSession],
    test: &mut [JoinedSession],
    settings: &StageSettings,
    check: impl Fn(&[Observation], &[String]) -> Found,
) -> Result<(), StageError> {
    beside(arm, training, &mut [], settings, &check)?;
    if test.is_empty() {
        return Ok(());
    }
    beside(arm, training, test, settings, check)
}

/// Takes them out of the sessions that judge, or, without any, out of those that train.
fn beside(
    arm: &Arm,
    training: &mut [JoinedSession],
    test: &mut [JoinedSession],
    settings: &StageSettings,
    check: impl Fn(&[Observation], &[String]) -> Found,
) -> Result<(), StageError> {
    let first = if test.is_empty() { 0 } else { training.len() };
    let mut sessions: Vec<&mut JoinedSession> = training.iter_mut().chain(test).collect();
    let seen = observations_of(arm, sessions.iter().map(|own| &**own), settings);
    let names: Vec<String> = sessions.iter().map(|own| own.name.clone()).collect();
    for own in check(&seen, &names)?.iter().filter(|own| own.session >= first) {
        own.take_out(sessions[own.session]);
    }
    Ok(())
}

impl Suspect {
    fn reading(seen: &Observation, reason: String, otherwise: Unmeasured) -> Self {
        let Observation { session, station, source, target, .. } = *seen;
        Self { session, station, source: Some(source), target: Some(target), reason, otherwise }
    }

    fn is(&self, reading: &Reading) -> bool {
        self.target.is_none_or(|target| target == reading.target)
            && self.source.is_none_or(|source| source == reading.source)
    }

    /// Takes the readings out of their session; they are counted and named as rejects.
    fn take_out(&self, session: &mut JoinedSession) {
        let joined = &mut session.joined;
        let is_it = |station: &&mut Station| station.number == self.station;
        let Some(station) = joined.stations.iter_mut().find(is_it) else {
            return;
        };
        let (wrong, kept): (Vec<Reading>, Vec<Reading>) =
            station.readings.drain(..).partition(|reading| self.is(reading));
        if kept.is_empty() {
            station.pairing = Pairing::Unmeasured(self.otherwise);
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
                reason: self.reason.clone(),
            });
        }
    }
}

/// Readings that are not of the target they name.
fn mislabelled_among(checked: Checked, names: &[String], settings: &StageSettings) -> Found {
    let name = |target: TargetId| target.name(&settings.fit.target_names);
    if let Some(SwappedThroughout { session, swap, against }) = checked.throughout {
        return Err(StageError::SwappedTargets {
            session: names[session].clone(),
            swap: swap.words(name),
            against: against.to_string(),
        });
    }
    let suspect = |own: &Mislabelled| Suspect {
        session: own.session,
        station: own.station,
        source: None,
        target: match &own.wrong {
            Wrong::Far { target, .. } => Some(*target),
            Wrong::Swapped(_) | Wrong::Disagree { .. } => None,
        },
        reason: reason(own, name),
        otherwise: Unmeasured::WrongTarget,
    };
    Ok(checked.stations.iter().map(suspect).collect())
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
