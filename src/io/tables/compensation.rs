//! `compensation`: the nodes of the chosen table, transformed from the base frame into the frame of commands.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use super::error_frame::ErrorFrameName;
use super::validity::{joint_ranges, largest_error_mm, learnt_from, temperatures};
use super::words::{TableVerdict, joint_units, placement, xyzw};
use super::{PublishContext, grid_steps};
use crate::common::corrects;
use crate::geometry::{self, upper};
use crate::grid::{Interpolation, Refusal, Source, Table as Chosen, TableNode};
use crate::join::Station;
use crate::judgement::Outcome;
use crate::kinematics::Configuration;
use crate::manifest::RunKey;
use crate::report::Angles;
use crate::table::row;

row! {
    /// A node of the chosen table, with the values of the whole table.
    pub struct NodeRow of "compensation" {
        node: usize,
        orientation: i64,
        index_x: usize,
        index_y: usize,
        index_z: usize,
        table_id: Arc<str>,
        at as [x_mm, y_mm, z_mm]: [f64; 3],
        turn as [qx, qy, qz, qw]: [f64; 4],
        configuration: Option<Arc<str>>,
        joint_names: Arc<[String]>,
        joint_units: Option<Arc<[String]>>,
        joints_rad: Option<Vec<f64>>,
        error as [error_x_mm, error_y_mm, error_z_mm]: Option<[f64; 3]>,
        error_cov_mm2 as [
            error_cov_xx_mm2,
            error_cov_xy_mm2,
            error_cov_xz_mm2,
            error_cov_yy_mm2,
            error_cov_yz_mm2,
            error_cov_zz_mm2,
        ]: Option<[f64; 6]>,
        error_sd_mm: Option<f64>,
        refused: Option<Refusal>,
        nearest_station_mm: Option<f64>,
        nearest_station_rad: Option<f64>,
        stations_near: usize,
        within_joint_ranges: Option<bool>,
        steps_mm as [step_x_mm, step_y_mm, step_z_mm]: [f64; 3],
        command_from_base as [
            command_from_base_x_mm,
            command_from_base_y_mm,
            command_from_base_z_mm,
        ]: [f64; 3],
        command_from_base_turn as [
            command_from_base_qx,
            command_from_base_qy,
            command_from_base_qz,
            command_from_base_qw,
        ]: [f64; 4],
        source: Source,
        interpolation: Interpolation,
        idw_power: Option<f64>,
        interpolation_moment_mm2 as [
            interpolation_moment_xx_mm2,
            interpolation_moment_xy_mm2,
            interpolation_moment_xz_mm2,
            interpolation_moment_yy_mm2,
            interpolation_moment_yz_mm2,
            interpolation_moment_zz_mm2,
        ]: Option<[f64; 6]>,
        angles: Angles,
        orientation_tolerance_deg: f64,
        verdict: TableVerdict,
        reason: Option<Arc<str>>,
        largest_error_mm: Option<f64>,
        table_and_arm: Option<Arc<str>>,
        joint_lower_rad: Arc<[f64]>,
        joint_upper_rad: Arc<[f64]>,
        flange_from_target as [
            flange_from_target_x_mm,
            flange_from_target_y_mm,
            flange_from_target_z_mm,
        ]: [f64; 3],
        error_frame: ErrorFrameName,
        error_frame_base as [
            error_frame_base_x_mm,
            error_frame_base_y_mm,
            error_frame_base_z_mm,
        ]: [f64; 3],
        error_frame_base_turn as [
            error_frame_base_qx,
            error_frame_base_qy,
            error_frame_base_qz,
            error_frame_base_qw,
        ]: [f64; 4],
        error_frame_sd_mm: Option<f64>,
        error_frame_sd_deg: Option<f64>,
        error_frame_lever_sd_mm: Option<f64>,
        tool: Option<Arc<str>>,
        payload_kg: Option<f64>,
        mounting: Option<Arc<str>>,
        base: Option<Arc<str>>,
        controller_model: Option<Arc<str>>,
        absolute_accuracy_option: Option<bool>,
        temperature_min_c: Option<f64>,
        temperature_max_c: Option<f64>,
    }
}

