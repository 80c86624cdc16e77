//! The joints from base to tip → a robot file. Up a joint the frame moves by `motion(−q) · origin⁻¹`: the axis is
//! reversed, and the rest stands before the next joint or in `[flange]`.

use std::collections::BTreeSet;
use std::f64::consts::FRAC_PI_2;

use nalgebra::Isometry3;

use super::error::{Result, UrdfError};
use super::joint::{Following, mm};
use super::tree::{Ends, Joint, Step, Tree, refuse_xacro};
use crate::geometry::Placement;
use crate::kinematics::robot_file::Mimic;
use crate::kinematics::{Convention, JointFile, JointKind, RobotFile};
use crate::units::MM_PER_M;

const MOST_JOINTS: usize = 64;

/// The robot file of the joints on the way, with remarks; `source` is the URDF's file name.
pub(super) fn robot_file(
    tree: &Tree<'_, '_>,
    steps: &[Step<'_, '_, '_>],
    ends: &Ends<'_>,
    source: &str,
) -> Result<(RobotFile, Vec<String>)> {
    if steps.len() > MOST_JOINTS {
        let [base, tip] = [ends.base, ends.tip].map(str::to_owned);
        return Err(UrdfError::TooLong { base, tip, found: steps.len(), most: MOST_JOINTS });
    }
    let mut remarks = cut_off(steps)?;
    let mut joints = Vec::with_capacity(steps.len());
    let mut left = None;
    for step in steps {
        refuse_xacro(step.joint.node)?;
        step.joint.refuse_misspelled()?;
        let kind = step.joint.kind()?;
        let mut joint =
            JointFile { name: step.joint.name.to_owned(), kind, ..JointFile::default() };
        left = place(&mut joint, step, left)?;
        if kind != JointKind::Fixed {
            move_by(&mut joint, step, tree, steps)?;
        }
        if joint.kind != kind {
            remarks.push(format!(
                "joint {:?} states no limits (line {}) and was taken for one that turns without",
                step.joint.name,
                step.joint.line()
            ));
        }
        joints.push(joint);
    }
    let model = match tree.robot {
        "" => "robot without a name",
        name => name,
    };
    let file = RobotFile {
        model: model.to_owned(),
        source: format!("URDF {source:?}, from {:?} to {:?}", ends.base, ends.tip),
        convention: Convention::Urdf,
        home_deg: None,
        joint_map: None,
        base: None,
        flange: left.as_ref().map(Placement::of),
        joint: joints,
    };
    Ok((file, remarks))
}

/// Least effect of an angle whose digits were cut off that is worth a remark, mm at the tip.
const SEEN_MM: f64 = 0.01;

/// Remarks on angles that are nearly right ones, each with its largest effect at the tip.
fn cut_off(steps: &[Step<'_, '_, '_>]) -> Result<Vec<String>> {
    let (mut reach_mm, mut remarks) = (0.0, Vec::new());
    for step in steps.iter().rev() {
        let origin = step.joint.origin()?;
        if let Some((angle, missed)) = origin.cut_off()
            && missed * reach_mm >= SEEN_MM
        {
            remarks.push(format!(
                "joint {:?} (line {}): an angle of {angle} rad misses a right one by {missed:.1e} rad, which is up to {:.2} mm at \
                 the tip; give it with all its digits, {}, if that is meant",
                step.joint.name,
                step.joint.line(),
                missed * reach_mm,
                (angle / FRAC_PI_2).round() * FRAC_PI_2
            ));
        }
        reach_mm += origin.length_mm();
    }
    remarks.reverse();
    Ok(remarks)
}

/// States the joint's origin and axis; gives what is left of an inverted joint for the next one.
fn place(
    joint: &mut JointFile,
    step: &Step<'_, '_, '_>,
    before: Option<Isometry3<f64>>,
) -> Result<Option<Isometry3<f64>>> {
    let origin = step.joint.origin()?;
    let moves = joint.kind != JointKind::Fixed;
    let axis = if moves { Some(step.joint.axis()?) } else { None };
    if !step.is_up {
        joint.origin = Some(match before {
            None => origin.placement(),
            Some(before) => Placement::of(&(before * origin.isometry())),
        });
        joint.axis = axis.map(Into::into);
        return Ok(None);
    }
    let before = before.unwrap_or_else(Isometry3::identity);
    let back = origin.isometry().inverse();
    joint.axis = axis.map(|axis| (-axis).map(|x| x + 0.0).into());
    if moves {
        joint.origin = Some(Placement::of(&before));
        Ok(Some(back))
    } else {
        joint.origin = Some(Placement::of(&(before * back)));
        Ok(None)
    }
}

/// States the limits of a joint, or the joint that it follows.
fn move_by(
    joint: &mut JointFile,
    step: &Step<'_, '_, '_>,
    tree: &Tree<'_, '_>,
    steps: &[Step<'_, '_, '_>],
) -> Result<()> {
    if let Some(following) = step.joint.following()? {
        joint.mimic = Some(mimic(step.joint, following, tree, steps)?);
        return Ok(());
    }
    if joint.kind == JointKind::Continuous {
        return Ok(());
    }
    match (step.joint.limits()?, joint.kind) {
        (Some(limits), JointKind::Prismatic) => joint.limits_mm = Some(limits.map(mm)),
        (Some(limits), _) => {
            // Without the digits that a π of few digits leaves behind a whole number.
            joint.limits_deg = Some(limits.map(|limit| (limit.to_degrees() * 1e9).round() / 1e9));
        }
        (None, JointKind::Prismatic) => {
            return Err(UrdfError::Has {
                line: step.joint.line(),
                joint: step.joint.name.to_owned(),
                found: "no limits".to_owned(),
                remedy: "a joint that slides needs <limit lower=\"…\" upper=\"…\"/>, in m",
            });
        }
        (None, _) => joint.kind = JointKind::Continuous,
    }
    Ok(())
}

/// The joint of the way that a joint follows in the end, over any that follow in between; in mm and degrees.
fn mimic(
    own: &Joint<'_, '_>,
    stated: Following<'_>,
    tree: &Tree<'_, '_>,
    steps: &[Step<'_, '_, '_>],
) -> Result<Mimic> {
    let refused = |follows: &str, problem| UrdfError::Mimic {
        line: own.line(),
        joint: own.name.to_owned(),
        follows: follows.to_owned(),
        problem,
    };
    let mut seen = BTreeSet::from([own.name]);
    let mut following = stated;
    loop {
        let name = following.joint;
        let Some(driver) = tree.joints.iter().find(|joint| joint.name == name) else {
            return Err(refused(name, "is no joint of the URDF"));
        };
        if !seen.insert(driver.name) {
            return Err(refused(name, "follows it in turn"));
        }
        let kind = driver.kind()?;
        if kind == JointKind::Fixed {
            return Err(refused(name, "is fixed"));
        }
        if let Some(next) = driver.following()? {
            following = Following {
                joint: next.joint,
                multiplier: following.multiplier * next.multiplier,
                offset: following.multiplier * next.offset + following.offset,
            };
            continue;
        }
        if !steps.iter().any(|step| step.joint.name == name) {
            return Err(refused(name, "is not between base and tip"));
        }
        return Ok(in_mm(own.kind()?, kind, &following));
    }
}

/// A joint's motion by another's: the file's m per rad and the like as mm per rad, the offset in mm or degrees.
fn in_mm(own: JointKind, driver: JointKind, following: &Following<'_>) -> Mimic {
    let slides = |kind| kind == JointKind::Prismatic;
    let multiplier = match (slides(own), slides(driver)) {
        (true, false) => following.multiplier * MM_PER_M,
        (false, true) => following.multiplier / MM_PER_M,
        _ => following.multiplier,
    };
    let stated = (following.offset != 0.0).then_some(following.offset);
    Mimic {
        joint: following.joint.to_owned(),
        multiplier,
        offset_deg: stated.filter(|_| !slides(own)).map(f64::to_degrees),
        offset_mm: stated.filter(|_| slides(own)).map(mm),
    }
}
