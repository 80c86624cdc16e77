//! Whether sessions fit together, and what is stated of them: one source of positions in each, no copies among those that judge, dates
//! around repairs, one arm.

use std::collections::{BTreeSet, HashMap};

use super::observed::Observed;
use super::{JoinedSession, StageError, StageSettings};
use crate::fit::Models;
use crate::fit::same_arm::{self, NotOneArm};
use crate::join::{Reading, Station, one_source};
use crate::kinematics::Arm;
use crate::units::WallTime;

/// Errors, grids and figures are of one tool point in one instrument's frame: sessions with several sources of positions are refused
/// here. Instruments that read one length train beside it ([`super::lengths`]). Of several targets the one reading of each station is derived ([`super::flanges`]).
pub(super) fn one_source_each<'s>(
    sessions: impl Iterator<Item = &'s JoinedSession>,
) -> Result<(), StageError> {
    for session in sessions {
        one_source(&session.joined.stations)
            .map_err(|source| StageError::SeveralIn { session: session.name.clone(), source })?;
    }
    Ok(())
}

/// Refuses a session that only judges and has lengths alone.
pub(super) fn check_judge(session: &JoinedSession) -> Result<(), StageError> {
    let mut readings = session.joined.stations.iter().flat_map(|own| &own.readings);
    let has_lengths = readings.clone().next().is_some();
    let has_places = readings.any(|reading| !reading.value.kind().is_length());
    if has_lengths && !has_places {
        return Err(StageError::NoPlaces { session: session.name.clone() });
    }
    Ok(())
}

/// Fewest equal stations that show a copy.
const COPIED: usize = 3;

/// Refuses a session that judges with stations that train.
pub(super) fn not_copied(
    training: &[JoinedSession],
    test: &[JoinedSession],
) -> Result<(), StageError> {
    let mut trained: HashMap<Vec<u64>, &str> = HashMap::new();
    for session in training {
        let measured = session.joined.stations.iter().filter_map(bits);
        trained.extend(measured.map(|own| (own, session.name.as_str())));
    }
    test.iter().try_for_each(|session| check_no_copy(session, &trained))
}

fn check_no_copy(
    session: &JoinedSession,
    trained: &HashMap<Vec<u64>, &str>,
) -> Result<(), StageError> {
    let measured: Vec<_> = session.joined.stations.iter().filter_map(bits).collect();
    let copies: Vec<&str> = measured.iter().filter_map(|own| trained.get(own).copied()).collect();
    if copies.len() < COPIED {
        return Ok(());
    }
    let of: BTreeSet<&str> = copies.iter().copied().collect();
    Err(StageError::Copied {
        session: session.name.clone(),
        of: Vec::from_iter(of).join(", "),
        copies: copies.len(),
        stations: measured.len(),
    })
}

/// Joint angles and readings of a station, bit by bit, without what the readings state of themselves; `None` of one without a reading.
fn bits(station: &Station) -> Option<Vec<u64>> {
    let read = |reading: &Reading| {
        let position = reading.position().map(|own| own.coords.as_slice().to_vec());
        let turn = reading.orientation().map(|own| own.coords.as_slice().to_vec());
        let length = reading.value.length().map(|own| vec![own.mm]);
        [position, turn, length].into_iter().flatten().flatten()
    };
    let readings = station.measured().iter().flat_map(read);
    let all = station.joints.iter().copied().chain(readings);
    (!station.measured().is_empty()).then(|| all.map(f64::to_bits).collect())
}

/// The settings with those repairs that a session which trains came after: one that is still to come changes nothing. An error where a
/// session has no date, or where one that judges is from before a repair, when the joint was another.
pub(super) fn repairs(
    training: &[JoinedSession],
    test: &[JoinedSession],
    settings: &StageSettings,
) -> Result<StageSettings, StageError> {
    let mut settings = settings.clone();
    if settings.full.repaired.is_empty() {
        return Ok(settings);
    }
    let day = |session: &JoinedSession| {
        let began = session.started().map(WallTime::day);
        began.ok_or_else(|| StageError::Undated { session: session.name.clone() })
    };
    let days: Vec<f64> = training.iter().map(day).collect::<Result<_, _>>()?;
    let repaired = &mut settings.full.repaired;
    repaired.retain(|repair| days.iter().any(|day| !repair.is_to_come(*day)));
    for repair in repaired.iter() {
        let judging = training.last().into_iter().chain(test);
        let mut judging = judging.filter_map(|own| Some((own, own.started()?.day())));
        if let Some((session, _)) = judging.find(|(_, day)| repair.is_to_come(*day)) {
            return Err(StageError::BeforeRepair {
                session: session.name.clone(),
                repair: *repair,
            });
        }
        let before = training.iter().zip(&days).filter(|(_, day)| repair.is_to_come(**day));
        let before: Vec<&str> = before.map(|(own, _)| own.name.as_str()).collect();
        if !before.is_empty() {
            tracing::info!(
                "joint {} was repaired on {}: of it {} {} nothing, of the rest of the arm as much as others; none of them is left out in turn",
                repair.joint,
                repair.from.0,
                before.join(", "),
                if before.len() == 1 { "says" } else { "say" },
            );
        }
    }
    Ok(settings)
}

pub(super) fn check_pool(
    arm: &Arm,
    observed: &Observed,
    models: &Models,
    training: &[JoinedSession],
    settings: &StageSettings,
) -> Result<(), NotOneArm> {
    let names: Vec<&str> = training.iter().map(|s| s.name.as_str()).collect();
    let change_rad = settings.full.session_curve_sd_rad;
    models.full.as_ref().map_or(Ok(()), |full| {
        same_arm::check(arm, full, &models.base_target, &observed.all, &names, change_rad)
    })
}
