//! A session that a table drove: its judgement on that table.

use nalgebra::Vector3;

use super::StageSettings;
use super::turns::commanded_turns;
use super::{Driven, DrivenBy, JoinedSession};
use crate::fit::ErrorFrame;
use crate::fit::commanded::CommandedPose;
use crate::join::Station;
use crate::report::driven::{self, DrivenStation};

/// The session's judgement on the table that drove it; `None` where none did.
pub(super) fn judged(
    session: &JoinedSession,
    error_frame: &ErrorFrame<'_>,
    settings: &StageSettings,
) -> Option<Driven> {
    let by = session.driven_by.as_ref()?;
    let stations = stations(session, by, error_frame, settings);
    Some(Driven {
        key: by.file.key.clone(),
        table: by.file.table.clone(),
        application: driven::application(&stations),
        measured: driven::measured(&stations, &session.name, settings.locate.first()),
        stations,
    })
}

/// The measured stations that went to a target.
fn stations(
    session: &JoinedSession,
    by: &DrivenBy,
    error_frame: &ErrorFrame<'_>,
    settings: &StageSettings,
) -> Vec<DrivenStation> {
    let base_from_command = &settings.base_from_command;
    let turns = commanded_turns(session, error_frame);
    let station = |(place, (station, pose)): (usize, (&Station, &Option<CommandedPose>))| {
        let target = &by.file.targets[by.matched.of_command[place]?];
        let reading = station.one_reading()?;
        let stated: Vector3<f64> = target.command - target.target;
        Some(DrivenStation {
            station: station.number,
            pose: session.joined.stations[session.commanded.visits[place]].number,
            target: base_from_command * target.target,
            command: pose.as_ref()?.position,
            attained: error_frame.attained_tool(&station.joints, reading)?,
            stated: base_from_command.rotation * stated,
            variance_mm2: target.variance_mm2,
            turn: turns[place],
        })
    };
    let stations = session.joined.stations.iter().zip(&session.commanded.poses);
    stations.enumerate().filter_map(station).collect()
}
