//! Commands in the base frame, and the settling errors: commanded minus reported joint angles.
//!
//! The angles a controller reports while stationary differ from the nominal inverse kinematics of its command by 0.1–2 mrad,
//! and the arm may be nearer to the command ([`crate::method::error_model`]). Steps:
//! 1. the constant turn between commanded and nominal orientation comes from the controller's rounded tool and is no error
//!    of the arm: its median per axis is removed;
//! 2. one regularised step of inverse kinematics from reported angles, bounded at singularities: the settling error;
//! 3. where orientations scatter far beyond any arm's, the commanded orientation is not the one that was sent: it is weighted
//!    by that scatter, so the settling error is mostly one of position and is comparable within its own session only.

use nalgebra::{DMatrix, DVector, Isometry3, Point3, Vector3};

pub use super::visits::CommandedPose;
use super::visits::{self, Dwell};
use crate::figures::median;
use crate::join::Station;
use crate::kinematics::Arm;
use crate::units::per_radian;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandFrames {
    /// The frame of commands, in the base frame, mm.
    pub base_from_command: Isometry3<f64>,
    /// The controller's own tool in the flange frame, mm; `None` where it is the measured target, which the fit finds.
    pub flange_from_tool: Option<Isometry3<f64>>,
}

/// The commands of one session and their settling errors.
#[derive(Debug, Clone, PartialEq)]
pub struct Commanded {
    /// The commanded pose of each station; `None` where the log has none.
    pub poses: Vec<Option<CommandedPose>>,
    /// The settling error of each station; `None` where no orientation is commanded.
    pub settling_errors: Vec<Option<SettlingError>>,
    pub trust: Trust,
    /// For each station, the index of the station that names its pose: visits of one pose have the same.
    pub visits: Vec<usize>,
    /// Radians that one unit of each joint's variable counts as.
    pub counted: Vec<f64>,
}

/// Commanded minus reported axis variables of one station, rad; mm where a joint slides.
#[derive(Debug, Clone, PartialEq)]
pub enum SettlingError {
    /// Settling error of the command as sent: comparable between sessions.
    Sent(Vec<f64>),
    /// Settling error of a command whose orientation was not sent as logged: comparable within its own session only.
    OfPosition(Vec<f64>),
}

