//! `scales`: whether each session's length unit agrees with the arm's lengths.

use crate::fit::scale::{ScaleVerdict, SessionScale};
use crate::table::row;

row! {
    /// The estimate of one session's scale.
    pub struct ScaleRow of "scales" {
        /// The session.
        of_session: String,
        /// Its measured stations.
        stations: usize,
        /// The scale in the full error model, ppm; `None` where it has none.
        fitted_ppm: Option<f64>,
        /// Its standard deviation, ppm.
        fitted_sd_ppm: Option<f64>,
        /// Whether the evidence kept it.
        kept: Option<bool>,
        /// Standard deviation of the scale before any measurement, ppm.
        prior_sd_ppm: f64,
        /// The scale from the arm's lengths alone, ppm; `None` where it could not be determined.
        free_ppm: Option<f64>,
        /// Its standard deviation, ppm.
        free_sd_ppm: Option<f64>,
        /// Root mean square of the remaining errors of the lengths with that scale, mm.
        length_rms_mm: Option<f64>,
        /// The smallest scale that would be named, ppm.
        detectable_ppm: Option<f64>,
        /// Standard deviation of the arm's lengths, mm.
        length_tolerance_mm: f64,
        /// Lowest temperature above the reference that explains the scale, K.
        warmer_by_least_k: Option<f64>,
        /// Highest such temperature, K.
        warmer_by_most_k: Option<f64>,
        /// Whether the scale is named.
        verdict: ScaleVerdict,
        /// The reason, where it is not obvious.
        reason: Option<String>,
    }
}

/// The rows of all training sessions.
pub fn rows(all: &[SessionScale]) -> Vec<ScaleRow> {
    all.iter().map(of_session).collect()
}

fn of_session(scale: &SessionScale) -> ScaleRow {
    let (fitted, free) = (scale.fitted, scale.free);
    ScaleRow {
        of_session: scale.session.clone(),
        stations: scale.stations,
        fitted_ppm: fitted.map(|fitted| fitted.ppm),
        fitted_sd_ppm: fitted.map(|fitted| fitted.sd_ppm),
        kept: fitted.map(|fitted| fitted.kept),
        prior_sd_ppm: scale.prior_sd_ppm,
        free_ppm: free.map(|free| free.ppm),
        free_sd_ppm: free.map(|free| free.sd_ppm),
        length_rms_mm: free.map(|free| free.length_rms_mm),
        detectable_ppm: free.map(|free| free.detectable_ppm()),
        length_tolerance_mm: scale.length_sd_mm,
        warmer_by_least_k: free.map(|free| free.kelvins()[0]),
        warmer_by_most_k: free.map(|free| free.kelvins()[1]),
        verdict: scale.verdict(),
        reason: scale.reason(),
    }
}
