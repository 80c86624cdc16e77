//! The size of a camera's noise, by likelihood: one factor on its stated standard deviations.
//!
//! Inputs: the observations of all sessions and the geometric calibration that they gave. Output: the factor with its standard error
//! ([`CameraSize`]). The residuals of a reading have the covariance `k C + s² I`: C is the camera's ([`super::observation::camera`]),
//! which differs from reading to reading with distance and slant, and s² is what the arm adds to each coordinate of the position
//! (repeatability, and errors that geometry leaves), which does not. Both follow from the likelihood by Fisher's scoring; unknowns of
//! the fit count by the share of rows that they take.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use super::Calibration;
use super::geometry_left::Residuals;
use super::observation::Observation;
use crate::join::SourceId;
use crate::kinematics::Arm;

const STEPS: usize = 60;
/// Relative change of both variances at which it has converged.
const CONVERGED: f64 = 1e-9;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraSize {
    /// Factor on the stated standard deviations, estimated.
    pub size: f64,
    pub size_se: f64,
    pub beside_mm: f64,
    pub readings: usize,
}

/// A reading's residual and the camera's covariance of it, mm and rad.
struct Row {
    residual: DVector<f64>,
    camera: DMatrix<f64>,
}

/// The size of the noise of `source`, from readings whose covariances are those of a factor of 1; `None` with fewer than ten readings,
/// or where rounding made a covariance indefinite.
pub fn found(
    arm: &Arm,
    observations: &[Observation],
    calibration: &Calibration,
    source: SourceId,
) -> Option<CameraSize> {
    let left = Residuals::of(arm, observations, calibration);
    let row =
        |own: &Observation| Row { residual: left.residual(own), camera: own.measured.instrument() };
    let rows: Vec<Row> = observations.iter().filter(|own| own.source == source).map(row).collect();
    (rows.len() >= 10).then(|| scored(&rows, left.counted)).flatten()
}

/// Fisher's scoring on the variances (k, s²) of `k C + s² I`, with squares of residuals raised by `counted`.
fn scored(rows: &[Row], counted: f64) -> Option<CameraSize> {
    let mut at = Vector2::new(1.0, 1e-6);
    let mut information = Matrix2::identity();
    for _ in 0..STEPS {
        let (squares, of) = sums(rows, &at, counted)?;
        information = of;
        let next = solved(&of, &squares)?;
        let moved = (next - at).component_div(&at.map(|own| own.max(1e-12))).amax();
        at = next;
        if moved < CONVERGED {
            break;
        }
    }
    let [k, beside] = [at[0], at[1]];
    let variance =
        if beside > 0.0 { information.try_inverse()?[(0, 0)] } else { 1.0 / information[(0, 0)] };
    (k > 0.0).then(|| CameraSize {
        size: k.sqrt(),
        size_se: variance.sqrt() / (2.0 * k.sqrt()),
        beside_mm: beside.sqrt(),
        readings: rows.len(),
    })
}

/// `½ rᵀ V⁻¹ V_a V⁻¹ r` and `½ tr(V⁻¹ V_a V⁻¹ V_b)`, summed over the readings, for the two variances.
fn sums(rows: &[Row], at: &Vector2<f64>, counted: f64) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    let (mut squares, mut information) = (Vector2::zeros(), Matrix2::zeros());
    for row in rows {
        let beside = DMatrix::from_fn(row.camera.nrows(), row.camera.nrows(), |i, j| {
            f64::from(u8::from(i == j && i < 3))
        });
        let inverse = (&row.camera * at[0] + &beside * at[1]).cholesky()?.inverse();
        let white = &inverse * &row.residual;
        let parts = [&inverse * &row.camera, &inverse * &beside];
        let of = [&row.camera, &beside];
        for (a, part) in parts.iter().enumerate() {
            squares[a] += 0.5 * counted * (of[a] * &white).dot(&white);
            for (b, other) in parts.iter().enumerate() {
                information[(a, b)] += 0.5 * (part * other).trace();
            }
        }
    }
    Some((squares, information))
}

fn solved(information: &Matrix2<f64>, squares: &Vector2<f64>) -> Option<Vector2<f64>> {
    let both = information.try_inverse()? * squares;
    Some(if both[1] > 0.0 && both[0] > 0.0 {
        both
    } else if both[0] > 0.0 {
        Vector2::new(squares[0] / information[(0, 0)], 0.0)
    } else {
        Vector2::new(1e-6, squares[1] / information[(1, 1)])
    })
}
