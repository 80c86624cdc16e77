//! `clocks`: the relation of the two clocks of a session.

use crate::join::ClockEstimate;
use crate::table::row;

const PPM: f64 = 1e6;

row! {
    /// The relation of a session's clocks.
    pub struct ClockRow of "clocks" {
        /// First stamp of the controller's log, ns.
        origin_ns: i64,
        /// Offset of the tracker's clock at that stamp, ns, positive when ahead.
        offset_ns: f64,
        /// Its standard error, ns.
        offset_se_ns: f64,
        /// Drift of the tracker's clock, ppm, positive when faster.
        drift_ppm: f64,
        /// Its standard error, ppm.
        drift_se_ppm: f64,
        /// Number of edges of dwells that were matched.
        matched_edges: usize,
        /// Root mean square of their residuals, ns.
        edge_rms_ns: f64,
        /// The method that found the relation, as text.
        method: String,
    }
}

/// The row of one session's clocks.
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
