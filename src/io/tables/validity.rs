//! What a result is valid for: stated in the pipeline file, and the temperatures met while measuring.

use serde::{Deserialize, Serialize};

use crate::io::table::Columns;
use crate::join::{Pairing, Station};
use crate::pipeline::outcome::Outcome;

/// What a calibration or a table is valid for, as the pipeline file states it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Validity {
    /// The tool's name.
    pub tool: Option<String>,
    /// The payload, kg.
    pub payload_kg: Option<f64>,
    /// The mounting: floor, wall, ceiling or an angle.
    pub mounting: Option<String>,
    /// The base frame's name.
    pub base: Option<String>,
    /// The controller's model.
    pub controller_model: Option<String>,
    /// Whether the controller's own absolute-accuracy option was on.
    pub absolute_accuracy_option: Option<bool>,
}

impl Validity {
    /// The columns of this validity, the same in each row.
    pub(super) fn columns(&self, columns: Columns, outcome: &Outcome<'_>) -> Columns {
        let (low, high) = temperatures(outcome).unzip();
        columns
            .same("tool", self.tool.clone())
            .same("payload_kg", self.payload_kg)
            .same("mounting", self.mounting.clone())
            .same("base", self.base.clone())
            .same("controller_model", self.controller_model.clone())
            .same("absolute_accuracy_option", self.absolute_accuracy_option)
            .same("temperature_min_c", low)
            .same("temperature_max_c", high)
    }
}

/// The paired stations that a run learnt from.
pub(super) fn learnt_from<'a>(outcome: &'a Outcome<'_>) -> impl Iterator<Item = &'a Station> {
    let stations = outcome
        .training
        .iter()
        .flat_map(|session| &session.joined.stations);
    stations.filter(|station| station.pairing == Pairing::Paired && station.attained.is_some())
}

/// Lowest and highest temperature of the stations learnt from, °C.
fn temperatures(outcome: &Outcome<'_>) -> Option<(f64, f64)> {
    let met = learnt_from(outcome).filter_map(|station| station.attained.as_ref()?.temperature_c);
    met.fold(None, |range, t| {
        let (low, high) = range.unwrap_or((t, t));
        Some((t.min(low), t.max(high)))
    })
}

/// Lowest and highest reported angle of each joint over the stations learnt from, rad.
pub(super) fn joint_ranges(outcome: &Outcome<'_>, joints: usize) -> Vec<(f64, f64)> {
    let empty = vec![(f64::INFINITY, f64::NEG_INFINITY); joints];
    learnt_from(outcome).fold(empty, |ranges, station| {
        let widened = ranges.iter().zip(&station.joints);
        widened
            .map(|((low, high), q)| (low.min(*q), high.max(*q)))
            .collect()
    })
}
