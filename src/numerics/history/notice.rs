//! The size of a change, and the size from which a change counts.
//!
//! Of many stations a change of a few µm is significant, and matters to nobody. A change counts where it is significant and moves the
//! measured point by [`notices_mm`](crate::grid::notices_mm) or more: root mean square over poses spread through the joint
//! ranges of the session (a lattice of Korobov 1959), with all shifts of the change together.

use nalgebra::{Isometry3, Vector3};
use serde::{Deserialize, Serialize};

use super::compare::Shift;
use super::estimate::Column;
use crate::kinematics::{Arm, Differential, Motion, Parameter, Twist};

/// Number of poses, a prime.
const POSES: usize = 7;
/// A primitive root of it.
const ROOT: usize = 3;

/// The size from which a change counts, and what gives the size of one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Noticed {
    pub least_mm: f64,
    /// Displacement of the measured point at each pose by one unit of each column, mm.
    effects: Vec<(Column, Vec<[f64; 3]>)>,
}

impl Noticed {
    /// Of changes of `columns` of an arm whose joints moved within `ranges`, with the measured target at the flange.
    pub fn new(
        least_mm: f64,
        columns: &[Column],
        arm: &Arm,
        target: &Isometry3<f64>,
        ranges: &[[f64; 2]],
    ) -> Self {
        let none = arm.no_offsets();
        let pose = |pose: usize| {
            let mut factor = pose;
            let joint = |[low, high]: &[f64; 2]| {
                factor = factor * ROOT % POSES;
                low + (high - low) * (factor as f64 + 0.5) / POSES as f64
            };
            let axes = arm.axes(&ranges.iter().map(joint).collect::<Vec<_>>());
            arm.chain().differential(&axes, &none)
        };
        let poses: Vec<Differential> = (0..POSES).map(pose).collect();
        let effect = |column: &Column| {
            // To the µm: what is kept of a run stays small.
            let by = poses.iter().map(|pose| {
                let by = moved(arm, pose, target, column) * column.unit();
                by.map(|mm| (1e3 * mm).round() / 1e3).into()
            });
            (*column, by.collect())
        };
        Self { least_mm, effects: columns.iter().map(effect).collect() }
    }

    /// The size from which a shift of one column counts, mm or rad; 0 where it moves the point nowhere.
    pub fn least(&self, column: Column) -> f64 {
        let value = column.unit();
        let one = Shift { column, value, sd: 0.0 };
        let size_mm = self.size_mm([&one].into_iter());
        if size_mm > 0.0 { value * self.least_mm / size_mm } else { 0.0 }
    }

    /// The displacement of the measured point by shifts together, root mean square over the poses, mm.
    pub fn size_mm<'s>(&self, shifts: impl Iterator<Item = &'s Shift>) -> f64 {
        let mut moved = [Vector3::zeros(); POSES];
        for shift in shifts {
            let units = shift.value / shift.column.unit();
            let own = self.effects.iter().find(|(own, _)| *own == shift.column);
            for (sum, by) in moved.iter_mut().zip(own.iter().flat_map(|(_, by)| by)) {
                *sum += Vector3::from(*by) * units;
            }
        }
        (moved.iter().map(Vector3::norm_squared).sum::<f64>() / POSES as f64).sqrt()
    }
}

/// Displacement of the measured target at a pose by one mm or rad of a column, base frame, mm.
fn moved(arm: &Arm, pose: &Differential, target: &Isometry3<f64>, column: &Column) -> Vector3<f64> {
    let at = pose.end * target;
    let lever = at.translation.vector - pose.end.translation.vector;
    let by = |twist: &Twist| twist.linear + twist.angular.cross(&lever);
    match column {
        Column::Chain(Parameter::Base(Motion::Translation(axis))) => axis.unit().into_inner(),
        Column::Chain(Parameter::Base(Motion::Rotation(axis))) => {
            axis.unit().cross(&at.translation.vector)
        }
        Column::Chain(Parameter::Target(Motion::Translation(axis))) => {
            at.rotation * axis.unit().into_inner()
        }
        Column::Chain(own) | Column::Slide(own) => {
            let mut parameters = arm.chain().parameters().into_iter().zip(&pose.parameters);
            let found = parameters.find(|(other, _)| other == own);
            found.map_or_else(Vector3::zeros, |(_, twist)| by(twist))
        }
        Column::Curve { joint, .. } | Column::SlideCurve { joint, .. } => {
            pose.joints.get(joint - 1).map_or_else(Vector3::zeros, by)
        }
        // A deflection is of some joint: as if of the one that moves the point most.
        Column::Gravity(_) | Column::SlideGravity(_) => {
            let longest = |a: &Vector3<f64>, b: &Vector3<f64>| a.norm().total_cmp(&b.norm());
            pose.joints.iter().map(by).max_by(longest).unwrap_or_default()
        }
    }
}
