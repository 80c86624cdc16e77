//! Identified errors of an arm converted from one convention into another, with their covariance.
//!
//! Both conventions describe the chain from base to target of one arm. Inputs: the offsets of one convention's parameters and their
//! covariance. Outputs: those of the other. With `J` the twists of the target per unit of each parameter at poses spread over the
//! joints' ranges, the offsets of the other convention solve `J' x' = J x` (by Gauss and Newton, as errors of angles are not quite
//! linear), and `T = J'⁺ J` carries the covariance: `C' = T C Tᵀ`. Directions that belong to the convention alone have no effect on
//! the target; of all solutions the least is taken, 1 mm counted as 1 mrad, and what a link can say is not said by base or target.

use nalgebra::{DMatrix, DVector, Isometry3};

use super::FramePair;
use super::problem::measurement_chain;
use crate::geometry::Transform;
use crate::kinematics::inverse::spread;
use crate::kinematics::{Arm, Chain, Parameter};

/// Poses that the two conventions are compared at, and as many others for what is left.
const POSES: u32 = 80;
const RAD_PER_MM: f64 = 1e-3;
/// An offset of base or target counts as much as a link's that is larger by the inverse of this.
const FRAME_SIZE: f64 = 1e-3;
/// Singular values below this share of the largest belong to the convention alone.
const NO_EFFECT: f64 = 1e-11;
const ROUNDS: usize = 20;

/// Offsets of the parameters of a chain from base to target, with their covariance.
#[derive(Debug, Clone, PartialEq)]
pub struct Errors {
    /// The parameters: those of the arm in its order, and of base and target.
    pub parameters: Vec<Parameter>,
    pub offsets: DVector<f64>,
    pub covariance: DMatrix<f64>,
}

impl Errors {
    pub fn set(&mut self, parameter: Parameter, offset: f64) {
        if let Some(place) = self.place(parameter) {
            self.offsets[place] = offset;
            return;
        }
        self.parameters.push(parameter);
        let size = self.parameters.len();
        self.offsets = self.offsets.clone().resize_vertically(size, offset);
        self.covariance = std::mem::take(&mut self.covariance).resize(size, size, 0.0);
    }

    fn of(&self, chain: &Chain) -> DVector<f64> {
        let parameters = chain.parameters();
        let offset =
            |parameter: &Parameter| self.place(*parameter).map_or(0.0, |place| self.offsets[place]);
        DVector::from_iterator(parameters.len(), parameters.iter().map(offset))
    }

    /// Columns per parameter of a chain, brought into the order of these errors.
    fn columns(&self, chain: &Chain, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let mut own = DMatrix::zeros(columns.nrows(), self.parameters.len());
        for (column, parameter) in chain.parameters().into_iter().enumerate() {
            if let Some(place) = self.place(parameter) {
                own.set_column(place, &columns.column(column));
            }
        }
        own
    }

    fn place(&self, parameter: Parameter) -> Option<usize> {
        self.parameters.iter().position(|own| *own == parameter)
    }
}

/// Errors in another convention, and how well they are the same.
#[derive(Debug, Clone, PartialEq)]
pub struct Converted {
    pub errors: Errors,
    /// The largest distance of the target as the two conventions predict it, at poses that took no part, mm.
    pub left_mm: f64,
    /// The largest turn between them there, rad.
    pub left_rad: f64,
}

/// The errors of `from`, stated in the parameters of `to`: the same nominal arm in another convention.
///
/// `flange_from_target` is what the target's offsets are counted from. A parameter that `errors` does not name has none.
pub fn converted(
    from: &Arm,
    errors: &Errors,
    to: &Arm,
    flange_from_target: &Isometry3<f64>,
) -> Converted {
    let (own, other) =
        (measured(from.chain(), flange_from_target), measured(to.chain(), flange_from_target));
    let offsets = errors.of(&own);
    let parameters = other.parameters();
    let poses = |first: u32| {
        (first..first + POSES).map(|place| {
            (from.axes(&spread_joints(from, place)), to.axes(&spread_joints(to, place)))
        })
    };
    let poses: [Vec<_>; 2] = [poses(0).collect(), poses(POSES).collect()];
    let sizes = DVector::from_iterator(parameters.len(), parameters.iter().map(cost));
    let mut found = DVector::zeros(parameters.len());
    let inverse = |found: &DVector<f64>| {
        pseudo_inverse(&jacobian(&other, found, poses[0].iter().map(|p| &p.1)), &sizes)
    };
    for _ in 0..ROUNDS {
        let away = differences(&own, &offsets, &other, &found, &poses[0]);
        let step = inverse(&found) * away;
        let is_done = step.component_div(&sizes).amax() < 1e-10;
        found += step;
        if is_done {
            break;
        }
    }
    let through = inverse(&found) * jacobian(&own, &offsets, poses[0].iter().map(|p| &p.0));
    let through = errors.columns(&own, &through);
    let left = differences(&own, &offsets, &other, &found, &poses[1]);
    let largest = |first: usize| {
        let norms = (first..left.len()).step_by(6).map(|row| left.rows(row, 3).norm());
        norms.fold(0.0, f64::max)
    };
    Converted {
        left_mm: largest(0),
        left_rad: largest(3) * RAD_PER_MM,
        errors: Errors {
            covariance: &through * &errors.covariance * through.transpose(),
            offsets: found,
            parameters,
        },
    }
}

