//! The identified arm: its model at any joint angles → the joint command at which the tool point attains a target.
//!
//! Inputs are the published result of a run ([`IdentifiedArm`]) and targets as joint angles or poses; outputs are
//! [`Corrected`] commands, joint angles included. Steps:
//! 1. the target becomes a pose of the nominal arm's tool, and joint angles that bring it there (`pose`);
//!    Angles a whole turn away from the measured ones are taken back by it where the joint's errors repeat, and the command is given
//!    on the turn that was asked for;
//! 2. these are held against the joint ranges and the arm configurations measured: beyond them the model falls back to its
//!    prior;
//! 3. the command is moved by minus the error that the model predicts at its joint angles, in the error reference frame
//!    ([`crate::method::compensation`]), as for the nodes of a grid: at a node both give the same command;
//!    Where readings show orientations (a 6-DoF target's, or three reflectors'), the command's orientation is turned by minus the error
//!    of the orientation in the same rounds; otherwise it is the target's;
//! 4. the covariance of the error at the joint command, and that of a surveyed frame at the target, are that of the correction: of
//!    many commands together, as one pass through the model's factor serves them all.

use std::any::Any;
use std::f64::consts::TAU;

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::fixed_point::converge;
use super::pose::{Poses, Wanted, within_limits};
use super::{Corrected, Covariances, Exception, JointCommand, Reason, Refused, Target, Validity};
use crate::fit::full::FullModel;
use crate::fit::{ErrorFrame, FramePair, FrameUncertainty, Model, PoseModel, ToolErrors};
use crate::geometry::{Base, Command, Flange, Position, Tool, Transform};
use crate::grid::Reach;
use crate::kinematics::Arm;
use crate::kinematics::inverse::JointVariable;

/// An angle beyond the measured ones by up to this counts as measured, rad: half a degree, while the shortest curves of
/// real joints extend over several. The correction of a target at the rim stays within it.
const RIM_RAD: f64 = 0.0087;

/// The published result of a run for one arm: everything that predicts its errors.
#[derive(Debug)]
pub struct IdentifiedArm {
    /// The run's name, carried by targets corrected with it.
    pub table_id: String,
    pub arm: Arm,
    /// The error reference frame: base and measured target. Errors are of one tool point, so of one source and one target.
    pub frames: FramePair,
    /// The controller's own tool in the flange frame, mm.
    pub flange_from_tool: Transform<Flange, Tool>,
    /// The base in the frame of commands, mm.
    pub command_from_base: Transform<Command, Base>,
    pub model: ArmModel,
    /// Lowest and highest value of each joint over the stations used, rad or mm.
    pub measured: Vec<[f64; 2]>,
    /// The arm configurations of the stations used; empty for an arm that has none.
    pub configurations: Vec<String>,
    pub validity: Validity,
    /// The uncertainty of the error reference frame, which is not in the model's covariance.
    pub frame_uncertainty: FrameUncertainty,
}

#[derive(Debug)]
pub struct ArmModel {
    pub model: Model,
    pub predicts: Box<dyn PoseModel>,
    /// The session (its index in the model) in whose error reference frame errors are stated.
    pub session: usize,
    /// The turn behind the model's flange by which it has the orientations that the readings show
    /// ([`crate::fit::flange::turn_behind`]); `None` where they show none, and orientations are commanded as they are.
    pub shown: Option<UnitQuaternion<f64>>,
}

impl ArmModel {
    /// The model as the kind `M`, for results that only that kind has; `None` when it is of another kind.
    pub fn is<M: PoseModel>(&self) -> Option<&M> {
        let any: &dyn Any = &*self.predicts;
        any.downcast_ref()
    }
}

