//! Poses and points: faults of a row, and conversion to the crate's units.

use super::rows::RowFault;

/// The count of quaternions that were not of unit length.
pub(super) const NOT_UNIT: &str = "quaternions_not_unit";

/// The fault of a row that has a position and, where present, a quaternion x y z w and a covariance; `None` without one.
pub(super) fn fault(
    position: [f64; 3],
    quaternion: Option<&[f64; 4]>,
    covariance: Option<&[f64; 6]>,
) -> Option<RowFault> {
    let mut numbers = position.iter().chain(covariance.into_iter().flatten());
    if !numbers.all(|x| x.is_finite()) {
        return Some(RowFault::Position);
    }
    let quaternion = quaternion?;
    if !quaternion.iter().all(|x| x.is_finite()) {
        return Some(RowFault::Orientation);
    }
    // A missing reflector is logged as all zeros; the join has to see and count it.
    let reads_something = position.iter().any(|&x| x != 0.0);
    let zero = quaternion
        .iter()
        .all(|x| x.abs() < f64::MIN_POSITIVE.sqrt());
    (reads_something && zero).then_some(RowFault::ZeroQuaternion)
}

/// Multiplies every number of a column.
pub(super) fn scale<const N: usize>(column: &mut [[f64; N]], factor: f64) {
    for x in column.as_flattened_mut() {
        *x *= factor;
    }
}

/// Normalises the quaternions; returns how many had a norm that differs from 1 by more than a thousandth.
pub(super) fn normalise_all(column: &mut [[f64; 4]]) -> u64 {
    let norms = column.iter_mut().filter_map(normalise);
    norms.filter(|norm| (norm - 1.0).abs() > 1e-3).count() as u64
}

/// Normalises a quaternion and returns its norm before; a zero quaternion becomes the identity and gives `None`.
fn normalise(quaternion: &mut [f64; 4]) -> Option<f64> {
    let largest = quaternion
        .iter()
        .fold(0.0_f64, |largest, x| largest.max(x.abs()));
    if largest < f64::MIN_POSITIVE.sqrt() {
        *quaternion = [0.0, 0.0, 0.0, 1.0];
        return None;
    }
    // Components are scaled first: squares of very large ones overflow.
    let norm = largest
        * quaternion
            .iter()
            .map(|x| (x / largest).powi(2))
            .sum::<f64>()
            .sqrt();
    for x in quaternion.iter_mut() {
        *x /= norm;
    }
    Some(norm)
}
