//! A target → the pose of the nominal arm's tool that it stands for, and joint angles that reach the pose.
//!
//! Joint angles give both; with a position in addition, the position is the target and they select how the arm reaches it.
//! A pose without joint angles is reached in the arm configuration it states: inverse kinematics from many joint angles of
//! that configuration, spread over the ranges measured, the nearest to the pose first, and where these fail from joint angles
//! all over the limits. An arm of at most six joints that has no configurations is taken within the ranges measured; one with
//! more joints needs joint angles.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::iter;

use nalgebra::{Isometry3, Translation3};

use super::identified::IdentifiedArm;
use super::{Reason, Target, TargetJoints};
use crate::fit::ErrorFrame;
use crate::grid::Reach;
use crate::kinematics::inverse::{JointVariable, spread};
use crate::kinematics::{Arm, Configuration, InverseError};

/// Joint angles that a search may begin at.
const SEEDS: u32 = 2048;
/// Seeds tried per pose: first as many of the nearest ones, then as many spread over all.
const TRIED: usize = 12;
/// Weight of a turn of the tool by one radian when poses are compared, mm.
const LEVER_MM: f64 = 500.0;
/// A pose and joint angles further apart than this contradict each other, mm, of a turn at [`LEVER_MM`]: angles in whole hundredths of
/// a degree make half a millimetre on a large arm, a wrong tool or unit makes centimetres.
const APART_MM: f64 = 2.0;

/// The pose and the joint angles that a target stands for.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Wanted {
    /// The pose of the tool in the base frame, mm.
    pub(super) base_from_tool: Isometry3<f64>,
    /// Joint angles at which the nominal arm has it, within the measured ranges where whole turns bring them there, rad.
    pub(super) joints: Vec<f64>,
    /// The whole turns of each joint that were taken off the angles asked for, rad.
    pub(super) turns_rad: Vec<f64>,
}

/// Finds the poses and joint angles of targets for one arm.
pub(super) struct Poses<'a> {
    identified: &'a IdentifiedArm,
    error_frame: &'a ErrorFrame<'a>,
    reach: &'a Reach<'a>,
    seeds: BTreeMap<Option<Configuration>, Vec<Seed>>,
    /// After what each joint's errors repeat, rad; `None` where they do not.
    periods: Vec<Option<f64>>,
}

/// Joint angles that a search may begin at.
struct Seed {
    joints: Vec<f64>,
    base_from_tool: Isometry3<f64>,
}

impl<'a> Poses<'a> {
    pub(super) fn new(
        identified: &'a IdentifiedArm,
        error_frame: &'a ErrorFrame<'a>,
        reach: &'a Reach<'a>,
    ) -> Self {
        let mut seeds = BTreeMap::<_, Vec<Seed>>::new();
        for number in 0..SEEDS {
            let joints = spread(number, &identified.measured);
            let base_from_tool = error_frame.nominal_tool(&joints);
            let own = seeds.entry(reach.configuration(&joints)).or_default();
            own.push(Seed { joints, base_from_tool });
        }
        Self { identified, error_frame, reach, seeds, periods: identified.periods() }
    }

    pub(super) fn wanted(&self, target: &Target) -> Result<Wanted, Reason> {
        match &target.joints {
            Some(joints) => self.at_joints(target, joints),
            None => self.at_pose(target),
        }
    }

    fn at_joints(&self, target: &Target, given: &TargetJoints) -> Result<Wanted, Reason> {
        let asked = self.in_order(given)?;
        within_limits(&self.identified.arm, &asked)?;
        let (joints, turns_rad) = self.identified.on_measured_turns(&asked, &self.periods);
        target.is_reached_in(self.reach.configuration(&joints).map(|c| c.to_string()))?;
        let nominal = self.error_frame.nominal_tool(&joints);
        let base_from_tool = self.pose(target, Some(&nominal))?;
        let apart_mm = (base_from_tool.translation.vector - nominal.translation.vector).norm();
        let apart_rad = base_from_tool.rotation.angle_to(&nominal.rotation);
        if apart_mm > APART_MM || LEVER_MM * apart_rad > APART_MM {
            return Err(Reason::Apart { apart_mm, apart_deg: apart_rad.to_degrees() });
        }
        // Even when the angles already reach the pose, this checks limits and singularities.
        let joints = self.reach.inverse.joints(&base_from_tool, &joints)?;
        Ok(Wanted { base_from_tool, joints, turns_rad })
    }

