//! Figures for the tool tip: the error of the measured point, carried there by lever ([`crate::method::accuracy`]).
//!
//! Input: residuals, each with the attained and the predicted or commanded orientation of the flange ([`Turn`]), and the
//! lever from their point to the tip. Output: residuals of the tip, `e_tip = e + (R_attained − R_wanted) · lever`, as
//! vectors station by station.
//!
//! A constant rotation between measured and commanded orientation comes from the mounting of the target and the
//! controller's rounding of its tool: it is no error of the arm ([`without_constant`]). Only stations whose orientation was
//! measured have an error of the tip.

use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::{Residual, ResidualSet};
use crate::figures::median;

/// The attained and the wanted axes of the flange, both in the base frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Turn {
    pub attained: UnitQuaternion<f64>,
    pub wanted: UnitQuaternion<f64>,
}

impl Turn {
    /// Measured minus predicted or commanded orientation as a rotation vector in the base frame, rad.
    pub fn residual(&self) -> Vector3<f64> {
        (self.attained * self.wanted.inverse()).scaled_axis()
    }

    /// The error that it adds at the end of a lever along the flange's axes, mm.
    pub fn at_end_of(&self, lever: &Vector3<f64>) -> Vector3<f64> {
        self.attained * lever - self.wanted * lever
    }

    #[must_use]
    pub fn seen_from(&self, to_from: &UnitQuaternion<f64>) -> Self {
        Self { attained: to_from * self.attained, wanted: to_from * self.wanted }
    }

    /// Attained relative to wanted orientation, as a rotation vector along the flange's axes, rad.
    fn vector(&self) -> Vector3<f64> {
        (self.wanted.inverse() * self.attained).scaled_axis()
    }
}

/// The turns without their median over those that `counts`, axis by axis.
pub fn without_constant(
    turns: &[Option<Turn>],
    counts: impl Fn(usize) -> bool,
) -> Vec<Option<Turn>> {
    let counted = || {
        let places = turns.iter().enumerate().filter(|(place, _)| counts(*place));
        places.filter_map(|(_, turn)| Some(turn.as_ref()?.vector()))
    };
    let along = |axis: usize| median(&counted().map(|turn| turn[axis]).collect::<Vec<_>>());
    let constant = Vector3::from_fn(|axis, _| along(axis).unwrap_or(0.0));
    let back = UnitQuaternion::from_scaled_axis(-constant);
    let settled = |turn: &Turn| Turn { attained: turn.attained * back, ..*turn };
    turns.iter().map(|turn| turn.as_ref().map(settled)).collect()
}

/// Residuals at the tip, `lever` from their point along the flange's axes, mm, of stations with a measured orientation.
#[must_use]
pub fn at_tip(set: &ResidualSet, lever: &Vector3<f64>) -> ResidualSet {
    let residual = |own: &Residual| {
        let turn = own.turn?;
        Some(Residual {
            attained: own.attained + turn.attained * lever,
            residual: own.residual + turn.at_end_of(lever),
            // The model's covariance is that of its own point.
            covariance: None,
            ..own.clone()
        })
    };
    ResidualSet {
        subject: set.subject.clone(),
        residuals: set.residuals.iter().filter_map(residual).collect(),
    }
}

