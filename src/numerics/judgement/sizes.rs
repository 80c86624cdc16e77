//! Sizes that training sessions show: of a camera's noise, of the covariances that readings state, and each session's scale.
//!
//! A session that does not determine the size of a source has the mean of those that do, and so has a session that only judges: its own
//! residuals would flatter what judges it.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::DMatrix;

use super::observed::{Observed, observations_of};
use super::{JoinedSession, StageError, StageSettings};
use crate::fit::camera_size::{self, CameraSize};
use crate::fit::observation::stated_of;
use crate::fit::scale::SessionScale;
use crate::fit::stated_size::{self, FoundSize};
use crate::fit::{self, Freedom, Models, Observation, SourceId, StatedSize, TargetId, Uncertainty};
use crate::grid::{Grids, Verdict};
use crate::join::Station;
use crate::kinematics::Arm;
use crate::report::Accuracy;

/// The size of the camera's noise in the sessions that train, and the settings with it; those of other instruments as they are.
pub(super) fn camera(
    arm: &Arm,
    training: &[JoinedSession],
    settings: &StageSettings,
) -> Result<(StageSettings, Option<CameraSize>), StageError> {
    let mut settings = settings.clone();
    if settings.noise.sources.iter().all(|own| own.uncertainty.camera().is_none()) {
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

/// Fits of the geometry from which the sizes follow: they change its weights.
const ROUNDS: usize = 2;

/// A reading: its session, station, source and target.
type Place = (usize, usize, SourceId, TargetId);

/// Finds the sizes and gives them to the sessions; none where no reading states a covariance, and of cameras, whose own size covers what
/// their readings state.
pub(super) fn stated(
    arm: &Arm,
    training: &mut [JoinedSession],
    test: &mut [JoinedSession],
    settings: &StageSettings,
) -> Result<Vec<FoundSize>, StageError> {
    let stated = stated_by(training, settings);
    let mut found = Vec::new();
    if stated.is_empty() {
        return Ok(found);
    }
    let of = |own: &Observation| {
        stated.get(&(own.session, own.station, own.source, own.target)).cloned()
    };
    for _ in 0..ROUNDS {
        let seen = observations_of(arm, &*training, settings);
        let geometric =
            fit::identify(arm, &seen, training.len(), Freedom::Geometry, &settings.fit)?;
        let sizes: Vec<Vec<StatedSize>> =
            training.iter().map(|own| own.stated_sizes.clone()).collect();
        found = stated_size::found(arm, &seen, &geometric, of, |own: &Observation| {
            sizes[own.session].get(own.source.0).copied().unwrap_or(StatedSize::ONE)
        });
        give(training, test, settings, &found);
    }
    Ok(found)
}

/// What each reading of another instrument than a camera states, as its rows have it.
fn stated_by(
    training: &[JoinedSession],
    settings: &StageSettings,
) -> BTreeMap<Place, DMatrix<f64>> {
    let of_session = |(session, own): (usize, &JoinedSession)| {
        let of_station = |station: &Station| {
            let own = station.measured().iter().filter_map(|reading| {
                let source = settings.noise.sources.get(reading.source.0)?;
                let place = (session, station.number, reading.source, reading.target);
                Some((place, stated_of(reading, source)?))
            });
            own.collect::<Vec<_>>()
        };
        own.joined.stations.iter().flat_map(of_station).collect::<Vec<_>>()
    };
    training.iter().enumerate().flat_map(of_session).collect()
}

fn give(
    training: &mut [JoinedSession],
    test: &mut [JoinedSession],
    settings: &StageSettings,
    found: &[FoundSize],
) {
    let sources = (0..settings.noise.sources.len()).map(SourceId);
    let means: Vec<StatedSize> =
        sources.map(|source| stated_size::mean(found, source).unwrap_or(StatedSize::ONE)).collect();
    for (place, session) in training.iter_mut().enumerate() {
        session.stated_sizes.clone_from(&means);
        for own in found.iter().filter(|own| own.session == place) {
            session.stated_sizes[own.source.0] = own.size;
        }
    }
    for session in test {
        session.stated_sizes.clone_from(&means);
    }
}

/// The instruments of length of a session.
fn lengths(observed: &Observed, place: usize) -> BTreeSet<SourceId> {
    let own = observed.of_session(place).map(|(own, _)| own);
    own.filter(|own| own.measured.length().is_some()).map(|own| own.source).collect()
}

/// The scales of all training sessions, in their order.
pub(super) fn scales(
    observed: &Observed,
    models: &Models,
    training: &[JoinedSession],
    settings: &StageSettings,
) -> Vec<SessionScale> {
    let evidence = models.full.as_ref().and_then(|full| full.trained.scale_evidence.as_ref());
    let free = evidence.and_then(|evidence| evidence.free_scales(settings.fit.length_tolerance_mm));
    let scale = |(place, session): (usize, &JoinedSession)| SessionScale {
        session: session.name.clone(),
        stations: observed.of_session(place).count(),
        lengths: lengths(observed, place)
            .into_iter()
            .map(|own| settings.fit.source_name(own))
            .collect(),
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
