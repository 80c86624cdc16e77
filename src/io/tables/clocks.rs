//! `clocks`: the relation of the two clocks of a session.

use crate::join::ClockEstimate;
use crate::rows::row;

const PPM: f64 = 1e6;

row! {
    pub struct ClockRow of "clocks" {
        origin_ns: i64,
        offset_ns: f64,
        offset_se_ns: f64,
        drift_ppm: f64,
        drift_se_ppm: f64,
        matched_edges: usize,
        edge_rms_ns: f64,
        method: String,
    }
}

pub fn row(clock: &ClockEstimate) -> ClockRow {
    let model = &clock.model;
    ClockRow {
        origin_ns: model.origin.ns(),
        offset_ns: model.offset_ns,
        offset_se_ns: clock.offset_se_ns,
        drift_ppm: model.drift * PPM,
        drift_se_ppm: clock.drift_se * PPM,
        matched_edges: clock.matched_edges,
        edge_rms_ns: clock.edge_rms_ns,
        method: clock.method.clone(),
    }
}