corrects!(NodeRow);

/// The rows of the chosen grid's nodes; none where no step gives a table.
pub fn rows(outcome: &Outcome<'_>, context: &PublishContext<'_>, key: &RunKey) -> Vec<NodeRow> {
    let Some(chosen) = &outcome.grids.table else {
        return Vec::new();
    };
    let (shared, support) =
        (shared(chosen, outcome, context, key), Support::new(chosen, outcome, context));
    let nodes = chosen.nodes.iter().enumerate();
    nodes
        .map(|(number, node)| {
            let row = support.of(number, node, shared.clone());
            of_place(number, chosen, context, row)
        })
        .collect()
}

/// The table's name: a run has one table, so it is the run's.
pub(super) fn table_id(key: &RunKey) -> &str {
    &key.run
}

/// The values of the whole table, in a row without a node.
fn shared(
    chosen: &Chosen,
    outcome: &Outcome<'_>,
    context: &PublishContext<'_>,
    key: &RunKey,
) -> NodeRow {
    let stated = &context.valid_for;
    let joints = context.arm.joints();
    let (lower, upper): (Vec<f64>, Vec<f64>) =
        joint_ranges(outcome, joints.len()).into_iter().unzip();
    let command_from_base = context.command_from_base.isometry();
    let (origin, turn) = placement(command_from_base);
    let target = outcome.error_frame.frames().flange_from_target.origin();
    let error_frame_base = placement(&outcome.frame.tracker_from_base);
    let (temperature_min_c, temperature_max_c) = temperatures(outcome).unzip();
    let text = |text: &Option<String>| text.as_deref().map(Arc::from);
    let configuration = chosen.configuration.as_ref().map(Configuration::to_string);
    NodeRow {
        node: 0,
        orientation: 0,
        index_x: 0,
        index_y: 0,
        index_z: 0,
        table_id: table_id(key).into(),
        at: [0.0; 3],
        turn: xyzw(&(command_from_base.rotation * chosen.orientation)),
        configuration: text(&configuration),
        joint_names: joints.iter().map(|joint| joint.name.clone()).collect(),
        joint_units: joint_units(joints),
        joints_rad: None,
        error: None,
        error_cov_mm2: None,
        error_sd_mm: None,
        refused: None,
        nearest_station_mm: None,
        nearest_station_rad: None,
        stations_near: 0,
        within_joint_ranges: None,
        steps_mm: chosen.lattice.step,
        command_from_base: origin,
        command_from_base_turn: turn,
        source: chosen.source,
        interpolation: chosen.interpolation,
        idw_power: grid_steps::power(chosen.interpolation, chosen.idw_power),
        interpolation_moment_mm2: chosen.interpolation_mm2.map(|own| {
            let turn = command_from_base.rotation.to_rotation_matrix();
            geometry::upper(&(turn * own * turn.transpose()))
        }),
        angles: match chosen.source {
            // A measured node is a station, and stations are at the angles that the controller reported.
            Source::Measured => Angles::Reported,
            Source::Model => Angles::Commanded,
        },
        orientation_tolerance_deg: chosen.orientation_tolerance_rad.to_degrees(),
        verdict: (&outcome.verdict.table().verdict()).into(),
        reason: text(&outcome.verdict.table().reason()),
        largest_error_mm: largest_error_mm(outcome),
        table_and_arm: text(&context.pairs.table_and_arm.map(|own| own.words())),
        joint_lower_rad: lower.into(),
        joint_upper_rad: upper.into(),
        flange_from_target: target.coords().into(),
        error_frame: (&outcome.frame).into(),
        error_frame_base: error_frame_base.0,
        error_frame_base_turn: error_frame_base.1,
        error_frame_sd_mm: outcome.frame.sd_mm,
        error_frame_sd_deg: outcome.frame.sd_deg,
        error_frame_lever_sd_mm: outcome.frame.lever_sd_mm,
        tool: text(&stated.tool),
        payload_kg: stated.payload_kg,
        mounting: text(&stated.mounting),
        base: text(&stated.base),
        controller_model: text(&stated.controller_model),
        absolute_accuracy_option: stated.absolute_accuracy_option,
        temperature_min_c,
        temperature_max_c,
    }
}

