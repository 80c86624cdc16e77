//! The mean of a dwell: readings → position, orientation, scatter, and the outliers among the readings.
//!
//! A reading is an outlier when it is further from the median than `mad_factor` standard deviations on any axis, the
//! standard deviation being 1.4826 times the median absolute deviation. Orientations: the barycentre on SO(3) of the
//! readings kept, by Newton's steps in the tangent plane (the Karcher mean).

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::figures::median_in_place;

/// Readings that agree within this are never outliers, mm: instruments write whole micrometres.
const RESOLUTION_MM: f64 = 2e-3;

/// Whether each of `positions` (mm) belongs to the dwell: `true` kept, `false` an outlier.
///
/// `usual_mm` is the session's usual standard deviation per axis: the few readings of one dwell can agree by chance.
pub fn kept(positions: &[[f64; 3]], mad_factor: f64, usual_mm: [f64; 3]) -> Vec<bool> {
    let mut keep = vec![true; positions.len()];
    for axis in 0..3 {
        let mut values: Vec<f64> = positions.iter().map(|position| position[axis]).collect();
        let middle = median(&mut values);
        let own_mm = robust_sigma(&mut values);
        let reach = mad_factor * own_mm.max(usual_mm[axis]).max(RESOLUTION_MM);
        for (keep, position) in keep.iter_mut().zip(positions) {
            *keep &= (position[axis] - middle).abs() <= reach;
        }
    }
    keep
}

/// Factor from a median absolute deviation to a standard deviation.
pub const SIGMA_PER_MAD: f64 = 1.4826;

/// The median; 0 of nothing. Reorders `values`.
pub fn median(values: &mut [f64]) -> f64 {
    median_in_place(values).unwrap_or(0.0)
}

/// Standard deviation from the median absolute deviation. Overwrites `values`.
pub(super) fn robust_sigma(values: &mut [f64]) -> f64 {
    let middle = median(values);
    for value in values.iter_mut() {
        *value = (*value - middle).abs();
    }
    SIGMA_PER_MAD * median(values)
}

/// Root mean square norm of vectors without their mean.
pub(crate) fn centred_rms(vectors: &[Vector3<f64>]) -> f64 {
    let n = vectors.len().max(1) as f64;
    let mean = vectors.iter().sum::<Vector3<f64>>() / n;
    let squares: f64 = vectors.iter().map(|own| (own - mean).norm_squared()).sum();
    (squares / n).sqrt()
}

/// Mean and standard deviation (n − 1) per axis, mm. Needs two positions or more.
pub(super) fn mean_and_scatter(positions: &[Vector3<f64>]) -> (Vector3<f64>, Vector3<f64>) {
    let count = positions.len() as f64;
    let mean =
        positions[0] + positions.iter().map(|p| p - positions[0]).sum::<Vector3<f64>>() / count;
    let squares =
        positions.iter().map(|p| (p - mean).component_mul(&(p - mean))).sum::<Vector3<f64>>();
    (mean, (squares / (count - 1.0)).map(f64::sqrt))
}

/// Mean orientation and the root mean square (n − 1) per axis of the rotation vectors from it, rad.
///
/// `None` when a quaternion is no rotation (zero length). Needs two orientations or more.
pub fn mean_orientation(quaternions: &[[f64; 4]]) -> Option<(UnitQuaternion<f64>, f64)> {
    let orientations: Vec<_> = quaternions.iter().map(unit).collect::<Option<_>>()?;
    let count = orientations.len() as f64;
    let mut mean = orientations[0];
    for _ in 0..20 {
        let step = rotation_vectors(&orientations, &mean).sum::<Vector3<f64>>() / count;
        mean *= UnitQuaternion::from_scaled_axis(step);
        if step.norm() < 1e-14 {
            break;
        }
    }
    let squares: f64 = rotation_vectors(&orientations, &mean).map(|v| v.norm_squared()).sum();
    Some((mean, (squares / (3.0 * (count - 1.0))).sqrt()))
}

/// A stated quaternion x y z w as a rotation; `None` for one of zero length.
pub fn unit(xyzw: &[f64; 4]) -> Option<UnitQuaternion<f64>> {
    UnitQuaternion::try_new(Quaternion::new(xyzw[3], xyzw[0], xyzw[1], xyzw[2]), 1e-6)
}

fn rotation_vectors(
    orientations: &[UnitQuaternion<f64>],
    mean: &UnitQuaternion<f64>,
) -> impl Iterator<Item = Vector3<f64>> {
    orientations.iter().map(|orientation| (mean.inverse() * orientation).scaled_axis())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_far_reading_of_seven_is_an_outlier() {
        let x = [1.00, 1.01, 0.99, 1.02, 0.98, 1.00, 1.30];
        let positions = x.map(|x| [x, 5.0, -3.0]);
        // Median 1.00, deviations 0 0 0.01 0.01 0.02 0.02 0.30: σ = 1.4826 · 0.01, and 6 σ = 0.09.
        let keep = kept(&positions, 6.0, [0.0; 3]);
        assert_eq!(keep, [true, true, true, true, true, true, false]);
        // A session that usually scatters by 0.06 has 0.30 within its 6 σ.
        assert!(kept(&positions, 6.0, [0.06; 3]).iter().all(|&keep| keep));
    }

    #[test]
    fn mean_and_scatter_by_hand() {
        let positions = [1.0, 2.0, 6.0].map(|x| Vector3::new(x, 10.0, -x));
        let (mean, scatter) = mean_and_scatter(&positions);
        assert!((mean - Vector3::new(3.0, 10.0, -3.0)).norm() < 1e-12);
        // Squares 4 + 1 + 9 = 14 over n − 1 = 2.
        assert!((scatter - Vector3::new(7.0_f64.sqrt(), 0.0, 7.0_f64.sqrt())).norm() < 1e-12);
    }

    #[test]
    fn orientations_of_either_sign_average_on_the_sphere() {
        let about_z = |angle: f64, sign: f64| {
            [0.0, 0.0, sign * (angle / 2.0).sin(), sign * (angle / 2.0).cos()]
        };
        // q and −q are one orientation: 0.1, 0.2 and 0.3 about z average to 0.2, a tenth away each.
        let quaternions = [about_z(0.1, 1.0), about_z(0.2, -1.0), about_z(0.3, 1.0)];
        let (mean, scatter) = mean_orientation(&quaternions).expect("rotations");
        assert!((mean.angle() - 0.2).abs() < 1e-12);
        // Squares 0.01 + 0 + 0.01 over three axes and n − 1 = 2.
        assert!((scatter - (0.02_f64 / 6.0).sqrt()).abs() < 1e-12);
        assert!(mean_orientation(&[[0.0; 4], [0.0; 4]]).is_none());
    }
}
