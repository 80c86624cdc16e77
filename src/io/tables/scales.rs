//! `scales`: whether each session's length unit agrees with the arm's lengths.

use super::PublishError;
use crate::fit::scale::{FreeScale, SessionScale};
use crate::io::schema;
use crate::io::table::{Columns, Table};
use crate::manifest::RunKey;

/// The table of all sessions that trained.
pub fn scales(all: &[SessionScale], key: &RunKey) -> Result<Table, PublishError> {
    let free = |of: fn(&FreeScale) -> f64| all.iter().map(move |scale| scale.free.as_ref().map(of));
    let fitted = || all.iter().map(|scale| scale.fitted);
    let table = Columns::new(schema::find("scales")?, all.len())
        .key(key)
        .column("of_session", all.iter().map(|scale| &scale.session))
        .column("stations", all.iter().map(|scale| scale.stations))
        .column("fitted_ppm", fitted().map(|fitted| Some(fitted?.ppm)))
        .column("fitted_sd_ppm", fitted().map(|fitted| Some(fitted?.sd_ppm)))
        .column("kept", fitted().map(|fitted| Some(fitted?.kept)))
        .column("prior_sd_ppm", all.iter().map(|scale| scale.prior_sd_ppm))
        .column("free_ppm", free(|free| free.ppm))
        .column("free_sd_ppm", free(|free| free.sd_ppm))
        .column("length_rms_mm", free(|free| free.length_rms_mm))
        .column("detectable_ppm", free(FreeScale::detectable_ppm))
        .column(
            "length_tolerance_mm",
            all.iter().map(|scale| scale.length_sd_mm),
        )
        .column("warmer_by_least_k", free(|free| free.kelvins()[0]))
        .column("warmer_by_most_k", free(|free| free.kelvins()[1]))
        .column("verdict", all.iter().map(SessionScale::verdict))
        .column("reason", all.iter().map(SessionScale::reason));
    Ok(table.finish()?)
}
