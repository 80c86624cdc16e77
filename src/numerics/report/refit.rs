//! The base of an unseen session: found from its own stations, with the arm fixed as identified.
//!
//! Six numbers of the base, and three of the target where the session has a mounting of its own. For a model
//! that knows the variation of scale between sessions ([`refit_with_scale`]), also the session's scale, with that variation
//! as its prior. Unweighted, for comparing models; or by an estimate that knows which errors the stations have in common
//! ([`generalised`]).

use nalgebra::{DMatrix, DVector, Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::fit::locate::Estimator;
use crate::geometry::align;
use crate::units::MM_PER_M;

/// A predicted target in the base frame, and the flange's rotation there.
#[derive(Debug, Clone, PartialEq)]
pub struct Placed {
    pub position: Point3<f64>,
    pub flange: UnitQuaternion<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refit {
    pub base_from_tracker: Isometry3<f64>,
    /// Displacement of the target from its place in training, along the flange's axes, mm.
    pub target_shift: Vector3<f64>,
    /// Scale of the session relative to the model, minus one, about `middle`.
    pub scale: f64,
    pub middle: Point3<f64>,
}

impl Refit {
    /// The frames after a small motion by the columns of [`columns`], and of [`levers`] behind them.
    fn moved(&self, by: &DVector<f64>, with_target: bool) -> Self {
        let turn = Vector3::new(by[3], by[4], by[5]) / MM_PER_M;
        let away = Vector3::new(by[0], by[1], by[2]);
        // The measured points stand further along by this motion: the base's place undoes it, about the middle.
        let turned = UnitQuaternion::from_scaled_axis(-turn);
        let about = Translation3::from(self.middle.coords);
        let undone = about * turned * Translation3::from(-away) * about.inverse();
        let frames = columns_of_frames(with_target);
        Self {
            base_from_tracker: undone * self.base_from_tracker,
            target_shift: self.target_shift
                + if with_target { Vector3::new(by[6], by[7], by[8]) } else { Vector3::zeros() },
            scale: self.scale + by.get(frames).map_or(0.0, |scale| scale / MM_PER_M),
            middle: self.middle,
        }
    }

    /// What prior knowledge holds, in the order of the columns: the target's shift and the scale.
    fn held(&self, size: usize, with_target: bool) -> DVector<f64> {
        let mut held = DVector::zeros(size);
        let frames = columns_of_frames(with_target);
        if with_target {
            held.rows_mut(6, 3).copy_from(&self.target_shift);
        }
        if size > frames {
            held[frames] = self.scale * MM_PER_M;
        }
        held
    }

    /// The position of a predicted target in the session's own frames and scale.
    pub fn predicted(&self, placed: &Placed) -> Point3<f64> {
        self.scaled(placed).position + placed.flange * self.target_shift
    }

    fn scaled(&self, placed: &Placed) -> Placed {
        Placed {
            position: placed.position + (placed.position - self.middle) * self.scale,
            ..placed.clone()
        }
    }
}

/// Ridge that bounds the target's shift where one tool orientation does not determine it.
pub const RIDGE: f64 = 1e-3;
const PASSES: usize = 4;
/// Largest scale that sessions ordinarily have, in standard deviations of its prior: a larger stays in the error.
const ORDINARY: f64 = 3.0;

/// The frames that bring `measured` (tracker frame) closest to `predicted`; `None` where stations do not span space.
pub fn refit(measured: &[Point3<f64>], predicted: &[Placed], with_target: bool) -> Option<Refit> {
    let mut target_shift = Vector3::zeros();
    let shifted = |shift: &Vector3<f64>| {
        predicted.iter().map(|p| p.position + p.flange * shift).collect::<Vec<_>>()
    };
    let weights = vec![1.0; measured.len()];
    let mut base_from_tracker = align(&shifted(&target_shift), measured, &weights)?;
    for _ in 0..if with_target { PASSES } else { 0 } {
        target_shift +=
            shift_step(measured, predicted, &shifted(&target_shift), &base_from_tracker)?;
        base_from_tracker = align(&shifted(&target_shift), measured, &weights)?;
    }
    Some(Refit { base_from_tracker, target_shift, scale: 0.0, middle: middle(predicted) })
}

/// The middle of predicted targets, mm.
pub fn middle(predicted: &[Placed]) -> Point3<f64> {
    let sum = predicted.iter().fold(Vector3::zeros(), |sum, p| sum + p.position.coords);
    Point3::from(sum / predicted.len().max(1) as f64)
}

/// The frames with the session's scale, whose expected error is `scale_sd` (a share); without it where the session's scale
/// is beyond what is ordinary, or too few numbers remain to estimate the noise.
pub fn refit_with_scale(
    measured: &[Point3<f64>],
    predicted: &[Placed],
    with_target: bool,
    scale_sd: f64,
) -> Option<Refit> {
    let plain = refit(measured, predicted, with_target)?;
    let mut found = plain;
    for _ in 0..PASSES {
        let Some(scale) = scale_of(measured, predicted, &found, scale_sd) else {
            return Some(plain);
        };
        found.scale = scale;
        let scaled: Vec<Placed> = predicted.iter().map(|p| found.scaled(p)).collect();
        found = Refit { scale, middle: plain.middle, ..refit(measured, &scaled, with_target)? };
    }
    let is_ordinary = found.scale.abs() <= ORDINARY * scale_sd;
    Some(if is_ordinary { found } else { plain })
}

/// The frames by an estimate ([`Estimator`]) from `measured` and `predicted` of its stations, in their order; the columns are about
/// `middle`, and a scale that no session ordinarily has (`scale_sd` is their standard deviation) stays in the remaining error. `None`
/// where stations do not span space.
pub fn generalised(
    measured: &[Point3<f64>],
    predicted: &[Placed],
    with_target: bool,
    middle: Point3<f64>,
    scale_sd: f64,
    by: &Estimator,
) -> Option<Refit> {
    let plain = Refit { middle, ..refit(measured, predicted, with_target)? };
    let mut found = plain;
    for _ in 0..PASSES {
        let pairs = measured.iter().zip(predicted);
        let left = stacked(pairs.map(|(m, p)| found.base_from_tracker * m - found.predicted(p)));
        // Target and scale are found from where they are expected.
        let held = found.held(by.from.nrows(), with_target);
        let step = &by.from * (left + &by.columns * &held) - held;
        found = found.moved(&step, with_target);
    }
    let is_ordinary = found.scale.abs() <= ORDINARY * scale_sd;
    Some(if is_ordinary { found } else { plain })
}

/// The scale in the frames of `found`: `Σ l r / (Σ l² + σ²/τ²)`, l from the middle, σ² the remaining variance per axis.
fn scale_of(
    measured: &[Point3<f64>],
    predicted: &[Placed],
    found: &Refit,
    scale_sd: f64,
) -> Option<f64> {
    let (mut levers, mut along, mut left) = (0.0, 0.0, 0.0);
    for (measured, placed) in measured.iter().zip(predicted) {
        let lever = placed.position - found.middle;
        let away = found.base_from_tracker * measured - found.predicted(placed);
        levers += lever.norm_squared();
        along += lever.dot(&(away + lever * found.scale));
        left += away.norm_squared();
    }
    // Ten numbers are found from three coordinates of each station.
    let freedom = (3 * measured.len()).checked_sub(10).filter(|f| *f > 0)?;
    let ridge = left / freedom as f64 / (scale_sd * scale_sd);
    let scale = along / (levers + ridge);
    (scale_sd > 0.0 && scale.is_finite()).then_some(scale)
}

/// Number of columns of [`columns`].
pub const fn columns_of_frames(with_target: bool) -> usize {
    if with_target { 9 } else { 6 }
}

/// The column of a session's scale: each point's way from the middle, per 1 m.
pub fn levers(positions: &[Point3<f64>], middle: &Point3<f64>) -> DVector<f64> {
    stacked(positions.iter().map(|position| (position - middle) / MM_PER_M))
}

/// The components of vectors, one vector's below the other's.
pub(super) fn stacked(vectors: impl ExactSizeIterator<Item = Vector3<f64>>) -> DVector<f64> {
    DVector::from_iterator(3 * vectors.len(), vectors.flat_map(|own| [own.x, own.y, own.z]))
}

/// Columns of a small motion of the base about the points' middle, and of the target: `[I | −[p]× / 1 m | R]`.
pub fn columns(
    positions: &[Point3<f64>],
    flanges: &[UnitQuaternion<f64>],
    with_target: bool,
) -> DMatrix<f64> {
    let middle = positions.iter().fold(Vector3::zeros(), |sum, p| sum + p.coords)
        / positions.len().max(1) as f64;
    let mut columns = DMatrix::zeros(3 * positions.len(), columns_of_frames(with_target));
    for (i, (position, flange)) in positions.iter().zip(flanges).enumerate() {
        let mut rows = columns.rows_mut(3 * i, 3);
        for axis in 0..3 {
            let unit = Vector3::ith(axis, 1.0);
            rows.fixed_view_mut::<3, 1>(0, axis).copy_from(&unit);
            rows.fixed_view_mut::<3, 1>(0, 3 + axis)
                .copy_from(&(unit.cross(&(position.coords - middle)) / MM_PER_M));
            if with_target {
                rows.fixed_view_mut::<3, 1>(0, 6 + axis).copy_from(&(flange * unit));
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
    let left = stacked(measured.iter().zip(positions).map(|(m, p)| base_from_tracker * m - p));
    let normal = columns.tr_mul(&columns) + DMatrix::identity(9, 9) * RIDGE;
    let step = normal.cholesky()?.solve(&columns.tr_mul(&left));
    Some(Vector3::new(step[6], step[7], step[8]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::isometry_from_rpy;

    fn placed(i: u32) -> Placed {
        let t = f64::from(i);
        let position = Point3::new(600.0 * t.sin(), 500.0 * (1.7 * t).cos(), 40.0 * t);
        Placed { position, flange: UnitQuaternion::from_euler_angles(t, 0.6 * t, 0.3 * t) }
    }

    #[test]
    fn a_session_s_own_scale_is_found_as_far_as_it_is_ordinary() {
        let truth = isometry_from_rpy([2000.0, -50.0, 30.0], [0.01, -0.02, 1.5]);
        let predicted: Vec<_> = (0..30).map(placed).collect();
        // A micrometre of noise: the remaining error is compared with the prior.
        let measured = |scale: f64| -> Vec<Point3<f64>> {
            let of = |(i, p): (usize, &Placed)| {
                let noise = Vector3::repeat(1e-3 * (7.0 * i as f64).sin());
                Point3::from((truth.inverse() * p.position).coords * (1.0 + scale) + noise)
            };
            predicted.iter().enumerate().map(of).collect()
        };
        let found = |scale| refit_with_scale(&measured(scale), &predicted, false, 50e-6);
        let ordinary = found(60e-6).expect("stations in space");
        assert!((ordinary.scale - 60e-6).abs() < 1e-6, "{ordinary:?}");
        let left = measured(60e-6);
        let left = left.iter().zip(&predicted);
        let left =
            left.map(|(m, p)| (ordinary.base_from_tracker * m - ordinary.predicted(p)).norm());
        assert!(left.fold(0.0, f64::max) < 4e-3);
        // 0.1 % is a fault, and stays in the remaining error.
        let fault = found(1e-3).expect("stations in space");
        assert!(fault.scale == 0.0, "{fault:?}");
    }

    #[test]
    fn base_and_target_of_another_mounting_are_found() {
        let truth = isometry_from_rpy([2000.0, -50.0, 30.0], [0.01, -0.02, 1.5]);
        let shift = Vector3::new(3.0, -2.0, 5.0);
        let predicted: Vec<_> = (0..30).map(placed).collect();
        let measured: Vec<_> =
            predicted.iter().map(|p| truth.inverse() * (p.position + p.flange * shift)).collect();
        let found = refit(&measured, &predicted, true).expect("stations in space");
        assert!((found.target_shift - shift).norm() < 1e-3, "{found:?}");
        assert!(
            (found.base_from_tracker.translation.vector - truth.translation.vector).norm() < 1e-3
        );
    }
}
