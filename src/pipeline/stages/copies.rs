//! Stations of a session that judges which trained under another name: a copied log, or a table that holds rows of another.
//!
//! No two dwells give the same joints and the same reading to the last bit by chance more than now and then, and only where both are rounded
//! coarsely. Halves of one table, and sessions of a pool that are left out in turn, share no station with those that train.

use std::collections::{BTreeSet, HashMap};

use super::StageError;
use crate::io::tables::outcome::JoinedSession;
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

/// Joint angles and readings of a station, bit by bit; `None` of one without a reading.
fn bits(station: &Station) -> Option<Vec<u64>> {
    let readings = station.measured().iter().flat_map(values);
    let readings: Vec<f64> = readings.collect();
    let all = station.joints.iter().chain(&readings);
    (!readings.is_empty()).then(|| all.map(|value| value.to_bits()).collect())
}

/// The numbers that an instrument read, without what it states of them.
fn values(reading: &Reading) -> Vec<f64> {
    let position = reading.position().into_iter();
    let position = position.flat_map(|position| <[f64; 3]>::from(position.coords));
    let turn = reading.orientation().into_iter();
    let turn = turn.flat_map(|turn| <[f64; 4]>::from(turn.coords));
    let length = reading.value.length().map(|length| length.mm);
    position.chain(turn).chain(length).collect()
}
