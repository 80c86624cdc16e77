//! What the nodes of a step answer at stations that took no part, before any tolerance judges it.
//!
//! Finding answers is the work of the grid stage: nodes are placed by inverse kinematics, and models are asked there. How far each answer
//! is from what was measured, and whether that is near enough, follows from answers and stations alone.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::node::{GridStation, NodeError, Refusal};
use crate::fit::ToolErrors;

/// The answer at one station: the error that nodes and model have for it, base frame, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    pub station: usize,
    /// Number of the grid that answers, where several do; otherwise 0.
    pub sample: usize,
    /// The error interpolated between the nodes around it.
    pub interpolated: Vector3<f64>,
    /// The error by the model itself, without a grid; `None` for measured nodes.
    pub predicted: Option<Vector3<f64>>,
}

/// The answers of one step, and the number of stations that have none.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Answers {
    /// The answers, grid by grid in station order.
    #[serde(skip)]
    pub given: Vec<Answer>,
    /// Number of stations in a refused cell, by reason.
    pub refused: BTreeMap<Refusal, usize>,
    /// Number of stations outside the box.
    pub outside: usize,
    /// Number of stations of another configuration or beyond the orientation tolerance.
    pub unlike: usize,
}

pub(super) type ByNumber<'s> = BTreeMap<usize, &'s GridStation>;

pub(super) fn by_number(stations: &[GridStation]) -> ByNumber<'_> {
    stations.iter().map(|own| (own.number, own)).collect()
}

impl Answers {
    /// Adds the value that a table `found` at a station, with the prediction of `model` there; or counts the reason why there is none.
    pub(super) fn add_found(
        &mut self,
        station: &GridStation,
        found: Option<NodeError>,
        model: &ToolErrors<'_>,
    ) {
        let Some(found) = found else {
            self.outside += 1;
            return;
        };
        let predicted = |interpolated| {
            Ok((interpolated, Some(model.error(&station.joints).map_err(|gap| gap.refusal())?)))
        };
        self.add(station, 0, found.and_then(predicted));
    }

    /// Adds what nodes of grid number `sample` answer at a station, and the model itself where they are its own; or counts the reason
    /// why they do not.
    pub(super) fn add(
        &mut self,
        station: &GridStation,
        sample: usize,
        found: Result<(Vector3<f64>, Option<Vector3<f64>>), Refusal>,
    ) {
        let station = station.number;
        match found {
            Err(refusal) => *self.refused.entry(refusal).or_default() += 1,
            Ok((interpolated, predicted)) => {
                self.given.push(Answer { station, sample, interpolated, predicted });
            }
        }
    }

    /// Second moment of what interpolation adds to the model at these stations, mm²; `None` without any.
    pub(super) fn interpolation(&self) -> Option<Matrix3<f64>> {
        let added = |own: &Answer| Some(own.interpolated - own.predicted?);
        let added: Vec<Vector3<f64>> = self.given.iter().filter_map(added).collect();
        let sum: Matrix3<f64> = added.iter().map(|own| own * own.transpose()).sum();
        (!added.is_empty()).then(|| sum / added.len() as f64)
    }

    /// Whether every answer is at one of these stations.
    pub(super) fn are_at(&self, stations: &ByNumber<'_>) -> bool {
        let mut given = self.given.iter();
        given.all(|own| stations.contains_key(&own.station))
    }
}
