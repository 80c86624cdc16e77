//! `stations`: every dwell of the arm, with its command, the tracker's measurement and the verdict on the pair.

use std::sync::Arc;

use nalgebra::DVector;

use super::words::{orientation_rows, xyzw};
use crate::fit::commanded::SettlingError;
use crate::join::{Pairing, Station, Unmeasured};
use crate::judgement::JoinedSession;
use crate::kinematics::Arm;
use crate::table::{row, words};

row! {
    /// A dwell of the arm.
    pub struct StationRow of "stations" {
        station: usize,
        verdict: PairingVerdict,
        reason: Option<Unpaired>,
        start_ns: i64,
        end_ns: i64,
        joint_names: Arc<[String]>,
        joints_rad: Vec<f64>,
        joint_samples: usize,
        commanded_joints_rad: Option<Vec<f64>>,
        command as [command_x_mm, command_y_mm, command_z_mm]: Option<[f64; 3]>,
        command_turn as [command_qx, command_qy, command_qz, command_qw]: Option<[f64; 4]>,
        target: Option<String>,
        target_at as [target_x_mm, target_y_mm, target_z_mm]: Option<[f64; 3]>,
        table_id: Option<Arc<str>>,
        at as [x_mm, y_mm, z_mm]: Option<[f64; 3]>,
        turn as [qx, qy, qz, qw]: Option<[f64; 4]>,
        scatter_mm as [scatter_x_mm, scatter_y_mm, scatter_z_mm]: Option<[f64; 3]>,
        scatter_orientation_rad: Option<f64>,
        stated_cov_mm2 as [
            stated_cov_xx_mm2,
            stated_cov_xy_mm2,
            stated_cov_xz_mm2,
            stated_cov_yy_mm2,
            stated_cov_yz_mm2,
            stated_cov_zz_mm2,
        ]: Option<[f64; 6]>,
        stated_orientation_cov_rad2: Option<Vec<f64>>,
        stated_position_orientation_cov_mm_rad: Option<Vec<f64>>,
        motion_cov_mm2 as [
            motion_cov_xx_mm2,
            motion_cov_xy_mm2,
            motion_cov_xz_mm2,
            motion_cov_yy_mm2,
            motion_cov_yz_mm2,
            motion_cov_zz_mm2,
        ]: Option<[f64; 6]>,
        readings: Option<usize>,
        readings_kept: Option<usize>,
        first_reading_ns: Option<i64>,
        last_reading_ns: Option<i64>,
        temperature_c: Option<f64>,
    }
}

/// Whether a dwell has a measurement of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum PairingVerdict {
    /// It has one.
    Paired,
    /// It has none.
    Unmeasured,
    /// Several measurements could belong to it.
    Ambiguous,
}

/// The reason why a dwell has no measurement of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unpaired {
    /// No measurement, and why.
    Unmeasured(Unmeasured),
    /// Several measurements could belong to it.
    SeveralCandidates,
}

words! {
    PairingVerdict { Paired: "paired", Unmeasured: "unmeasured", Ambiguous: "ambiguous" }
    Unpaired {
        Unmeasured(Unmeasured::NoReadings): "no_readings",
        Unmeasured(Unmeasured::TooFewReadings): "too_few_readings",
        Unmeasured(Unmeasured::TargetMoved): "target_moved",
        Unmeasured(Unmeasured::OutsideTrackerLog): "outside_tracker_log",
        Unmeasured(Unmeasured::WrongTarget): "wrong_target",
        Unmeasured(Unmeasured::InstrumentMoved): "instrument_moved",
        Unmeasured(Unmeasured::FlippedView): "flipped_view",
        SeveralCandidates: "several_candidates",
    }
}

impl From<&Pairing> for PairingVerdict {
    fn from(pairing: &Pairing) -> Self {
        match pairing {
            Pairing::Paired => Self::Paired,
            Pairing::Unmeasured(_) => Self::Unmeasured,
            Pairing::Ambiguous => Self::Ambiguous,
        }
    }
}

