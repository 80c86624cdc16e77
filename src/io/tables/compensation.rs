//! `compensation`: the nodes of the chosen table, transformed from the base frame into the frame of commands.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3};

use super::validity::{ValidFor, joint_ranges, learnt_from};
use super::words::{TableVerdict, xyzw};
use super::{PublishContext, grid_steps};
use crate::geometry::upper;
use crate::grid::{Interpolation, Refusal, Source, Table as Chosen};
use crate::join::Station;
use crate::judgement::Outcome;
use crate::kinematics::Configuration;
use crate::manifest::RunKey;
use crate::report::Angles;
use crate::rows::{Each, Field, FieldColumn, Names, columns, row};
use crate::table::{Columns, Table};

row! {
    pub struct NodeRow of "compensation" {
        node: usize,
        index_x: usize,
        index_y: usize,
        index_z: usize,
        at as [x_mm, y_mm, z_mm]: [f64; 3],
        joints_rad: Option<Vec<f64>>,
        error as point: Option<[f64; 3]>,
        error_cov_mm2 as [error_cov: covariance]: Option<[f64; 6]>,
        error_sd_mm: Option<f64>,
        refused: Option<Refusal>,
        nearest_station_mm: Option<f64>,
        nearest_station_rad: Option<f64>,
        stations_near: usize,
        within_joint_ranges: Option<bool>,
        of_table: Arc<TableColumns>,
    }
}

columns! {
    /// Columns of the whole table, the same in every row.
    pub struct TableColumns {
        orientation: i64,
        table_id: String,
        turn as [qx, qy, qz, qw]: [f64; 4],
        configuration: Option<String>,
        steps_mm as [step_x_mm, step_y_mm, step_z_mm]: [f64; 3],
        source: Source,
        interpolation: Interpolation,
        idw_power: Option<f64>,
        interpolation_moment_mm2 as [interpolation_moment: covariance]: Option<[f64; 6]>,
        angles: Angles,
        orientation_tolerance_deg: f64,
        verdict: TableVerdict,
        reason: Option<String>,
        table_and_arm: Option<String>,
        flange_from_target as point: [f64; 3],
        valid_for: ValidFor,
    }
}

/// Rows that follow each other and have the same columns share them.
impl Field for Arc<TableColumns> {
    fn put<'v>(columns: Columns, names: Names, values: impl Each<'v, Self>) -> Columns {
        TableColumns::put(columns, names, values.map(AsRef::as_ref))
    }

    fn all(table: &Table, names: Names) -> impl Iterator<Item = Self> {
        TableColumns::all(table, names).scan(None, |last: &mut Option<Self>, own| {
            let same = last.take().filter(|last| **last == own);
            *last = Some(same.unwrap_or_else(|| Self::new(own)));
            last.clone()
        })
    }

    fn columns(names: Names) -> Vec<FieldColumn> {
        TableColumns::columns(names)
    }
}

/// The rows of the chosen grid's nodes; none where no step gives a table.
pub fn rows(outcome: &Outcome<'_>, context: &PublishContext<'_>, key: &RunKey) -> Vec<NodeRow> {
    let Some(chosen) = &outcome.grids.table else { return Vec::new() };
    let of_table = Arc::new(of_table(chosen, outcome, context, key));
    let support = Support::new(chosen, outcome, context);
    let command_from_base = context.command_from_base.isometry();
    let row = |number| support.row(number, command_from_base, Arc::clone(&of_table));
    (0..chosen.nodes.len()).map(row).collect()
}

/// The table's name: a run has one table, so it is the run's.
pub(super) fn table_id(key: &RunKey) -> &str {
    &key.run
}

fn of_table(
    chosen: &Chosen,
    outcome: &Outcome<'_>,
    context: &PublishContext<'_>,
    key: &RunKey,
) -> TableColumns {
    let turn = context.command_from_base.isometry().rotation;
    let verdict = &outcome.verdict.table;
    let target = outcome.error_frame.frames.flange_from_target.origin();
    TableColumns {
        orientation: 0,
        table_id: table_id(key).to_owned(),
        turn: xyzw(&(turn * chosen.orientation)),
        configuration: chosen.configuration.as_ref().map(Configuration::to_string),
        steps_mm: chosen.lattice.step,
        source: chosen.source,
        interpolation: chosen.interpolation,
        idw_power: grid_steps::power(chosen.interpolation, chosen.idw_power),
        interpolation_moment_mm2: chosen.interpolation_mm2.map(|own| {
            let turn = turn.to_rotation_matrix();
            upper(&(turn * own * turn.transpose()))
        }),
        angles: match chosen.source {
            // A measured node is a station, and stations are at the angles that the controller reported.
            Source::Measured => Angles::Reported,
            Source::Model => Angles::Commanded,
        },
        orientation_tolerance_deg: chosen.orientation_tolerance_rad.to_degrees(),
        verdict: (&verdict.verdict()).into(),
        reason: verdict.reason(),
        table_and_arm: context.pairs.table_and_arm.map(|own| own.words()),
        flange_from_target: target.coords().into(),
        valid_for: ValidFor::of(outcome, context),
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

    /// A node, its error in the frame of commands.
    fn row(
        &self,
        node: usize,
        command_from_base: &Isometry3<f64>,
        of_table: Arc<TableColumns>,
    ) -> NodeRow {
        let Chosen { lattice, nodes, .. } = self.chosen;
        let ([nx, ny, _], own) = (lattice.counts, &nodes[node]);
        let turn = command_from_base.rotation.to_rotation_matrix();
        let error = own.error.as_ref().ok();
        let covariance = error.map(|(_, covariance)| turn * covariance * turn.transpose());
        let joints = own.joints.as_deref().ok();
        NodeRow {
            node,
            index_x: node % nx,
            index_y: node / nx % ny,
            index_z: node / (nx * ny),
            at: (command_from_base * lattice.position(node)).coords.into(),
            joints_rad: joints.map(<[f64]>::to_vec),
            error: error.map(|(error, _)| (turn * error).into()),
            error_cov_mm2: covariance.as_ref().map(upper),
            error_sd_mm: covariance.map(|covariance| covariance.trace().sqrt()),
            refused: own.error.as_ref().err().copied(),
            nearest_station_mm: Some(own.nearest_mm).filter(|mm| mm.is_finite()),
            nearest_station_rad: joints
                .and_then(|joints| nearest_rad(joints, &self.stations, &self.counted)),
            stations_near: self.near(node),
            within_joint_ranges: joints.map(|joints| self.is_within(joints)),
            of_table,
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
        let pairs = station.joints.iter().zip(joints).zip(counted);
        let differences = pairs.map(|((a, b), counted)| (a - b).abs() * counted);
        differences.fold(0.0, f64::max)
    };
    stations.iter().map(apart).min_by(f64::total_cmp)
}
