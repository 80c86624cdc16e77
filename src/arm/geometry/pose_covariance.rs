//! Covariance of a pose: of the position, of the rotation vector about fixed axes (not of the body), and of one with
//! the other, in the order of `geometry_msgs/PoseWithCovariance`.

use nalgebra::{DMatrix, Isometry3, Matrix3, Matrix6};

use super::{symmetric, upper};

/// Entries that belong together differ by at most this share: publishers compute in single precision.
const ALIKE: f64 = 1e-5;
/// The least eigenvalue of a correlation matrix that rounding in single precision can leave.
const LEAST: f64 = -1e-6;

#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TurnCovariance {
    /// Covariance of the rotation vector, rad²: xx xy xz yy yz zz.
    pub own: [f64; 6],
    /// Covariance of position and rotation vector, mm·rad, row by row: a row for each of x, y and z.
    pub with_position: [f64; 9],
}

#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PoseCovariance {
    /// Covariance of the position, mm²: xx xy xz yy yz zz; `None` where it is not known.
    pub position: Option<[f64; 6]>,
    /// Covariance of the orientation, alone and with the position; `None` where there is none, or it is not known.
    pub turn: Option<TurnCovariance>,
}

impl TurnCovariance {
    /// Covariance of the rotation vector, rad².
    pub const fn matrix(&self) -> Matrix3<f64> {
        symmetric(self.own)
    }

    /// Covariance of position (rows) and rotation vector (columns), mm·rad.
    pub fn cross(&self) -> Matrix3<f64> {
        Matrix3::from_row_slice(&self.with_position)
    }

    pub fn of(whole: &Matrix6<f64>) -> Self {
        let cross = whole.fixed_view::<3, 3>(0, 3);
        Self {
            own: upper(&whole.fixed_view::<3, 3>(3, 3).into_owned()),
            with_position: std::array::from_fn(|place| cross[(place / 3, place % 3)]),
        }
    }

    /// This covariance along other axes: `turn` times those that it is along.
    #[must_use]
    pub fn turned(&self, turn: &Matrix3<f64>) -> Self {
        let cross = turn * self.cross() * turn.transpose();
        Self {
            own: upper(&(turn * self.matrix() * turn.transpose())),
            with_position: std::array::from_fn(|place| cross[(place / 3, place % 3)]),
        }
    }
}

impl PoseCovariance {
    /// The parts of a covariance of position (mm) and rotation vector (rad) together.
    pub fn of(whole: &Matrix6<f64>) -> Self {
        Self {
            position: Some(upper(&whole.fixed_view::<3, 3>(0, 0).into_owned())),
            turn: Some(TurnCovariance::of(whole)),
        }
    }

    /// The whole covariance of position (mm) and rotation vector (rad); `None` where a part is not known.
    pub fn whole(&self) -> Option<Matrix6<f64>> {
        Some(joint(&symmetric(self.position?), &self.turn?))
    }

    /// The covariance of the pose with its length in units of `length` and its angle in units of `angle`.
    #[must_use]
    pub fn scaled(&self, length: f64, angle: f64) -> Self {
        Self {
            position: self.position.map(|own| own.map(|entry| length * length * entry)),
            turn: self.turn.map(|turn| TurnCovariance {
                own: turn.own.map(|entry| angle * angle * entry),
                with_position: turn.with_position.map(|entry| length * angle * entry),
            }),
        }
    }

    /// The covariance of the inverse of `pose`. Where a part is not known, the other is only turned.
    #[must_use]
    pub fn inverted(&self, pose: &Isometry3<f64>) -> Self {
        if let Some(whole) = self.whole() {
            return Self::of(&inverted(&whole, pose));
        }
        let back = *pose.rotation.inverse().to_rotation_matrix().matrix();
        let position = self.position.map(symmetric);
        Self {
            position: position.map(|own| upper(&(back * own * back.transpose()))),
            turn: self.turn.map(|own| own.turned(&back)),
        }
    }
}

pub fn joint(position: &Matrix3<f64>, turn: &TurnCovariance) -> Matrix6<f64> {
    let mut whole = Matrix6::zeros();
    let cross = turn.cross();
    whole.fixed_view_mut::<3, 3>(0, 0).copy_from(position);
    whole.fixed_view_mut::<3, 3>(0, 3).copy_from(&cross);
    whole.fixed_view_mut::<3, 3>(3, 0).copy_from(&cross.transpose());
    whole.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn.matrix());
    whole
}

/// Whether both parts of a covariance together are one: means of parts that different readings state need not be.
pub fn is_joint(position: &Matrix3<f64>, turn: &TurnCovariance) -> bool {
    is_covariance(&DMatrix::from_column_slice(6, 6, joint(position, turn).as_slice()))
}