impl SettlingError {
    /// Commanded minus reported axis variables, rad, of a command as sent; otherwise `None`.
    pub fn sent(&self) -> Option<&[f64]> {
        match self {
            Self::Sent(axes) => Some(axes),
            Self::OfPosition(_) => None,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Trust {
    /// They agree: the median turn from the nominal arm, the constant turn removed, rad.
    Agrees(f64),
    /// They scatter by this median turn, rad: they are not those that were sent.
    Scatters(f64),
    /// The log has no commanded orientations, or the tool is not known.
    NoOrientations,
}

impl Trust {
    pub const fn agrees(self) -> bool {
        matches!(self, Self::Agrees(_))
    }
}

/// Commanded and nominal orientations further apart than this do not agree, rad. Servo errors of a stationary joint are a
/// tenth of a milliradian to a third.
const TRUSTED_RAD: f64 = 0.5e-3;
/// No arm misses one command by two places further apart than this, mm.
const LEFT_MM: f64 = 10.0;
/// Standard deviations of the regularised step: of position, of orientation, and of the settling error expected.
const POSITION_MM: f64 = 0.01;
const ORIENTATION_RAD: f64 = 30e-6;
const SETTLING_ERROR_RAD: f64 = 250e-6;

pub fn commanded(stations: &[Station], arm: &Arm, frames: &CommandFrames) -> Commanded {
    let poses = current_poses(stations, arm, frames);
    let (trust, settling_errors) = settling_errors(stations, &poses, arm, frames)
        .unwrap_or_else(|| (Trust::NoOrientations, vec![None; poses.len()]));
    let counted = arm.counted();
    let visits = visits::poses(&dwells(stations, &poses, trust, &counted));
    Commanded { poses, settling_errors, trust, visits, counted }
}

/// Whether commanded orientations agree with the arm, and the settling error of each station; `None` without orientations or a tool.
fn settling_errors(
    stations: &[Station],
    poses: &[Option<CommandedPose>],
    arm: &Arm,
    frames: &CommandFrames,
) -> Option<(Trust, Vec<Option<SettlingError>>)> {
    let tool = &frames.flange_from_tool?;
    let each = stations.iter().zip(poses);
    let turns = each.clone().map(|(station, pose)| turn(station, pose.as_ref()?, arm, tool));
    let turns: Vec<Option<Vector3<f64>>> = turns.collect();
    let constant = constant_turn(&turns)?;
    let scatter =
        median(&turns.iter().flatten().map(|turn| (turn - constant).norm()).collect::<Vec<_>>())?;
    let agrees = scatter <= TRUSTED_RAD;
    let turn_rad = if agrees { ORIENTATION_RAD } else { scatter };
    let errors = each.zip(&turns).map(|((station, pose), turn)| {
        let turn = (*turn)? - constant;
        let own = settling_error(station, pose.as_ref()?, turn, turn_rad, arm, tool);
        Some(if agrees { SettlingError::Sent(own) } else { SettlingError::OfPosition(own) })
    });
    let trust = if agrees { Trust::Agrees(scatter) } else { Trust::Scatters(scatter) };
    Some((trust, errors.collect()))
}

/// Stations as dwells for the search of visits of one pose. Orientations that were not sent as logged differ between
/// visits of one pose, so they take no part.
pub fn dwells<'s>(
    stations: &'s [Station],
    poses: &[Option<CommandedPose>],
    trust: Trust,
    counted: &'s [f64],
) -> Vec<Dwell<'s>> {
    let stated = |pose: &CommandedPose| CommandedPose {
        orientation: pose.orientation.filter(|_| !matches!(trust, Trust::Scatters(_))),
        ..*pose
    };
    let dwell = |(station, pose): (&'s Station, &Option<CommandedPose>)| Dwell {
        command: pose.as_ref().map(stated),
        joints: &station.joints,
        counted,
    };
    stations.iter().zip(poses).map(dwell).collect()
}

/// The command of each station; `None` also where it is that of the station before, which the arm has left.
fn current_poses(
    stations: &[Station],
    arm: &Arm,
    frames: &CommandFrames,
) -> Vec<Option<CommandedPose>> {
    let place = |station: &Station| match frames.flange_from_tool {
        Some(tool) => {
            Some(arm.flange(&station.joints).isometry() * Point3::from(tool.translation.vector))
        }
        None => station.measured().first()?.position(),
    };
    let mut held: Option<(CommandedPose, Point3<f64>)> = None;
    let poses = stations.iter().map(|station| {
        let (pose, place) = (pose(station, frames)?, place(station));
        match (&held, place) {
            (Some((own, at)), Some(place)) if *own == pose => {
                return ((place - at).norm() <= LEFT_MM).then_some(pose);
            }
            (_, Some(place)) => held = Some((pose, place)),
            (_, None) => {}
        }
        Some(pose)
    });
    let poses: Vec<Option<CommandedPose>> = poses.collect();
    let is_without =
        |(own, pose): &(&Station, &Option<_>)| pose.is_none() && !own.measured().is_empty();
    let without = stations.iter().zip(&poses).filter(is_without).count();
    if without > 0 && poses.iter().any(Option::is_some) {
        tracing::warn!(
            "{without} of {} stations judge no commands: they have none, or still that of a station before, which the arm has left by more \
             than {LEFT_MM} mm",
            stations.len()
        );
    }
    poses
}

fn pose(station: &Station, frames: &CommandFrames) -> Option<CommandedPose> {
    let command = station.command.as_ref()?;
    let from_command = &frames.base_from_command;
    Some(CommandedPose {
        position: from_command * command.position,
        orientation: command.orientation.map(|orientation| from_command.rotation * orientation),
    })
}

/// Commanded relative to nominal orientation, as a rotation vector along the flange's axes, rad.
fn turn(
    station: &Station,
    pose: &CommandedPose,
    arm: &Arm,
    flange_from_tool: &Isometry3<f64>,
) -> Option<Vector3<f64>> {
    let flange = arm.flange(&station.joints).isometry().rotation;
    let commanded_flange = pose.orientation? * flange_from_tool.rotation.inverse();
    Some((flange.inverse() * commanded_flange).scaled_axis())
}

fn constant_turn(turns: &[Option<Vector3<f64>>]) -> Option<Vector3<f64>> {
    let along =
        |axis: usize| median(&turns.iter().flatten().map(|turn| turn[axis]).collect::<Vec<_>>());
    Some(Vector3::new(along(0)?, along(1)?, along(2)?))
}

/// Commanded less reported axis variables of a station whose command is taken as it was logged, rad; mm where a joint slides. `None` without a
/// commanded orientation or a tool.
pub(super) fn away(station: &Station, arm: &Arm, frames: &CommandFrames) -> Option<Vec<f64>> {
    let flange_from_tool = &frames.flange_from_tool?;
    let pose = pose(station, frames)?;
    let turn = turn(station, &pose, arm, flange_from_tool)?;
    Some(settling_error(station, &pose, turn, ORIENTATION_RAD, arm, flange_from_tool))
}

/// `(Jᵀ S J + I/σ²)⁻¹ Jᵀ S [Δp; Δr]` about the reported angles; the turn Δr has the standard deviation `turn_rad`.
fn settling_error(
    station: &Station,
    pose: &CommandedPose,
    turn: Vector3<f64>,
    turn_rad: f64,
    arm: &Arm,
    flange_from_tool: &Isometry3<f64>,
) -> Vec<f64> {
    let axes = arm.axes(&station.joints);
    let differential = arm.chain().differential(&axes, &arm.no_offsets());
    let tool = differential.end * Point3::from(flange_from_tool.translation.vector);
    let lever = tool.coords - differential.end.translation.vector;
    let mut rows = DMatrix::zeros(6, axes.len());
    for (column, twist) in differential.joints.iter().enumerate() {
        let linear = (twist.linear + twist.angular.cross(&lever)) / POSITION_MM;
        rows.fixed_view_mut::<3, 1>(0, column).copy_from(&linear);
        rows.fixed_view_mut::<3, 1>(3, column).copy_from(&(twist.angular / turn_rad));
    }
    let mut away = DVector::zeros(6);
    away.fixed_rows_mut::<3>(0).copy_from(&((pose.position - tool) / POSITION_MM));
    away.fixed_rows_mut::<3>(3).copy_from(&(differential.end.rotation * turn / turn_rad));
    let slides = arm.chain().slides();
    let expected =
        slides.iter().map(|slides| 1.0 / (SETTLING_ERROR_RAD * per_radian(*slides)).powi(2));
    let ridge = DMatrix::from_diagonal(&DVector::from_iterator(axes.len(), expected));
    let factor =
        (rows.tr_mul(&rows) + ridge).cholesky().expect("a ridge makes it positive definite");
    factor.solve(&rows.tr_mul(&away)).as_slice().to_vec()
}
