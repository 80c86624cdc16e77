//! Where a joint comes to stand against its command, for predictions that do not know how far it fell short.
//!
//! The model puts the arm at `reported + β d + c clip(d)`, d the settling error `commanded − reported`. Of a command alone, or of
//! reported angles alone, d is not known, but its distribution is: the training stations show it. So a command predicts
//! with the mean of `(β − 1) d + c clip(d)` per joint, reported angles with that of `β d + c clip(d)`, and each with its
//! variance.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::design::SATURATION_RAD;
use crate::fit::observation::Observation;

/// True minus known axis variables over the training stations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ApproachOffsets {
    /// Against the command.
    pub commanded: Against,
    /// Against the reported angles.
    pub reported: Against,
}

/// True minus known axis variables: their distribution over the stations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Against {
    /// Mean of each, rad.
    pub mean: Vec<f64>,
    /// Variance of each, rad².
    pub variance: Vec<f64>,
}

impl ApproachOffsets {
    /// From the stations' settling errors and the model's coefficients; `None` where no settling error is known.
    pub fn of(
        observations: &[Observation],
        command_weight: &DVector<f64>,
        approach_offset: &DVector<f64>,
    ) -> Option<Self> {
        let settling_errors: Vec<&[f64]> = observations
            .iter()
            .filter_map(|o| o.settling_error.as_ref()?.sent())
            .collect();
        let joints = settling_errors.first()?.len();
        let against = |share: f64| {
            let away = |joint: usize, settling_error: f64| {
                (command_weight[joint] - share) * settling_error
                    + approach_offset[joint] * (settling_error / SATURATION_RAD).clamp(-1.0, 1.0)
            };
            let of_joint = |joint: usize| {
                mean_and_variance(
                    settling_errors
                        .iter()
                        .map(|short| away(joint, short[joint])),
                )
            };
            let (mean, variance) = (0..joints).map(of_joint).unzip();
            Against { mean, variance }
        };
        Some(Self {
            commanded: against(1.0),
            reported: against(0.0),
        })
    }
}

fn mean_and_variance(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    (
        mean,
        values.map(|value| (value - mean).powi(2)).sum::<f64>() / n,
    )
}
