//! The settling time: the time from the arm's arrival until the target no longer vibrates, found from the readings themselves.
//!
//! 1. In each matched dwell the later half of the readings gives a median and a usual distance from it.
//! 2. The distances of the earlier readings, in units of that usual distance, are sorted by their age after arrival.
//! 3. The time is the age from which their median over all dwells is no more than half again the usual distance.
//!
//! Without vibration it is 0, and no reading is left out for it.

use nalgebra::Vector3;

use super::JoinError;
use super::average::median;
use super::observe::Observation;
use super::pattern::{Pair, Relation};
use super::readings::Readings;

/// Distance at which the target has settled, in usual distances: a vibration of half the usual scatter hides in the mean.
const SETTLED: f64 = 1.5;
const MIN_READINGS: usize = 8;
/// Least step of ages, s; otherwise the interval of readings.
const LEAST_AGE_STEP_S: f64 = 0.02;
/// Longest settling time, s: motion after it is drift.
const LONGEST_S: f64 = 2.0;

/// The settling time in s, by the dwells of `pairs`.
pub(super) fn settling_s(
    seen: &Observation,
    readings: &Readings<'_>,
    pairs: &[Pair],
    relation: Relation,
) -> Result<f64, JoinError> {
    let step_s = seen.sampling_s[1].max(LEAST_AGE_STEP_S);
    let mut by_age: Vec<Vec<f64>> = Vec::new();
    for pair in pairs {
        let (arm, target) = (&seen.arm[pair.arm], &seen.target[pair.target]);
        let Some(arrived_s) = arm.span.arrived_s else { continue };
        let arrived_s = relation.to_tracker(arrived_s);
        let readings = readings.of(target.stretch)?;
        let time_s = |row| readings.stamp(row).since_s(seen.first_measured);
        let times_s: Vec<f64> = readings.measured().map(time_s).collect();
        let position = |row| Vector3::from(readings.position(row));
        let positions: Vec<_> = readings.measured().map(position).collect();
        for (age_s, ratio) in early_ratios(&times_s, &positions, arrived_s) {
            let Some(bin) = age_bin(age_s, step_s) else { continue };
            if by_age.len() <= bin {
                by_age.resize_with(bin + 1, Vec::new);
            }
            by_age[bin].push(ratio);
        }
    }
    // An age at which few dwells have a reading is skipped; the next one decides.
    let most = by_age.iter().map(Vec::len).max().unwrap_or(0);
    let rings = |ratios: &mut Vec<f64>| 2 * ratios.len() < most || median(ratios) > SETTLED;
    let settled = by_age.iter_mut().position(|ratios| !rings(ratios)).unwrap_or(0);
    let sparse = (0..settled).all(|bin| 2 * by_age[bin].len() < most);
    Ok(if sparse { 0.0 } else { settled as f64 * step_s })
}

/// Age (s) and distance, in usual distances, of each reading in the earlier half of a dwell.
fn early_ratios(times_s: &[f64], positions: &[Vector3<f64>], arrived_s: f64) -> Vec<(f64, f64)> {
    if times_s.len() < MIN_READINGS {
        return Vec::new();
    }
    let (early, late) = positions.split_at(positions.len() / 2);
    let axis = |axis: usize| median(&mut late.iter().map(|p| p[axis]).collect::<Vec<f64>>());
    let middle = Vector3::new(axis(0), axis(1), axis(2));
    let distance = |position: &Vector3<f64>| (position - middle).norm();
    let usual_mm = median(&mut late.iter().map(distance).collect::<Vec<f64>>());
    if usual_mm <= 0.0 {
        return Vec::new();
    }
    let ratio = |(time_s, position): (&f64, _)| (time_s - arrived_s, distance(position) / usual_mm);
    times_s.iter().zip(early).map(ratio).collect()
}

fn age_bin(age_s: f64, step_s: f64) -> Option<usize> {
    let whole = (age_s / step_s).floor();
    if !(0.0..LONGEST_S / step_s).contains(&whole) {
        return None;
    }
    usize::try_from(crate::units::round_ns(whole)).ok()
}
