//! Stations against their commands: the raw command, the table that drove a session, and the turns of the flange.

use nalgebra::Vector3;

use super::{Driven, DrivenBy, JoinedSession, StageSettings};
use crate::fit::commanded::{CommandedPose, Trust};
use crate::fit::{ErrorBase, ErrorFrame};
use crate::grid::Verdict;
use crate::join::Station;
use crate::report::driven::{self, DrivenStation};
use crate::report::tip::{Turn, without_constant};
use crate::report::{Angles, BaseRefit, Model, Residual, ResidualSet, Split, Subject};

/// Errors against the raw command in the error reference frame: where the base is surveyed, and where it is said to be fitted and
/// command and target are one point.
pub(super) fn raw_command(
    session: &JoinedSession,
    error_frame: &ErrorFrame<'_>,
    settings: &StageSettings,
) -> Option<ResidualSet> {
    let is_tool = settings.target_is_tool?;
    if settings.base? == ErrorBase::Fitted && !is_tool {
        return None;
    }
    let turns = without_constant(&commanded_turns(session, error_frame), |_| true);
    let (stations, visits) = (&session.joined.stations, &session.commanded.visits);
    let residual = |(place, (station, pose)): (usize, (&Station, &Option<CommandedPose>))| {
        let commanded = pose.as_ref()?.position;
        let attained = error_frame.attained_tool(&station.joints, station.one_reading()?)?;
        Some(Residual {
            station: station.number,
            pose: stations[visits[place]].number,
            attained,
            residual: attained - commanded,
            turn: turns[place],
            ..Residual::default()
        })
    };
    let commanded = stations.iter().zip(&session.commanded.poses);
    let residuals = commanded.enumerate().filter_map(residual).collect();
    let (of, base_refit) = ((Split::None, &*session.name), BaseRefit::None);
    let subject = Subject::new(of, Model::RawCommand, Angles::Commanded, base_refit);
    Some(ResidualSet { subject, residuals })
}

/// The session's judgement on the table that drove it; `None` where none did.
pub(super) fn driven_by(
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

/// For each station of a session the attained orientation of the flange in the base of `error_frame`, and the commanded
/// one. Commanded orientations that were not sent are not used.
pub(super) fn commanded_turns(
    session: &JoinedSession,
    error_frame: &ErrorFrame<'_>,
) -> Vec<Option<Turn>> {
    let sent = session.commanded.trust.agrees();
    let tool_from_flange = error_frame.flange_from_tool.rotation.inverse();
    let turn = |(station, pose): (&Station, &Option<CommandedPose>)| {
        let reading = station.one_reading().filter(|_| sent)?;
        Some(Turn {
            attained: error_frame.measured_flange(reading)?,
            wanted: pose.as_ref()?.orientation? * tool_from_flange,
        })
    };
    session.joined.stations.iter().zip(&session.commanded.poses).map(turn).collect()
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
