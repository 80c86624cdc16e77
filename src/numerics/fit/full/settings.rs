//! The `[fit.full]` section: the start of the full error model. Sizes are starting points that the session's own
//! likelihood replaces; lengths are fixed. `posegrid schema pipeline` shows what each key means.

use serde::{Deserialize, Serialize};

use super::repairs::Repair;
use crate::fit::observation::Uncertainty;

/// Usual lengths of a slide's kernels, mm: a pinion's turn, and the rails' pieces.
const SLIDE_LENGTH_MM: [f64; 2] = [100.0, 800.0];
/// Usual size of a slide's kernels, mm.
const SLIDE_SD_MM: f64 = 0.1;

/// Whether the lengths are left at their default: then they are not written, and runs of arms without slides stay what they were.
fn is_usual_length(lengths_mm: &[f64; 2]) -> bool {
    *lengths_mm == SLIDE_LENGTH_MM
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_usual_size(size_mm: &f64) -> bool {
    (*size_mm - SLIDE_SD_MM).abs() == 0.0
}

#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each part of the model can be left out by itself"
)]
pub struct FullSettings {
    pub enabled: bool,
    pub gravity: bool,
    pub gear_lines: bool,
    pub drift: bool,
    pub command_weight: bool,
    pub short_length_deg: f64,
    pub long_length_deg: f64,
    pub curve_period_turns: u32,
    pub harmonics: usize,
    pub curve_sd_rad: f64,
    #[serde(skip_serializing_if = "is_usual_length")]
    pub slide_length_mm: [f64; 2],
    #[serde(skip_serializing_if = "is_usual_size")]
    pub slide_sd_mm: f64,
    /// Expected compliance, rad per m of lever.
    pub gravity_sd: f64,
    pub line_sd_rad: f64,
    /// Gain in log likelihood that a gear line needs, nats. Among the 10⁴ frequencies of an arm, noise alone reaches 9.
    pub line_threshold: f64,
    pub drift_sd_mm: f64,
    pub drift_length_stations: f64,
    pub command_weight_sd: f64,
    /// Expected size of the approach-direction offset, rad; m where the joint slides.
    pub approach_offset_sd_rad: f64,
    pub session_command_weight_sd: f64,
    pub session_curve_sd_rad: f64,
    pub session_length_deg: f64,
    /// Standard deviation of a session's own scale, ppm: the instrument's length unit, the air, and how warm the arm is (11 to
    /// 24 ppm per kelvin). It is fixed, because a session's stations cannot separate lengths and scale; 0 for no scale.
    pub session_scale_ppm: f64,
    pub noise_mm: f64,
    pub joint_noise_rad: f64,
    /// Whether stations are weighted by a Student t of their leave-one-out residual: 0 for no, any other number for yes; its
    /// degrees of freedom are found from the residuals.
    pub student_t: f64,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub repaired: Vec<Repair>,
}

impl FullSettings {
    /// These settings for sessions measured by this instrument: the part of a tracker's ranging limit per metre adds to the scale.
    #[must_use]
    pub fn measured_by(mut self, instrument: &Uncertainty) -> Self {
        if let (Uncertainty::Tracker(tracker), true) = (instrument, self.session_scale_ppm > 0.0) {
            let own_ppm = tracker.range_um_per_m / tracker.divisor;
            self.session_scale_ppm = self.session_scale_ppm.hypot(own_ppm);
        }
        self
    }
}

impl Default for FullSettings {
    fn default() -> Self {
        Self {
            enabled: true,
            gravity: true,
            gear_lines: true,
            drift: true,
            command_weight: true,
            short_length_deg: 6.0,
            long_length_deg: 50.0,
            curve_period_turns: 1,
            harmonics: 90,
            curve_sd_rad: 0.4e-3,
            slide_length_mm: SLIDE_LENGTH_MM,
            slide_sd_mm: SLIDE_SD_MM,
            gravity_sd: 0.4e-3,
            line_sd_rad: 15e-6,
            line_threshold: 10.0,
            drift_sd_mm: 0.03,
            drift_length_stations: 180.0,
            command_weight_sd: 1.0,
            approach_offset_sd_rad: 30e-6,
            session_command_weight_sd: 0.1,
            session_curve_sd_rad: 30e-6,
            session_length_deg: 30.0,
            session_scale_ppm: 50.0,
            noise_mm: 0.02,
            joint_noise_rad: 25e-6,
            student_t: 8.0,
            repaired: Vec::new(),
        }
    }
}
