//! Known distances between targets: one further row of the fit each.
//!
//! A distance `d ± sd` between the targets a and b, which sit at `p_a` and `p_b` on the flange, has the whitened residual
//! `(d − |p_a − p_b|) / sd`, and its derivative along the places is `± u / sd` with `u` the direction from b to a. It is told by
//! other means than the readings, so it counts like a prior: with its own standard deviation, whatever the arm's misfit.

use nalgebra::{DMatrix, DVector, Vector3};

use super::unknowns::{Owner, TargetDistance, Unknown};
use crate::fit::frames::Frames;
use crate::join::TargetId;
use crate::kinematics::{Axis, Motion, Parameter};

/// Targets closer together than this have no direction between them, mm.
const ONE_PLACE_MM: f64 = 1e-6;

#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    /// Places of the two targets' shifts along x, y, z among the unknowns.
    columns: [[usize; 3]; 2],
    /// The places on the flange that the shifts start from, mm.
    starts: [Vector3<f64>; 2],
    known: TargetDistance,
}

/// A row at given offsets: whitened.
#[derive(Debug, Clone, Copy)]
pub(in crate::fit) struct DistanceRow {
    /// Unknowns and the derivative of the predicted distance along each.
    pub(in crate::fit) entries: [(usize, f64); 6],
    pub(in crate::fit) residual: f64,
}

impl Row {
    /// The rows of the distances in all sessions; none where the places are fixed, or a session has no such target.
    pub(super) fn all(
        distances: &[TargetDistance],
        unknowns: &[Unknown],
        starts: &[Frames],
    ) -> Vec<Self> {
        let rows = starts.iter().enumerate().flat_map(|(session, frames)| {
            distances.iter().filter_map(move |known| Self::of(*known, session, frames, unknowns))
        });
        rows.collect()
    }

    fn of(
        known: TargetDistance,
        session: usize,
        frames: &Frames,
        unknowns: &[Unknown],
    ) -> Option<Self> {
        let [a, b] = known.between;
        let columns = |target| {
            let place = |axis| {
                let unknown = Unknown {
                    owner: Owner::Target { session, target },
                    parameter: Parameter::Target(Motion::Translation(axis)),
                };
                unknowns.iter().position(|own| *own == unknown)
            };
            let [x, y, z] = Axis::ALL.map(place);
            Some([x?, y?, z?])
        };
        let start =
            |target: TargetId| Some(frames.targets().get(target.0)?.isometry().translation.vector);
        Some(Self { columns: [columns(a)?, columns(b)?], starts: [start(a)?, start(b)?], known })
    }

    pub(super) fn at(&self, offsets: &DVector<f64>) -> DistanceRow {
        let place = |end: usize| {
            self.starts[end] + Vector3::from(self.columns[end].map(|column| offsets[column]))
        };
        let away = place(0) - place(1);
        let length_mm = away.norm();
        // From one place every direction is as good as any other: the readings part the targets first.
        let direction = if length_mm > ONE_PLACE_MM {
            away / (length_mm * self.known.sd_mm)
        } else {
            Vector3::zeros()
        };
        let entry = |at: usize| {
            let (end, axis) = (at / 3, at % 3);
            (self.columns[end][axis], [direction[axis], -direction[axis]][end])
        };
        DistanceRow {
            entries: std::array::from_fn(entry),
            residual: (self.known.mm - length_mm) / self.known.sd_mm,
        }
    }
}

impl DistanceRow {
    /// Adds `jᵀ j` to an information.
    pub(super) fn add_information(&self, information: &mut DMatrix<f64>) {
        for &(row, by) in &self.entries {
            for &(column, other) in &self.entries {
                information[(row, column)] += by * other;
            }
        }
    }

    /// Adds `jᵀ r` to a gradient.
    pub(super) fn add_gradient(&self, gradient: &mut DVector<f64>) {
        for &(unknown, by) in &self.entries {
            gradient[unknown] += by * self.residual;
        }
    }
}