impl IdentifiedArm {
    /// The error reference frame in which errors are stated.
    pub fn error_frame(&self) -> ErrorFrame<'_> {
        ErrorFrame::new(&self.arm, self.frames, Some(*self.flange_from_tool.isometry()), false)
    }

    /// The commands at which the tool point attains each of `targets`, in their order, or the reasons why there is none.
    ///
    /// `allow` names a reason for which no target is refused.
    pub fn compensate(
        &self,
        targets: &[Target],
        allow: &[Exception],
        covariances: Covariances,
    ) -> Vec<Result<Corrected, Refused>> {
        let error_frame = self.error_frame();
        let errors = ToolErrors::new(&*self.model.predicts, self.model.session, &error_frame);
        let reach = Reach::new(&self.arm, *self.flange_from_tool.isometry());
        let poses = Poses::new(self, &error_frame, &reach);
        let correction = Correction { identified: self, errors, reach: &reach, allow };
        let one = |target: &Target| {
            let wanted = self.validity.admit(target).and_then(|()| poses.wanted(target));
            wanted.and_then(|wanted| correction.of(&wanted))
        };
        let some = |targets: &[Target]| {
            let mut corrected: Vec<_> = targets.iter().map(one).collect();
            if covariances == Covariances::Given {
                correction.add_covariances(&mut corrected);
            }
            let named = targets.iter().zip(corrected).map(|(target, own)| {
                let refused = |reason| Refused { target: target.name.clone(), reason, slip: None };
                own.map(|own| own.corrected).map_err(refused)
            });
            named.collect::<Vec<_>>()
        };
        targets.par_chunks(TOGETHER).flat_map_iter(some).collect()
    }

    /// The tool in the base frame, mm, where the arm stands at each of `many` joint commands; its orientation is the commanded one where
    /// the readings show none.
    ///
    /// `allow` names a reason for which none is refused.
    pub fn attained(
        &self,
        many: &[&[f64]],
        allow: &[Exception],
    ) -> Vec<Result<Isometry3<f64>, Reason>> {
        let error_frame = self.error_frame();
        let errors = ToolErrors::new(&*self.model.predicts, self.model.session, &error_frame);
        let periods = self.periods();
        let one = |asked: &&[f64]| {
            let (joints, _) = self.on_measured_turns(asked, &periods);
            if !allow.contains(&Exception::JointRange) {
                self.within_measured(&joints)?;
            }
            let Isometry3 { translation, rotation } = error_frame.nominal_tool(&joints);
            let (error, turn) = self.error_and_turn(&errors, &joints)?;
            let place = Translation3::from(translation.vector + error);
            Ok(Isometry3::from_parts(place, turn * rotation))
        };
        many.par_iter().map(one).collect()
    }

    /// The error at joint angles, mm, and the turn of the orientation; none where no readings show orientations.
    fn error_and_turn(
        &self,
        errors: &ToolErrors<'_>,
        joints: &[f64],
    ) -> Result<(Vector3<f64>, UnitQuaternion<f64>), Reason> {
        let found = match &self.model.shown {
            Some(shown) => errors.error_and_turn(joints, shown),
            None => errors.error(joints).map(|error| (error, UnitQuaternion::identity())),
        };
        found.map_err(Reason::Target)
    }

    /// By how much a joint's value is beyond those measured, rad or mm; negative inside.
    fn beyond_measured(&self, joint: usize, angle: f64) -> f64 {
        let [low, high] = self.measured[joint];
        (low - angle).max(angle - high)
    }

    /// By how much a joint's value may be beyond those measured and counts as measured, rad or mm.
    fn rim(&self, joint: usize) -> f64 {
        RIM_RAD * self.arm.joints()[joint].per_radian()
    }

    /// After what each joint's errors repeat, rad: a turn or several, as the joint curves do. `None` for a linear joint, and for one
    /// that moves axes by another share than whole turns.
    pub(super) fn periods(&self) -> Vec<Option<f64>> {
        let turns = self.model.is::<FullModel>().map_or(1, |full| full.trained.layout.period_turns);
        let of = |own| (own == JointVariable::Turning).then(|| TAU * f64::from(turns));
        JointVariable::of(&self.arm).into_iter().map(of).collect()
    }

    /// The whole turns (rad, a multiple of the period) to take off a joint's angle so that it is in the measured range; 0 where it is in
    /// it already, or none brings it there.
    pub(super) fn turns_beyond(&self, joint: usize, angle: f64, period: Option<f64>) -> f64 {
        let [low, high] = self.measured[joint];
        let Some(period) = period.filter(|_| self.beyond_measured(joint, angle) > self.rim(joint))
        else {
            return 0.0;
        };
        let turns = period * ((angle - low.midpoint(high)) / period).round();
        let is_inside = self.beyond_measured(joint, angle - turns) <= self.rim(joint);
        if is_inside { turns } else { 0.0 }
    }

    /// Each joint's angle without its [`Self::turns_beyond`], and these.
    pub(super) fn on_measured_turns(
        &self,
        asked: &[f64],
        periods: &[Option<f64>],
    ) -> (Vec<f64>, Vec<f64>) {
        let own = asked.iter().zip(periods).enumerate().map(|(joint, (angle, period))| {
            let turns = self.turns_beyond(joint, *angle, *period);
            (angle - turns, turns)
        });
        own.unzip()
    }

    /// Refuses joint angles beyond those measured, naming the joint that is furthest out.
    pub(super) fn within_measured(&self, joints: &[f64]) -> Result<(), Reason> {
        let per_radian = |joint: usize| self.arm.joints()[joint].per_radian();
        let beyond = |joint: usize| self.beyond_measured(joint, joints[joint]) / per_radian(joint);
        let out = (0..joints.len()).map(|joint| (joint, beyond(joint)));
        match out.max_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((joint, furthest)) if furthest > RIM_RAD => {
                let own = &self.arm.joints()[joint];
                Err(Reason::JointRange {
                    joint: own.name.clone(),
                    value: own.shown(joints[joint]),
                    beyond: own.shown(self.beyond_measured(joint, joints[joint])),
                    measured: self.measured[joint].map(|value| own.shown(value)),
                    unit: own.sign_of_unit(),
                })
            }
            _ => Ok(()),
        }
    }
}

