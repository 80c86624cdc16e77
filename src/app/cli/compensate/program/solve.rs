//! Positions of a program → commands of the identified arm, in the arm configuration that their motions have.
//!
//! A position whose tool is another than the calibrated one is corrected where both have one tool point, or where the readings
//! showed orientations: the flange is brought to where the tool is right. KUKA's S names the configuration, and so do FANUC's letters. ABB's
//! quarter turns are held against all joint angles that reach the pose: those that agree have to be the only ones.

use std::cell::RefCell;
use std::collections::HashMap;

use nalgebra::{Isometry3, Point3};
use rayon::prelude::*;

use crate::compensation::{Corrected, Covariances, Exception, IdentifiedArm, Target, TargetJoints};
use crate::geometry::{self, Tool, Transform};
use crate::kinematics::{Anywhere, Configuration, Inverse, InverseSettings};
use crate::programs::write::{COUNTED, Command};
use crate::programs::{Asked, Branch, Position, Postures, Programs, Wanted};

/// Tool points nearer to each other are one, mm.
const SAME_POINT_MM: f64 = 0.01;
/// Joint angles nearer to each other are one, rad.
const SAME_RAD: f64 = 1e-6;
/// Poses nearer than this have the same ways to reach them.
const NEAR_MM: f64 = 300.0;
const NEAR_RAD: f64 = 0.5;
/// Positions that are solved one after the other, each beginning at the ways of those before it.
const CHUNK: usize = 256;

pub(super) struct Solver<'a> {
    pub(super) arm: &'a IdentifiedArm,
    /// Joint values of the nominal arm that bring the calibrated tool to a pose.
    pub(super) inverse: Inverse<'a>,
    postures: Option<Postures>,
    /// By FANUC's letters.
    fanuc: Option<Postures>,
    pub(super) allow: &'a [Exception],
    largest_mm: Option<f64>,
}

/// All joint angles that reach poses, found anywhere or from those of poses nearby.
struct Ways<'a> {
    anywhere: &'a Anywhere<'a>,
    /// Poses that were solved, each with the ways that those of positions nearby may agree with.
    known: Vec<(Isometry3<f64>, Vec<Vec<f64>>)>,
}

impl<'a> Ways<'a> {
    const fn new(anywhere: &'a Anywhere<'a>) -> Self {
        Self { anywhere, known: Vec::new() }
    }

    /// Keeps the ways to a pose that those of positions nearby may agree with: with the shoulder turned over joint 1 is two
    /// quarters away, with the wrist turned over joints 4 and 6 are.
    fn add(&mut self, pose: Isometry3<f64>, mut joints: Vec<Vec<f64>>, agreeing: &[f64]) {
        let apart = |own: &[f64], joint: usize| match (own.get(joint), agreeing.get(joint)) {
            (Some(own), Some(other)) => (own - other).cos(),
            _ => 1.0,
        };
        let is_turned = |own: &[f64]| apart(own, 3).max(apart(own, 5)) < -0.99;
        joints.retain(|own| apart(own, 0) > 0.0 && !is_turned(own));
        self.known.push((pose, joints));
    }

    /// The ways to the first pose nearby; none where there is none.
    fn near(&self, pose: &Isometry3<f64>) -> &[Vec<f64>] {
        let is_near = |(from, _): &&(Isometry3<f64>, Vec<Vec<f64>>)| {
            (from.translation.vector - pose.translation.vector).norm() < NEAR_MM
                && from.rotation.angle_to(&pose.rotation) < NEAR_RAD
        };
        self.known.iter().find(is_near).map_or(&[], |(_, joints)| joints)
    }

    /// All joint angles that reach a pose within the limits.
    fn all(&self, pose: &Isometry3<f64>) -> Result<Vec<Vec<f64>>, String> {
        let found = RefCell::new(Vec::<Vec<f64>>::new());
        let collect = |joints: &[f64]| {
            let mut found = found.borrow_mut();
            let is_one =
                |own: &Vec<f64>| own.iter().zip(joints).all(|(a, b)| (a - b).abs() < SAME_RAD);
            if !found.iter().any(is_one) {
                found.push(joints.to_vec());
            }
            false
        };
        let ended = self.anywhere.joints_where(pose, None, collect);
        let found = found.into_inner();
        if found.is_empty() {
            let why = ended.err().map_or_else(String::new, |why| why.to_string());
            return Err(format!("{why}; is it of another arm?"));
        }
        Ok(found)
    }
}