    /// The pose that a target states; what it leaves out is that of its joint angles.
    fn pose(
        &self,
        target: &Target,
        nominal: Option<&Isometry3<f64>>,
    ) -> Result<Isometry3<f64>, Reason> {
        let base_from_command = self.identified.command_from_base.inverse();
        let position = target.position.map(|wanted| base_from_command * wanted);
        let turn = base_from_command.isometry().rotation;
        let rotation = target.orientation.map(|wanted| turn * wanted);
        let translation = position
            .map(|position| Translation3::from(position.coords()))
            .or(nominal.map(|pose| pose.translation))
            .ok_or(Reason::NoPosition)?;
        let rotation =
            rotation.or(nominal.map(|pose| pose.rotation)).ok_or(Reason::NoOrientation)?;
        Ok(Isometry3::from_parts(translation, rotation))
    }

    fn in_order(&self, given: &TargetJoints) -> Result<Vec<f64>, Reason> {
        let own = || self.identified.arm.joints().iter().map(|joint| &joint.name);
        let other = || Reason::Joints {
            found: if given.names.is_empty() {
                format!("{} joint angles", given.angles.len())
            } else {
                format!("angles of {}", given.names.join(", "))
            },
            expected: own().cloned().collect(),
        };
        if given.angles.len() != own().len() {
            return Err(other());
        }
        let mut stated = self.identified.arm.joints().iter().zip(given.slides.iter().flatten());
        if let Some((joint, _)) = stated.find(|(joint, is_length)| joint.slides != **is_length) {
            return Err(Reason::JointUnit { joint: joint.name.clone(), slides: joint.slides });
        }
        if given.names.is_empty() {
            return Ok(given.angles.clone());
        }
        let angle = |name| {
            let place = given.names.iter().position(|given| given == name)?;
            given.angles.get(place).copied()
        };
        own().map(angle).collect::<Option<_>>().ok_or_else(other)
    }

    fn at_pose(&self, target: &Target) -> Result<Wanted, Reason> {
        let base_from_tool = self.pose(target, None)?;
        let joints = self.identified.arm.joints().len();
        if joints > 6 {
            return Err(Reason::Redundant { joints });
        }
        let joints = self.solution(&base_from_tool, target.configuration.as_deref())?;
        Ok(Wanted { turns_rad: vec![0.0; joints.len()], joints, base_from_tool })
    }

    /// Joint angles of a pose, in the wanted arm configuration. An arm without configurations takes, of the ways that the search
    /// finds, one within the ranges measured.
    fn solution(&self, pose: &Isometry3<f64>, wanted: Option<&str>) -> Result<Vec<f64>, Reason> {
        self.reach.inverse.within_links(pose)?;
        let (mut first, mut beyond) = (None, None);
        for seed in self.nearest(wanted, pose)? {
            match self.reach.inverse.joints(pose, &seed.joints) {
                Ok(joints) => {
                    let joints = self.on_measured_turn(joints);
                    let is_measured = self.identified.within_measured(&joints).is_ok();
                    if wanted.is_some() || is_measured {
                        return Ok(joints);
                    }
                    beyond = beyond.or(Some(joints));
                }
                Err(error) => first = first.or(Some(error)),
            }
        }
        let is_wanted = |joints: &[f64]| {
            self.reach.configuration(joints).map(|c| c.to_string()).as_deref() == wanted
        };
        let anywhere = || self.reach.anywhere(pose, is_wanted).ok();
        let found = beyond.or_else(|| anywhere().map(|joints| self.on_measured_turn(joints)));
        found.ok_or_else(|| first.map_or(Reason::NoConfiguration, Reason::Arm))
    }

