//! Placement: pairs of nominal flange and attained position → the poses of base and target, and the pairs that disagree.
//!
//! `attained = tracker_from_base · (flange · target)` with six unknowns of the base and three of the target, by
//! Gauss–Newton from Kabsch's closed form. Cauchy weights on the residual norm, their scale from the median, keep
//! wrong reflectors from affecting the fit. It is as accurate as the nominal arm (1–10 mm): enough to distinguish stations.

use nalgebra::{
    Isometry3, Matrix3, Point3, SMatrix, SVector, Translation3, UnitQuaternion, Vector3,
};

use super::average::median;
use crate::geometry::align;

/// Standard deviation of the target's distance from the flange, mm. With one tool orientation base and target cannot
/// be distinguished: then this prior alone decides, and the residuals do not depend on it.
const TARGET_PRIOR_MM: f64 = 300.0;
const ROUNDS: usize = 12;
/// A nominal arm is off by less than this, mm: a placement that leaves more is a wrong one.
pub const NOMINAL_MM: f64 = 30.0;
/// Distances of far targets from the flange, mm.
const FAR_MM: [f64; 3] = [150.0, 400.0, 1000.0];
/// Readings that far targets are looked for with, at most.
const FAR_READINGS: usize = 100;
/// Starts that are followed, of the best, and for how many rounds.
const FAR_STARTS: usize = 6;
const FAR_ROUNDS: usize = 50;
/// A step below this (mm, or rad times 1000) ends the search.
const STEP_DONE: f64 = 1e-3;

/// A nominal flange (mm, base frame) and the position attained with it (mm, tracker frame).
#[derive(Debug, Clone, Copy)]
pub struct ReadingAtFlange {
    pub flange: Isometry3<f64>,
    pub attained: Vector3<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    pub tracker_from_base: Isometry3<f64>,
    pub target_mm: Vector3<f64>,
}

impl Placement {
    /// The predicted position of the target when the nominal flange is `flange`, in the tracker frame, mm.
    pub fn predict(&self, flange: &Isometry3<f64>) -> Vector3<f64> {
        (self.tracker_from_base * (flange * Point3::from(self.target_mm))).coords
    }

    pub fn distance_mm(&self, reading: &ReadingAtFlange) -> f64 {
        (reading.attained - self.predict(&reading.flange)).norm()
    }

    /// The placement that fits most of `readings`; `None` where they do not determine it (fewer than three, or on a line).
    pub fn fit(readings: &[ReadingAtFlange]) -> Option<Self> {
        Self::start(readings, Vector3::zeros())?.refined(readings, ROUNDS)
    }

    /// The placement that fits most of `readings`, wherever the target sits: [`Self::fit`] starts with it at the flange, from where a
    /// target further away than the flange moves is not always reached. Where that leaves more than a nominal arm is off by, targets in
    /// all directions and at three distances are starts too.
    pub fn fit_far(readings: &[ReadingAtFlange]) -> Option<Self> {
        let near = Self::fit(readings);
        if near.is_some_and(|near| near.median_mm(readings) <= NOMINAL_MM) {
            return near;
        }
        let stride = readings.len().div_ceil(FAR_READINGS).max(1);
        let spread: Vec<ReadingAtFlange> = readings.iter().step_by(stride).copied().collect();
        let mut starts: Vec<Self> =
            far_targets().filter_map(|target| Self::start(&spread, target)).collect();
        starts.sort_by(|a, b| a.median_mm(&spread).total_cmp(&b.median_mm(&spread)));
        let far = starts.into_iter().take(FAR_STARTS);
        let far =
            far.filter_map(|start| start.refined(&spread, FAR_ROUNDS)?.refined(readings, ROUNDS));
        let median_mm = |placement: &Self| placement.median_mm(readings);
        near.into_iter().chain(far).min_by(|a, b| median_mm(a).total_cmp(&median_mm(b)))
    }

