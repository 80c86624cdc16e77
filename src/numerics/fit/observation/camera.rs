//! A camera's uncertainty: pixel noise of a target's corners → covariance of the measured pose.
//!
//! The corners of a flat, square target lie on a grid in the x-y plane of the target's frame, around its origin; z is the normal. They
//! are seen with independent noise on the image plane, so the covariance of the pose that fits them best is
//! `σ² (Jᵀ J)⁻¹`, J the derivative of the image points with the pose ([`crate::method::uncertainty`]). Distance, size and slant need no
//! terms of their own: the lateral part grows with d, the depth with d², the tilt of a target seen from the front with d², and a target
//! seen at grazing angle has corners that are harder to find, by the reciprocal of the cosine.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, UnitQuaternion, Vector3, Vector6};
use serde::{Deserialize, Serialize};

use crate::geometry::pose_covariance::inverted;
use crate::geometry::{PoseCovariance, symmetric};

/// A camera with a flat, square target, by numbers that its calibration and the target's drawing state.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct CameraUncertainty {
    pub focal_px: f64,
    /// Standard deviation of a corner in the image along each axis, for a target seen from the front, pixels.
    pub noise_px: f64,
    pub target_mm: f64,
    /// Number of corners along an edge: 2 for a marker, more for a board.
    #[serde(default = "marker", skip_serializing_if = "is_marker")]
    pub corners: u32,
    /// Direction in which the camera looks, in the frame of its readings: z of an optical frame. `None`: each target counts as one in the
    /// middle of the image, which is near enough for narrow lenses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub looks_along: Option<[f64; 3]>,
    #[serde(default, skip_serializing_if = "Mounted::is_fixed")]
    pub mounted: Mounted,
    /// Factor on all standard deviations, those that readings state included: 1 before it is estimated.
    #[serde(skip, default = "stated")]
    pub size: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Mounted {
    #[default]
    Fixed,
    Flange,
}

impl Mounted {
    pub const fn is_fixed(&self) -> bool {
        matches!(self, Self::Fixed)
    }
}

/// The cosine of the steepest slant that the noise is stated for: corners of a target seen at 84° and more cannot be found worse.
const LEAST_COSINE: f64 = 0.1;
/// Corners on an edge that are counted one by one; of more, the noise of each is lowered instead.
const MOST_CORNERS: u32 = 12;

