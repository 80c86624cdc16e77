//! Placement: pairs of nominal flange and attained position → the poses of base and target, and the pairs that disagree.
//!
//! `attained = tracker_from_base · (flange · target)` with six unknowns of the base and three of the target, by
//! Gauss–Newton from Kabsch's closed form. Cauchy weights on the residual norm, their scale from the median, keep
//! wrong reflectors from affecting the fit. It is as accurate as the nominal arm (1–10 mm): enough to distinguish stations.

use nalgebra::{
    Isometry3, Matrix3, Point3, SMatrix, SVector, Translation3, UnitQuaternion, Vector3,
};

use super::dwell::median;
use crate::geometry::align;

/// Standard deviation of the target's distance from the flange, mm. With one tool orientation base and target cannot
/// be distinguished: then this prior alone decides, and the residuals do not depend on it.
const TARGET_PRIOR_MM: f64 = 300.0;
const ROUNDS: usize = 12;
/// A step below this (mm, or rad times 1000) ends the search.
const STEP_DONE: f64 = 1e-3;

/// A nominal flange (mm, base frame) and the position attained with it (mm, tracker frame).
#[derive(Debug, Clone, Copy)]
pub struct ReadingAtFlange {
    /// The nominal flange in the base frame, mm.
    pub flange: Isometry3<f64>,
    /// The target in the tracker frame, mm.
    pub attained: Vector3<f64>,
}

/// Approximate placement of base and target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// The base in the tracker frame, mm.
    pub tracker_from_base: Isometry3<f64>,
    /// The target in the flange frame, mm.
    pub target_mm: Vector3<f64>,
}

impl Placement {
    /// The predicted position of the target when the nominal flange is `flange`, in the tracker frame, mm.
    pub fn predict(&self, flange: &Isometry3<f64>) -> Vector3<f64> {
        (self.tracker_from_base * (flange * Point3::from(self.target_mm))).coords
    }

    /// Distance between prediction and measurement, mm.
    pub fn distance_mm(&self, reading: &ReadingAtFlange) -> f64 {
        (reading.attained - self.predict(&reading.flange)).norm()
    }

    /// The placement that fits most of `readings`; `None` where they do not determine it (fewer than three, or on a line).
    pub fn fit(readings: &[ReadingAtFlange]) -> Option<Self> {
        let mut placement = Self::start(readings)?;
        for _ in 0..ROUNDS {
            let scale = placement.median_mm(readings).max(0.01);
            let step = placement.step(readings, scale)?;
            placement = placement.moved(&step);
            if scaled(&step) < STEP_DONE {
                break;
            }
        }
        Some(placement)
    }

    /// Median distance over `readings`, mm.
    pub(super) fn median_mm(&self, readings: &[ReadingAtFlange]) -> f64 {
        let mut distances: Vec<f64> = readings.iter().map(|s| self.distance_mm(s)).collect();
        median(&mut distances)
    }

    /// The starting placement: Kabsch's closed form with the target at the flange.
    fn start(readings: &[ReadingAtFlange]) -> Option<Self> {
        let to: Vec<_> = readings.iter().map(|s| Point3::from(s.attained)).collect();
        let from: Vec<_> = readings
            .iter()
            .map(|s| Point3::from(s.flange.translation.vector))
            .collect();
        let tracker_from_base = align(&to, &from, &vec![1.0; to.len()])?;
        Some(Self {
            tracker_from_base,
            target_mm: Vector3::zeros(),
        })
    }

    /// The Gauss–Newton step: translation and rotation of the base, then the target.
    fn step(&self, readings: &[ReadingAtFlange], scale_mm: f64) -> Option<SVector<f64, 9>> {
        let mut normal = SMatrix::<f64, 9, 9>::zeros();
        let mut right = SVector::<f64, 9>::zeros();
        for reading in readings {
            let (jacobian, residual) = self.row(reading);
            let weight = 1.0 / (1.0 + residual.norm_squared() / (scale_mm * scale_mm * 4.0));
            normal += jacobian.transpose() * jacobian * weight;
            right += jacobian.transpose() * residual * weight;
        }
        let pull = (scale_mm / TARGET_PRIOR_MM).powi(2);
        for axis in 0..3 {
            normal[(6 + axis, 6 + axis)] += pull;
            right[6 + axis] -= pull * self.target_mm[axis];
        }
        normal.cholesky().map(|factor| factor.solve(&right))
    }

