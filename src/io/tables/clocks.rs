//! `clocks`: how the two clocks of a session relate.

use super::PublishError;
use crate::io::schema;
use crate::io::table::{Columns, Table};
use crate::join::ClockEstimate;
use crate::manifest::RunKey;

const PPM: f64 = 1e6;

/// The table of one session's clocks.
pub fn clocks(clock: &ClockEstimate, key: &RunKey) -> Result<Table, PublishError> {
    let model = &clock.model;
    let table = Columns::new(schema::find("clocks")?, 1)
        .key(key)
        .same("origin_ns", model.origin.ns())
        .same("offset_ns", model.offset_ns)
        .same("offset_se_ns", clock.offset_se_ns)
        .same("drift_ppm", model.drift * PPM)
        .same("drift_se_ppm", clock.drift_se * PPM)
        .same("matched_edges", clock.matched_edges)
        .same("edge_rms_ns", clock.edge_rms_ns)
        .same("method", &clock.method);
    Ok(table.finish()?)
}
