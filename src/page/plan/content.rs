//! What a plan's page tells: rows of its published tables, in the words and units that they are published in.

use crate::page::content::{Count, Provenance};

/// Everything on the page of one plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Content {
    /// The robot.
    pub robot: String,
    /// The plan's id: its run.
    pub plan: String,
    /// What it promises; `None` for a plan without a visit.
    pub promise: Option<Promise>,
    /// `plan_figures`.
    pub figures: Vec<Figure>,
    /// `sampling_plan`.
    pub visits: Vec<Visit>,
    /// The joints in the order of each visit's angles.
    pub joints: Vec<String>,
    /// Candidates in and out.
    pub counts: Vec<Count>,
    /// What the plan was made from.
    pub provenance: Provenance,
}

/// What every row of `sampling_plan` says of the whole plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Promise {
    /// What mean errors stay below, mm.
    pub mean_mm: Option<f64>,
    /// What bounds stay below, mm.
    pub bound_mm: Option<f64>,
    /// The share of robots that both are of.
    pub share: f64,
    /// With which confidence.
    pub confidence: f64,
    /// Robots that it was found on.
    pub robots: i64,
    /// Of these, robots whose bound is within the tolerance.
    pub meet: i64,
    /// mm.
    pub tolerance_mm: f64,
    /// Share of errors that each robot's bound covers.
    pub bound_share: f64,
    /// With which confidence.
    pub bound_confidence: f64,
}

/// Accuracy after compensation over many simulated robots.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// What is varied: `step`, `design`, `promise` or an influence.
    pub study: String,
    /// How far, in the unit that the study says.
    pub value: Option<f64>,
    /// How the measured poses are chosen.
    pub design: String,
    /// `measured`, `model` or `identified_arm`.
    pub source: String,
    /// `idw` or `trilinear`; `None` without a grid.
    pub interpolation: Option<String>,
    /// Step of the grid, mm.
    pub step_mm: Option<f64>,
    /// Poses measured.
    pub poses: i64,
    /// Nodes or poses asked for that the arm does not reach.
    pub not_reached: i64,
    /// Robots drawn.
    pub robots: i64,
    /// Robots whose session could not be fitted.
    pub no_fit: i64,
    /// Robots with enough fresh poses for a bound.
    pub judged: i64,
    /// Fresh poses in a cell that cannot serve, all robots together.
    pub refused: i64,
    /// Fresh poses outside the grid, all robots together.
    pub outside: i64,
    /// Mean error, mm.
    pub mean_mm: Option<f64>,
    /// 95th percentile, mm.
    pub p95_mm: Option<f64>,
    /// Mean error that the error model expects, mm.
    pub expected_mean_mm: Option<f64>,
    /// What the tolerance's share of errors stays below, as the error model expects, mm.
    pub expected_share_mm: Option<f64>,
    /// Bound that the asked share of robots stays below, mm.
    pub bound_mm: Option<f64>,
    /// Robots whose bound is within the tolerance.
    pub meet: i64,
    /// Least share of such robots, with the asked confidence.
    pub share_at_least: f64,
    /// The share asked for.
    pub share_asked: f64,
    /// Whether the plan is this one, or the step that influences were studied at.
    pub chosen: bool,
}

impl Figure {
    /// Whether the asked share of robots is shown to meet the tolerance.
    pub fn holds(&self) -> bool {
        self.share_at_least >= self.share_asked
    }
}

/// A planned visit.
#[derive(Debug, Clone, PartialEq)]
pub struct Visit {
    /// Place in the order of visits, from 0.
    pub pose: i64,
    /// Its name where the plan is a file of targets.
    pub target: String,
    /// `identify`, `verify` or `drift_check`.
    pub purpose: String,
    /// The visit whose pose a drift check repeats.
    pub repeats: Option<i64>,
    /// Joint angles, rad.
    pub joints_rad: Vec<f64>,
    /// Position of the target in the frame of commands, mm.
    pub at: [f64; 3],
    /// Place in the order in which the design chose it, from 0.
    pub chosen_as: Option<i64>,
    /// Predicted variance that is left over the region once this pose and those before it are measured, mm².
    pub variance_left_mm2: Option<f64>,
}
