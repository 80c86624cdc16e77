//! The `[plan]` section of a pipeline file: expected robots and constraints of the cell (`posegrid schema pipeline`).

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::figures::Coverage;
use crate::geometry::Placement;
use crate::simulate::Poses;
use crate::simulate::settings::{
    Cell, GeometryErrors, Gravity, JointErrors, SimulateSettings, TrackerErrors,
};

#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlanSection {
    /// Reported joint angles of a pose in the arm configuration of the whole plan, degrees (mm of a joint that slides). Where `[grid]` states no
    /// orientation, the target's orientation there is the table's.
    pub home_deg: Vec<f64>,
    pub tracker_from_base: Placement,
    pub seed: u64,
    pub robots: usize,
    pub whole_model_robots: usize,
    pub test_poses: usize,
    pub robots_meet: Coverage,
    pub candidates: usize,
    pub poses: Vec<usize>,
    pub cone_deg: f64,
    pub drift_check_every: usize,
    pub verify_poses: usize,
    /// Measured poses may be turned away from the table's orientation by up to this angle, degrees: a larger angle gives
    /// more information. Never less than `cone_deg`.
    pub candidate_cone_deg: f64,
    pub constraints: ConstraintsSection,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub known: Option<KnownSection>,
    pub expect: Expect,
}

/// What a pipeline file may leave out; it has to state `home_deg` and `tracker_from_base`.
impl Default for PlanSection {
    fn default() -> Self {
        Self {
            home_deg: Vec::new(),
            tracker_from_base: Placement::default(),
            seed: 1,
            robots: 200,
            // One more than the 59 that 95 % of robots with 95 % confidence need.
            whole_model_robots: 60,
            test_poses: 200,
            robots_meet: Coverage { share: 0.95, confidence: 0.95 },
            candidates: 1000,
            poses: vec![25, 50, 100],
            cone_deg: 0.0,
            drift_check_every: 25,
            // 95 % of errors with 95 % confidence need 59.
            verify_poses: 60,
            // Most reflectors accept this angle from a tracker.
            candidate_cone_deg: 30.0,
            constraints: ConstraintsSection::default(),
            known: None,
            expect: Expect::default(),
        }
    }
}

/// A past session that identified the arm: its posterior takes the place of geometry, curves, gravity, gear lines,
/// backlash and repeatability in [`Expect`].
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct KnownSection {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibrations: Option<PathBuf>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub session: Option<String>,
    pub base: BaseMounted,
    pub target: TargetMounted,
}

/// The places of base and tracker in a new session, relative to a past one.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BaseMounted {
    #[default]
    New,
    Same,
}

/// The mounting of the target in a new session, relative to a past one.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TargetMounted {
    /// The same target in the same place, mounted again: within `[plan.expect] target_sd_mm`.
    #[default]
    Again,
    Same,
    /// Another target, or in another place: the one in `[fit] target`.
    Other,
}

/// Constraints on measured poses, in addition to the arm configuration of `home_deg`.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct ConstraintsSection {
    pub limit_margin_deg: f64,
    pub least_singularity_factor: f64,
    pub keep_out: Vec<KeepOutSection>,
    pub keep_out_margin_mm: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line_of_sight: Option<LineOfSightSection>,
}

#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct KeepOutSection {
    pub name: String,
    pub low_mm: [f64; 3],
    pub high_mm: [f64; 3],
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct LineOfSightSection {
    pub facing: [f64; 3],
    pub acceptance_deg: f64,
    pub range_mm: [f64; 2],
    pub link_radius_mm: f64,
}

impl Default for ConstraintsSection {
    fn default() -> Self {
        Self {
            limit_margin_deg: 1.0,
            least_singularity_factor: 0.05,
            keep_out: Vec::new(),
            keep_out_margin_mm: 100.0,
            line_of_sight: None,
        }
    }
}

/// The expected robots, as standard deviations.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct Expect {
    pub length_sd_mm: f64,
    pub angle_sd_deg: f64,
    pub slow_curve_urad: f64,
    pub fast_curve_urad: f64,
    pub gear_line_urad: f64,
    pub backlash_urad: f64,
    pub stops_short_urad: f64,
    pub repeatability_urad: f64,
    pub sag_urad: f64,
    pub target_sd_mm: f64,
    pub base_drift_mm: f64,
    pub lost_share: f64,
}

impl Default for Expect {
    /// The robots of [`crate::method::planning`]: lengths 0.3 mm, angles 0.02°, compliance, harmonics; the other values are
    /// those of good industrial arms.
    fn default() -> Self {
        Self {
            length_sd_mm: 0.3,
            angle_sd_deg: 0.02,
            slow_curve_urad: 100.0,
            fast_curve_urad: 20.0,
            gear_line_urad: 10.0,
            backlash_urad: 20.0,
            stops_short_urad: 50.0,
            repeatability_urad: 5.0,
            sag_urad: 400.0,
            target_sd_mm: 0.1,
            base_drift_mm: 0.02,
            lost_share: 0.005,
        }
    }
}

impl Expect {
    /// Robots of this kind in a cell, seen by a tracker.
    pub fn population(&self, cell: Cell, tracker: TrackerErrors, up: [f64; 3]) -> SimulateSettings {
        let urad = |value: f64| value * 1e-6;
        let no_poses = Poses::Listed { joints: Vec::new() };
        SimulateSettings {
            geometry: GeometryErrors {
                length_sd_mm: self.length_sd_mm,
                angle_sd_rad: self.angle_sd_deg.to_radians(),
            },
            joints: JointErrors {
                slow_curve_rad: urad(self.slow_curve_urad),
                fast_curve_rad: urad(self.fast_curve_urad),
                gear_line_rad: urad(self.gear_line_urad),
                backlash_rad: urad(self.backlash_urad),
                stops_short_rad: urad(self.stops_short_urad),
                nearer_command: 0.5,
                repeatability_rad: urad(self.repeatability_urad),
            },
            gravity: Gravity { sag_rad: urad(self.sag_urad), up },
            cell: Cell {
                target_sd_mm: self.target_sd_mm,
                base_drift_mm: self.base_drift_mm,
                ..cell
            },
            tracker: TrackerErrors { lost_share: self.lost_share, ..tracker },
            ..SimulateSettings::exact(0, Vec::new(), no_poses)
        }
    }
}
