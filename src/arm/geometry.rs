//! Frames as types: a [`Transform<To, From>`] maps coordinates in `From` to coordinates in `To`. Raw numbers get a
//! frame only through [`Transform::claim`] and [`Position::claim`].

pub mod placement;
pub mod pose_covariance;
mod rotation_order;
pub mod saved;
pub mod typed;

use std::marker::PhantomData;
use std::ops::Mul;

pub use placement::{EulerOrder, Placement, PlacementError};
pub use pose_covariance::{PoseCovariance, TurnCovariance};
pub use rotation_order::{NoOrder, RotationOrder};

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tracker {}
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Base {}
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Flange {}
/// The measured target: a reflector (SMR) or a 6-DoF probe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Target {}
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tool {}
/// The frame in which the controller states its commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {}

/// A rigid transform from frame `From` to frame `To`; translation in mm.
///
/// ```
/// use nalgebra::Isometry3;
/// use posegrid_arm::geometry::{Base, Flange, Target, Transform};
///
/// let base_from_flange = Transform::<Base, Flange>::claim(Isometry3::translation(800.0, 0.0, 600.0));
/// let flange_from_target = Transform::<Flange, Target>::claim(Isometry3::translation(0.0, 0.0, 50.0));
/// let base_from_target: Transform<Base, Target> = base_from_flange * flange_from_target;
/// assert_eq!(base_from_target.origin().point().z, 650.0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(transparent, bound = "")]
pub struct Transform<To, From> {
    isometry: Isometry3<f64>,
    #[serde(skip)]
    frames: PhantomData<(To, From)>,
}

impl<To, From> Transform<To, From> {
    pub const fn claim(isometry: Isometry3<f64>) -> Self {
        Self { isometry, frames: PhantomData }
    }

    pub fn identity() -> Self {
        Self::claim(Isometry3::identity())
    }

    pub fn inverse(&self) -> Transform<From, To> {
        Transform::claim(self.isometry.inverse())
    }

    pub const fn isometry(&self) -> &Isometry3<f64> {
        &self.isometry
    }

    /// The origin of `From` in the frame `To`.
    pub fn origin(&self) -> Position<To> {
        Position::claim(Point3::from(self.isometry.translation.vector))
    }
}

impl<A, B, C> Mul<Transform<B, C>> for Transform<A, B> {
    type Output = Transform<A, C>;
    fn mul(self, other: Transform<B, C>) -> Transform<A, C> {
        Transform::claim(self.isometry * other.isometry)
    }
}

/// A point in the frame `F`, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Position<F> {
    point: Point3<f64>,
    frame: PhantomData<F>,
}

impl<F> Position<F> {
    pub const fn claim(point: Point3<f64>) -> Self {
        Self { point, frame: PhantomData }
    }

    pub const fn point(&self) -> &Point3<f64> {
        &self.point
    }

    pub const fn coords(&self) -> Vector3<f64> {
        self.point.coords
    }
}

impl<To, From> Mul<Position<From>> for Transform<To, From> {
    type Output = Position<To>;
    fn mul(self, position: Position<From>) -> Position<To> {
        Position::claim(self.isometry * position.point)
    }
}

/// An isometry from a translation (mm) and fixed-axis roll, pitch, yaw (rad): `Rot(z, yaw) Rot(y, pitch) Rot(x, roll)`.
pub fn isometry_from_rpy(xyz_mm: [f64; 3], rpy: [f64; 3]) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(xyz_mm),
        UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]),
    )
}

/// Roll, pitch and yaw (rad) of `Rot(z, yaw) Rot(y, pitch) Rot(x, roll)`, none of them −0, which restore the rotation
/// to the last digits even at a pitch of ±90°, where yaw is not determined.
pub fn rpy(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    let matrix = *rotation.to_rotation_matrix().matrix();
    let yaw = matrix[(1, 0)].atan2(matrix[(0, 0)]);
    let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), -yaw).matrix() * matrix;
    let pitch = (-turned[(2, 0)]).atan2(turned[(0, 0)]);
    let roll = (-turned[(1, 2)]).atan2(turned[(1, 1)]);
    [roll, pitch, yaw].map(|angle| angle + 0.0)
}

