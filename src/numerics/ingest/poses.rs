//! Poses and points: faults of a row, and conversion to the crate's units.

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};

use super::rows::RowFault;
use super::{DecodedPoses, LoggedCovariance};
use crate::geometry::PoseCovariance;

pub(super) const NOT_UNIT: &str = "quaternions_not_unit";

/// The fault of a row that has a position and, where present, a quaternion x y z w and a covariance; `None` without one.
pub(super) fn fault(
    position: [f64; 3],
    quaternion: Option<&[f64; 4]>,
    covariance: Option<&LoggedCovariance>,
) -> Option<RowFault> {
    let is_finite = covariance.is_none_or(LoggedCovariance::is_finite);
    if !is_finite || !position.iter().all(|x| x.is_finite()) {
        return Some(RowFault::Position);
    }
    let quaternion = quaternion?;
    if !quaternion.iter().all(|x| x.is_finite()) {
        return Some(RowFault::Orientation);
    }
    // A missing reflector is logged as all zeros; the join has to see and count it.
    let reads_something = position.iter().any(|&x| x != 0.0);
    let zero = quaternion.iter().all(|x| x.abs() < f64::MIN_POSITIVE.sqrt());
    (reads_something && zero).then_some(RowFault::ZeroQuaternion)
}

/// Makes readings that are no numbers, as some instruments log at a lost beam, the zeros that others log: the join counts them.
pub(super) fn zero_lost(block: &mut DecodedPoses) {
    for row in 0..block.positions.len() {
        if !block.positions[row].iter().any(|x| x.is_nan()) {
            continue;
        }
        block.positions[row] = [0.0; 3];
        if let Some(orientation) = block.orientations.as_mut().and_then(|all| all.get_mut(row)) {
            *orientation = [0.0; 4];
        }
        if let Some(covariance) = block.covariances.as_mut().and_then(|all| all.get_mut(row)) {
            *covariance = LoggedCovariance::Position([0.0; 9]);
        }
    }
}

pub(super) fn scale<const N: usize>(column: &mut [[f64; N]], factor: f64) {
    for x in column.as_flattened_mut() {
        *x *= factor;
    }
}

/// Normalises a quaternion and returns its norm before; a zero quaternion becomes the identity and gives `None`.
pub(super) fn normalise(quaternion: &mut [f64; 4]) -> Option<f64> {
    let largest = quaternion.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    if largest < f64::MIN_POSITIVE.sqrt() {
        *quaternion = [0.0, 0.0, 0.0, 1.0];
        return None;
    }
    // Components are scaled first: squares of very large ones overflow.
    let norm = largest * quaternion.iter().map(|x| (x / largest).powi(2)).sum::<f64>().sqrt();
    for x in quaternion.iter_mut() {
        *x /= norm;
    }
    Some(norm)
}

/// Inverts a pose: position, unit quaternion x y z w, and the covariance that is stated of it. A position of zeros stays.
pub(super) fn invert(
    position: &mut [f64; 3],
    quaternion: &mut [f64; 4],
    covariance: Option<&mut PoseCovariance>,
) {
    if position.iter().all(|&x| x == 0.0) {
        return;
    }
    let [x, y, z, w] = *quaternion;
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    let pose = Isometry3::from_parts(Vector3::from(*position).into(), turn);
    let back = turn.inverse();
    *position = (back * -Vector3::from(*position)).into();
    *quaternion = back.coords.into();
    if let Some(own) = covariance {
        *own = own.inverted(&pose);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_inverted_twice_is_itself_and_zeros_stay() {
        let (mut position, mut quaternion) = ([100.0, -20.0, 900.0], [0.5, -0.5, 0.5, 0.5]);
        let mut covariance =
            PoseCovariance { position: Some([1.0, 0.1, 0.2, 2.0, 0.3, 3.0]), turn: None };
        let before = (position, quaternion, covariance);
        invert(&mut position, &mut quaternion, Some(&mut covariance));
        // The quaternion turns axes into each other: here x to y, y to −z, z to −x, or a cycle like it; lengths stay.
        let norm = |v: [f64; 3]| Vector3::from(v).norm();
        assert!((norm(position) - norm(before.0)).abs() < 1e-9);
        assert!((Vector3::from(position) - Vector3::from(before.0)).norm() > 1.0);
        let turned = covariance.position.expect("stated");
        assert!((turned[0] + turned[3] + turned[5] - 6.0).abs() < 1e-12);
        invert(&mut position, &mut quaternion, Some(&mut covariance));
        for (a, b) in position.iter().zip(before.0) {
            assert!((a - b).abs() < 1e-9);
        }
        let own = |own: PoseCovariance| own.position.expect("stated");
        for (a, b) in own(covariance).into_iter().zip(own(before.2)) {
            assert!((a - b).abs() < 1e-12);
        }
        let mut missing = [0.0; 3];
        invert(&mut missing, &mut quaternion, None);
        assert!(missing.iter().all(|&x| x == 0.0));
    }
}
