//! The settings that a plan follows from.

use std::sync::Arc;

use nalgebra::{Isometry3, UnitQuaternion, UnitVector3};

use super::known::KnownArm;
use super::line_of_sight::Constraints;
use crate::figures::Coverage;
use crate::fit::full::FullSettings;
use crate::fit::{FitSettings, Noise};
use crate::grid::{GridSettings, Tolerance, WorkBox};
use crate::simulate::SimulateSettings;

/// All inputs of a plan except the nominal arm.
#[derive(Debug, Clone)]
pub struct PlanSettings {
    /// Key of all random numbers.
    pub seed: u64,
    /// Reported angles (rad) of a pose in the arm configuration of the whole plan.
    pub home: Vec<f64>,
    /// Intended place of the target at the flange.
    pub flange_from_target: Isometry3<f64>,
    /// The region in which the plan has to hold.
    pub region: Region,
    /// Largest turn of measured poses away from the table's orientation, rad: a larger turn gives more information.
    pub candidate_cone_rad: f64,
    /// Constraints on measured poses.
    pub constraints: Constraints,
    /// Steps, node sources and interpolations.
    pub grid: GridSettings,
    /// The tolerance: limit, share of positions and confidence.
    pub tolerance: Tolerance,
    /// The expected robots, the cell and the instrument; its seed, home and poses are not used.
    pub population: SimulateSettings,
    /// The arm as a past session identified it, instead of the expected robots; `None` without one.
    pub known: Option<Arc<KnownArm>>,
    /// The measurement's uncertainty, for the fit.
    pub noise: Noise,
    /// The geometric fit.
    pub fit: FitSettings,
    /// The full error model.
    pub full: FullSettings,
    /// Direction against gravity in the base frame; `None` where the mounting is not known.
    pub up: Option<UnitVector3<f64>>,
    /// Number of robots that steps are judged on.
    pub robots: usize,
    /// Number of robots that designs are judged on, with the full error model.
    pub whole_model_robots: usize,
    /// Number of fresh poses that judge each robot.
    pub test_poses: usize,
    /// The share of robots that has to meet the tolerance, and the confidence of that.
    pub robots_meet: Coverage,
    /// Number of candidate poses that designs choose from.
    pub candidates: usize,
    /// Numbers of poses at which designs are compared; the last is the most that a session may have.
    pub poses: Vec<usize>,
    /// Number of stations after which early poses are visited again; 0 for never.
    pub drift_check_every: usize,
    /// Number of fresh poses that the session measures to verify the promise.
    pub verify_poses: usize,
}

/// The region in which a plan has to hold, in the base frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// The box of target positions, mm.
    pub bounds: WorkBox,
    /// The table's orientation of the target.
    pub orientation: UnitQuaternion<f64>,
    /// Largest turn away from it, rad; 0 for one orientation.
    pub cone_rad: f64,
}
