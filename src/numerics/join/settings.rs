//! The settings of the join, their defaults and their checks, in one place.

use serde::{Deserialize, Serialize};

use super::JoinError;
use super::stationary::StationaryRule;

/// `[join]` of a pipeline file. Every key has a default; none was fitted to any recording.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct JoinSettings {
    /// Readings sooner than this after the arm became stationary are left out, s. Found from the readings where absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub settle_s: Option<f64>,
    /// The shortest dwell of the arm, s. Longer than the turning points of a move, shorter than any measurement.
    pub min_dwell_s: f64,
    /// Length of the window in which nothing may move, s (at least three samples).
    pub window_s: f64,
    /// A break between samples longer than this ends a dwell, s (at least five usual intervals).
    pub gap_s: f64,
    /// Joint motion within the window that still counts as stationary, rad; a mm of sliding counts as a mrad. Found from the
    /// log where absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stationary_rad: Option<f64>,
    /// Target motion within the window that still counts as stationary, mm. Found from the log where absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stationary_mm: Option<f64>,
    /// The fewest readings that make a mean with a scatter.
    pub min_readings: usize,
    /// Readings further than this many robust standard deviations from their dwell's median are outliers.
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
    pub fn check(&self) -> Result<(), JoinError> {
        if let Some(settle_s) = self.settle_s {
            positive_or_zero("settle_s", settle_s)?;
        }
        for (key, value) in [
            ("min_dwell_s", Some(self.min_dwell_s)),
            ("window_s", Some(self.window_s)),
            ("gap_s", Some(self.gap_s)),
            ("mad_factor", Some(self.mad_factor)),
            ("geometry_gate_mm", Some(self.geometry_gate_mm)),
            ("stationary_rad", self.stationary_rad),
            ("stationary_mm", self.stationary_mm),
        ] {
            value.map_or(Ok(()), |value| positive(key, value))?;
        }
        if self.min_readings < 2 {
            return Err(JoinError::Setting {
                key: "min_readings",
                found: self.min_readings.to_string(),
                wanted: "2 or more: one reading has no scatter",
            });
        }
        Ok(())
    }

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
            window_s: self.window_s,
            gap_s: self.gap_s,
            min_stretch_s: 0.0,
            threshold: self.stationary_mm,
            floor: FLOOR_MM,
        }
    }
}

fn positive(key: &'static str, found: f64) -> Result<(), JoinError> {
    if found.is_finite() && found > 0.0 {
        return Ok(());
    }
    Err(JoinError::Setting { key, found: found.to_string(), wanted: "a finite number above 0" })
}

fn positive_or_zero(key: &'static str, found: f64) -> Result<(), JoinError> {
    if found == 0.0 { Ok(()) } else { positive(key, found) }
}
