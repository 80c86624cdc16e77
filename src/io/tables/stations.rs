//! `stations`: every dwell of the arm, with its command, what the tracker saw and the verdict on the pair.

use nalgebra::DVector;

use super::PublishError;
use super::words::xyzw;
use crate::fit::commanded::Shortfall;
use crate::fit::saved::axes_from_joints;
use crate::io::schema;
use crate::io::table::{Columns, Table};
use crate::join::{Attained, Command, Pairing, Station, Unmeasured};
use crate::kinematics::Arm;
use crate::manifest::RunKey;
use crate::pipeline::outcome::JoinedSession;

/// The table of one session's stations.
pub fn stations(session: &JoinedSession, arm: &Arm, key: &RunKey) -> Result<Table, PublishError> {
    let stations = &session.joined.stations;
    let names: Vec<&str> = arm
        .joints()
        .iter()
        .map(|joint| joint.name.as_str())
        .collect();
    let table = Columns::new(schema::find("stations")?, stations.len())
        .key(key)
        .column("station", stations.iter().map(|s| s.number))
        .column("verdict", stations.iter().map(|s| verdict(&s.pairing)))
        .column("reason", stations.iter().map(|s| reason(&s.pairing)))
        .column("start_ns", stations.iter().map(|s| s.start.ns()))
        .column("end_ns", stations.iter().map(|s| s.end.ns()))
        .same("joint_names", names)
        .column("joints_rad", stations.iter().map(|s| &s.joints))
        .column("joint_samples", stations.iter().map(|s| s.joint_samples))
        .column("commanded_joints_rad", commanded_joints(session, arm));
    let table = targets(table, session);
    Ok(attained(commands(table, stations), stations).finish()?)
}

/// The verdict's word.
pub(super) const fn verdict(pairing: &Pairing) -> &'static str {
    match pairing {
        Pairing::Paired => "paired",
        Pairing::Unmeasured(_) => "unmeasured",
        Pairing::Ambiguous => "ambiguous",
    }
}

/// Why a dwell has no measurement of its own, as a word; `None` when paired.
pub(super) const fn reason(pairing: &Pairing) -> Option<&'static str> {
    match pairing {
        Pairing::Paired => None,
        Pairing::Ambiguous => Some("several_candidates"),
        Pairing::Unmeasured(why) => Some(match why {
            Unmeasured::NoReadings => "no_readings",
            Unmeasured::TooFewReadings => "too_few_readings",
            Unmeasured::TargetMoved => "target_moved",
            Unmeasured::OutsideTrackerLog => "outside_tracker_log",
            Unmeasured::WrongTarget => "wrong_target",
        }),
    }
}

/// Reported angles plus the shortfall, carried from axis variables to joint angles.
fn commanded_joints(session: &JoinedSession, arm: &Arm) -> Vec<Option<Vec<f64>>> {
    let joints_from_axes = axes_from_joints(arm)
        .try_inverse()
        .expect("a robot file's joint map was checked to be invertible");
    let commanded = |(station, shortfall): (&Station, &Option<Shortfall>)| {
        let away = &joints_from_axes * DVector::from_column_slice(shortfall.as_ref()?.sent()?);
        Some(
            station
                .joints
                .iter()
                .zip(&away)
                .map(|(q, away)| q + away)
                .collect(),
        )
    };
    let stations = session.joined.stations.iter();
    stations
        .zip(&session.commanded.shortfalls)
        .map(commanded)
        .collect()
}

fn commands(columns: Columns, stations: &[Station]) -> Columns {
    let commands = || stations.iter().map(|station| station.command.as_ref());
    let position = |command: Option<&Command>| command.map(|c| c.position.coords.into());
    let orientation = |command: Option<&Command>| Some(xyzw(command?.orientation.as_ref()?));
    columns
        .group(
            ["command_x_mm", "command_y_mm", "command_z_mm"],
            commands().map(position),
        )
        .group(
            ["command_qx", "command_qy", "command_qz", "command_qw"],
            commands().map(orientation),
        )
}

/// The targets that the stations of a session driven by a table went to.
fn targets(columns: Columns, session: &JoinedSession) -> Columns {
    let stations = session.joined.stations.len();
    let target = |station: usize| {
        let by = session.driven_by.as_ref()?;
        let place = by.matched.of_command[station]?;
        Some((&by.file.key.run, &by.file.targets[place]))
    };
    let targets = || (0..stations).map(target);
    columns
        .column(
            "target",
            targets().map(|of| of.map(|(_, target)| &target.name)),
        )
        .group(
            ["target_x_mm", "target_y_mm", "target_z_mm"],
            targets().map(|of| of.map(|(_, target)| target.target.coords.into())),
        )
        .column("table_id", targets().map(|of| of.map(|(run, _)| run)))
}

fn attained(columns: Columns, stations: &[Station]) -> Columns {
    let attained: Vec<Option<&Attained>> = stations.iter().map(|s| s.attained.as_ref()).collect();
    let all = || attained.iter();
    let columns = columns
        .group(
            ["x_mm", "y_mm", "z_mm"],
            all().map(|a| a.map(|a| a.position.coords.into())),
        )
        .group(
            ["qx", "qy", "qz", "qw"],
            all().map(|a| a.and_then(|a| a.orientation.as_ref().map(xyzw))),
        )
        .group(
            ["scatter_x_mm", "scatter_y_mm", "scatter_z_mm"],
            all().map(|a| a.map(|a| a.scatter_mm)),
        )
        .column(
            "scatter_orientation_rad",
            all().map(|a| a.and_then(|a| a.orientation_scatter_rad)),
        )
        .group(
            ["xx", "xy", "xz", "yy", "yz", "zz"]
                .map(|c| format!("stated_cov_{c}_mm2"))
                .each_ref()
                .map(String::as_str),
            all().map(|a| a.and_then(|a| a.stated_covariance)),
        );
    columns
        .column("readings", all().map(|a| a.map(|a| a.readings)))
        .column("readings_kept", all().map(|a| a.map(|a| a.kept)))
        .column("first_reading_ns", all().map(|a| a.map(|a| a.first.ns())))
        .column("last_reading_ns", all().map(|a| a.map(|a| a.last.ns())))
        .column(
            "temperature_c",
            all().map(|a| a.and_then(|a| a.temperature_c)),
        )
}
