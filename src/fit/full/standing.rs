//! Where a joint comes to stand against its command, for predictions that know nothing but the command.
//!
//! The model puts the arm at `reported + β d + c clip(d)`, d the shortfall `commanded − reported`. Of a command alone d is
//! not known, but its distribution is: the training stations show it. So a command predicts with the mean of
//! `(β − 1) d + c clip(d)` per joint, and with its variance.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::design::SATURATION_RAD;
use crate::fit::observation::Observation;

/// True minus commanded axis variables over the training stations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Standing {
    /// Mean of each, rad.
    pub mean: Vec<f64>,
    /// Variance of each, rad².
    pub variance: Vec<f64>,
}

impl Standing {
    /// From the stations' shortfalls and the model's coefficients; `None` where no shortfall is known.
    pub fn of(
        observations: &[Observation],
        blend: &DVector<f64>,
        stop_short: &DVector<f64>,
    ) -> Option<Self> {
        let shortfalls: Vec<&[f64]> = observations
            .iter()
            .filter_map(|o| o.shortfall.as_ref()?.sent())
            .collect();
        let n = shortfalls.len() as f64;
        let joints = shortfalls.first()?.len();
        let away = |joint: usize, shortfall: f64| {
            (blend[joint] - 1.0) * shortfall
                + stop_short[joint] * (shortfall / SATURATION_RAD).clamp(-1.0, 1.0)
        };
        let of_joint = |joint: usize| {
            let values: Vec<f64> = shortfalls
                .iter()
                .map(|shortfall| away(joint, shortfall[joint]))
                .collect();
            let mean = values.iter().sum::<f64>() / n;
            (
                mean,
                values
                    .iter()
                    .map(|value| (value - mean).powi(2))
                    .sum::<f64>()
                    / n,
            )
        };
        let (mean, variance) = (0..joints).map(of_joint).unzip();
        Some(Self { mean, variance })
    }
}