    /// The placement after at most so many rounds.
    fn refined(mut self, readings: &[ReadingAtFlange], rounds: usize) -> Option<Self> {
        for _ in 0..rounds {
            let scale = self.median_mm(readings).max(0.01);
            let step = self.step(readings, scale)?;
            self = self.moved(&step);
            if scaled(&step) < STEP_DONE {
                break;
            }
        }
        Some(self)
    }

    pub fn median_mm(&self, readings: &[ReadingAtFlange]) -> f64 {
        let mut distances: Vec<f64> = readings.iter().map(|s| self.distance_mm(s)).collect();
        median(&mut distances)
    }

    /// The starting placement: Kabsch's closed form with the target at this place.
    fn start(readings: &[ReadingAtFlange], target_mm: Vector3<f64>) -> Option<Self> {
        let to: Vec<_> = readings.iter().map(|s| Point3::from(s.attained)).collect();
        let from: Vec<_> = readings.iter().map(|s| s.flange * Point3::from(target_mm)).collect();
        let tracker_from_base = align(&to, &from, &vec![1.0; to.len()])?;
        Some(Self { tracker_from_base, target_mm })
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
        jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
        jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&-arm.cross_matrix());
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

/// Places to look for a far target: along the axes, the diagonals of faces and of the cube, at three distances, mm.
fn far_targets() -> impl Iterator<Item = Vector3<f64>> {
    let directions = (0..27).map(|number| Vector3::new(number % 3, number / 3 % 3, number / 9));
    let directions = directions.map(|own| own.map(|index| f64::from(index) - 1.0));
    let directions = directions.filter_map(|own| own.try_normalize(0.0));
    directions.flat_map(|direction| FAR_MM.map(|mm| direction * mm))
}

/// The largest component of a step, mm; angles count as the motion at a distance of one metre.
fn scaled(step: &SVector<f64, 9>) -> f64 {
    let reach_mm = |index: usize| if (3..6).contains(&index) { 1000.0 } else { 1.0 };
    (0..9).map(|i| step[i].abs() * reach_mm(i)).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::isometry_from_rpy;

    fn readings(truth: &Placement) -> Vec<ReadingAtFlange> {
        let flange = |k: i32| {
            let t = f64::from(k);
            let place =
                [700.0 * (t * 0.9).sin(), 500.0 * (t * 1.7).cos(), 40.0 * (t * 2.3).sin() * t];
            isometry_from_rpy(place, [t * 0.7, (t * 1.3).sin(), t * 0.4])
        };
        let reading =
            |k| ReadingAtFlange { flange: flange(k), attained: truth.predict(&flange(k)) };
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
        assert!((found.target_mm - truth.target_mm).norm() < 0.1, "{}", found.target_mm);
        assert!(found.median_mm(&seen) < 0.1);
    }

    #[test]
    fn a_target_further_away_than_the_flange_moves_is_found() {
        // Two axes that cross: the flange stays on a circle of 475 mm, the target is 834 mm from it.
        let truth = Placement {
            tracker_from_base: isometry_from_rpy([500.0, -600.0, 900.0], [2.2, 0.3, -0.9]),
            target_mm: Vector3::new(177.0, -636.0, 509.0),
        };
        let reading = |k: i32| {
            let (tilt, turn) = (0.5 * (f64::from(k) * 0.7).sin(), 0.31 * f64::from(k));
            let flange = isometry_from_rpy([0.0; 3], [-1.6, 0.0, tilt])
                * isometry_from_rpy([0.0, 0.0, -475.0], [0.0, 0.0, turn]);
            ReadingAtFlange { attained: truth.predict(&flange), flange }
        };
        let seen: Vec<ReadingAtFlange> = (0..60).map(reading).collect();
        let found = Placement::fit_far(&seen).expect("sixty poses");
        assert!(found.median_mm(&seen) < 0.1, "{}", found.median_mm(&seen));
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