pub(super) struct Done {
    pub(super) command: Command,
    pub(super) correction_mm: f64,
    /// The command of the calibrated tool.
    pub(super) corrected: Corrected,
}

type Solved = Result<Done, String>;

impl<'a> Solver<'a> {
    pub(super) fn new(
        arm: &'a IdentifiedArm,
        allow: &'a [Exception],
        largest_mm: Option<f64>,
    ) -> Self {
        let tool = *arm.flange_from_tool.isometry();
        let settings = InverseSettings::default();
        Self {
            arm,
            inverse: Inverse::new(&arm.arm, &arm.arm.no_offsets(), tool, settings),
            postures: Postures::of_arm(&arm.arm),
            fanuc: Postures::of_fanuc(&arm.arm),
            allow,
            largest_mm,
        }
    }

    /// Whether orientations are corrected.
    pub(super) fn turns(&self) -> bool {
        self.arm.model.shown.is_some()
    }

    /// Gives positions whose motions go on in the arm configuration of another position the joint angles of that.
    pub(super) fn follow(&self, programs: &Programs, asked: &mut [Result<Asked, String>]) {
        let anywhere = self.anywhere();
        let mut ways = Ways::new(&anywhere);
        let mut known: HashMap<usize, Result<Branch, String>> = HashMap::new();
        let followed = asked.iter().flatten().flat_map(Asked::branches).filter_map(Branch::other);
        for by in followed.collect::<Vec<_>>() {
            let of = || match &asked[by] {
                Ok(own) => self.at_own_turns(own, &mut ways),
                Err(why) => Err(why.clone()),
            };
            known.entry(by).or_insert_with(of);
        }
        for own in asked {
            let Ok(Asked { wanted: Wanted::Pose { branches, .. }, .. }) = own else { continue };
            let ended = branches.iter_mut().try_for_each(|branch| {
                let Some(by) = branch.other() else { return Ok(()) };
                let told = |why: &String| {
                    let Position { file, line, name, .. } = &programs.positions[by];
                    let at = programs.files[*file].at(*line);
                    format!("it is reached in the arm configuration of {name} ({at}), which is not known: {why}")
                };
                *branch = known[&by].as_ref().map_err(told)?.clone();
                Ok::<_, String>(())
            });
            if let Err(why) = ended {
                *own = Err(why);
            }
        }
    }

    /// The joint angles at which the controller has a position now, by the quarter turns that it states.
    fn at_own_turns(&self, asked: &Asked, ways: &mut Ways<'_>) -> Result<Branch, String> {
        let Wanted::Pose { programmed, branches, .. } = &asked.wanted else {
            return Err("it is stated in joint angles".to_owned());
        };
        let is_own = |branch: &&Branch| matches!(branch, Branch::Quadrants(_));
        let own: Vec<Branch> = branches.iter().filter(is_own).cloned().collect();
        let pose = programmed * self.own_tool_in(&asked.stated_tool);
        let joints = self.only_joints(&pose, &own, ways)?;
        Ok(Branch::Joints(self.shown(&joints)))
    }

