//! Stations of a session that judges which trained under another name: a copied log, or a table that holds rows of another.
//!
//! No two dwells give the same joints and the same reading to the last bit by chance more than now and then, and only where both are rounded
//! coarsely. Halves of one table, and sessions of a pool that are left out in turn, share no station with those that train.

use std::collections::{BTreeSet, HashMap};

use super::JoinedSession;
use super::StageError;
use crate::join::{Reading, Station};

/// Fewest equal stations that show a copy.
const COPIED: usize = 3;

/// Refuses a session that judges with stations that train.
pub(super) fn check(training: &[JoinedSession], test: &[JoinedSession]) -> Result<(), StageError> {
    let mut trained: HashMap<Vec<u64>, &str> = HashMap::new();
    for session in training {
        let measured = session.joined.stations.iter().filter_map(bits);
        trained.extend(measured.map(|own| (own, session.name.as_str())));
    }
    for session in test {
        let measured: Vec<_> = session.joined.stations.iter().filter_map(bits).collect();
        let copies = measured.iter().filter_map(|own| trained.get(own).copied());
        let copies: Vec<&str> = copies.collect();
        if copies.len() >= COPIED {
            let of: BTreeSet<&str> = copies.iter().copied().collect();
            return Err(StageError::Copied {
                session: session.name.clone(),
                of: of.into_iter().collect::<Vec<_>>().join(", "),
                copies: copies.len(),
                stations: measured.len(),
            });
        }
    }
    Ok(())
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