/// The rigid transform from `from` onto `to` with the least weighted squared distances (Kabsch 1976; Umeyama's
/// determinant). `None` with fewer than three points or points on a line.
pub fn align(to: &[Point3<f64>], from: &[Point3<f64>], weights: &[f64]) -> Option<Isometry3<f64>> {
    let total: f64 = weights.iter().sum();
    if to.len() < 3 || to.len() != from.len() || to.len() != weights.len() || total <= 0.0 {
        return None;
    }
    let barycentre = |points: &[Point3<f64>]| {
        points.iter().zip(weights).fold(Vector3::zeros(), |sum, (p, &w)| sum + p.coords * w) / total
    };
    let (to_centre, from_centre) = (barycentre(to), barycentre(from));
    let mut cross = Matrix3::zeros();
    for ((p, q), &w) in to.iter().zip(from).zip(weights) {
        cross += (p.coords - to_centre) * (q.coords - from_centre).transpose() * w;
    }
    let svd = cross.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let largest = svd.singular_values.max();
    // On a line only one singular value is left: turning about the line changes nothing.
    if svd.singular_values.iter().filter(|&&s| s > 1e-9 * largest).count() < 2 {
        return None;
    }
    let handedness = (u * v_t).determinant().signum();
    // nalgebra sorts the singular values, so the last direction is the weakest one.
    let mend = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, handedness));
    let rotation =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * mend * v_t));
    Some(Isometry3::from_parts(Translation3::from(to_centre - rotation * from_centre), rotation))
}

/// A symmetric matrix of the six numbers that files and tables state: xx xy xz yy yz zz.
pub const fn symmetric([xx, xy, xz, yy, yz, zz]: [f64; 6]) -> Matrix3<f64> {
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

/// The entries on and above the diagonal, row by row.
pub fn upper(matrix: &Matrix3<f64>) -> [f64; 6] {
    [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|place| matrix[place])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn six_numbers_come_back() {
        let six = [1.0, 0.1, 0.2, 2.0, 0.3, 3.0];
        let matrix = symmetric(six);
        assert_eq!(matrix, matrix.transpose());
        assert_eq!((matrix[(1, 2)], upper(&matrix)), (0.3, six));
    }

    #[test]
    fn roll_pitch_yaw_give_the_rotation_back_wherever_the_pitch_is() {
        for step in 0..2000_u32 {
            let part = |k: f64| (f64::from(step) * k).fract() * 6.3 - 3.15;
            // Every other pitch lies within 1e-9 of ±90°.
            let pitch = match step % 4 {
                0 => std::f64::consts::FRAC_PI_2 - f64::from(step) * 5e-13,
                1 => -std::f64::consts::FRAC_PI_2 + f64::from(step) * 5e-13,
                _ => part(0.618_034),
            };
            let own = UnitQuaternion::from_euler_angles(part(0.414_214), pitch, part(0.732_051));
            let [roll, pitch, yaw] = rpy(&own);
            let again = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            let apart = own.to_rotation_matrix().matrix() - again.to_rotation_matrix().matrix();
            assert!(apart.abs().max() < 1e-15 * 8.0, "step {step}: {apart}");
        }
    }

    #[test]
    fn align_finds_a_known_transform() {
        let truth = isometry_from_rpy([1000.0, -20.0, 300.0], [0.3, -1.2, 2.5]);
        let from: Vec<_> =
            [[0.0, 0.0, 0.0], [500.0, 0.0, 10.0], [0.0, 700.0, -3.0], [20.0, 40.0, 600.0]]
                .map(Point3::from)
                .to_vec();
        let to: Vec<_> = from.iter().map(|p| truth * p).collect();
        let found = align(&to, &from, &[1.0, 2.0, 0.5, 1.0]).expect("four points span space");
        assert!((found.to_homogeneous() - truth.to_homogeneous()).abs().max() < 1e-9);
    }

    #[test]
    fn align_refuses_points_on_a_line() {
        let line: Vec<_> =
            (0..5).map(|i| Point3::new(f64::from(i), 2.0 * f64::from(i), 0.0)).collect();
        assert!(align(&line, &line, &[1.0; 5]).is_none());
    }

    #[test]
    fn frames_compose_and_invert() {
        let tracker_from_base =
            Transform::<Tracker, Base>::claim(isometry_from_rpy([1.0, 2.0, 3.0], [0.1, 0.2, 0.3]));
        let base_from_flange =
            Transform::<Base, Flange>::claim(isometry_from_rpy([4.0, 5.0, 6.0], [0.4, 0.5, 0.6]));
        let flange_point = Position::<Flange>::claim(Point3::new(7.0, 8.0, 9.0));
        let once = (tracker_from_base * base_from_flange) * flange_point;
        let twice = tracker_from_base * (base_from_flange * flange_point);
        assert!((once.coords() - twice.coords()).norm() < 1e-12);
        assert!(
            ((tracker_from_base.inverse() * once).coords()
                - (base_from_flange * flange_point).coords())
            .norm()
                < 1e-12
        );
    }
}
