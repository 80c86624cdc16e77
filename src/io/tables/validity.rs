//! The conditions that a result is valid for: those stated in the pipeline file, and the temperatures while measuring.

use std::collections::BTreeSet;

use crate::figures::extremes;
use crate::grid::Reach;
use crate::io::tables::outcome::Outcome;
use crate::join::Station;
use crate::kinematics::Configuration;

/// The paired stations that a run learnt from.
pub(super) fn learnt_from<'a>(outcome: &'a Outcome<'_>) -> impl Iterator<Item = &'a Station> {
    let stations = outcome
        .training
        .iter()
        .flat_map(|session| &session.joined.stations);
    stations.filter(|station| !station.measured().is_empty())
}

/// Lowest and highest temperature of the stations learnt from, °C.
pub(super) fn temperatures(outcome: &Outcome<'_>) -> Option<(f64, f64)> {
    let readings = learnt_from(outcome).flat_map(Station::measured);
    let met = readings.filter_map(|reading| reading.temperature_c);
    extremes(met)
}

/// The arm configurations of the stations learnt from, in order; empty for an arm without six axes.
pub(super) fn configurations(outcome: &Outcome<'_>) -> Vec<String> {
    let error_frame = &outcome.error_frame;
    let reach = Reach::new(error_frame.arm(), *error_frame.flange_from_tool());
    let own = learnt_from(outcome).filter_map(|station| reach.configuration(&station.joints));
    let all: BTreeSet<Configuration> = own.collect();
    all.iter().map(Configuration::to_string).collect()
}

/// Lowest and highest reported angle of each joint over the stations learnt from, rad.
pub(super) fn joint_ranges(outcome: &Outcome<'_>, joints: usize) -> Vec<(f64, f64)> {
    let empty = vec![(f64::INFINITY, f64::NEG_INFINITY); joints];
    learnt_from(outcome).fold(empty, |ranges, station| {
        let widened = ranges.iter().zip(&station.joints);
        widened
            .map(|((low, high), q)| (low.min(*q), high.max(*q)))
            .collect()
    })
}
