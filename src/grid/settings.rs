//! The `[grid]` section, and the box, orientation and configuration that follow from it and the stations.

use std::collections::BTreeMap;

use nalgebra::{Quaternion, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::interpolation::Interpolation;
use super::lattice::WorkBox;
use super::node::GridStation;
use super::{GridError, Source};
use crate::fit::start::mean_rotation;
use crate::kinematics::Configuration;

/// The `[grid]` section of a pipeline file.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct GridSettings {
    /// Steps to judge, mm.
    pub steps_mm: Vec<f64>,
    /// The box in the base frame. Absent: the box around the stations that are like the table.
    #[serde(default, rename = "box", skip_serializing_if = "Option::is_none")]
    pub bounds: Option<WorkBox>,
    /// The tool's orientation in the base frame as a quaternion x y z w. Absent: the mean of the most frequent
    /// configuration's stations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orientation_xyzw: Option<[f64; 4]>,
    /// A target's orientation may differ from the table's by this much, degrees.
    #[serde(default = "default_orientation_tolerance")]
    pub orientation_tolerance_deg: f64,
    /// Ways to interpolate inside a cell.
    #[serde(default = "default_interpolations")]
    pub interpolations: Vec<Interpolation>,
    /// Where node values may come from.
    #[serde(default = "default_sources")]
    pub sources: Vec<Source>,
    /// The power p of `idw`.
    #[serde(default = "default_power")]
    pub idw_power: f64,
}

fn default_orientation_tolerance() -> f64 {
    5.0
}

fn default_interpolations() -> Vec<Interpolation> {
    vec![Interpolation::Idw, Interpolation::Trilinear]
}

fn default_sources() -> Vec<Source> {
    vec![Source::Measured, Source::Model]
}

fn default_power() -> f64 {
    2.0
}

/// The table's box, orientation and configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct GridPlan {
    /// The box in the base frame.
    pub bounds: WorkBox,
    /// The tool's orientation in the base frame.
    pub orientation: UnitQuaternion<f64>,
    /// The arm configuration that most stations have.
    pub configuration: Option<Configuration>,
    tolerance_rad: f64,
}

impl GridSettings {
    /// Settles what the section leaves to the stations.
    pub fn plan(&self, stations: &[GridStation]) -> Result<GridPlan, GridError> {
        if stations.is_empty() {
            return Err(GridError::NoStations);
        }
        let configuration = most_frequent(stations);
        let own: Vec<&GridStation> = stations
            .iter()
            .filter(|s| s.configuration == configuration)
            .collect();
        let mean = || mean_rotation(own.iter().map(|station| station.orientation));
        let given = self
            .orientation_xyzw
            .map(|[x, y, z, w]| UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)));
        let orientation = given.or_else(mean).ok_or(GridError::NoStations)?;
        let tolerance_rad = self.orientation_tolerance_deg.to_radians();
        let near =
            |station: &&&GridStation| station.orientation.angle_to(&orientation) <= tolerance_rad;
        let around = |stations: Vec<&GridStation>| {
            WorkBox::around(
                &stations
                    .iter()
                    .map(|station| station.position)
                    .collect::<Vec<_>>(),
            )
        };
        // A session of many orientations has few stations near any one: its box is around all of the configuration.
        let alike: Vec<&GridStation> = own.iter().filter(near).copied().collect();
        let alike = if 2 * alike.len() >= own.len() {
            alike
        } else {
            own.clone()
        };
        let bounds = self
            .bounds
            .or_else(|| around(alike))
            .ok_or(GridError::NoStations)?;
        Ok(GridPlan {
            bounds,
            orientation,
            configuration,
            tolerance_rad,
        })
    }
}

impl GridPlan {
    /// Whether the table claims to serve a station: its configuration, and its orientation within the tolerance.
    pub(super) fn is_like(&self, station: &GridStation) -> bool {
        station.configuration == self.configuration
            && station.orientation.angle_to(&self.orientation) <= self.tolerance_rad
    }

    /// The error of a step that does not fit.
    pub fn too_large(&self, step_mm: f64) -> GridError {
        let [x, y, z] = [0, 1, 2].map(|axis| self.bounds.size(axis));
        GridError::StepTooLarge {
            step_mm,
            sizes: format!("{x:.1} × {y:.1} × {z:.1}"),
        }
    }
}

/// The configuration of most stations; the first in order where several are as frequent.
fn most_frequent(stations: &[GridStation]) -> Option<Configuration> {
    let mut counts: BTreeMap<Option<Configuration>, usize> = BTreeMap::new();
    for station in stations {
        *counts.entry(station.configuration).or_default() += 1;
    }
    let most = counts.values().copied().max()?;
    counts.into_iter().find(|(_, count)| *count == most)?.0
}
