//! Frames that the cell says were touched with an arm → where they really are, by where that arm stood at each touch.
//!
//! For each such frame that a motion uses:
//! 1. the calibration of the arm that touched it is read, and has to be of the same robot and base;
//! 2. the taught points become what the controller had and what the arm really had there, as for positions that were taught;
//! 3. the frame is made again of the latter ([`crate::programs::taught`]). How far that is known is the model's standard deviation
//!    at the points; what the touch itself was off is not in it.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Point3};
use serde::Serialize;

use super::Points;
use super::solve::Solver;
use crate::cli::compensate::CompensateArgs;
use crate::cli::compensate::error::CompensateCommandError;
use crate::compensation::{Covariances, Target};
use crate::io::calibrations_table::PublishedArm;
use crate::programs::taught::{Taught, TaughtError, TaughtFrame, Touched, base, tool};
use crate::programs::{Asked, Branch, Cell, CellFrame, Programs, TaughtPoint, TruePlace, Wanted};

/// A taught frame beside its numbers at the controller.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct FoundFrame {
    name: String,
    moved_mm: f64,
    turned_deg: f64,
    /// Largest standard deviation of a touched point by the calibration.
    sd_mm: f64,
}

impl FoundFrame {
    fn new(frame: &TaughtFrame, actual: &Isometry3<f64>, sd_mm: f64) -> Self {
        let apart = frame.stated.inverse() * actual;
        Self {
            name: frame.name.clone(),
            moved_mm: apart.translation.vector.norm(),
            turned_deg: apart.rotation.angle().to_degrees(),
            sd_mm,
        }
    }
}

impl fmt::Display for FoundFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, moved_mm, turned_deg, sd_mm } = self;
        write!(
            f,
            "{name} was touched with the arm: it stands {moved_mm:.3} mm and {turned_deg:.4}° beside its numbers, known to {sd_mm:.3} mm (standard \
             deviation of the points that were touched, without that of the touch)"
        )
    }
}

impl CompensateArgs {
    /// Tells the cell where its taught frames really are. Positions that were taught are those of the controller's frames, whatever these
    /// hold.
    pub(super) fn true_places(
        &self,
        arm: &PublishedArm,
        programs: &Programs,
        cell: &mut Cell,
    ) -> Result<Vec<FoundFrame>, CompensateCommandError> {
        let folder = self.program.cell.as_deref().and_then(Path::parent).unwrap_or(Path::new(""));
        let mut arms: BTreeMap<PathBuf, Box<PublishedArm>> = BTreeMap::new();
        let mut found = Vec::new();
        for frame in programs.taught(cell) {
            let taught =
                cell.frame(&frame.name).and_then(|own| Some((own, own.taught_with.clone()?)));
            let Some((own, path)) = taught else { continue };
            let path = folder.join(path);
            if !arms.contains_key(&path) {
                arms.insert(path.clone(), self.arm_of(&path)?);
            }
            let place = if self.program.points == Some(Points::Taught) {
                Ok(frame.stated)
            } else {
                let touching = same_base(&arms[&path], arm);
                let place = touching.and_then(|by| Teaching::new(&by.arm, self, own).place(&frame));
                place.map(|(actual, sd_mm)| {
                    found.push(FoundFrame::new(&frame, &actual, sd_mm));
                    actual
                })
            };
            let TaughtFrame { name, stated, .. } = frame;
            cell.true_places.push(TruePlace { name, stated, actual: place });
        }
        Ok(found)
    }
}

/// The arm that touched, if places in its base are places in that of the arm which is corrected.
fn same_base<'a>(by: &'a PublishedArm, arm: &PublishedArm) -> Result<&'a PublishedArm, String> {
    let (own, other) = (&by.key, &arm.key);
    if own.robot != other.robot {
        return Err(format!(
            "taught_with is of robot {}, and the program is corrected for {}; survey the frame",
            own.robot, other.robot
        ));
    }
    let is_surveyed = by.error_frame.is_surveyed && arm.error_frame.is_surveyed;
    if own.run != other.run && !is_surveyed {
        return Err(format!(
            "the runs {} and {} have bases that were fitted each by itself; touch the frame again and give taught_with the table that corrects, \
             or survey it",
            own.run, other.run
        ));
    }
    Ok(by)
}

/// An arm and what the cell says of a frame that it touched.
struct Teaching<'a> {
    solver: Solver<'a>,
    frame: &'a CellFrame,
}

impl<'a> Teaching<'a> {
    fn new(
        arm: &'a crate::compensation::IdentifiedArm,
        args: &'a CompensateArgs,
        frame: &'a CellFrame,
    ) -> Self {
        Self { solver: Solver::new(arm, &args.allow, None), frame }
    }

