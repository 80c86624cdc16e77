//! Repairs of joints that the pipeline file states, held against the sessions' dates.

use super::JoinedSession;
use super::{StageError, StageSettings};
use crate::units::WallTime;

/// The settings with those repairs that a session which trains came after: one that is still to come changes nothing. An error where a
/// session has no date, or where one that judges is from before a repair, when the joint was another.
pub(super) fn told(
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
        let dated = training.iter().zip(&days);
        let before = dated.filter(|(_, day)| repair.is_to_come(**day));
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