/// The offset that counts as 1 mm of a link.
fn size(parameter: &Parameter) -> f64 {
    if parameter.is_angle() { RAD_PER_MM } else { 1.0 }
}

/// The offset that counts as 1 mm of a link when the least offsets are looked for.
fn cost(parameter: &Parameter) -> f64 {
    let share = match parameter {
        Parameter::Link { .. } => 1.0,
        Parameter::Base(_) | Parameter::Target(_) | Parameter::Gauge(_) => FRAME_SIZE,
    };
    share * size(parameter)
}

/// The chain of a fit with the base where the root is: `(six small motions of the base) · arm · (three shifts) · flange_from_target ·
/// (three turns)`.
pub fn measured(arm: &Chain, flange_from_target: &Isometry3<f64>) -> Chain {
    let frames = FramePair::only(
        Transform::claim(Isometry3::identity()),
        Transform::claim(*flange_from_target),
    );
    measurement_chain(arm, &frames, true)
}

/// Joint positions spread over the ranges, rad or mm, another pose for each `place`.
pub fn spread_joints(arm: &Arm, place: u32) -> Vec<f64> {
    let ranges: Vec<_> = arm.joints().iter().map(|joint| [joint.lower, joint.upper]).collect();
    spread(place, &ranges)
}

/// Target of `one` minus target of `other` at each pose: three rows of mm, three of rad over [`RAD_PER_MM`].
fn differences(
    one: &Chain,
    offsets: &DVector<f64>,
    other: &Chain,
    found: &DVector<f64>,
    poses: &[(Vec<f64>, Vec<f64>)],
) -> DVector<f64> {
    let mut rows = DVector::zeros(6 * poses.len());
    for (place, (own, others)) in poses.iter().enumerate() {
        let wanted = one.forward(own, offsets.as_slice());
        let here = other.forward(others, found.as_slice());
        let off = wanted.translation.vector - here.translation.vector;
        let turn = (wanted.rotation * here.rotation.inverse()).scaled_axis();
        rows.fixed_rows_mut::<3>(6 * place).copy_from(&off);
        rows.fixed_rows_mut::<3>(6 * place + 3).copy_from(&(turn / RAD_PER_MM));
    }
    rows
}

/// Rows of [`differences`] per unit of each parameter.
fn jacobian<'a>(
    chain: &Chain,
    offsets: &DVector<f64>,
    poses: impl Iterator<Item = &'a Vec<f64>>,
) -> DMatrix<f64> {
    let poses: Vec<&Vec<f64>> = poses.collect();
    let mut jacobian = DMatrix::zeros(6 * poses.len(), offsets.len());
    for (place, axes) in poses.iter().enumerate() {
        let twists = chain.differential(axes, offsets.as_slice()).parameters;
        for (column, twist) in twists.iter().enumerate() {
            let mut rows = jacobian.fixed_view_mut::<6, 1>(6 * place, column);
            rows.fixed_rows_mut::<3>(0).copy_from(&twist.linear);
            rows.fixed_rows_mut::<3>(3).copy_from(&(twist.angular / RAD_PER_MM));
        }
    }
    jacobian
}

/// The pseudo-inverse that gives the least offsets, each in its own size.
fn pseudo_inverse(jacobian: &DMatrix<f64>, sizes: &DVector<f64>) -> DMatrix<f64> {
    let mut scaled = jacobian.clone();
    for (column, size) in sizes.iter().enumerate() {
        scaled.column_mut(column).scale_mut(*size);
    }
    let svd = scaled.svd(true, true);
    let floor = NO_EFFECT * svd.singular_values.amax();
    let mut inverse = svd.pseudo_inverse(floor).expect("both sides were asked for");
    for (row, size) in sizes.iter().enumerate() {
        inverse.row_mut(row).scale_mut(*size);
    }
    inverse
}

#[cfg(test)]
pub(super) mod tests;