    /// Where a frame really is, and the largest standard deviation of a touched point, mm.
    fn place(&self, frame: &TaughtFrame) -> Result<(Isometry3<f64>, f64), String> {
        if self.frame.points.is_empty() {
            return Err("give its points: joints_deg of each, or pose".to_owned());
        }
        let tip = self.tip(frame)?;
        let asked = self.frame.points.iter().map(|point| asked_at(point, &tip, frame.kind));
        let asked: Vec<Asked> = asked.collect::<Result<_, _>>()?;
        let attained = self.attained(&asked)?;
        let pairs = asked.iter().zip(&attained);
        let stands = pairs.map(|(asked, own)| Ok([self.tool_at(asked)?, self.tool_at(own)?]));
        let actual = made(frame, &stands.collect::<Result<Vec<_>, String>>()?);
        Ok((actual.map_err(|why| why.to_string())?, self.sd_mm(&asked)?))
    }

    /// The tool that touched, in the flange frame.
    fn tip(&self, frame: &TaughtFrame) -> Result<Isometry3<f64>, String> {
        match frame.kind {
            Taught::Tool if self.solver.turns() => Ok(frame.stated),
            Taught::Tool => Err(
                "the calibration shows no orientations, which a tool's tip hangs on; survey the tool, or calibrate with a 6-DoF target or three \
                 reflectors"
                    .to_owned(),
            ),
            Taught::Base { .. } => {
                let tool = self.frame.tool.as_ref().and_then(|tool| tool.isometry().ok());
                tool.ok_or_else(|| "give tool, the one that touched, in the flange frame".to_owned())
            }
        }
    }

    /// What the arm really had at each point.
    fn attained(&self, asked: &[Asked]) -> Result<Vec<Asked>, String> {
        let attained = self.solver.attained(&asked.iter().collect::<Vec<_>>());
        let numbered = attained.into_iter().enumerate();
        numbered
            .map(|(place, own)| own.map_err(|why| format!("point {}: {why}", place + 1)))
            .collect()
    }

    /// The tool in the arm's base by the nominal arm, mm.
    fn tool_at(&self, asked: &Asked) -> Result<Isometry3<f64>, String> {
        match &asked.wanted {
            Wanted::Pose { base_from_tool, .. } => Ok(*base_from_tool),
            Wanted::Joints(shown) => {
                let joints = self.solver.joints(shown)?.angles;
                Ok(self.solver.arm.arm.flange(&joints).isometry() * asked.flange_from_tool)
            }
        }
    }

    fn sd_mm(&self, asked: &[Asked]) -> Result<f64, String> {
        let solved = self.solver.solve(&asked.iter().collect::<Vec<_>>());
        let target = |done: Result<super::solve::Done, String>| -> Result<Target, String> {
            let [shown, _] = done?.command.joints.ok_or("it has no joint angles")?;
            let joints = Some(self.solver.joints(&shown)?);
            Ok(Target { joints, ..Target::default() })
        };
        let targets: Vec<Target> = solved.into_iter().map(target).collect::<Result<_, String>>()?;
        let found = self.solver.arm.compensate(&targets, self.solver.allow, Covariances::Given);
        found.into_iter().try_fold(0.0_f64, |largest, own| {
            let own = own.map_err(|why| why.reason.to_string())?;
            Ok(largest.max(own.own_variance_mm2().unwrap_or_default().sqrt()))
        })
    }
}

/// What the controller had at a point.
fn asked_at(point: &TaughtPoint, tool: &Isometry3<f64>, kind: Taught) -> Result<Asked, String> {
    let wanted = match (&point.joints_deg, &point.pose, kind) {
        (Some(joints), ..) => Wanted::Joints(joints.clone()),
        (None, Some(pose), Taught::Base { world_from_base, .. }) => {
            let pose = pose.isometry().map_err(|why| why.to_string())?;
            let programmed = world_from_base.inverse() * pose;
            let branch = match (point.status, point.cf) {
                (Some(status), _) => Branch::Status { status, turn: None },
                (None, cf) => Branch::Quadrants(cf.unwrap_or_default()),
            };
            Wanted::Pose {
                base_from_frame: world_from_base.inverse(),
                programmed,
                base_from_tool: programmed,
                branches: vec![branch],
            }
        }
        _ => return Err("give the poses of a tool by their joints_deg".to_owned()),
    };
    let (flange_from_tool, stated_tool) = (*tool, *tool);
    Ok(Asked { position: 0, flange_from_tool, stated_tool, holds_part: false, wanted })
}

/// A frame of its touches: of each where the controller had the tool, and where it really was.
fn made(
    frame: &TaughtFrame,
    stands: &[[Isometry3<f64>; 2]],
) -> Result<Isometry3<f64>, TaughtError> {
    match frame.kind {
        Taught::Base { is_rapid, .. } => {
            let points = stands.iter().map(|own| {
                let [stated, actual] = own.map(|pose| Point3::from(pose.translation.vector));
                Touched { stated, actual }
            });
            base(&frame.stated, &points.collect::<Vec<_>>(), is_rapid)
        }
        Taught::Tool => {
            let tool_from_flange = frame.stated.inverse();
            let flanges = stands.iter().map(|own| own.map(|pose| pose * tool_from_flange));
            tool(&frame.stated, &flanges.collect::<Vec<_>>())
        }
    }
}
