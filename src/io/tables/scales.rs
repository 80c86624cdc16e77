//! `scales`: whether each session's length unit agrees with the arm's lengths.

use crate::fit::scale::{ScaleVerdict, SessionScale};
use crate::rows::row;

row! {
    pub struct ScaleRow of "scales" {
        of_session: String,
        stations: usize,
        fitted_ppm: Option<f64>,
        fitted_sd_ppm: Option<f64>,
        kept: Option<bool>,
        prior_sd_ppm: f64,
        free_ppm: Option<f64>,
        free_sd_ppm: Option<f64>,
        length_rms_mm: Option<f64>,
        detectable_ppm: Option<f64>,
        length_tolerance_mm: f64,
        warmer_by_least_k: Option<f64>,
        warmer_by_most_k: Option<f64>,
        verdict: ScaleVerdict,
        reason: Option<String>,
    }
}

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
