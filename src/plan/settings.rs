//! What a plan is made for and with.

use std::sync::Arc;

use nalgebra::{Isometry3, UnitQuaternion, UnitVector3};

use super::known::KnownArm;
use super::line_of_sight::Constraints;
use crate::figures::Coverage;
use crate::fit::full::FullSettings;
use crate::fit::{FitSettings, Noise};
use crate::grid::{GridSettings, Tolerance, WorkBox};
use crate::simulate::SimulateSettings;

/// Everything a plan follows from besides the nominal arm.
#[derive(Debug, Clone)]
pub struct PlanSettings {
    /// Key of all random numbers.
    pub seed: u64,
    /// Reported angles (rad) of a pose in the arm configuration of the whole plan.
    pub home: Vec<f64>,
    /// Where the target is meant to sit at the flange.
    pub flange_from_target: Isometry3<f64>,
    /// Where the plan has to hold.
    pub region: Region,
    /// Largest turn of measured poses away from the table's orientation, rad: the more, the more they say.
    pub candidate_cone_rad: f64,
    /// What is asked of measured poses.
    pub constraints: Constraints,
    /// Steps, node sources and interpolations.
    pub grid: GridSettings,
    /// What has to be met.
    pub tolerance: Tolerance,
    /// Robots as they may turn out, the cell and the instrument; its seed, home and poses are not used.
    pub population: SimulateSettings,
    /// What a past session knows of the arm, in the place of what is expected of robots.
    pub known: Option<Arc<KnownArm>>,
    /// What the fit is told of the measurement.
    pub noise: Noise,
    /// The geometric fit.
    pub fit: FitSettings,
    /// The full error model.
    pub full: FullSettings,
    /// Against gravity in the base frame, where the mounting is known.
    pub up: Option<UnitVector3<f64>>,
    /// Robots that steps are judged on.
    pub robots: usize,
    /// Robots that designs are judged on, with the full error model.
    pub whole_model_robots: usize,
    /// Fresh poses that judge each robot.
    pub test_poses: usize,
    /// The share of robots that has to meet the tolerance, and how sure one has to be of that.
    pub robots_meet: Coverage,
    /// Candidate poses that designs choose from.
    pub candidates: usize,
    /// Numbers of poses at which designs are compared; the last is the most a session may have.
    pub poses: Vec<usize>,
    /// Early poses are visited again after so many stations; 0 for never.
    pub drift_check_every: usize,
    /// Fresh poses that the session measures to verify the promise.
    pub verify_poses: usize,
}

/// Where a plan has to hold, in the base frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// Where the target will be sent, mm.
    pub bounds: WorkBox,
    /// The table's orientation of the target.
    pub orientation: UnitQuaternion<f64>,
    /// Largest turn away from it, rad; 0 for one orientation.
    pub cone_rad: f64,
}
