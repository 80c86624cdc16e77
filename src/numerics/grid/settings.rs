//! The `[grid]` section, whose keys `posegrid schema pipeline` explains, and the box, orientation and configuration that follow from it and the stations.

use std::collections::BTreeMap;

use nalgebra::{Quaternion, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::interpolation::Interpolation;
use super::lattice::{Lattice, NoLattice, WorkBox};
use super::node::GridStation;
use super::{GridError, Source};
use crate::fit::start::mean_rotation;
use crate::kinematics::Configuration;

#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct GridSettings {
    pub steps_mm: Vec<f64>,
    #[serde(rename = "box", skip_serializing_if = "Option::is_none")]
    pub bounds: Option<WorkBox>,
    /// The tool's orientation in the base frame as a quaternion x y z w. Absent: the mean of the most frequent
    /// configuration's stations.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub orientation_xyzw: Option<[f64; 4]>,
    pub orientation_tolerance_deg: f64,
    pub interpolations: Vec<Interpolation>,
    pub sources: Vec<Source>,
    pub idw_power: f64,
    pub choose: Rule,
    /// A table of model nodes may have a bound above the model's own by this share of it, or by
    /// [`WITHIN_MM`](super::choose::WITHIN_MM) where that is more.
    pub within: f64,
}

impl Default for GridSettings {
    fn default() -> Self {
        Self {
            steps_mm: Vec::new(),
            bounds: None,
            orientation_xyzw: None,
            orientation_tolerance_deg: 5.0,
            interpolations: vec![Interpolation::Idw, Interpolation::Trilinear],
            sources: vec![Source::Measured, Source::Model],
            idw_power: 2.0,
            choose: Rule::Within,
            within: WITHIN,
        }
    }
}

/// The rules for choosing the published step among the judged ones.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rule {
    /// Model nodes, which need no measurement: the largest step whose bound is within `within` of the model's own. Measured
    /// nodes: the largest step that holds. Of both, the one with the smaller bound.
    #[default]
    Within,
    /// The largest step that holds with all smaller ones, whatever its nodes cost: the seed paper's rule.
    FewestNodes,
}

/// Share of the model's own error by which a table may exceed it and still be near.
pub const WITHIN: f64 = 0.05;

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
    /// Derives from the stations the values that the section does not give.
    pub fn plan(&self, stations: &[GridStation]) -> Result<GridPlan, GridError> {
        if stations.is_empty() {
            return Err(GridError::NoStations);
        }
        let configuration = most_frequent(stations);
        let own: Vec<_> = stations.iter().filter(|s| s.configuration == configuration).collect();
        let mean = || mean_rotation(own.iter().map(|station| station.orientation));
        let given = self.orientation_xyzw.map(|[x, y, z, w]| Quaternion::new(w, x, y, z));
        let given = given.map(UnitQuaternion::from_quaternion);
        let orientation = given.or_else(mean).ok_or(GridError::NoStations)?;
        let tolerance_rad = self.orientation_tolerance_deg.to_radians();
        let near =
            |station: &&&GridStation| station.orientation.angle_to(&orientation) <= tolerance_rad;
        // A session of many orientations has few stations near one: then its box is around all of the configuration.
        let alike: Vec<&GridStation> = own.iter().filter(near).copied().collect();
        let alike = if 2 * alike.len() >= own.len() { alike } else { own.clone() };
        let positions: Vec<_> = alike.iter().map(|station| station.position).collect();
        let around = || WorkBox::around(&positions);
        let bounds = self.bounds.or_else(around).ok_or(GridError::NoStations)?;
        Ok(GridPlan { bounds, orientation, configuration, tolerance_rad })
    }
}

impl GridPlan {
    /// Whether the table covers a station: its configuration, and its orientation within the tolerance.
    pub(super) fn is_like(&self, station: &GridStation) -> bool {
        station.configuration == self.configuration
            && station.orientation.angle_to(&self.orientation) <= self.tolerance_rad
    }

    /// The lattice that `step_mm` is judged on, or why it is not judged; `steps_mm` are all steps.
    pub(super) fn lattice(&self, step_mm: f64, steps_mm: &[f64]) -> Result<Lattice, NotJudged> {
        let lattice = Lattice::new(&self.bounds, step_mm)?;
        let is_same = |other: &f64| Lattice::new(&self.bounds, *other).is_ok_and(|o| o == lattice);
        let least_mm = steps_mm.iter().copied().filter(is_same).fold(step_mm, f64::min);
        if least_mm < step_mm {
            return Err(NotJudged::SamePitches { judged_mm: least_mm, pitch_mm: lattice.step });
        }
        Ok(lattice)
    }
}

/// Why a step is not judged on nodes of the model.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub(super) enum NotJudged {
    #[error(transparent)]
    NoLattice(#[from] NoLattice),
    #[error("it comes to the same pitches as the step of {judged_mm} mm, which is judged")]
    SamePitches {
        /// The smallest such step, mm.
        judged_mm: f64,
        pitch_mm: [f64; 3],
    },
}

impl NotJudged {
    /// The pitches of the step along each axis, mm; `None` where it does not fit.
    pub(super) const fn pitch_mm(&self) -> Option<[f64; 3]> {
        match self {
            Self::NoLattice(_) => None,
            Self::SamePitches { pitch_mm, .. } => Some(*pitch_mm),
        }
    }
}

/// The configuration of most stations; of equally frequent ones the first in order.
fn most_frequent(stations: &[GridStation]) -> Option<Configuration> {
    let mut counts: BTreeMap<Option<Configuration>, usize> = BTreeMap::new();
    for station in stations {
        *counts.entry(station.configuration).or_default() += 1;
    }
    let most = counts.values().copied().max()?;
    counts.into_iter().find(|(_, count)| *count == most)?.0
}
