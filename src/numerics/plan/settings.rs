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

#[derive(Debug, Clone)]
pub struct PlanSettings {
    pub seed: u64,
    /// Reported angles (rad) of a pose in the arm configuration of the whole plan.
    pub home: Vec<f64>,
    pub flange_from_target: Isometry3<f64>,
    pub region: Region,
    /// Largest turn of measured poses away from the table's orientation, rad: a larger turn gives more information.
    pub candidate_cone_rad: f64,
    pub constraints: Constraints,
    pub grid: GridSettings,
    pub tolerance: Tolerance,
    /// The expected robots, the cell and the instrument; its seed, home and poses are not used.
    pub population: SimulateSettings,
    /// The arm as a past session identified it, instead of the expected robots; `None` without one.
    pub known: Option<Arc<KnownArm>>,
    pub noise: Noise,
    pub fit: FitSettings,
    pub full: FullSettings,
    pub up: Option<UnitVector3<f64>>,
    pub robots: usize,
    pub whole_model_robots: usize,
    pub test_poses: usize,
    pub robots_meet: Coverage,
    pub candidates: usize,
    /// Numbers of poses at which designs are compared; the last is the most that a session may have.
    pub poses: Vec<usize>,
    /// Number of stations after which early poses are visited again; 0 for never.
    pub drift_check_every: usize,
    pub verify_poses: usize,
}

/// The region in which a plan has to hold, in the base frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    pub bounds: WorkBox,
    /// The table's orientation of the target.
    pub orientation: UnitQuaternion<f64>,
    /// Largest turn away from it, rad; 0 for one orientation.
    pub cone_rad: f64,
}
