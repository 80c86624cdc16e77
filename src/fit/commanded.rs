//! Commands in the base frame, and what the arm fell short of them: commanded minus reported joint angles.
//!
//! The angles a controller reports while stationary differ from the nominal inverse kinematics of its command by 0.1–2 mrad, and
//! the arm may stand nearer the command ([`crate::method::error_model`]). Steps:
//! 1. the constant turn between commanded and nominal orientation is the tool's as the controller rounds it, no error
//!    of the arm: its median per axis is taken out;
//! 2. one regularised step of inverse kinematics from the reported angles, bounded at singularities, gives the
//!    settling error;
//! 3. where orientations scatter far beyond any arm's, the commanded orientation is not what was sent: it counts by that
//!    scatter, so that the settling error is mostly one of position, and means something in its own session alone.

use nalgebra::{DMatrix, DVector, Isometry3, Point3, UnitQuaternion, Vector3};

use super::visits::{self, Dwell};
use crate::figures::median;
use crate::join::Station;
use crate::kinematics::Arm;

/// How the controller states its commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandFrames {
    /// The frame commands are stated in, in the base frame.
    pub base_from_command: Isometry3<f64>,
    /// The controller's own tool at the flange; `None` where it is the measured target, whose place the fit finds.
    pub flange_from_tool: Option<Isometry3<f64>>,
}

/// A commanded tool pose in the base frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandedPose {
    /// mm.
    pub position: Point3<f64>,
    /// Where the log has it.
    pub orientation: Option<UnitQuaternion<f64>>,
}

/// What a session's commands say.
#[derive(Debug, Clone, PartialEq)]
pub struct Commanded {
    /// The commanded pose of each station, where the log has one.
    pub poses: Vec<Option<CommandedPose>>,
    /// What each station fell short of; `None` where no orientation is commanded.
    pub settling_errors: Vec<Option<SettlingError>>,
    /// Whether commanded orientations are those that were sent.
    pub trust: Trust,
    /// For each station the place of the one that its pose is named by: visits of one pose have one.
    pub visits: Vec<usize>,
}

/// Commanded minus reported axis variables of one station, rad.
#[derive(Debug, Clone, PartialEq)]
pub enum SettlingError {
    /// Of the command as it was sent: means the same in every session.
    Sent(Vec<f64>),
    /// Of a command whose orientation is not what was sent: says something in its own session alone.
    OfPosition(Vec<f64>),
}

impl SettlingError {
    /// Commanded minus reported axis variables, rad, where both are the same motion.
    pub fn sent(&self) -> Option<&[f64]> {
        match self {
            Self::Sent(axes) => Some(axes),
            Self::OfPosition(_) => None,
        }
    }
}

/// Whether commanded orientations agree with the arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Trust {
    /// They do: their median turn from the nominal arm, the constant taken out, is this, rad.
    Agrees(f64),
    /// They scatter by this, rad: they are not what was sent.
    Scatters(f64),
    /// The log has no commanded orientations, or the tool is not known.
    NoOrientations,
}

impl Trust {
    /// Whether commanded orientations are those that were sent.
    pub const fn agrees(self) -> bool {
        matches!(self, Self::Agrees(_))
    }
}

/// Commanded and nominal orientations further apart than this are not of one motion, rad. Servo errors of a stationary joint are a
/// tenth of a milliradian to a third.
const TRUSTED_RAD: f64 = 0.5e-3;
/// What the regularised step weighs: position, orientation, and how large a settling error is expected to be.
const POSITION_MM: f64 = 0.01;
const ORIENTATION_RAD: f64 = 30e-6;
const SETTLING_ERROR_RAD: f64 = 250e-6;

/// Reads the commands of `stations`.
pub fn commanded(stations: &[Station], arm: &Arm, frames: &CommandFrames) -> Commanded {
    let poses: Vec<Option<CommandedPose>> = stations
        .iter()
        .map(|station| pose(station, frames))
        .collect();
    let Some(flange_from_tool) = frames.flange_from_tool else {
        return without_orientations(stations, poses);
    };
    let turns: Vec<Option<Vector3<f64>>> = stations
        .iter()
        .zip(&poses)
        .map(|(station, pose)| turn(station, pose.as_ref()?, arm, &flange_from_tool))
        .collect();
    let Some(constant) = constant_turn(&turns) else {
        return without_orientations(stations, poses);
    };
    let scatter = median(
        &turns
            .iter()
            .flatten()
            .map(|turn| (turn - constant).norm())
            .collect::<Vec<_>>(),
    );
    let trust = match scatter {
        Some(scatter) if scatter <= TRUSTED_RAD => Trust::Agrees(scatter),
        Some(scatter) => Trust::Scatters(scatter),
        None => Trust::NoOrientations,
    };
    let settling_errors = stations
        .iter()
        .zip(&poses)
        .zip(&turns)
        .map(|((station, pose), turn)| {
            let (pose, turn) = (pose.as_ref()?, (*turn)?);
            let turn = turn - constant;
            let settling_error =
                |turn_rad| settling_error(station, pose, turn, turn_rad, arm, &flange_from_tool);
            match trust {
                Trust::Agrees(_) => Some(SettlingError::Sent(settling_error(ORIENTATION_RAD))),
                Trust::Scatters(scatter) => {
                    Some(SettlingError::OfPosition(settling_error(scatter)))
                }
                Trust::NoOrientations => None,
            }
        });
    Commanded {
        settling_errors: settling_errors.collect(),
        visits: visits::poses(&dwells(stations, &poses, trust)),
        poses,
        trust,
    }
}

