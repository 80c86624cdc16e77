//! Where the base of an unseen session stands: found from its own stations, the arm held as identified.
//!
//! Six numbers of the base, and three of the target where the session has a mounting of its own; unweighted.

use nalgebra::{DMatrix, DVector, Isometry3, Point3, UnitQuaternion, Vector3};

use crate::geometry::align;

/// A predicted target in the base frame, and the flange's rotation there.
#[derive(Debug, Clone, PartialEq)]
pub struct Placed {
    /// mm.
    pub position: Point3<f64>,
    /// From flange to base axes.
    pub flange: UnitQuaternion<f64>,
}

/// The session's own frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refit {
    /// Where the tracker stands in the base frame.
    pub base_from_tracker: Isometry3<f64>,
    /// How far the target sits from where training had it, along the flange's axes, mm.
    pub target_shift: Vector3<f64>,
}

/// Keeps the target's shift from running away where one tool orientation does not show it.
pub const RIDGE: f64 = 1e-3;
const PASSES: usize = 4;

/// The frames that bring `measured` (tracker frame) nearest to `predicted`; `None` where stations do not span space.
pub fn refit(measured: &[Point3<f64>], predicted: &[Placed], with_target: bool) -> Option<Refit> {
    let mut target_shift = Vector3::zeros();
    let shifted = |shift: &Vector3<f64>| {
        predicted
            .iter()
            .map(|p| p.position + p.flange * shift)
            .collect::<Vec<_>>()
    };
    let weights = vec![1.0; measured.len()];
    let mut base_from_tracker = align(&shifted(&target_shift), measured, &weights)?;
    for _ in 0..if with_target { PASSES } else { 0 } {
        target_shift += shift_step(
            measured,
            predicted,
            &shifted(&target_shift),
            &base_from_tracker,
        )?;
        base_from_tracker = align(&shifted(&target_shift), measured, &weights)?;
    }
    Some(Refit {
        base_from_tracker,
        target_shift,
    })
}

/// Columns of a small motion of the base about the points' middle, and of the target: `[I | −[p]× / 1 m | R]`.
pub fn columns(
    positions: &[Point3<f64>],
    flanges: &[UnitQuaternion<f64>],
    with_target: bool,
) -> DMatrix<f64> {
    let middle = positions
        .iter()
        .fold(Vector3::zeros(), |sum, p| sum + p.coords)
        / positions.len().max(1) as f64;
    let mut columns = DMatrix::zeros(3 * positions.len(), if with_target { 9 } else { 6 });
    for (i, (position, flange)) in positions.iter().zip(flanges).enumerate() {
        let mut rows = columns.rows_mut(3 * i, 3);
        for axis in 0..3 {
            let unit = Vector3::ith(axis, 1.0);
            rows.fixed_view_mut::<3, 1>(0, axis).copy_from(&unit);
            rows.fixed_view_mut::<3, 1>(0, 3 + axis)
                .copy_from(&(unit.cross(&(position.coords - middle)) / 1000.0));
            if with_target {
                rows.fixed_view_mut::<3, 1>(0, 6 + axis)
                    .copy_from(&(flange * unit));
            }
        }
    }
    columns
}

fn shift_step(
    measured: &[Point3<f64>],
    predicted: &[Placed],
    positions: &[Point3<f64>],
    base_from_tracker: &Isometry3<f64>,
) -> Option<Vector3<f64>> {
    let flanges: Vec<_> = predicted.iter().map(|p| p.flange).collect();
    let columns = columns(positions, &flanges, true);
    let left = measured.iter().zip(positions).flat_map(|(m, p)| {
        let away = base_from_tracker * m - p;
        [away.x, away.y, away.z]
    });
    let left = DVector::from_iterator(3 * positions.len(), left);
    let normal = columns.tr_mul(&columns) + DMatrix::identity(9, 9) * RIDGE;
    let step = normal.cholesky()?.solve(&columns.tr_mul(&left));
    Some(Vector3::new(step[6], step[7], step[8]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::isometry_from_rpy;

    #[test]
    fn base_and_target_of_another_mounting_are_found() {
        let truth = isometry_from_rpy([2000.0, -50.0, 30.0], [0.01, -0.02, 1.5]);
        let shift = Vector3::new(3.0, -2.0, 5.0);
        let placed = |i: u32| {
            let t = f64::from(i);
            let position = Point3::new(600.0 * t.sin(), 500.0 * (1.7 * t).cos(), 40.0 * t);
            Placed {
                position,
                flange: UnitQuaternion::from_euler_angles(t, 0.6 * t, 0.3 * t),
            }
        };
        let predicted: Vec<_> = (0..30).map(placed).collect();
        let measured: Vec<_> = predicted
            .iter()
            .map(|p| truth.inverse() * (p.position + p.flange * shift))
            .collect();
        let found = refit(&measured, &predicted, true).expect("stations in space");
        assert!((found.target_shift - shift).norm() < 1e-3, "{found:?}");
        assert!(
            (found.base_from_tracker.translation.vector - truth.translation.vector).norm() < 1e-3
        );
    }
}