const fn marker() -> u32 {
    2
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde gives a reference")]
const fn is_marker(corners: &u32) -> bool {
    *corners == marker()
}

const fn stated() -> f64 {
    1.0
}

impl CameraUncertainty {
    /// Covariance of a position, mm², in the camera's frame, of a target that faces the camera.
    pub fn covariance(&self, position: &Point3<f64>) -> Matrix3<f64> {
        let ray = along(&position.coords);
        let facing = UnitQuaternion::rotation_between(&Vector3::z(), &-ray).unwrap_or_else(|| {
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
        });
        let pose = Isometry3::from_parts(position.coords.into(), facing);
        self.of_pose(&pose).fixed_view::<3, 3>(0, 0).into_owned()
    }

    /// Covariance of a pose of the target in the camera's frame: position (mm) and rotation vector (rad), both along the camera's axes.
    pub fn of_pose(&self, camera_from_target: &Isometry3<f64>) -> Matrix6<f64> {
        let ray = along(&camera_from_target.translation.vector);
        let slant = (camera_from_target.rotation * Vector3::z()).dot(&ray).abs();
        let counted =
            f64::from(self.corners.clamp(2, MOST_CORNERS)) / f64::from(self.corners.max(2));
        let noise_px = self.size * self.noise_px * counted / slant.max(LEAST_COSINE);
        // Rotations are counted at the target's edge, so that all columns are in mm.
        let unit = Vector6::from_fn(|row, _| if row < 3 { 1.0 } else { 1.0 / self.target_mm });
        let information = self.information(camera_from_target, &self.ahead(&ray), &unit);
        let covariance =
            information.try_inverse().unwrap_or_else(Matrix6::identity) * noise_px.powi(2);
        Matrix6::from_fn(|i, j| covariance[(i, j)] * unit[i] * unit[j])
    }

    /// Covariance of a reading's pose as it is used in a fit, mm² and rad²: that of the target in the camera's frame or, of a camera on
    /// the flange, that of the camera in the target's frame. What the reading states of it, `stated`, takes the place of the camera's.
    pub fn of_reading(&self, pose: &Isometry3<f64>, stated: &PoseCovariance) -> Matrix6<f64> {
        if let Some(whole) = stated.whole() {
            return whole * self.size.powi(2);
        }
        match self.mounted {
            Mounted::Fixed => self.with_part(pose, stated),
            Mounted::Flange => {
                let camera_from_target = pose.inverse();
                inverted(&self.with_part(&camera_from_target, stated), &camera_from_target)
            }
        }
    }

    /// Covariance of a pose of the target in the camera's frame, with the part that the reading states in its place: of that nothing
    /// says how it goes with the other.
    fn with_part(
        &self,
        camera_from_target: &Isometry3<f64>,
        stated: &PoseCovariance,
    ) -> Matrix6<f64> {
        let mut covariance = self.of_pose(camera_from_target);
        let turn = match self.mounted {
            Mounted::Fixed => Matrix3::identity(),
            Mounted::Flange => *camera_from_target.rotation.to_rotation_matrix().matrix(),
        };
        let parts = [(0, stated.position.map(symmetric)), (3, stated.turn.map(|own| own.matrix()))];
        for (from, stated) in parts {
            let Some(stated) = stated else { continue };
            let stated = turn * stated * turn.transpose() * self.size.powi(2);
            covariance.fixed_view_mut::<3, 3>(from, from).copy_from(&stated);
            covariance.fixed_view_mut::<3, 3>(0, 3).fill(0.0);
            covariance.fixed_view_mut::<3, 3>(3, 0).fill(0.0);
        }
        covariance
    }

    /// Standard uncertainty of the orientation per axis of a target that is seen at 45°, rad: root mean square of the three axes.
    pub fn orientation_rad(&self, distance_mm: f64) -> f64 {
        let slanted =
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.75 * std::f64::consts::PI);
        let pose = Isometry3::from_parts(Vector3::new(0.0, 0.0, distance_mm).into(), slanted);
        (self.of_pose(&pose).fixed_view::<3, 3>(3, 3).trace() / 3.0).sqrt()
    }

    /// Normal of the image plane for a target on this ray, away from the camera.
    fn ahead(&self, ray: &Vector3<f64>) -> Vector3<f64> {
        let axis = self.looks_along.map(Vector3::from);
        let axis = axis.and_then(|axis| axis.try_normalize(0.0));
        // A target beside or behind the camera's axis is not seen: its reading has another frame than stated.
        axis.filter(|axis| axis.dot(ray) > LEAST_COSINE).unwrap_or(*ray)
    }

    /// `Jᵀ J` of the corners' image points, with columns in these units.
    fn information(
        &self,
        pose: &Isometry3<f64>,
        ahead: &Vector3<f64>,
        unit: &Vector6<f64>,
    ) -> Matrix6<f64> {
        let across = across(ahead);
        let corners = self.places_mm();
        let mut information = Matrix6::zeros();
        for (&x, &y) in corners.iter().flat_map(|x| corners.iter().map(move |y| (x, y))) {
            let lever = pose.rotation * Vector3::new(x, y, 0.0);
            let corner = pose.translation.vector + lever;
            // A target larger than its distance has corners beside the camera; those count as just before it.
            let depth = corner.dot(ahead).max(0.1 * self.target_mm);
            for axis in &across {
                let gradient =
                    (axis - ahead * (corner.dot(axis) / depth)) * (self.focal_px / depth);
                let turn = lever.cross(&gradient);
                let row = Vector6::new(gradient.x, gradient.y, gradient.z, turn.x, turn.y, turn.z);
                let row = row.component_mul(unit);
                information += row * row.transpose();
            }
        }
        information
    }

    fn places_mm(&self) -> Vec<f64> {
        let last = f64::from(self.corners.clamp(2, MOST_CORNERS) - 1);
        let place = |corner: u32| self.target_mm * (f64::from(corner) / last - 0.5);
        (0..self.corners.clamp(2, MOST_CORNERS)).map(place).collect()
    }
}

fn along(position: &Vector3<f64>) -> Vector3<f64> {
    position.try_normalize(0.0).unwrap_or_else(Vector3::z)
}