/// Commands whose orientations say nothing of what the arm fell short of.
fn without_orientations(stations: &[Station], poses: Vec<Option<CommandedPose>>) -> Commanded {
    let trust = Trust::NoOrientations;
    Commanded {
        settling_errors: vec![None; poses.len()],
        visits: visits::poses(&dwells(stations, &poses, trust)),
        poses,
        trust,
    }
}

/// Stations as dwells whose visits of one pose are to be found. Orientations that were not sent as they are stated differ between
/// visits of one pose, so they take no part.
pub fn dwells<'s>(
    stations: &'s [Station],
    poses: &[Option<CommandedPose>],
    trust: Trust,
) -> Vec<Dwell<'s>> {
    let stated = |pose: &CommandedPose| CommandedPose {
        orientation: pose
            .orientation
            .filter(|_| !matches!(trust, Trust::Scatters(_))),
        ..*pose
    };
    let dwell = |(station, pose): (&'s Station, &Option<CommandedPose>)| Dwell {
        command: pose.as_ref().map(stated),
        joints: &station.joints,
    };
    stations.iter().zip(poses).map(dwell).collect()
}

fn pose(station: &Station, frames: &CommandFrames) -> Option<CommandedPose> {
    let command = station.command.as_ref()?;
    Some(CommandedPose {
        position: frames.base_from_command * command.position,
        orientation: command
            .orientation
            .map(|orientation| frames.base_from_command.rotation * orientation),
    })
}

/// Commanded orientation seen from the nominal one, as a rotation vector along the flange's axes.
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

/// The median of the turns, axis by axis.
fn constant_turn(turns: &[Option<Vector3<f64>>]) -> Option<Vector3<f64>> {
    let along = |axis: usize| {
        median(
            &turns
                .iter()
                .flatten()
                .map(|turn| turn[axis])
                .collect::<Vec<_>>(),
        )
    };
    Some(Vector3::new(along(0)?, along(1)?, along(2)?))
}

/// `(Jᵀ S J + I/σ²)⁻¹ Jᵀ S [Δp; Δr]` about the reported angles; the turn Δr is known to `turn_rad`.
fn settling_error(
    station: &Station,
    pose: &CommandedPose,
    turn: Vector3<f64>,
    turn_rad: f64,
    arm: &Arm,
    flange_from_tool: &Isometry3<f64>,
) -> Vec<f64> {
    let axes = arm.axes(&station.joints);
    let differential = arm
        .chain()
        .differential(&axes, &vec![0.0; arm.chain().parameters().len()]);
    let tool = differential.end * Point3::from(flange_from_tool.translation.vector);
    let lever = tool.coords - differential.end.translation.vector;
    let mut rows = DMatrix::zeros(6, axes.len());
    for (column, twist) in differential.joints.iter().enumerate() {
        let linear = (twist.linear + twist.angular.cross(&lever)) / POSITION_MM;
        rows.fixed_view_mut::<3, 1>(0, column).copy_from(&linear);
        rows.fixed_view_mut::<3, 1>(3, column)
            .copy_from(&(twist.angular / turn_rad));
    }
    let mut away = DVector::zeros(6);
    away.fixed_rows_mut::<3>(0)
        .copy_from(&((pose.position - tool) / POSITION_MM));
    away.fixed_rows_mut::<3>(3)
        .copy_from(&(differential.end.rotation * turn / turn_rad));
    let ridge = DMatrix::identity(axes.len(), axes.len()) / SETTLING_ERROR_RAD.powi(2);
    let factor = (rows.tr_mul(&rows) + ridge)
        .cholesky()
        .expect("a ridge makes it positive definite");
    factor.solve(&rows.tr_mul(&away)).as_slice().to_vec()
}
