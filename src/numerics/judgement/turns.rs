//! Attained and commanded orientations of the flange at stations, where both are known; and why they are not.

use super::JoinedSession;
use crate::fit::ErrorFrame;
use crate::fit::commanded::{CommandedPose, Trust};
use crate::grid::Verdict;
use crate::join::Station;
use crate::report::Model;
use crate::report::tip::Turn;

use super::StageSettings;

/// For each station of a session the attained orientation of the flange in the base of `error_frame`, and the commanded
/// one. Commanded orientations that were not sent are not used.
pub(super) fn commanded_turns(
    session: &JoinedSession,
    error_frame: &ErrorFrame<'_>,
) -> Vec<Option<Turn>> {
    let sent = session.commanded.trust.agrees();
    let tool_from_flange = error_frame.flange_from_tool().rotation.inverse();
    let turn = |(station, pose): (&Station, &Option<CommandedPose>)| {
        let reading = station.one_reading().filter(|_| sent)?;
        Some(Turn {
            attained: error_frame.measured_flange(reading)?,
            wanted: pose.as_ref()?.orientation? * tool_from_flange,
        })
    };
    let stations = session.joined.stations.iter();
    stations.zip(&session.commanded.poses).map(turn).collect()
}

/// The reason why a model's residuals of a session have no turns.
pub(super) fn why_no_turns(
    settings: &StageSettings,
    session: &JoinedSession,
    model: Model,
) -> Verdict {
    let against_command = model.is_against_commands();
    Verdict::NotShown(match session.commanded.trust {
        _ if !settings.noise.takes_orientations() => {
            "orientations were not taken into the fit; those of a 6-DoF target are with [fit] orientations = true and [tracker] \
             uncertainty.orientation_rad"
                .to_owned()
        }
        Trust::Scatters(rad) if against_command => format!(
            "commanded orientations scatter by {:.2} mrad about the arm's, so they are not those that were sent",
            1e3 * rad
        ),
        Trust::NoOrientations if against_command => {
            "the log has no commanded orientations, or [commanded] flange_from_tool is not given".to_owned()
        }
        _ => "no orientation was measured: the target of the tracker's log is no 6-DoF target".to_owned(),
    })
}
