//! Whether sessions fit together, and what is stated of them: one source of positions in each, no copies among those that judge, dates
//! around repairs, one arm.

use std::collections::HashMap;

use nalgebra::{Isometry3, Point3};

use super::observed::Observed;
use super::{JoinedSession, StageError, StageSettings};
use crate::figures::median;
use crate::fit::Models;
use crate::fit::same_arm::{self, NotOneArm};
use crate::geometry::align;
use crate::join::{Station, one_source};
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

/// Fewest equal stations that show a copy, and fewest that are equal once they are moved as one.
const COPIED: [usize; 2] = [3, 10];
/// Median distance of positions that were measured once alone, mm: repeatability and an instrument leave more.
const ONE_MM: f64 = 0.005;

/// Refuses a session that judges with stations that train, be they rounded or in another frame, and one whose readings are its commands.
pub(super) fn measured_once(
    training: &[JoinedSession],
    test: &[JoinedSession],
) -> Result<(), StageError> {
    for session in test {
        training.iter().try_for_each(|trained| check_no_copy(session, trained))?;
    }
    for session in training.iter().chain(test) {
        let stations = session.joined.stations.iter();
        let pairs = stations.filter_map(|own| Some((read(own)?, own.command.as_ref()?.position)));
        if are_one(&pairs.collect::<Vec<_>>()) {
            return Err(StageError::Commanded { session: session.name.clone() });
        }
    }
    Ok(())
}

fn check_no_copy(session: &JoinedSession, trained: &JoinedSession) -> Result<(), StageError> {
    // Milliradians and micrometres: two visits of a pose differ by more, a rounded number by less.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "angles and lengths of an arm in thousandths"
    )]
    let joints = |own: &Station| own.joints.iter().map(|q| (q * 1e3).round() as i64).collect();
    let place = |own: &Station| Some((joints(own), read(own)?));
    let places: HashMap<Vec<i64>, Point3<f64>> =
        trained.joined.stations.iter().filter_map(place).collect();
    let pair = |own: &Station| Some((read(own)?, *places.get(&joints(own))?));
    let pairs: Vec<_> = session.joined.stations.iter().filter_map(pair).collect();
    let equal = pairs.iter().filter(|(own, other)| own == other).count();
    if equal < COPIED[0] && !are_one(&pairs) {
        return Ok(());
    }
    Err(StageError::Copied {
        session: session.name.clone(),
        of: trained.name.clone(),
        copies: pairs.len(),
        stations: session.joined.stations.iter().filter_map(read).count(),
    })
}

fn read(station: &Station) -> Option<Point3<f64>> {
    station.measured().first()?.position()
}

/// Whether positions and others of the same stations were measured once alone, and at most moved as one.
fn are_one(pairs: &[(Point3<f64>, Point3<f64>)]) -> bool {
    let (own, others): (Vec<_>, Vec<_>) = pairs.iter().copied().unzip();
    let moved = align(&own, &others, &vec![1.0; pairs.len()]);
    let apart = |moved: Isometry3<f64>| {
        let apart = own.iter().zip(&others).map(|(own, other)| (own - moved * other).norm());
        median(&apart.collect::<Vec<_>>())
    };
    pairs.len() >= COPIED[1] && moved.and_then(apart).is_some_and(|apart| apart < ONE_MM)
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