fn of_place(number: usize, chosen: &Chosen, context: &PublishContext<'_>, row: NodeRow) -> NodeRow {
    let [nx, ny, _] = chosen.lattice.counts;
    let at = context.command_from_base.isometry() * chosen.lattice.position(number);
    let row = NodeRow {
        node: number,
        index_x: number % nx,
        index_y: number / nx % ny,
        index_z: number / (nx * ny),
        at: at.coords.into(),
        ..row
    };
    with_error(&chosen.nodes[number], context.command_from_base.isometry(), row)
}

/// The node's error transformed into the frame of commands, or why it has none.
fn with_error(node: &TableNode, command_from_base: &Isometry3<f64>, row: NodeRow) -> NodeRow {
    let turn = command_from_base.rotation.to_rotation_matrix();
    let carried = |(error, covariance): &(Vector3<f64>, Matrix3<f64>)| {
        (turn * error, turn * covariance * turn.transpose())
    };
    let found = node.error.as_ref().ok().map(carried);
    NodeRow {
        error: found.map(|(error, _)| error.into()),
        error_cov_mm2: found.as_ref().map(|(_, covariance)| upper(covariance)),
        error_sd_mm: found.map(|(_, covariance)| covariance.trace().sqrt()),
        refused: node.error.as_ref().err().copied(),
        ..row
    }
}

/// The relation of nodes to the stations that were learnt from.
struct Support<'a> {
    chosen: &'a Chosen,
    stations: Vec<&'a Station>,
    /// The nominal tool point at each station, base frame, mm.
    tools: Vec<Point3<f64>>,
    /// Lowest and highest reported angle of each joint, rad.
    ranges: Vec<(f64, f64)>,
    /// Radians that one unit of each joint's variable counts as.
    counted: Vec<f64>,
}

impl<'a> Support<'a> {
    fn new(chosen: &'a Chosen, outcome: &'a Outcome<'_>, context: &PublishContext<'_>) -> Self {
        let stations: Vec<&Station> = learnt_from(outcome).collect();
        let tool = |station: &&Station| {
            let tool = outcome.error_frame.nominal_tool(&station.joints);
            Point3::from(tool.translation.vector)
        };
        Self {
            chosen,
            tools: stations.iter().map(tool).collect(),
            stations,
            ranges: joint_ranges(outcome, context.arm.joints().len()),
            counted: context.arm.counted(),
        }
    }

    fn of(&self, number: usize, node: &TableNode, row: NodeRow) -> NodeRow {
        let joints = node.joints.as_deref().ok();
        NodeRow {
            joints_rad: joints.map(<[f64]>::to_vec),
            nearest_station_mm: Some(node.nearest_mm).filter(|mm| mm.is_finite()),
            nearest_station_rad: joints
                .and_then(|joints| nearest_rad(joints, &self.stations, &self.counted)),
            stations_near: self.near(number),
            within_joint_ranges: joints.map(|joints| self.is_within(joints)),
            ..row
        }
    }

    /// Whether joint angles are within those of the stations.
    fn is_within(&self, joints: &[f64]) -> bool {
        let mut joints = joints.iter().zip(&self.ranges);
        joints.all(|(q, (low, high))| (low..=high).contains(&q))
    }

    /// The number of stations within a step of a node along each axis.
    fn near(&self, number: usize) -> usize {
        let (node, step) = (self.chosen.lattice.position(number), self.chosen.lattice.step);
        let is_near = |tool: &&Point3<f64>| (0..3).all(|k| (tool[k] - node[k]).abs() <= step[k]);
        self.tools.iter().filter(is_near).count()
    }
}

/// The largest joint difference to the station for which it is smallest, rad; a mm of sliding counts as a mrad.
fn nearest_rad(joints: &[f64], stations: &[&Station], counted: &[f64]) -> Option<f64> {
    let apart = |station: &&Station| {
        let differences = station
            .joints
            .iter()
            .zip(joints)
            .zip(counted)
            .map(|((a, b), counted)| (a - b).abs() * counted);
        differences.fold(0.0, f64::max)
    };
    stations.iter().map(apart).min_by(f64::total_cmp)
}