/// Whether a matrix is symmetric and positive semi-definite, but for the rounding of single precision.
pub fn is_covariance(matrix: &DMatrix<f64>) -> bool {
    let size = matrix.nrows();
    let is_sound = matrix.iter().all(|entry| entry.is_finite())
        && matrix.diagonal().iter().all(|own| *own >= 0.0);
    if !is_sound {
        return false;
    }
    let roots: Vec<f64> = matrix.diagonal().iter().map(|own| own.sqrt()).collect();
    let mut places = (0..size).flat_map(|row| (0..size).map(move |column| (row, column)));
    let is_symmetric = places.all(|(row, column)| {
        let off = (matrix[(row, column)] - matrix[(column, row)]).abs();
        let scale = roots[row] * roots[column];
        // What is exact has no correlation with anything.
        off <= ALIKE * scale && (scale > 0.0 || matrix[(row, column)] == 0.0)
    });
    let correlation = DMatrix::from_fn(size, size, |row, column| {
        let (a, b) = (row.min(column), row.max(column));
        let scale = roots[row] * roots[column];
        if scale > 0.0 { matrix[(a, b)] / scale } else { f64::from(u8::from(row == column)) }
    });
    is_symmetric && correlation.symmetric_eigenvalues().min() >= LEAST
}

/// Covariance of a pose's inverse from its own: `A C Aᵀ`, A the adjoint of the inverse with signs of small motions.
pub fn inverted(covariance: &Matrix6<f64>, pose: &Isometry3<f64>) -> Matrix6<f64> {
    let back = *pose.rotation.inverse().to_rotation_matrix().matrix();
    let mut adjoint = Matrix6::zeros();
    adjoint.fixed_view_mut::<3, 3>(0, 0).copy_from(&-back);
    adjoint.fixed_view_mut::<3, 3>(3, 3).copy_from(&-back);
    let lever = -back * pose.translation.vector.cross_matrix();
    adjoint.fixed_view_mut::<3, 3>(0, 3).copy_from(&lever);
    adjoint * covariance * adjoint.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{UnitQuaternion, Vector3, Vector6};

    fn pose() -> Isometry3<f64> {
        let turn = UnitQuaternion::from_euler_angles(0.4, -1.1, 2.0);
        Isometry3::from_parts(Vector3::new(300.0, -200.0, 900.0).into(), turn)
    }

    /// A covariance with every block filled: sizes of a tenth of a millimetre and a tenth of a milliradian.
    fn whole() -> Matrix6<f64> {
        let root = Matrix6::from_fn(|row, column| {
            let size = if row < 3 { 0.1 } else { 1e-4 };
            size * ((3 * row + 7 * column + 1) as f64).sin()
        });
        root * root.transpose()
    }

    #[test]
    fn the_parts_of_a_covariance_are_the_whole_again() {
        let own = PoseCovariance::of(&whole());
        assert!((own.whole().expect("both parts") - whole()).amax() < 1e-18);
        let alone = PoseCovariance { turn: None, ..own };
        assert!(alone.whole().is_none());
    }

    #[test]
    fn an_inverse_has_the_covariance_of_its_numerical_derivatives() {
        let moved = |by: &Vector6<f64>| {
            let turn = UnitQuaternion::from_scaled_axis(by.fixed_rows::<3>(3).into_owned());
            let shift = pose().translation.vector + by.fixed_rows::<3>(0);
            Isometry3::from_parts(shift.into(), turn * pose().rotation).inverse()
        };
        let at = pose().inverse();
        let column = |k: usize| {
            let step = if k < 3 { 1e-3 } else { 1e-6 };
            let ahead = moved(&Vector6::from_fn(|row, _| if row == k { step } else { 0.0 }));
            let shift = (ahead.translation.vector - at.translation.vector) / step;
            let turn = (ahead.rotation * at.rotation.inverse()).scaled_axis() / step;
            Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
        };
        let adjoint = Matrix6::from_columns(&std::array::from_fn::<_, 6, _>(column));
        let numeric = adjoint * whole() * adjoint.transpose();
        let own = PoseCovariance::of(&whole()).inverted(&pose());
        let found = own.whole().expect("both parts");
        for (row, column) in (0..6).flat_map(|row| (0..6).map(move |column| (row, column))) {
            let size = (numeric[(row, row)] * numeric[(column, column)]).sqrt();
            let off = (found[(row, column)] - numeric[(row, column)]).abs();
            assert!(off < 1e-5 * size, "{row} {column}: {found} {numeric}");
        }
        // Twice inverted it is what it was, and a position's alone is turned.
        let back = own.inverted(&at).whole().expect("both parts");
        assert!((back - whole()).amax() < 1e-9 * whole().amax());
        let position = PoseCovariance { turn: None, ..PoseCovariance::of(&whole()) };
        let turned = position.inverted(&pose()).position.expect("known");
        let trace = |own: [f64; 6]| own[0] + own[3] + own[5];
        assert!((trace(turned) / trace(position.position.expect("known")) - 1.0).abs() < 1e-12);
    }
}
