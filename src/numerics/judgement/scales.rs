//! The scale of each training session, and its effect on verdicts where a scale is named.

use super::JoinedSession;
use super::StageSettings;
use super::observed::Observed;
use crate::fit::Models;
use crate::fit::scale::SessionScale;
use crate::grid::{Grids, Verdict};
use crate::report::Accuracy;

/// The scales of all training sessions, in their order.
pub(super) fn scales(
    observed: &Observed,
    models: &Models,
    training: &[JoinedSession],
    settings: &StageSettings,
) -> Vec<SessionScale> {
    let evidence = models.full.as_ref().and_then(|full| full.scale_evidence());
    let free = evidence.and_then(|evidence| evidence.free_scales(settings.fit.length_tolerance_mm));
    let scale = |(place, session): (usize, &JoinedSession)| SessionScale {
        session: session.name.clone(),
        stations: observed.of_session(place).count(),
        prior_sd_ppm: settings.full.session_scale_ppm,
        fitted: models.full.as_ref().and_then(|full| full.fitted_scale(place)),
        length_sd_mm: settings.fit.length_tolerance_mm,
        free: free.as_ref().map(|free| free[place]),
    };
    training.iter().enumerate().map(scale).collect()
}

/// The reason why no position is shown to be right: the sessions whose scale is named; `None` where none is.
pub fn named(scales: &[SessionScale]) -> Option<String> {
    let named: Vec<String> = scales.iter().filter_map(SessionScale::named).collect();
    (!named.is_empty()).then(|| named.join("; "))
}

/// Withdraws every verdict that positions are right, where a scale is named: all of them were measured in its unit.
pub(super) fn withhold<'v>(
    scales: &[SessionScale],
    grids: &mut Grids,
    accuracy: impl Iterator<Item = &'v mut Accuracy>,
) {
    let Some(reason) = named(scales) else { return };
    let judged = grids.judged.iter_mut().map(|row| &mut row.verdict);
    let verdicts = judged.chain([&mut grids.choice.verdict]);
    for verdict in verdicts.chain(accuracy.map(|figure| &mut figure.verdict)) {
        if *verdict == Verdict::Meets {
            *verdict = Verdict::NotShown(reason.clone());
        }
    }
}