/// Targets that a worker takes at once; fixed, so that results do not depend on the number of threads.
const TOGETHER: usize = 64;

/// A correction without its covariance, and the joint angles of its command on the measured turn, where the model knows its error.
struct Found {
    corrected: Corrected,
    joints: Vec<f64>,
}

/// Computes the corrections of one arm.
struct Correction<'a> {
    identified: &'a IdentifiedArm,
    errors: ToolErrors<'a>,
    reach: &'a Reach<'a>,
    allow: &'a [Exception],
}

impl Correction<'_> {
    fn of(&self, wanted: &Wanted) -> Result<Found, Reason> {
        let Isometry3 { translation, rotation } = wanted.base_from_tool;
        let mut allowed = self.exceptions(&wanted.joints)?;
        let mut joints = wanted.joints.clone();
        let mut commanded = rotation;
        let target = Point3::from(translation.vector);
        let converged = converge(&target, |command| {
            let pose = Isometry3::from_parts(Translation3::from(command.coords), commanded);
            joints = self.reach.inverse.joints(&pose, &joints)?;
            let (error, turn) = self.identified.error_and_turn(&self.errors, &joints)?;
            self.identified.validity.admit_error(&error)?;
            // Errors hardly change with so small a turn: the next round's is the last digit of this one's.
            let found = (joints.clone(), commanded);
            commanded = turn.inverse() * rotation;
            Ok((error, found))
        })?;
        let (joints, commanded) = converged.found;
        allowed.extend(self.exceptions(&joints)?);
        allowed.sort_unstable();
        allowed.dedup();
        let of_frame = self.identified.frame_uncertainty.covariance(&target);
        let command_from_base = &self.identified.command_from_base;
        let turn: UnitQuaternion<f64> = command_from_base.isometry().rotation;
        let [target, command] = [target, converged.command]
            .map(|point| *command_from_base * Position::<Base>::claim(point));
        let corrected = Corrected {
            target,
            command,
            orientation: Some(turn * commanded),
            correction: command.coords() - target.coords(),
            covariance: None,
            of_frame: self.in_command_frame(of_frame),
            joints: Some(self.on_turn(wanted, &joints)?),
            iterations: converged.iterations,
            allowed,
        };
        Ok(Found { corrected, joints })
    }

    /// Adds the covariance of each correction, or refuses it where the model has none.
    fn add_covariances(&self, some: &mut [Result<Found, Reason>]) {
        let joints = some.iter().flatten().map(|own| own.joints.as_slice());
        let errors = self.errors.errors_with_covariance(&joints.collect::<Vec<_>>());
        for (own, error) in some.iter_mut().filter(|own| own.is_ok()).zip(errors) {
            match (own.as_mut(), error) {
                (Ok(own), Ok((_, covariance))) => {
                    let covariance = self.in_command_frame(covariance);
                    own.corrected.covariance = Some(covariance + own.corrected.of_frame);
                }
                (_, Err(gap)) => *own = Err(Reason::Target(gap)),
                (Err(_), Ok(_)) => {}
            }
        }
    }

    /// A covariance of the base frame along the axes of commands.
    fn in_command_frame(&self, covariance: Matrix3<f64>) -> Matrix3<f64> {
        let turn = self.identified.command_from_base.isometry().rotation.to_rotation_matrix();
        turn * covariance * turn.transpose()
    }

    /// The joint angles of a target and its command on the turns that were asked for, which the arm has to have.
    fn on_turn(&self, wanted: &Wanted, command: &[f64]) -> Result<JointCommand, Reason> {
        let turned = |joints: &[f64]| -> Vec<f64> {
            joints.iter().zip(&wanted.turns_rad).map(|(joint, turns)| joint + turns).collect()
        };
        let joints = JointCommand { target: turned(&wanted.joints), command: turned(command) };
        within_limits(&self.identified.arm, &joints.command)?;
        Ok(joints)
    }

    /// The exceptions that joint angles need, where they are allowed: for their ranges, and for the arm configuration they are in.
    fn exceptions(&self, joints: &[f64]) -> Result<Vec<Exception>, Reason> {
        let checks = [
            (Exception::JointRange, self.identified.within_measured(joints)),
            (Exception::Configuration, self.in_measured_configuration(joints)),
        ];
        let mut needed = Vec::new();
        for (exception, measured) in checks {
            match measured {
                Err(_) if self.allow.contains(&exception) => needed.push(exception),
                measured => measured?,
            }
        }
        Ok(needed)
    }

    /// Refuses an arm configuration that no station was in.
    fn in_measured_configuration(&self, joints: &[f64]) -> Result<(), Reason> {
        let Some(found) = self.reach.configuration(joints) else { return Ok(()) };
        let (found, measured) = (found.to_string(), &self.identified.configurations);
        if measured.contains(&found) {
            return Ok(());
        }
        Err(Reason::NeverMeasured { found, measured: measured.clone() })
    }
}

#[cfg(test)]
mod tests;
