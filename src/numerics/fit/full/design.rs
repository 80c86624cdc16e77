//! Rows of the error model: the target's motion per unit of every column, at one pose.

use std::f64::consts::PI;
use std::ops::Range;

use nalgebra::{DMatrix, DVector, Matrix3, Point3, Vector3};

use super::layout::{Block, Layout};
use super::tabulated::Tabulated;
use crate::fit::commanded::SettlingError;
use crate::fit::observation::measured::{Shown, moved};
use crate::kinematics::{Axes, Twist};
use crate::units::per_radian;

/// Settling error from which on the approach-direction offset of a joint that turns is complete, rad. Widths of 40 to
/// 110 µrad fit equally well.
const SATURATION_RAD: f64 = 60e-6;

pub fn saturation(slides: bool) -> f64 {
    SATURATION_RAD * per_radian(slides)
}

#[derive(Debug, Clone)]
pub struct PoseView<'a> {
    /// The target's motion per unit of each unknown of the problem that moves it.
    pub unknowns: &'a [(usize, Twist)],
    pub joints: &'a [Twist],
    pub axes: &'a Axes,
    /// Position of the target, mm.
    pub end: Point3<f64>,
    /// Direction of up, a unit vector; `None` where the mounting is not known.
    pub up: Option<Vector3<f64>>,
    pub base: Matrix3<f64>,
    pub angles: &'a [f64],
    /// Commanded minus reported axis variables, rad (mm where a joint slides); `None` where it is not known.
    pub settling_error: Option<&'a SettlingError>,
    pub session: Option<usize>,
    /// Place in the session as a share of the drift's span; `None` where drift and the session's scale do not apply.
    pub time: Option<f64>,
    /// The middle of the session's stations, mm, from which its scale moves the target away.
    pub middle: Point3<f64>,
}

/// Number of gravity columns: for each joint, one per point mass at a later joint's origin or at the target.
pub(super) fn gravity_columns(joints: usize) -> usize {
    (1..=joints).sum()
}