    fn anywhere(&self) -> Anywhere<'_> {
        let (arm, tool) = (&self.arm.arm, *self.own_tool().isometry());
        Anywhere::new(arm, &arm.no_offsets(), tool, InverseSettings::default())
    }

    /// What becomes of each position.
    pub(super) fn solve(&self, asked: &[&Asked]) -> Vec<Solved> {
        let anywhere = self.anywhere();
        let targets = asked.par_chunks(CHUNK).flat_map_iter(|chunk| {
            let mut ways = Ways::new(&anywhere);
            let targets = chunk.iter().map(|asked| self.target(asked, &mut ways));
            targets.collect::<Vec<_>>()
        });
        let targets: Vec<Result<Target, String>> = targets.collect();
        let outcomes = self.commands(targets);
        // Those that are asked for on another turn than they were found on, once more on that.
        let turned = asked.iter().zip(&outcomes).map(|(asked, (target, outcome))| {
            let done = outcome.as_ref().map_err(Clone::clone)?;
            let target = target.as_ref().ok_or_else(String::new)?;
            self.turned(asked, target, done)?.ok_or_else(String::new)
        });
        let again = self.commands(turned.collect());
        let pairs = asked.iter().zip(outcomes.into_iter().zip(again));
        pairs
            .map(|(asked, ((_, first), (_, again)))| match (first, again) {
                // Nothing says why where nothing is to be turned.
                (Ok(done), Err(why)) if why.is_empty() => self.done(asked, &done),
                (Ok(_), Ok(done)) => self.done(asked, &done),
                (Err(why), _) | (Ok(_), Err(why)) => Err(why),
            })
            .collect()
    }

    fn commands(
        &self,
        targets: Vec<Result<Target, String>>,
    ) -> Vec<(Option<Target>, Result<Corrected, String>)> {
        let all: Vec<Target> = targets.iter().flatten().cloned().collect();
        let mut outcomes = self.arm.compensate(&all, self.allow, Covariances::Omitted).into_iter();
        let command = |target: Result<Target, String>| match target {
            Err(why) => (None, Err(why)),
            Ok(target) => {
                let none = || Err("it has no command".to_owned());
                let outcome = outcomes.next().map(|own| own.map_err(|why| why.reason.to_string()));
                (Some(target), outcome.unwrap_or_else(none))
            }
        };
        targets.into_iter().map(command).collect()
    }

    /// What each position asks for where it was taught on this arm: the pose that the arm really had at it. An error and that at
    /// its correction differ by micrometres, so the pose lies as far behind the position as its command before.
    pub(super) fn attained(&self, asked: &[&Asked]) -> Vec<Result<Asked, String>> {
        let solved = self.solve(asked).into_iter().zip(asked);
        let attained = solved.map(|(solved, asked)| {
            let mut attained = (*asked).clone();
            match (&mut attained.wanted, solved?.command) {
                (
                    Wanted::Pose { base_from_tool, programmed, .. },
                    Command { base_from_tool: Some(command), .. },
                ) => {
                    let behind = programmed.translation.vector - command.translation.vector;
                    base_from_tool.translation.vector += behind;
                    let turn = programmed.rotation * command.rotation.inverse();
                    base_from_tool.rotation = turn * base_from_tool.rotation;
                }
                (Wanted::Joints(joints), Command { joints: Some([from, to]), .. }) => {
                    for (joint, (from, to)) in joints.iter_mut().zip(from.iter().zip(&to)) {
                        *joint += from - to;
                    }
                }
                _ => return Err("it has no command on the arm that it was taught on".to_owned()),
            }
            Ok(attained)
        });
        attained.collect()
    }

    /// A position as the controller has it now, as a target of the calibrated tool.
    pub(super) fn stated(&self, name: String, asked: &Asked) -> Target {
        match &asked.wanted {
            Wanted::Joints(joints) => {
                Target { name, joints: self.joints(joints).ok(), ..Target::default() }
            }
            Wanted::Pose { programmed, .. } => {
                let own = programmed * self.own_tool_in(&asked.stated_tool);
                let pose = self.arm.command_from_base.isometry() * own;
                let position =
                    Some(geometry::Position::claim(Point3::from(pose.translation.vector)));
                Target { name, position, ..Target::default() }
            }
        }
    }

    fn target(&self, asked: &Asked, ways: &mut Ways<'_>) -> Result<Target, String> {
        self.same_tool(&asked.flange_from_tool)?;
        let (base_from_tool, programmed, branches) = match &asked.wanted {
            Wanted::Joints(joints) => {
                let joints = Some(self.joints(joints)?);
                return Ok(Target { joints, ..Target::default() });
            }
            Wanted::Pose { base_from_tool, programmed, branches, .. } => {
                (base_from_tool, programmed, branches)
            }
        };
        let own = base_from_tool * self.own_tool_in(&asked.flange_from_tool);
        let pose = self.arm.command_from_base.isometry() * own;
        let target = Target {
            position: Some(geometry::Position::claim(Point3::from(pose.translation.vector))),
            orientation: Some(pose.rotation),
            ..Target::default()
        };
        if branches.iter().any(|branch| matches!(branch, Branch::Quadrants(_))) {
            // The quarter turns are those of the position as the controller has it.
            let programmed = programmed * self.own_tool_in(&asked.stated_tool);
            let angles = self.only_joints(&programmed, branches, ways)?;
            let angles = self.inverse.joints(&own, &angles).map_err(|why| why.to_string())?;
            let joints = Some(TargetJoints { angles, ..TargetJoints::default() });
            return Ok(Target { joints, ..target });
        }
        let mut configurations = branches.iter().map(|branch| self.configuration_of(branch));
        let first = configurations.next().unwrap_or_else(|| Err("no motion uses it".to_owned()))?;
        for other in configurations {
            if other? != first {
                return Err("the motions that lead to it state two arm configurations".to_owned());
            }
        }
        Ok(Target { configuration: Some(first.to_string()), ..target })
    }

    /// The joint angles that reach a pose and agree with the quarter turns stated; an error where there are none, or several.
    fn only_joints(
        &self,
        pose: &Isometry3<f64>,
        branches: &[Branch],
        ways: &mut Ways<'_>,
    ) -> Result<Vec<f64>, String> {
        let agrees = |joints: &Vec<f64>| {
            let own = self.configuration(joints);
            let is_in = |branch: &Branch| {
                !matches!(branch, Branch::Joints(_)) || self.configuration_of(branch).ok() == own
            };
            let mut all = branches.iter();
            all.try_fold(joints.clone(), |joints, branch| {
                self.agrees(branch, &joints).filter(|_| is_in(branch))
            })
        };
        let from = |seed: &Vec<f64>| agrees(&self.inverse.joints(pose, seed).ok()?);
        let mut agreeing: Vec<Vec<f64>> = ways.near(pose).iter().filter_map(from).collect();
        if agreeing.is_empty() {
            let found = ways.all(pose)?;
            agreeing = found.iter().filter_map(agrees).collect();
            if let Some(first) = agreeing.first() {
                ways.add(*pose, found, first);
            }
        }
        match agreeing.as_slice() {
            [only] => Ok(only.clone()),
            [] => Err("its cf1, cf4 and cf6 fit no joint angles that reach its pose in the arm configuration of its motions; is it of \
                       another arm?"
                .to_owned()),
            _ => Err("its cf1, cf4 and cf6 agree with two arm configurations, which differ by cfx; what that means is not proven for this \
                      arm"
                .to_owned()),
        }
    }

    /// The calibrated tool in the frame of another one.
    pub(super) fn own_tool_in(&self, flange_from_tool: &Isometry3<f64>) -> Isometry3<f64> {
        flange_from_tool.inverse() * self.own_tool().isometry()
    }

    pub(super) const fn own_tool(&self) -> &Transform<crate::geometry::Flange, Tool> {
        &self.arm.flange_from_tool
    }

    fn same_tool(&self, tool: &Isometry3<f64>) -> Result<(), String> {
        let own = self.own_tool().isometry().translation.vector;
        let apart_mm = (own - tool.translation.vector).norm();
        if apart_mm <= SAME_POINT_MM || self.turns() {
            return Ok(());
        }
        Err(format!(
            "its tool point lies {apart_mm:.2} mm from the calibrated one, and the calibration shows no orientations; calibrate with this \
             tool, with a 6-DoF target or with three reflectors"
        ))
    }

    pub(super) fn joints(&self, shown: &[f64]) -> Result<TargetJoints, String> {
        let joints = self.arm.arm.joints();
        if joints.len() != shown.len() {
            return Err(format!(
                "it has {} joint angles, the arm has {} joints",
                shown.len(),
                joints.len()
            ));
        }
        let angles = joints.iter().zip(shown).map(|(joint, shown)| joint.read(*shown)).collect();
        Ok(TargetJoints { angles, ..TargetJoints::default() })
    }

    pub(super) fn shown(&self, joints: &[f64]) -> Vec<f64> {
        self.arm.arm.joints().iter().zip(joints).map(|(joint, value)| joint.shown(*value)).collect()
    }

    fn configuration(&self, joints: &[f64]) -> Option<Configuration> {
        self.inverse.factors(joints).map(|factors| factors.configuration())
    }

    fn configuration_of(&self, branch: &Branch) -> Result<Configuration, String> {
        let none = || "the arm of this calibration has no arm configurations".to_owned();
        match branch {
            Branch::Status { status, .. } => {
                let postures = self.postures.as_ref().ok_or_else(none)?;
                let unknown = || format!("S is {status}, which has bits of no meaning");
                postures.configuration(*status).ok_or_else(unknown)
            }
            Branch::Config { letters, .. } => {
                let found = self.fanuc.as_ref().and_then(|own| own.of_letters(*letters));
                found.ok_or_else(|| {
                    "configuration not proven: the letters of CONFIG are with T, and for an arm of six axes whose robot file counts joint 3 against \
                     the horizontal (joint_map); begin with a motion to joint angles"
                        .to_owned()
                })
            }
            Branch::Joints(joints) => {
                let joints = self.joints(joints)?;
                self.configuration(&joints.angles).ok_or_else(none)
            }
            Branch::Quadrants(_) | Branch::Of(_) => Err(none()),
        }
    }

    /// Joint angles on the turns that a position states; `None` where they do not agree with it.
    fn agrees(&self, branch: &Branch, joints: &[f64]) -> Option<Vec<f64>> {
        let shown = self.shown(joints);
        let fits = |joint: usize, degrees: f64| {
            let is_near = |stated: &[i32], turn: f64, middle: f64| {
                let mut of_joint = COUNTED.iter().zip(stated).filter(|(own, _)| **own == joint);
                of_joint
                    .all(|(_, own)| (degrees / turn - f64::from(*own) - middle).abs() <= 0.5 + 1e-5)
            };
            match branch {
                Branch::Status { turn: Some(turn), .. } if joint < 6 => {
                    (turn >> joint & 1 == 1) == (degrees < 0.0) || degrees.abs() < 1e-3
                }
                Branch::Quadrants(quadrants) => is_near(quadrants, 90.0, 0.5),
                Branch::Config { turns: Some(turns), .. } => is_near(turns, 360.0, 0.0),
                _ => true,
            }
        };
        let limits = self.arm.arm.joints();
        let turned = |joint: usize| {
            let own = shown[joint];
            let turns: &[f64] = if limits[joint].slides { &[0.0] } else { &[0.0, 360.0, -360.0] };
            let may = turns.iter().map(|turn| own + turn).find(|degrees| fits(joint, *degrees))?;
            let angle = limits[joint].read(may);
            (limits[joint].lower..=limits[joint].upper).contains(&angle).then_some(angle)
        };
        (0..joints.len()).map(turned).collect()
    }

    /// The target on the turns that a position states; `None` where it is on them.
    fn turned(
        &self,
        asked: &Asked,
        target: &Target,
        done: &Corrected,
    ) -> Result<Option<Target>, String> {
        let Wanted::Pose { branches, .. } = &asked.wanted else { return Ok(None) };
        let wanted = done.joints.as_ref().map(|joints| joints.target.clone()).unwrap_or_default();
        let own = self.programmed(asked, &wanted)?;
        let mut all = branches.iter();
        let turned = all.try_fold(own.clone(), |joints, branch| self.agrees(branch, &joints));
        let turned = turned.ok_or_else(|| {
            "the turns that it states do not fit its pose: is it of another arm?".to_owned()
        })?;
        if own.iter().zip(&turned).all(|(own, turned)| (own - turned).abs() < SAME_RAD) {
            return Ok(None);
        }
        let by = turned.iter().zip(&own).map(|(turned, own)| turned - own);
        let angles = wanted.iter().zip(by).map(|(wanted, by)| wanted + by).collect();
        let joints = Some(TargetJoints { angles, ..TargetJoints::default() });
        Ok(Some(Target { joints, ..target.clone() }))
    }

    /// Joint angles at which the controller has a position now, near those at which it is wanted.
    fn programmed(&self, asked: &Asked, wanted: &[f64]) -> Result<Vec<f64>, String> {
        match &asked.wanted {
            Wanted::Pose { programmed, base_from_tool, .. }
                if programmed != base_from_tool || asked.stated_tool != asked.flange_from_tool =>
            {
                let pose = programmed * self.own_tool_in(&asked.stated_tool);
                self.inverse.joints(&pose, wanted).map_err(|why| why.to_string())
            }
            _ => Ok(wanted.to_vec()),
        }
    }

    fn done(&self, asked: &Asked, done: &Corrected) -> Solved {
        let joints = done.joints.as_ref().ok_or_else(|| "it has no joint angles".to_owned())?;
        if self.configuration(&joints.target) != self.configuration(&joints.command) {
            return Err("its command is in another arm configuration than the position".to_owned());
        }
        let base_from_own = |done: &Corrected| {
            let rotation = done.orientation?;
            let at = done.command.coords();
            let command = Isometry3::from_parts(at.into(), rotation);
            Some(self.arm.command_from_base.isometry().inverse() * command)
        };
        let (base_from_tool, correction_mm) = match &asked.wanted {
            Wanted::Joints(_) => (None, done.correction.norm()),
            Wanted::Pose { .. } => {
                let own = base_from_own(done).ok_or_else(|| "it has no orientation".to_owned())?;
                let command = own * self.own_tool_in(&asked.stated_tool).inverse();
                (Some(command), asked.correction(&command).unwrap_or_default().norm())
            }
        };
        if let Some(largest) = self.largest_mm.filter(|largest| correction_mm > *largest) {
            return Err(format!(
                "its correction is {correction_mm:.3} mm, more than --largest {largest}"
            ));
        }
        let programmed = self.programmed(asked, &joints.target)?;
        let joints = Some([self.shown(&programmed), self.shown(&joints.command)]);
        let command = Command { base_from_tool, joints };
        Ok(Done { command, correction_mm, corrected: done.clone() })
    }
}
