//! The size of the covariances that readings state of themselves, found in the sessions that train and used in all.
//!
//! A session that does not determine the size of a source has the mean of those that do, and so has a session that only judges: its own
//! residuals would flatter what judges it.

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use super::JoinedSession;
use super::observed::observations_of;
use super::{StageError, StageSettings};
use crate::fit::observation::stated_of;
use crate::fit::stated_size::{self, FoundSize};
use crate::fit::{self, Freedom, Observation, SourceId, StatedSize, TargetId};
use crate::join::Station;
use crate::kinematics::Arm;

/// Fits of the geometry from which the sizes follow: they change its weights.
const ROUNDS: usize = 2;

/// A reading: its session, station, source and target.
type Place = (usize, usize, SourceId, TargetId);

/// Finds the sizes and gives them to the sessions; none where no reading states a covariance, and of cameras, whose own size covers what
/// their readings state.
pub(super) fn sized(
    arm: &Arm,
    training: &mut [JoinedSession],
    test: &mut [JoinedSession],
    settings: &StageSettings,
) -> Result<Vec<FoundSize>, StageError> {
    let stated = stated(training, settings);
    let mut found = Vec::new();
    if stated.is_empty() {
        return Ok(found);
    }
    let of = |own: &Observation| {
        let place = (own.session, own.station, own.source, own.target);
        stated.get(&place).cloned()
    };
    for _ in 0..ROUNDS {
        let seen = observations_of(arm, &*training, settings);
        let geometric =
            fit::identify(arm, &seen, training.len(), Freedom::Geometry, &settings.fit)?;
        let sizes: Vec<Vec<StatedSize>> =
            training.iter().map(|own| own.stated_sizes.clone()).collect();
        found = stated_size::found(arm, &seen, &geometric, of, |own: &Observation| {
            let own = sizes[own.session].get(own.source.0).copied();
            own.unwrap_or(StatedSize::ONE)
        });
        give(training, test, settings, &found);
    }
    Ok(found)
}

/// What each reading of another instrument than a camera states, as its rows have it.
fn stated(training: &[JoinedSession], settings: &StageSettings) -> BTreeMap<Place, DMatrix<f64>> {
    let of_session = |(session, own): (usize, &JoinedSession)| {
        let of_station = |station: &Station| {
            let readings = station.measured().iter();
            let own = readings.filter_map(|reading| {
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

/// Gives each session the sizes of its sources.
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