impl Unpaired {
    /// Why a dwell has no measurement of its own; `None` when paired.
    pub(super) const fn of(pairing: &Pairing) -> Option<Self> {
        match pairing {
            Pairing::Paired => None,
            Pairing::Ambiguous => Some(Self::SeveralCandidates),
            Pairing::Unmeasured(why) => Some(Self::Unmeasured(*why)),
        }
    }
}

/// The rows of one session's stations.
pub fn rows(session: &JoinedSession, arm: &Arm) -> Vec<StationRow> {
    let names: Arc<[String]> = arm.joints().iter().map(|joint| joint.name.clone()).collect();
    let run = session.driven_by.as_ref();
    let run: Option<Arc<str>> = run.map(|by| by.file.key.run.as_str().into());
    let commanded = commanded_joints(session, arm);
    let stations = session.joined.stations.iter().zip(commanded).enumerate();
    stations
        .map(|(place, (station, commanded_joints_rad))| {
            let command = station.command.as_ref();
            let by = session.driven_by.as_ref();
            let target = by.and_then(|by| {
                let place = by.matched.of_command[place]?;
                Some(&by.file.targets[place])
            });
            StationRow {
                joint_names: Arc::clone(&names),
                commanded_joints_rad,
                command: command.map(|c| c.position.coords.into()),
                command_turn: command.and_then(|c| c.orientation.as_ref().map(xyzw)),
                target: target.map(|target| target.name.clone()),
                target_at: target.map(|target| target.target.coords.into()),
                table_id: run.clone().filter(|_| target.is_some()),
                ..measured(station)
            }
        })
        .collect()
}

/// The dwell and its one reading, without its command: sessions with several sources or targets are never published.
fn measured(station: &Station) -> StationRow {
    let reading = station.one_reading();
    let point = reading.and_then(|reading| reading.value.point());
    let turn = reading.and_then(|reading| reading.value.turn());
    let stated = turn.and_then(|turn| turn.stated_covariance);
    StationRow {
        station: station.number,
        verdict: (&station.pairing).into(),
        reason: Unpaired::of(&station.pairing),
        start_ns: station.start.ns(),
        end_ns: station.end.ns(),
        joint_names: [].into(),
        joints_rad: station.joints.clone(),
        joint_samples: station.joint_samples,
        commanded_joints_rad: None,
        command: None,
        command_turn: None,
        target: None,
        target_at: None,
        table_id: None,
        at: point.map(|point| point.position.coords.into()),
        turn: turn.map(|turn| xyzw(&turn.orientation)),
        scatter_mm: point.map(|point| point.scatter_mm),
        scatter_orientation_rad: turn.map(|turn| turn.scatter_rad),
        stated_cov_mm2: point.and_then(|point| point.stated_covariance),
        stated_orientation_cov_rad2: stated.map(orientation_rows),
        stated_position_orientation_cov_mm_rad: stated.map(|own| own.with_position.to_vec()),
        motion_cov_mm2: point.and_then(|point| point.motion_covariance),
        readings: reading.map(|reading| reading.taken),
        readings_kept: reading.map(|reading| reading.kept),
        first_reading_ns: reading.map(|reading| reading.first.ns()),
        last_reading_ns: reading.map(|reading| reading.last.ns()),
        temperature_c: reading.and_then(|reading| reading.temperature_c),
    }
}

/// Reported angles plus the settling error, converted from axis variables to joint angles.
fn commanded_joints(session: &JoinedSession, arm: &Arm) -> Vec<Option<Vec<f64>>> {
    let joints_from_axes = arm
        .axes_from_joints()
        .try_inverse()
        .expect("a robot file's joint map was checked to be invertible");
    let commanded = |(station, settling_error): (&Station, &Option<SettlingError>)| {
        let away = &joints_from_axes * DVector::from_column_slice(settling_error.as_ref()?.sent()?);
        Some(station.joints.iter().zip(&away).map(|(q, away)| q + away).collect())
    };
    let stations = session.joined.stations.iter();
    stations.zip(&session.commanded.settling_errors).map(commanded).collect()
}