fn across(ahead: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let helper = if ahead.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let first = ahead.cross(&helper).normalize();
    [first, ahead.cross(&first)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: CameraUncertainty = CameraUncertainty {
        focal_px: 1500.0,
        noise_px: 0.2,
        target_mm: 100.0,
        corners: 2,
        looks_along: None,
        mounted: Mounted::Fixed,
        size: 1.0,
    };

    fn pose(distance_mm: f64, slant_deg: f64) -> Isometry3<f64> {
        let facing = UnitQuaternion::from_axis_angle(
            &Vector3::x_axis(),
            std::f64::consts::PI - slant_deg.to_radians(),
        );
        Isometry3::from_parts(Vector3::new(0.0, 0.0, distance_mm).into(), facing)
    }

    fn sds(distance_mm: f64, slant_deg: f64) -> Vec<f64> {
        let covariance = CAMERA.of_pose(&pose(distance_mm, slant_deg));
        covariance.diagonal().iter().map(|own| own.sqrt()).collect()
    }

    #[test]
    fn sizes_are_those_of_a_sheet_of_paper() {
        // At 1 m a pixel is 2/3 mm. The mean of four corners is off by σ d / (f √4) = 0.067 mm along each axis.
        let sd = sds(1000.0, 45.0);
        assert!((0.06..0.12).contains(&sd[0]), "{sd:?}");
        // The target is 150 pixels wide; roll by 0.2 / (√4 · 75 √2) rad.
        let front = sds(1000.0, 0.0);
        assert!((front[5] - 0.2 / (2.0 * 75.0 * 2.0_f64.sqrt())).abs() < 1e-5, "{front:?}");
        // Depth: the same size as a share of the distance.
        assert!((front[2] / 1000.0 / front[5] - 1.0).abs() < 0.01, "{front:?}");
        // The tilt of a target seen from the front shows only by perspective.
        assert!(front[3] > 5.0 * sd[3], "{front:?} {sd:?}");
    }

    #[test]
    fn depth_and_tilt_grow_with_the_square_of_the_distance() {
        let (near, far) = (sds(1000.0, 0.0), sds(2000.0, 0.0));
        assert!((far[2] / near[2] - 4.0).abs() < 0.1);
        assert!((far[3] / near[3] - 4.0).abs() < 0.1);
        assert!((far[5] / near[5] - 2.0).abs() < 0.01);
        // At grazing view corners are found worse.
        assert!(sds(1000.0, 80.0)[0] > 2.0 * sds(1000.0, 40.0)[0]);
    }

    /// Image points on the plane z = 1 of a camera that looks along the ray.
    fn image(pose: &Isometry3<f64>) -> Vec<f64> {
        let corners = [(-50.0, -50.0), (-50.0, 50.0), (50.0, -50.0), (50.0, 50.0)];
        let seen = corners.map(|(x, y)| pose * Point3::new(x, y, 0.0));
        seen.iter().flat_map(|p| [1500.0 * p.x / p.z, 1500.0 * p.y / p.z]).collect()
    }

    #[test]
    fn the_covariance_is_that_of_poses_fitted_to_noisy_corners() {
        // Independent of the formula: corners with noise, a pose fitted to them by numerical derivatives, its scatter.
        let truth = pose(800.0, 35.0);
        let moved = |by: &Vector6<f64>, from: &Isometry3<f64>| {
            let turn = UnitQuaternion::from_scaled_axis(by.fixed_rows::<3>(3).into_owned());
            Isometry3::from_parts(
                (from.translation.vector + by.fixed_rows::<3>(0)).into(),
                turn * from.rotation,
            )
        };
        let mut state = 7_u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let slant = 35.0_f64.to_radians().cos();
        let (count, mut scatter) = (4000, Matrix6::zeros());
        for _ in 0..count {
            let noise =
                (0..8).map(|_| 0.2 / slant * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0));
            let seen: Vec<f64> = image(&truth).into_iter().zip(noise).map(|(a, b)| a + b).collect();
            let mut found = truth;
            for _ in 0..4 {
                let at = image(&found);
                let column = |k: usize| {
                    let step = if k < 3 { 1e-3 } else { 1e-6 };
                    let by = Vector6::from_fn(|row, _| if row == k { step } else { 0.0 });
                    let ahead = image(&moved(&by, &found));
                    ahead.iter().zip(&at).map(|(a, b)| (a - b) / step).collect::<Vec<f64>>()
                };
                let columns: Vec<Vec<f64>> = (0..6).map(column).collect();
                let jacobian = nalgebra::DMatrix::from_fn(8, 6, |row, k| columns[k][row]);
                let off = nalgebra::DVector::from_fn(8, |row, _| seen[row] - at[row]);
                let step = jacobian.svd(true, true).solve(&off, 1e-12).expect("full rank");
                found = moved(&Vector6::from_iterator(step.iter().copied()), &found);
            }
            let off = found.translation.vector - truth.translation.vector;
            let turn = (found.rotation * truth.rotation.inverse()).scaled_axis();
            let off = Vector6::new(off.x, off.y, off.z, turn.x, turn.y, turn.z);
            scatter += off * off.transpose() / f64::from(count);
        }
        let stated = CAMERA.of_pose(&truth);
        for axis in 0..6 {
            let ratio = (scatter[(axis, axis)] / stated[(axis, axis)]).sqrt();
            assert!((ratio - 1.0).abs() < 0.05, "axis {axis}: {ratio}");
        }
        // Position and tilt are correlated as stated, too.
        let correlation = |c: &Matrix6<f64>| c[(1, 3)] / (c[(1, 1)] * c[(3, 3)]).sqrt();
        assert!((correlation(&scatter) - correlation(&stated)).abs() < 0.06);
    }

    #[test]
    fn the_covariance_of_an_inverse_is_that_of_inverted_poses() {
        let (truth, camera) =
            (pose(700.0, 30.0), CameraUncertainty { mounted: Mounted::Flange, ..CAMERA });
        let carried = camera.of_reading(&truth.inverse(), &PoseCovariance::default());
        let factor = camera.of_pose(&truth).cholesky().expect("positive").l();
        // Numerically: each column of the factor as a small motion, the change of the inverse.
        let scale = 1e-4;
        let mut found = Matrix6::zeros();
        for column in factor.column_iter() {
            let by = column * scale;
            let turn = UnitQuaternion::from_scaled_axis(by.fixed_rows::<3>(3).into_owned());
            let moved = Isometry3::from_parts(
                (truth.translation.vector + by.fixed_rows::<3>(0)).into(),
                turn * truth.rotation,
            );
            let (inverse, before) = (moved.inverse(), truth.inverse());
            let shift = (inverse.translation.vector - before.translation.vector) / scale;
            let turn = (inverse.rotation * before.rotation.inverse()).scaled_axis() / scale;
            let change = Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z);
            found += change * change.transpose();
        }
        let largest = carried.diagonal().map(f64::sqrt);
        for i in 0..6 {
            for j in 0..6 {
                let off = (found[(i, j)] - carried[(i, j)]).abs() / (largest[i] * largest[j]);
                assert!(off < 1e-3, "{i} {j}: {off}");
            }
        }
        // A stated covariance replaces that of the position; a tilt still moves the camera at the end of the ray.
        let stated = camera.of_reading(
            &truth.inverse(),
            &PoseCovariance { position: Some([1e-8, 0.0, 0.0, 1e-8, 0.0, 1e-8]), turn: None },
        );
        assert!(stated[(0, 0)] > 1e-4, "{stated}");
    }

    #[test]
    fn more_corners_lower_the_noise_and_a_size_raises_it() {
        let board = CameraUncertainty { corners: 4, ..CAMERA };
        let many = CameraUncertainty { corners: 24, ..CAMERA };
        let twelve = CameraUncertainty { corners: 12, ..CAMERA };
        let lateral = |camera: &CameraUncertainty| camera.of_pose(&pose(1000.0, 30.0))[(0, 0)];
        assert!(lateral(&board) < lateral(&CAMERA));
        assert!((lateral(&many) / lateral(&twelve) - 0.25).abs() < 1e-9);
        let doubled = CameraUncertainty { size: 2.0, ..CAMERA };
        assert!((lateral(&doubled) / lateral(&CAMERA) - 4.0).abs() < 1e-9);
        // A camera's point in any direction has the covariance of the same point before it, turned.
        let (before, beside) = (
            CAMERA.covariance(&Point3::new(0.0, 0.0, 900.0)),
            CAMERA.covariance(&Point3::new(900.0, 0.0, 0.0)),
        );
        assert!((before[(2, 2)] - beside[(0, 0)]).abs() < 1e-9 && before[(2, 2)] > before[(0, 0)]);
    }
}