/// Expanded uncertainty (k = 2) of an error measured at the tip, mm: that of the point, and the orientation's standard
/// uncertainty per axis (rad) at the end of the lever.
pub fn expanded_uncertainty_mm(
    of_point_mm: f64,
    orientation_rad: f64,
    lever: &Vector3<f64>,
) -> f64 {
    of_point_mm.hypot(2.0 * orientation_rad * lever.norm())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{Angles, BaseRefit, Model, Split, Subject};
    use nalgebra::Point3;

    fn set(turns: &[Option<Turn>], residual: Vector3<f64>) -> ResidualSet {
        let residual = |(station, turn): (usize, &Option<Turn>)| Residual {
            station,
            target: None,
            pose: station,
            fold: None,
            used_for_refit: false,
            attained: Point3::new(1500.0, 0.0, 1000.0) + residual,
            residual,
            covariance: None,
            weight: None,
            turn: *turn,
        };
        ResidualSet {
            subject: Subject {
                split: Split::Blocks,
                of_session: "monday".to_owned(),
                model: Model::Full,
                angles: Angles::Commanded,
                base_refit: BaseRefit::None,
            },
            residuals: turns.iter().enumerate().map(residual).collect(),
        }
    }

    /// The flange at some orientation, rotated from it by `vector` along its own axes.
    fn turned(vector: Vector3<f64>, wanted: UnitQuaternion<f64>) -> Turn {
        Turn { attained: wanted * UnitQuaternion::from_scaled_axis(vector), wanted }
    }

    #[test]
    fn a_turn_of_1_3_mrad_is_0_26_mm_at_the_end_of_200_mm() {
        let wanted = UnitQuaternion::from_euler_angles(0.4, -1.1, 2.0);
        // About an axis perpendicular to the lever, and about the lever itself.
        let turns = [Vector3::x(), Vector3::z()].map(|axis| Some(turned(axis * 1.3e-3, wanted)));
        let lever = Vector3::new(0.0, 0.0, 200.0);
        let tip = at_tip(&set(&turns, Vector3::zeros()), &lever);
        // A chord: 2 · 200 mm · sin(0.65 mrad) = 0.26 mm but for 2e-8.
        assert!((tip.residuals[0].residual.norm() - 0.26).abs() < 1e-7);
        assert!(tip.residuals[1].residual.norm() < 1e-12);
    }

    #[test]
    fn errors_add_as_vectors_and_may_cancel() {
        let turn = turned(Vector3::x() * 1e-3, UnitQuaternion::identity());
        // ω × lever = (1e-3, 0, 0) × (0, 0, 100) = (0, −0.1, 0).
        let at = |error| at_tip(&set(&[Some(turn)], error), &Vector3::new(0.0, 0.0, 100.0));
        let cancelled = at(Vector3::new(0.0, 0.1, 0.0));
        assert!(cancelled.residuals[0].residual.norm() < 1e-4);
        let added = at(Vector3::new(0.0, -0.1, 0.0));
        assert!((added.residuals[0].residual.norm() - 0.2).abs() < 1e-4);
    }

    #[test]
    fn a_station_without_an_orientation_has_no_error_of_the_tip() {
        let turn = turned(Vector3::zeros(), UnitQuaternion::identity());
        let tip = at_tip(&set(&[None, Some(turn)], Vector3::x()), &Vector3::x());
        assert_eq!(tip.residuals.len(), 1);
        assert_eq!(tip.residuals[0].station, 1);
    }

    #[test]
    fn a_constant_turn_is_taken_out_as_those_that_count_have_it() {
        let constant = Vector3::new(0.02, -0.01, 0.03);
        let of = |i: i32| {
            let wanted = UnitQuaternion::from_euler_angles(f64::from(i), 0.5, -0.2 * f64::from(i));
            // The last one is off by another 1 mrad.
            let own = if i == 4 { 1e-3 } else { 0.0 };
            let off = UnitQuaternion::from_scaled_axis(Vector3::x() * own);
            Some(Turn {
                attained: wanted * off * UnitQuaternion::from_scaled_axis(constant),
                wanted,
            })
        };
        let turns: Vec<_> = (0..5).map(of).collect();
        let settled = without_constant(&turns, |place| place < 4);
        let left: Vec<f64> = settled.iter().flatten().map(|turn| turn.vector().norm()).collect();
        assert!(left[..4].iter().all(|left| *left < 1e-12), "{left:?}");
        assert!((left[4] - 1e-3).abs() < 1e-12, "{left:?}");
    }

    #[test]
    fn the_orientation_s_uncertainty_grows_with_the_lever() {
        // 2 · 130 µrad · 200 mm = 0.052 mm; with 0.039 mm of the point 0.065 mm (5, 12 and 13).
        let lever = Vector3::new(0.0, 0.0, 200.0);
        let found = expanded_uncertainty_mm(0.039, 130e-6, &lever);
        assert!((found - 0.065).abs() < 1e-12, "{found}");
    }
}
