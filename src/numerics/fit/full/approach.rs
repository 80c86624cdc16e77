//! True minus known joint angles, for predictions where the settling error is not known.
//!
//! In the model the true angle is `reported + β d + c clip(d)`, d the settling error `commanded − reported`. For a command
//! alone, or reported angles alone, d is not known, but the training stations show its distribution. So a command predicts
//! with the mean of `(β − 1) d + c clip(d)` per joint, reported angles with that of `β d + c clip(d)`, and each with its
//! variance.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::design::saturation;
use super::layout::{Block, Layout};
use crate::fit::observation::Observation;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ApproachOffsets {
    pub commanded: Against,
    pub reported: Against,
}

/// True minus known axis variables: their distribution over the stations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Against {
    /// Mean of each axis variable, rad; mm where it slides.
    pub mean: Vec<f64>,
    /// Variance of each axis variable, rad²; mm² where it slides.
    pub variance: Vec<f64>,
}

impl ApproachOffsets {
    /// The distributions from the stations' settling errors and the coefficients `mean` of all columns; `None` without settling
    /// errors, or where the model does not have the parts for it.
    pub fn of(observations: &[Observation], layout: &Layout, mean: &DVector<f64>) -> Option<Self> {
        let of = |block| {
            let columns = layout.columns(block)?;
            Some(mean.rows(columns.start, columns.len()))
        };
        let command_weight = of(Block::CommandWeight)?;
        let approach_offset = of(Block::ApproachOffset)?;
        let settling_errors: Vec<&[f64]> =
            observations.iter().filter_map(|o| o.settling_error.as_ref()?.sent()).collect();
        let joints = settling_errors.first()?.len();
        let against = |share: f64| {
            let away = |joint: usize, settling_error: f64| {
                let whole = saturation(layout.slide_period_mm(joint).is_some());
                (command_weight[joint] - share) * settling_error
                    + approach_offset[joint] * (settling_error / whole).clamp(-1.0, 1.0)
            };
            let of_joint = |joint: usize| {
                mean_and_variance(settling_errors.iter().map(|short| away(joint, short[joint])))
            };
            let (mean, variance) = (0..joints).map(of_joint).unzip();
            Against { mean, variance }
        };
        Some(Self { commanded: against(1.0), reported: against(0.0) })
    }

    /// These distributions, or none, where each axis variable has another variance as well.
    pub fn with(own: Option<Self>, variance: &[f64]) -> Self {
        let none =
            || Against { mean: vec![0.0; variance.len()], variance: vec![0.0; variance.len()] };
        let mut both = own.unwrap_or_else(|| Self { commanded: none(), reported: none() });
        for against in [&mut both.commanded, &mut both.reported] {
            against.variance.iter_mut().zip(variance).for_each(|(own, more)| *own += more);
        }
        both
    }
}

fn mean_and_variance(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    (mean, values.map(|value| (value - mean).powi(2)).sum::<f64>() / n)
}
