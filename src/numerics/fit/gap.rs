//! The reasons why a model has no prediction, and why a node of a grid has no value.

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Refusal {
    /// The arm does not reach it, or only beyond a joint limit.
    OutOfReach,
    /// The pose is at a singularity or across one.
    Singularity,
    OtherConfiguration,
    Unmeasured,
    /// Its vertices are on different branches of the joint angles.
    Branches,
}

#[derive(Debug, Clone, PartialEq, Error)]
pub enum Gap {
    #[error("states no joint angles, and an arm's error depends on them")]
    NoJoints,
    #[error("states joint angles alone, and a compensation table has positions only")]
    NoPosition,
    #[error(
        "is turned {angle_deg:.3}° from the table's tool orientation, which is valid up to {limit_deg:.3}°"
    )]
    Orientation { angle_deg: f64, limit_deg: f64 },
    #[error("lies {} the table's box", beyond(beyond_mm))]
    Outside {
        /// From the nearest point of the box to the position, in the frame of commands, mm.
        beyond_mm: Vector3<f64>,
    },
    #[error("lies in a cell whose node {node} at ({:.3}, {:.3}, {:.3}) mm has no value: {}", at.x, at.y, at.z, words(*why))]
    Node { node: usize, at: Point3<f64>, why: Refusal },
    #[error("lies in a cell with no values between its nodes: {}", words(Refusal::Branches))]
    Branches,
}

impl Refusal {
    pub const fn name(self) -> &'static str {
        match self {
            Self::OutOfReach => "out_of_reach",
            Self::Singularity => "singularity",
            Self::OtherConfiguration => "other_configuration",
            Self::Unmeasured => "unmeasured",
            Self::Branches => "branches",
        }
    }
}

impl Gap {
    /// The reason for a node without a value, when the model that fills it has this gap.
    pub const fn refusal(&self) -> Refusal {
        match self {
            Self::Node { why, .. } => *why,
            Self::Branches => Refusal::Branches,
            Self::NoJoints | Self::NoPosition | Self::Orientation { .. } | Self::Outside { .. } => {
                Refusal::Unmeasured
            }
        }
    }
}

/// Less than this beyond the box along an axis is rounding, mm.
const ROUNDING_MM: f64 = 1e-9;

fn beyond(beyond_mm: &Vector3<f64>) -> String {
    let part = |(axis, mm): (char, &f64)| {
        let sign = if *mm < 0.0 { '−' } else { '+' };
        (mm.abs() > ROUNDING_MM).then(|| format!("{:.4} mm along {sign}{axis}", mm.abs()))
    };
    let parts: Vec<String> = "xyz".chars().zip(beyond_mm.iter()).filter_map(part).collect();
    format!("{} beyond", parts.join(" and "))
}

const fn words(refusal: Refusal) -> &'static str {
    match refusal {
        Refusal::OutOfReach => "the arm does not reach it within its joint limits",
        Refusal::Singularity => "the arm is at a singularity there",
        Refusal::OtherConfiguration => "the arm reaches it in another configuration only",
        Refusal::Unmeasured => "no station was measured at it",
        Refusal::Branches => "the arm reaches its nodes on different branches of the joint angles",
    }
}
