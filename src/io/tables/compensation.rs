//! `compensation`: the nodes of the chosen table, carried from the base frame into the frame of commands.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use super::validity::{self, joint_ranges, learnt_from};
use super::{PublishContext, PublishError, grid_steps, words};
use crate::grid::{Source, Table as Chosen, TableNode};
use crate::io::schema;
use crate::io::table::{Columns, Table};
use crate::join::Station;
use crate::kinematics::Configuration;
use crate::manifest::RunKey;
use crate::pipeline::outcome::Outcome;

/// The table of the chosen grid's nodes.
pub fn compensation(
    outcome: &Outcome<'_>,
    context: &PublishContext<'_>,
    key: &RunKey,
) -> Result<Table, PublishError> {
    let chosen = &outcome.grids.table;
    let table = Columns::new(schema::find("compensation")?, chosen.nodes.len())
        .key(key)
        .column("node", 0..chosen.nodes.len())
        .same("table_id", table_id(key));
    let table = places(table, chosen, context.command_from_base.isometry());
    let table = errors(table, chosen, context.command_from_base.isometry());
    let table = support(table, outcome, context);
    let table = measured(reading(table, outcome, context), outcome, context);
    Ok(validity::columns(table, &context.valid_for, outcome).finish()?)
}

/// A run has one table, so its name is the table's.
pub(super) fn table_id(key: &RunKey) -> &str {
    &key.run
}

fn places(columns: Columns, chosen: &Chosen, command_from_base: &Isometry3<f64>) -> Columns {
    let [nx, ny, _] = chosen.lattice.counts;
    let numbers = || 0..chosen.nodes.len();
    let position = |node: usize| -> [f64; 3] {
        (command_from_base * chosen.lattice.position(node))
            .coords
            .into()
    };
    let (origin, turn) = words::placement(command_from_base);
    let orientation = words::xyzw(&(command_from_base.rotation * chosen.orientation));
    columns
        .same("orientation", 0_i64)
        .column("index_x", numbers().map(|node| node % nx))
        .column("index_y", numbers().map(|node| node / nx % ny))
        .column("index_z", numbers().map(|node| node / (nx * ny)))
        .group(["x_mm", "y_mm", "z_mm"], numbers().map(position))
        .group(["qx", "qy", "qz", "qw"], numbers().map(|_| orientation))
        .group(
            ["step_x_mm", "step_y_mm", "step_z_mm"],
            numbers().map(|_| chosen.lattice.step),
        )
        .group(
            ["x", "y", "z"]
                .map(|axis| format!("command_from_base_{axis}_mm"))
                .each_ref()
                .map(String::as_str),
            numbers().map(|_| origin),
        )
        .group(
            ["x", "y", "z", "w"]
                .map(|axis| format!("command_from_base_q{axis}"))
                .each_ref()
                .map(String::as_str),
            numbers().map(|_| turn),
        )
}

fn errors(columns: Columns, chosen: &Chosen, command_from_base: &Isometry3<f64>) -> Columns {
    let turn = command_from_base.rotation.to_rotation_matrix();
    let carried = |node: &TableNode| -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let (error, covariance) = node.error.as_ref().ok()?;
        Some((turn * error, turn * covariance * turn.transpose()))
    };
    let found: Vec<_> = chosen.nodes.iter().map(carried).collect();
    let refused = |node: &TableNode| node.error.as_ref().err().map(|refusal| refusal.name());
    columns
        .group(
            ["error_x_mm", "error_y_mm", "error_z_mm"],
            found
                .iter()
                .map(|found| found.map(|(error, _)| error.into())),
        )
        .group(
            ["xx", "xy", "xz", "yy", "yz", "zz"]
                .map(|c| format!("error_cov_{c}_mm2"))
                .each_ref()
                .map(String::as_str),
            found.iter().map(|found| {
                found
                    .as_ref()
                    .map(|(_, covariance)| words::upper(covariance))
            }),
        )
        .column(
            "error_sd_mm",
            found
                .iter()
                .map(|found| found.map(|(_, covariance)| covariance.trace().sqrt())),
        )
        .column("refused", chosen.nodes.iter().map(refused))
}

