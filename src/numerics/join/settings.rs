//! The settings of the join and their defaults; `posegrid schema pipeline` shows what each key means.

use serde::{Deserialize, Serialize};

use super::stationary::StationaryRule;

/// `[join]` of a pipeline file. Every key has a default; none was fitted to any recording.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct JoinSettings {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub settle_s: Option<f64>,
    /// The shortest dwell of the arm, s. Longer than the turning points of a move, shorter than any measurement.
    pub min_dwell_s: f64,
    /// Length of the window in which nothing may move, s (at least three samples).
    pub window_s: f64,
    /// A break between samples longer than this ends a dwell, s (at least five usual intervals).
    pub gap_s: f64,
    /// Joint motion within the window that counts as stationary, rad; a mm of sliding as a mrad; absent: found from the log.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stationary_rad: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stationary_mm: Option<f64>,
    pub min_readings: usize,
    pub mad_factor: f64,
    /// A dwell further than this from the nominal arm (base and target fitted) is one of another reflector, mm. Nominal
    /// arms are off by 1–10 mm, wrong reflectors by hundreds.
    pub geometry_gate_mm: f64,
}

impl Default for JoinSettings {
    fn default() -> Self {
        Self {
            settle_s: None,
            min_dwell_s: 0.3,
            window_s: 0.1,
            gap_s: 1.0,
            stationary_rad: None,
            stationary_mm: None,
            min_readings: 3,
            mad_factor: 6.0,
            geometry_gate_mm: 30.0,
        }
    }
}

/// Least threshold for joints, rad: no encoder resolves less between samples.
const FLOOR_RAD: f64 = 1e-7;
/// Least threshold for the target, mm: no tracker resolves less.
const FLOOR_MM: f64 = 1e-3;

impl JoinSettings {
    pub fn arm_rule(&self) -> StationaryRule {
        StationaryRule {
            window_s: self.window_s,
            gap_s: self.gap_s,
            min_stretch_s: self.min_dwell_s,
            threshold: self.stationary_rad,
            floor: FLOOR_RAD,
        }
    }

    /// The rule by which the target is stationary. It has no least duration: a tracker may read only a few times, and only
    /// while stationary.
    pub(super) fn target_rule(&self) -> StationaryRule {
        StationaryRule {
            min_stretch_s: 0.0,
            threshold: self.stationary_mm,
            floor: FLOOR_MM,
            ..self.arm_rule()
        }
    }
}