    /// Seeds of the wanted configuration, the nearest to a pose first.
    fn nearest(
        &self,
        wanted: Option<&str>,
        pose: &Isometry3<f64>,
    ) -> Result<impl Iterator<Item = &Seed>, Reason> {
        if wanted.is_none() && self.seeds.keys().any(Option::is_some) {
            return Err(Reason::NoConfiguration);
        }
        let named = |own: &Option<Configuration>| own.map(|own| own.to_string());
        let mut seeds = self.seeds.iter();
        let Some((_, seeds)) = seeds.find(|(own, _)| named(own).as_deref() == wanted) else {
            return Err(Reason::Unmeasured {
                wanted: wanted.unwrap_or_default().to_owned(),
                measured: self.seeds.keys().flatten().map(Configuration::to_string).collect(),
            });
        };
        // When the search fails from the nearest, it may succeed from others of the configuration.
        let pose = *pose;
        let others = iter::once_with(move || others(seeds, &pose)).flatten();
        Ok(nearest(seeds, &pose).into_iter().chain(others))
    }

    /// The angles, each moved by whole turns as near to the middle of the measured range as its limits allow.
    fn on_measured_turn(&self, joints: Vec<f64>) -> Vec<f64> {
        let limits = self.identified.arm.joints();
        let variables = JointVariable::of(&self.identified.arm);
        let turned = |(joint, q): (usize, f64)| {
            if variables[joint] != JointVariable::Turning {
                return q;
            }
            let [low, high] = self.identified.measured[joint];
            let near = q + TAU * ((low.midpoint(high) - q) / TAU).round();
            let allowed = (limits[joint].lower..=limits[joint].upper).contains(&near);
            if allowed { near } else { q }
        };
        joints.into_iter().enumerate().map(turned).collect()
    }
}

/// Refuses joint angles that are not within the arm's limits, naming the first joint that is beyond.
pub(super) fn within_limits(arm: &Arm, joints: &[f64]) -> Result<(), Reason> {
    let mut joints = arm.joints().iter().zip(joints);
    let beyond = joints.find(|(joint, value)| !(joint.lower..=joint.upper).contains(value));
    beyond.map_or(Ok(()), |(joint, value)| Err(Reason::Arm(InverseError::beyond(joint, *value))))
}

/// The seed nearest to a pose, the first of several that are as near.
fn nearest<'s>(seeds: &'s [Seed], pose: &Isometry3<f64>) -> Option<&'s Seed> {
    let (mut nearest, mut least_mm) = (None, f64::INFINITY);
    for seed in seeds {
        let place = seed.base_from_tool.translation.vector - pose.translation.vector;
        // A turn costs more to find than a distance, and counts only where that is the least.
        if place.norm_squared() < least_mm * least_mm {
            let apart_mm = apart_mm(&seed.base_from_tool, pose);
            if apart_mm < least_mm {
                (nearest, least_mm) = (Some(seed), apart_mm);
            }
        }
    }
    nearest
}

/// Some more of the seeds that are near a pose, then some of all.
fn others<'s>(seeds: &'s [Seed], pose: &Isometry3<f64>) -> Vec<&'s Seed> {
    let apart = seeds.iter().map(|seed| (apart_mm(&seed.base_from_tool, pose), seed));
    let mut seeds: Vec<(f64, &Seed)> = apart.collect();
    seeds.sort_by(|a, b| a.0.total_cmp(&b.0));
    let stride = seeds.len() / TRIED + 1;
    let order = (1..TRIED).chain((TRIED..).step_by(stride));
    order.map_while(|place| seeds.get(place).map(|(_, seed)| *seed)).collect()
}

/// How far apart two poses are, a turn counted by its lever, mm.
fn apart_mm(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
    let place = (a.translation.vector - b.translation.vector).norm();
    place + LEVER_MM * a.rotation.angle_to(&b.rotation)
}