/// How the nodes stand to the stations that were learnt from.
fn support(columns: Columns, outcome: &Outcome<'_>, context: &PublishContext<'_>) -> Columns {
    let chosen = &outcome.grids.table;
    let stations: Vec<&Station> = learnt_from(outcome).collect();
    let tool = |station: &&Station| {
        Point3::from(
            outcome
                .gauge
                .nominal_tool(&station.joints)
                .translation
                .vector,
        )
    };
    let tools: Vec<Point3<f64>> = stations.iter().map(tool).collect();
    let ranges = joint_ranges(outcome, context.arm.joints().len());
    let joints = || chosen.nodes.iter().map(|node| node.joints.as_deref().ok());
    let within = |joints: &[f64]| {
        joints
            .iter()
            .zip(&ranges)
            .all(|(q, (low, high))| (low..=high).contains(&q))
    };
    let near = |number: usize| {
        let node = chosen.lattice.position(number);
        let is_near = |tool: &&Point3<f64>| {
            (0..3).all(|k| (tool[k] - node[k]).abs() <= chosen.lattice.step[k])
        };
        tools.iter().filter(is_near).count()
    };
    let names: Vec<&str> = context
        .arm
        .joints()
        .iter()
        .map(|joint| joint.name.as_str())
        .collect();
    columns
        .same(
            "configuration",
            chosen.configuration.as_ref().map(Configuration::to_string),
        )
        .same("joint_names", names)
        .column("joints_rad", joints())
        .column(
            "within_joint_ranges",
            joints().map(|joints| joints.map(within)),
        )
        .column(
            "nearest_station_rad",
            joints().map(|joints| nearest_rad(joints?, &stations)),
        )
        .column(
            "nearest_station_mm",
            chosen
                .nodes
                .iter()
                .map(|node| Some(node.nearest_mm).filter(|mm| mm.is_finite())),
        )
        .column("stations_near", (0..chosen.nodes.len()).map(near))
}

/// The largest joint difference to the station where that is least, rad.
fn nearest_rad(joints: &[f64], stations: &[&Station]) -> Option<f64> {
    let apart = |station: &&Station| {
        let differences = station
            .joints
            .iter()
            .zip(joints)
            .map(|(a, b)| (a - b).abs());
        differences.fold(0.0, f64::max)
    };
    stations.iter().map(apart).min_by(f64::total_cmp)
}

/// How far the joints went, and where the target sat.
fn measured(columns: Columns, outcome: &Outcome<'_>, context: &PublishContext<'_>) -> Columns {
    let ranges = joint_ranges(outcome, context.arm.joints().len());
    let (lower, upper): (Vec<f64>, Vec<f64>) = ranges.into_iter().unzip();
    let target = outcome.gauge.frames().flange_from_target.origin();
    let [x, y, z]: [f64; 3] = target.coords().into();
    columns
        .same("joint_lower_rad", lower)
        .same("joint_upper_rad", upper)
        .same("flange_from_target_x_mm", x)
        .same("flange_from_target_y_mm", y)
        .same("flange_from_target_z_mm", z)
}

/// How the table has to be read.
fn reading(columns: Columns, outcome: &Outcome<'_>, context: &PublishContext<'_>) -> Columns {
    let (grids, chosen) = (&outcome.grids, &outcome.grids.table);
    let angles = match chosen.source {
        // A measured node is a station, and stations are at the angles that the controller reported.
        Source::Measured => "reported",
        Source::Model => words::angles(context.grid.angles),
    };
    columns
        .same("source", chosen.source.name())
        .same("interpolation", chosen.interpolation.name())
        .same("idw_power", grid_steps::power(chosen.interpolation, grids))
        .same("angles", angles)
        .same(
            "orientation_tolerance_deg",
            chosen.orientation_tolerance_rad.to_degrees(),
        )
        .same("verdict", words::verdict(&outcome.verdict.verdict()))
}