    /// One reading's motion (mm) per unit of the base's translation (mm) and rotation (rad) and of the target (mm), and what its
    /// prediction leaves, mm.
    pub(crate) fn row(&self, reading: &ReadingAtFlange) -> (SMatrix<f64, 3, 9>, Vector3<f64>) {
        let predicted = self.predict(&reading.flange);
        let arm = predicted - self.tracker_from_base.translation.vector;
        let rotation = self.tracker_from_base.rotation.to_rotation_matrix();
        let turned = rotation.matrix() * reading.flange.rotation.to_rotation_matrix().matrix();
        let mut jacobian = SMatrix::<f64, 3, 9>::zeros();
        jacobian
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&Matrix3::identity());
        jacobian
            .fixed_view_mut::<3, 3>(0, 3)
            .copy_from(&-arm.cross_matrix());
        jacobian.fixed_view_mut::<3, 3>(0, 6).copy_from(&turned);
        (jacobian, reading.attained - predicted)
    }

    /// The placement after a step in the order of [`Self::row`].
    pub(crate) fn moved(&self, step: &SVector<f64, 9>) -> Self {
        let part = |first: usize| Vector3::new(step[first], step[first + 1], step[first + 2]);
        let base = &self.tracker_from_base;
        Self {
            tracker_from_base: Isometry3::from_parts(
                Translation3::from(base.translation.vector + part(0)),
                UnitQuaternion::from_scaled_axis(part(3)) * base.rotation,
            ),
            target_mm: self.target_mm + part(6),
        }
    }
}

/// The largest component of a step, mm; angles count as the motion at a distance of one metre.
fn scaled(step: &SVector<f64, 9>) -> f64 {
    let reach_mm = |index: usize| if (3..6).contains(&index) { 1000.0 } else { 1.0 };
    (0..9)
        .map(|i| step[i].abs() * reach_mm(i))
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::isometry_from_rpy;

    fn readings(truth: &Placement) -> Vec<ReadingAtFlange> {
        let flange = |k: i32| {
            let t = f64::from(k);
            let place = [
                700.0 * (t * 0.9).sin(),
                500.0 * (t * 1.7).cos(),
                40.0 * (t * 2.3).sin() * t,
            ];
            isometry_from_rpy(place, [t * 0.7, (t * 1.3).sin(), t * 0.4])
        };
        let reading = |k| ReadingAtFlange {
            flange: flange(k),
            attained: truth.predict(&flange(k)),
        };
        (0..20).map(reading).collect()
    }

    #[test]
    fn base_and_a_far_target_are_found_in_spite_of_wrong_reflectors() {
        let truth = Placement {
            tracker_from_base: isometry_from_rpy([2000.0, -500.0, 300.0], [0.1, -0.2, 2.0]),
            target_mm: Vector3::new(250.0, -100.0, 180.0),
        };
        let mut seen = readings(&truth);
        for wrong in [2, 7, 13] {
            seen[wrong].attained.z += 300.0;
        }
        let found = Placement::fit(&seen).expect("twenty poses");
        assert!(
            (found.target_mm - truth.target_mm).norm() < 0.1,
            "{}",
            found.target_mm
        );
        assert!(found.median_mm(&seen) < 0.1);
    }

    #[test]
    fn with_one_orientation_the_distances_are_still_right() {
        let truth = Placement {
            tracker_from_base: isometry_from_rpy([100.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
            target_mm: Vector3::new(0.0, 0.0, 90.0),
        };
        let mut seen = readings(&truth);
        for reading in &mut seen {
            reading.flange.rotation = UnitQuaternion::identity();
            reading.attained = truth.predict(&reading.flange);
        }
        let found = Placement::fit(&seen).expect("twenty places");
        assert!(found.median_mm(&seen) < 1e-3);
    }
}