impl PoseView<'_> {
    /// The rows of a reading that shows `shown` of this pose, by all columns that move the target.
    pub fn rows(&self, layout: &Layout, shown: &Shown) -> DMatrix<f64> {
        let count = shown.rows();
        let mut rows = DMatrix::zeros(count, layout.size());
        let all = rows.as_mut_slice();
        self.walk(layout.blocks(), layout, &mut |column, twist, amount| {
            moved(shown, twist, amount, &mut all[column * count..(column + 1) * count]);
        });
        rows
    }

    /// The target's motion by the coefficients `mean` of all columns, mm and rad: the product of rows and `mean`, without forming rows.
    /// `curves` are the joint curves of the same coefficients.
    pub fn moved(&self, layout: &Layout, mean: &DVector<f64>, curves: &Tabulated) -> Twist {
        let mut moved = Twist::zero();
        let blocks = layout.blocks().filter(|(block, _)| !block.is_curve());
        self.walk(blocks, layout, &mut |column, twist, amount| {
            moved.add(twist, amount * mean[column]);
        });
        let errors = curves.at(self.session, self.angles);
        errors.zip(self.joints).for_each(|(error, twist)| moved.add(twist, error));
        moved
    }

    /// Calls `each` for every column of `blocks` with the twist and the factor by which its coefficient moves the target.
    pub(super) fn walk(
        &self,
        blocks: impl Iterator<Item = (Block, Range<usize>)>,
        layout: &Layout,
        each: &mut impl FnMut(usize, &Twist, f64),
    ) {
        for (block, columns) in blocks {
            match block {
                Block::Unknowns => {
                    for (unknown, twist) in self.unknowns {
                        each(columns.start + unknown, twist, 1.0);
                    }
                }
                Block::Gravity => self.gravity(columns.start, each),
                Block::CommandWeight => self.command_weight(columns, self.sent(), each),
                Block::ApproachOffset => self.approach_offset(columns, layout, each),
                Block::SessionCommandWeight(session) if self.session == Some(session) => {
                    self.command_weight(columns, self.sent(), each);
                }
                Block::OwnCommandWeight(session) if self.session == Some(session) => {
                    self.command_weight(columns, self.of_position(), each);
                }
                Block::WarmUp => self.drift(columns, each),
                Block::Drift(session) if self.session == Some(session) => {
                    self.drift(columns, each);
                }
                // It does not apply to a command, which is used in another session with another scale.
                Block::Scale(session) if self.session == Some(session) && self.time.is_some() => {
                    let linear = self.end - self.middle;
                    each(columns.start, &Twist { linear, angular: Vector3::zeros() }, 1.0);
                }
                Block::Curve(joint) if layout.is_now(self.session, joint) => {
                    self.curve(columns, joint, layout, each);
                }
                Block::Earlier { joint, to_come }
                    if layout.to_come(self.session, joint) == to_come =>
                {
                    self.curve_with_constant(columns, joint, layout, each);
                }
                Block::SessionCurve { session, joint } if self.session == Some(session) => {
                    self.curve_with_constant(columns, joint, layout, each);
                }
                Block::Ageing { joint, step } => {
                    let share = self.session.map(|session| layout.ageing(session, joint, step));
                    let Some(share) = share.filter(|share| *share > 0.0) else { continue };
                    let mut aged = |column: usize, twist: &Twist, amount: f64| {
                        each(column, twist, share * amount);
                    };
                    self.curve_with_constant(columns, joint, layout, &mut aged);
                }
                Block::Line { joint, cycles } if layout.is_now(self.session, joint) => {
                    let (sin, cos) = (cycles * self.angles[joint]).sin_cos();
                    each(columns.start, &self.joints[joint], cos);
                    each(columns.start + 1, &self.joints[joint], sin);
                }
                Block::SessionCommandWeight(_)
                | Block::OwnCommandWeight(_)
                | Block::Drift(_)
                | Block::Scale(_)
                | Block::Curve(_)
                | Block::Earlier { .. }
                | Block::SessionCurve { .. }
                | Block::Line { .. } => {}
            }
        }
    }

    /// `J_j` times the generalised force of the variable: `z_j·((o_k − o_j) × (−up))` for a joint that turns, lengths in m.
    fn gravity(&self, first: usize, each: &mut impl FnMut(usize, &Twist, f64)) {
        let Some(up) = self.up else { return };
        let mut column = first;
        for (joint, twist) in self.joints.iter().enumerate() {
            for force in self.axes.forces(joint, self.end, -up) {
                each(column, twist, force);
                column += 1;
            }
        }
    }

    fn sent(&self) -> &[f64] {
        self.settling_error.and_then(SettlingError::sent).unwrap_or_default()
    }

    fn of_position(&self) -> &[f64] {
        match self.settling_error {
            Some(SettlingError::OfPosition(axes)) => axes,
            Some(SettlingError::Sent(_)) | None => &[],
        }
    }

    fn command_weight(
        &self,
        columns: Range<usize>,
        settling_error: &[f64],
        each: &mut impl FnMut(usize, &Twist, f64),
    ) {
        for (column, (twist, settling_error)) in columns.zip(self.joints.iter().zip(settling_error))
        {
            each(column, twist, *settling_error);
        }
    }

    /// The offset of each joint, whole or in proportion to its settling error.
    fn approach_offset(
        &self,
        columns: Range<usize>,
        layout: &Layout,
        each: &mut impl FnMut(usize, &Twist, f64),
    ) {
        let settling_errors = self.joints.iter().zip(self.sent()).enumerate();
        for (column, (joint, (twist, settling_error))) in columns.zip(settling_errors) {
            let whole = saturation(layout.slide_period_mm(joint).is_some());
            each(column, twist, (settling_error / whole).clamp(-1.0, 1.0));
        }
    }

    fn drift(&self, columns: Range<usize>, each: &mut impl FnMut(usize, &Twist, f64)) {
        let Some(time) = self.time else { return };
        let orders = columns.len() / 3;
        let along = |axis: usize| Twist {
            linear: self.base.column(axis).into_owned(),
            angular: Vector3::zeros(),
        };
        let axes = [along(0), along(1), along(2)];
        let first = (PI * time).cos();
        let (mut shape, mut before) = (first, 1.0);
        for order in 0..orders {
            for (axis, along) in axes.iter().enumerate() {
                each(columns.start + axis * orders + order, along, shape);
            }
            // cos (k + 1)x = 2 cos x cos kx − cos (k − 1)x.
            (shape, before) = (2.0 * first * shape - before, shape);
        }
    }

    /// A constant, then the pairs of a curve.
    fn curve_with_constant(
        &self,
        columns: Range<usize>,
        joint: usize,
        layout: &Layout,
        each: &mut impl FnMut(usize, &Twist, f64),
    ) {
        each(columns.start, &self.joints[joint], 1.0);
        self.curve(columns.start + 1..columns.end, joint, layout, each);
    }

    fn curve(
        &self,
        columns: Range<usize>,
        joint: usize,
        layout: &Layout,
        each: &mut impl FnMut(usize, &Twist, f64),
    ) {
        let angle = self.angles[joint] / layout.curve_unit(joint);
        curve_pairs(angle, columns.len() / 2, |pair, cos, sin| {
            each(columns.start + 2 * pair, &self.joints[joint], cos);
            each(columns.start + 2 * pair + 1, &self.joints[joint], sin);
        });
    }
}

/// Calls `each` for the pairs of a curve, from 0, with `cos` and `sin` of `k q`, k being one more than the pair.
pub(super) fn curve_pairs(angle: f64, pairs: usize, mut each: impl FnMut(usize, f64, f64)) {
    let (sin, cos) = angle.sin_cos();
    let (mut sin_k, mut cos_k) = (sin, cos);
    for pair in 0..pairs {
        each(pair, cos_k, sin_k);
        // The angle sums of (k + 1) q.
        (sin_k, cos_k) = (sin_k * cos + cos_k * sin, cos_k * cos - sin_k * sin);
    }
}
