//! The commanded pose of a table, and where its frame lies against the nominal arm: mostly the base itself, turned by
//! right angles or not; then the tool alone is found beside the commands. Otherwise both are, and are no more than a
//! start.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use super::by_arm::LENGTHS;
use super::columns::position;
use super::roles::Placed;
use super::turns::{Turned, turned};
use crate::figures::median;
use crate::ingest::LengthUnit;
use crate::join::JoinSettings;
use crate::join::placement::{Placement, ReadingAtFlange};
use crate::measured_table::MeasuredTable;

/// A frame turned by right angles is taken where it leaves no more than this many times what the fitted one leaves, or
/// a millimetre.
const AS_GOOD: f64 = 2.0;
const A_MILLIMETRE: f64 = 1.0;

#[derive(Debug, Clone, PartialEq)]
pub struct Commands {
    pub placed: Placed,
    pub unit: LengthUnit,
    /// Its orientation; absent where there is none, or none that turns with the arm.
    pub turned: Option<Turned>,
    /// The frame of the commands in the base frame, mm.
    pub base_from_command: Isometry3<f64>,
    /// The commanded tool in the flange frame, mm.
    pub flange_from_tool: Isometry3<f64>,
    /// Median distance from the nominal arm, mm.
    pub median_mm: f64,
    /// Whether the frame is the base's, turned by right angles or not at all.
    pub is_of_base: bool,
}

type Pair = (usize, Isometry3<f64>, Vector3<f64>);

/// The commanded pose of these columns beside the nominal flanges of rows; `None` where it is not near the arm in any
/// unit.
pub fn commands(
    table: &MeasuredTable,
    placed: &Placed,
    flanges: &[(usize, Isometry3<f64>)],
) -> Option<Commands> {
    let of_unit = |unit: LengthUnit| {
        let pair = |(row, flange): &(usize, Isometry3<f64>)| {
            let at = Vector3::from(position(&placed.position(), table, *row)?);
            Some((*row, *flange, at * unit.to_mm()))
        };
        let pairs: Vec<Pair> = flanges.iter().filter_map(pair).collect();
        let (base, tool, median_mm, is_of_base) = frames(&pairs)?;
        Some(Commands {
            turned: None,
            placed: placed.clone(),
            unit,
            base_from_command: base,
            flange_from_tool: tool.into(),
            median_mm,
            is_of_base,
        })
    };
    let found = LENGTHS.into_iter().filter_map(of_unit);
    let found = found.min_by(|a, b| a.median_mm.total_cmp(&b.median_mm))?;
    (found.median_mm <= JoinSettings::default().geometry_gate_mm)
        .then(|| with_turn(table, found, flanges))
}

/// Commands with their orientation, and the tool's with it.
fn with_turn(
    table: &MeasuredTable,
    mut found: Commands,
    flanges: &[(usize, Isometry3<f64>)],
) -> Commands {
    let command_from_base = found.base_from_command.rotation.inverse();
    let flanges: Vec<(usize, UnitQuaternion<f64>)> =
        flanges.iter().map(|(row, flange)| (*row, command_from_base * flange.rotation)).collect();
    found.turned = found.placed.turn.as_ref().and_then(|columns| turned(table, columns, &flanges));
    if let Some(turned) = &found.turned {
        found.flange_from_tool.rotation = turned.flange_from_own;
    }
    found
}

/// The frame of commands, the tool's origin in the flange frame, what they leave in the median, and whether it is the
/// base's.
fn frames(pairs: &[Pair]) -> Option<(Isometry3<f64>, nalgebra::Translation3<f64>, f64, bool)> {
    let readings: Vec<ReadingAtFlange> =
        pairs.iter().map(|&(_, flange, attained)| ReadingAtFlange { flange, attained }).collect();
    let placement = Placement::fit(&readings)?;
    let fitted_mm =
        median(&readings.iter().map(|own| placement.distance_mm(own)).collect::<Vec<_>>())?;
    let turn = nearest_right_angles(&placement.tracker_from_base.rotation);
    let base = Isometry3::from_parts(Vector3::zeros().into(), turn.inverse());
    let (tool, median_mm) = tool(pairs, &base)?;
    if median_mm <= (AS_GOOD * fitted_mm).max(A_MILLIMETRE) {
        return Some((base, tool.into(), median_mm, true));
    }
    Some((placement.tracker_from_base.inverse(), placement.target_mm.into(), fitted_mm, false))
}

/// The tool's origin in the flange frame, the median per axis, and what it leaves, mm.
fn tool(pairs: &[Pair], base_from_command: &Isometry3<f64>) -> Option<(Vector3<f64>, f64)> {
    let local: Vec<Point3<f64>> = pairs
        .iter()
        .map(|(_, flange, at)| {
            flange.inverse_transform_point(&(base_from_command * Point3::from(*at)))
        })
        .collect();
    let axis = |axis: usize| median(&local.iter().map(|point| point[axis]).collect::<Vec<_>>());
    let tool = Vector3::new(axis(0)?, axis(1)?, axis(2)?);
    let apart =
        median(&local.iter().map(|point| (point.coords - tool).norm()).collect::<Vec<_>>())?;
    Some((tool, apart))
}

/// The rotation by right angles about the axes that is nearest to a rotation.
fn nearest_right_angles(rotation: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let quarter = |turns: u8| f64::from(turns) * FRAC_PI_2;
    let all = (0..64_u8).map(|number| {
        let [x, y, z] = [number % 4, number / 4 % 4, number / 16].map(quarter);
        UnitQuaternion::from_euler_angles(x, y, z)
    });
    let nearest = all.min_by(|a, b| a.angle_to(rotation).total_cmp(&b.angle_to(rotation)));
    nearest.unwrap_or_else(UnitQuaternion::identity)
}
