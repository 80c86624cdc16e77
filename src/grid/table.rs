//! The table of the chosen step: its nodes with their errors and covariances, and what other sessions say of it.

use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

use super::judge::HeldOut;
use super::lattice::{InCell, Lattice};
use super::measured::MeasuredGrid;
use super::node::{GridStation, PlacedGrid, Reach, Refusal, on_one_branch};
use super::settings::{GridPlan, GridSettings};
use super::{GridError, GridInput, Judged, Source, Table, TableNode};
use crate::fit::ToolErrors;

/// The nodes of the chosen row, with their values and covariances.
pub(super) fn table(
    input: &GridInput<'_>,
    reach: &Reach<'_>,
    plan: &GridPlan,
    like: &[&GridStation],
    chosen: &Judged,
    settings: &GridSettings,
) -> Result<Table, GridError> {
    let (lattice, nodes) = match chosen.source {
        Source::Model => model_nodes(input, reach, plan, like, chosen.step_mm)?,
        Source::Measured => measured_nodes(input, plan, chosen.step_mm)?,
    };
    Ok(Table {
        step_mm: chosen.step_mm,
        lattice,
        orientation: plan.orientation,
        configuration: plan.configuration,
        source: chosen.source,
        interpolation: chosen.interpolation,
        idw_power: settings.idw_power,
        orientation_tolerance_rad: settings.orientation_tolerance_deg.to_radians(),
        nodes,
    })
}

impl Table {
    /// Judges the table by stations of another session, beside what the model predicts there.
    pub(super) fn judged_by(&self, stations: &[GridStation], model: &ToolErrors<'_>) -> HeldOut {
        let mut held_out = HeldOut::default();
        for station in stations {
            if !self.is_like(station) {
                held_out.unlike += 1;
                continue;
            }
            held_out.add_found(station, self.error_at(&station.position), model);
        }
        held_out
    }

    /// Whether the table claims to serve a station: its configuration, and its orientation within the tolerance.
    fn is_like(&self, station: &GridStation) -> bool {
        let turned = station.orientation.angle_to(&self.orientation);
        station.configuration == self.configuration && turned <= self.orientation_tolerance_rad
    }

    /// The error at a point by the nodes around it, mm; `None` outside the table, or why its cell cannot serve.
    fn error_at(&self, point: &Point3<f64>) -> Option<Result<Vector3<f64>, Refusal>> {
        let cell = self.lattice.locate(point)?;
        let nodes = cell.vertices.map(|vertex| &self.nodes[vertex]);
        Some(self.interpolated(&nodes, &cell))
    }

    fn interpolated(
        &self,
        nodes: &[&TableNode; 8],
        cell: &InCell,
    ) -> Result<Vector3<f64>, Refusal> {
        let (mut joints, mut errors) = (Vec::with_capacity(8), Vec::with_capacity(8));
        for node in nodes {
            joints.push(node.joints.as_deref().map_err(|refusal| *refusal)?);
            errors.push(node.error.as_ref().map_err(|refusal| *refusal)?.0);
        }
        if !on_one_branch(&joints) {
            return Err(Refusal::Branches);
        }
        let (fraction, step) = (&cell.fraction, &self.lattice.step);
        let weights = self.interpolation.weights(fraction, step, self.idw_power);
        Ok(errors.iter().zip(weights).map(|(error, w)| error * w).sum())
    }
}

fn model_nodes(
    input: &GridInput<'_>,
    reach: &Reach<'_>,
    plan: &GridPlan,
    like: &[&GridStation],
    step_mm: f64,
) -> Result<(Lattice, Vec<TableNode>), GridError> {
    let lattice =
        Lattice::new(&plan.bounds, [step_mm; 3]).ok_or_else(|| plan.too_large(step_mm))?;
    let grid = PlacedGrid::new(reach, lattice, plan.orientation, like);
    let nodes = grid.nodes.into_par_iter().map(|node| TableNode {
        error: error_at(&input.model, &node.joints),
        joints: node.joints,
        nearest_mm: node.nearest_mm,
    });
    Ok((lattice, nodes.collect()))
}

/// The model's error at the joint angles of a node, with its covariance, or why there is none.
fn error_at(
    model: &ToolErrors<'_>,
    joints: &Result<Vec<f64>, Refusal>,
) -> Result<(Vector3<f64>, Matrix3<f64>), Refusal> {
    let joints = joints.as_ref().map_err(|refusal| *refusal)?;
    let error = model.error_with_covariance(joints);
    error.map_err(|gap| gap.refusal())
}

fn measured_nodes(
    input: &GridInput<'_>,
    plan: &GridPlan,
    step_mm: f64,
) -> Result<(Lattice, Vec<TableNode>), GridError> {
    let no_table = |reason: String| GridError::NoTable { reason };
    let own = MeasuredGrid::of(input.stations).map_err(|reason| no_table(reason.to_string()))?;
    let multiples = own
        .multiples(step_mm)
        .ok_or_else(|| no_table(format!("{step_mm} mm is no multiple of the pitch")))?;
    let grid = own
        .decimated(multiples, [0; 3])
        .ok_or_else(|| no_table("no cell is left".to_owned()))?;
    let variance = (input.guard_mm / 2.0).powi(2);
    let refused = |refusal: Refusal, nearest_mm: f64| TableNode {
        joints: Err(refusal),
        error: Err(refusal),
        nearest_mm,
    };
    let node = |place: &Option<usize>| match place.map(|place| &input.stations[place]) {
        None => refused(Refusal::Unmeasured, f64::INFINITY),
        Some(station) if station.configuration != plan.configuration => {
            refused(Refusal::OtherConfiguration, 0.0)
        }
        Some(station) => TableNode {
            joints: Ok(station.joints.clone()),
            error: Ok((station.error, Matrix3::identity() * variance)),
            nearest_mm: 0.0,
        },
    };
    Ok((grid.lattice, grid.nodes.iter().map(node).collect()))
}
