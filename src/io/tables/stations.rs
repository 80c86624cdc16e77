//! `stations`: every dwell of the arm, with its command, the tracker's measurement and the verdict on the pair.

use std::sync::Arc;

use nalgebra::DVector;

use super::words::{orientation_rows, xyzw};
use crate::fit::commanded::SettlingError;
use crate::join::{Pairing, Reading, Station, Unmeasured};
use crate::judgement::JoinedSession;
use crate::kinematics::Arm;
use crate::rows::{Word, columns, row, words};

row! {
    pub struct StationRow of "stations" {
        dwell: DwellColumns,
        verdict: PairingVerdict,
        joint_names: Arc<[String]>,
        commanded_joints_rad: Option<Vec<f64>>,
        target: Option<String>,
        target_at as [target: point]: Option<[f64; 3]>,
        table_id: Option<Arc<str>>,
        read: ReadColumns,
        readings: Option<usize>,
        readings_kept: Option<usize>,
        first_reading_ns: Option<i64>,
        last_reading_ns: Option<i64>,
    }
}

columns! {
    /// Columns of `stations` and `readings`: a dwell with its command.
    #[derive(Default)]
    pub struct DwellColumns {
        station: usize,
        reason: Option<Unpaired>,
        start_ns: i64,
        end_ns: i64,
        joints_rad: Vec<f64>,
        joint_samples: usize,
        command as point: Option<[f64; 3]>,
        command_turn as [command: turn]: Option<[f64; 4]>,
    }
}

columns! {
    /// Columns of `stations` and `readings`: a mean position and orientation; absent of a length, and without a reading.
    #[derive(Default)]
    pub struct ReadColumns {
        at as [x_mm, y_mm, z_mm]: Option<[f64; 3]>,
        turn as [qx, qy, qz, qw]: Option<[f64; 4]>,
        scatter_mm as [scatter: point]: Option<[f64; 3]>,
        scatter_orientation_rad: Option<f64>,
        stated_cov_mm2 as [stated_cov: covariance]: Option<[f64; 6]>,
        stated_orientation_cov_rad2: Option<Vec<f64>>,
        stated_position_orientation_cov_mm_rad: Option<Vec<f64>>,
        motion_cov_mm2 as [motion_cov: covariance]: Option<[f64; 6]>,
        temperature_c: Option<f64>,
    }
}

impl From<&Station> for DwellColumns {
    fn from(station: &Station) -> Self {
        let command = station.command.as_ref();
        Self {
            station: station.number,
            reason: Unpaired::of(&station.pairing),
            start_ns: station.start.ns(),
            end_ns: station.end.ns(),
            joints_rad: station.joints.clone(),
            joint_samples: station.joint_samples,
            command: command.map(|own| own.position.coords.into()),
            command_turn: command.and_then(|own| own.orientation.as_ref().map(xyzw)),
        }
    }
}

impl From<&Reading> for ReadColumns {
    fn from(reading: &Reading) -> Self {
        let (point, turn) = (reading.value.point(), reading.value.turn());
        let stated = turn.and_then(|own| own.stated_covariance);
        Self {
            at: point.map(|own| own.position.coords.into()),
            turn: turn.map(|own| xyzw(&own.orientation)),
            scatter_mm: point.map(|own| own.scatter_mm),
            scatter_orientation_rad: turn.map(|own| own.scatter_rad),
            stated_cov_mm2: point.and_then(|own| own.stated_covariance),
            stated_orientation_cov_rad2: stated.map(orientation_rows),
            stated_position_orientation_cov_mm_rad: stated.map(|own| own.with_position.to_vec()),
            motion_cov_mm2: point.and_then(|own| own.motion_covariance),
            temperature_c: reading.temperature_c,
        }
    }
}

words! {
    #[derive(PartialOrd, Ord)]
    pub enum PairingVerdict {
        Paired: "paired",
        Unmeasured: "unmeasured",
        /// Several measurements could belong to it.
        Ambiguous: "ambiguous",
    }
}

/// The reason why a dwell has no measurement of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unpaired {
    Unmeasured(Unmeasured),
    /// Several measurements could belong to it.
    SeveralCandidates,
}

impl Word for Unpaired {
    fn word(self) -> &'static str {
        match self {
            Self::Unmeasured(why) => why.name(),
            Self::SeveralCandidates => "several_candidates",
        }
    }

    fn of_word(word: &str) -> Option<Self> {
        let unmeasured = Unmeasured::ALL.into_iter().map(Self::Unmeasured);
        unmeasured.chain([Self::SeveralCandidates]).find(|own| own.word() == word)
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

/// The rows of one session's stations. A station has one reading: sessions with several sources or targets are never published.
pub fn rows(session: &JoinedSession, arm: &Arm) -> Vec<StationRow> {
    let joint_names: Arc<[String]> = arm.joints().iter().map(|joint| joint.name.clone()).collect();
    let by = session.driven_by.as_ref();
    let run: Option<Arc<str>> = by.map(|by| by.file.key.run.as_str().into());
    let commanded = commanded_joints(session, arm);
    let row = |(place, (station, commanded_joints_rad)): (usize, (&Station, _))| {
        let target = by.and_then(|by| Some(&by.file.targets[by.matched.of_command[place]?]));
        let reading = station.one_reading();
        StationRow {
            dwell: station.into(),
            verdict: (&station.pairing).into(),
            joint_names: Arc::clone(&joint_names),
            commanded_joints_rad,
            target: target.map(|target| target.name.clone()),
            target_at: target.map(|target| target.target.coords.into()),
            table_id: run.clone().filter(|_| target.is_some()),
            read: reading.map(ReadColumns::from).unwrap_or_default(),
            readings: reading.map(|reading| reading.taken),
            readings_kept: reading.map(|reading| reading.kept),
            first_reading_ns: reading.map(|reading| reading.first.ns()),
            last_reading_ns: reading.map(|reading| reading.last.ns()),
        }
    };
    session.joined.stations.iter().zip(commanded).enumerate().map(row).collect()
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
