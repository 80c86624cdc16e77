//! The table of the chosen step: its nodes with their errors and covariances.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::lattice::Lattice;
use super::measured::MeasuredGrid;
use super::node::{GridStation, PlacedGrid, Reach, Refusal};
use super::settings::{GridPlan, GridSettings};
use super::{GridError, GridInput, Judged, Source, Table, TableNode};

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
        error: node
            .joints
            .as_ref()
            .map(|joints| input.model.error_with_covariance(joints))
            .map_err(|refusal| *refusal),
        joints: node.joints,
        nearest_mm: node.nearest_mm,
    });
    Ok((lattice, nodes.collect()))
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
