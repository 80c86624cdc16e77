//! Disagreements of some size: a frame or one link off by an amount that the logs tell.

mod link;

use nalgebra::{Isometry3, Point3, Translation3};

use super::agreement::{Relation, Seen, in_flange, robust_align};
use super::evidence::{Evidence, point};
use super::hypotheses::{FrameKey, Hypothesis};
use super::set_up::SetUp;
use crate::units::to_step;

/// Every link quantity in turn, moved to where the logs agree best.
pub(super) fn links(stated: &SetUp, evidence: &Evidence, seen: &Seen) -> Vec<Hypothesis> {
    seen.placement.map_or_else(Vec::new, |placement| link::links(stated, evidence, &placement))
}

/// Every frame in turn, moved to where the logs agree best.
pub(super) fn frames(stated: &SetUp, evidence: &Evidence, seen: &Seen) -> Vec<Hypothesis> {
    let tool = tool(stated, evidence, seen);
    let mut frames = vec![
        (FrameKey::Tool, tool),
        (FrameKey::Target, target(stated, seen)),
        (FrameKey::Both, tool.filter(|_| FrameKey::Both.of(stated).is_some())),
        (FrameKey::Survey, survey(stated, seen)),
        (FrameKey::Commands, commands(stated, evidence, seen)),
    ];
    // Where the two are one point, either may be meant to be where the other is.
    if let (Some([_, target]), Some(tool)) = (stated.one_point(), stated.flange_from_tool) {
        let meant = Isometry3::from_parts(Translation3::from(target), tool.rotation);
        frames.push((FrameKey::Tool, Some(meant)));
        frames.push((FrameKey::Target, Some(tool)));
    }
    let alike = are_alike(stated, evidence);
    let mut all: Vec<Hypothesis> = Vec::new();
    for (frame, moved) in frames {
        let shifted = moved.and_then(|moved| shifted(stated, frame, &moved, alike));
        all.extend(shifted.filter(|shifted| all.iter().all(|known| known.edit != shifted.edit)));
    }
    all
}

/// What a turn of the tool explains as well where all commands have one orientation.
const OR_WRITTEN_OTHERWISE: &str =
    ", or the commanded orientations, which are all alike, are written otherwise than stated";

fn are_alike(stated: &SetUp, evidence: &Evidence) -> bool {
    let turns = evidence.commands(stated.rows[3]);
    let turns: Vec<_> = turns.filter_map(|(_, command)| stated.commanded_turn(command)).collect();
    turns.iter().all(|own| own.angle_to(&turns[0]) <= Relation::Turns.usual())
}

fn shifted(
    stated: &SetUp,
    frame: FrameKey,
    moved: &Isometry3<f64>,
    alike: bool,
) -> Option<Hypothesis> {
    let was = frame.of(stated)?;
    let step = (moved.translation.vector - was.translation.vector).map(|x| to_step(x, 0.1));
    let turn_deg = turn_deg(frame, &was, moved);
    let is_tool = matches!(frame, FrameKey::Tool | FrameKey::Both);
    let or = if alike && is_tool { OR_WRITTEN_OTHERWISE } else { "" };
    let turn =
        if turn_deg > 0.05 { format!(" and turned by {turn_deg:.2}°{or}") } else { String::new() };
    let mistake =
        format!("{} is off by [{:.1}, {:.1}, {:.1}] mm{turn}", frame.key(), step.x, step.y, step.z);
    Some(Hypothesis::of_size(mistake, frame.edit(moved), frame.put(stated, *moved)))
}

/// The tool where the commands have it.
fn tool(stated: &SetUp, evidence: &Evidence, seen: &Seen) -> Option<Isometry3<f64>> {
    let tool = stated.flange_from_tool?;
    let at = in_flange(&seen.commanded(stated, evidence))?;
    let turn = seen.tool_turn(stated, evidence);
    // A turn that says nothing stays as it is stated.
    let turn = turn.filter(|turn| turn.angle_to(&tool.rotation) > Relation::Turns.usual());
    Some(Isometry3::from_parts(Translation3::from(at), turn.unwrap_or(tool.rotation)))
}

/// The target where the readings have it.
fn target(stated: &SetUp, seen: &Seen) -> Option<Isometry3<f64>> {
    stated.target?;
    Some(Translation3::from(seen.placement?.target_mm).into())
}

/// The base where the readings have it.
fn survey(stated: &SetUp, seen: &Seen) -> Option<Isometry3<f64>> {
    stated.tracker_from_base?;
    let Some(target) = stated.stated_target() else {
        return Some(seen.placement?.tracker_from_base);
    };
    let measured: Vec<Point3<f64>> = seen.measured.iter().map(point).collect();
    robust_align(&measured, &seen.at_flange(&target))
}

/// The frame of commands where the arm has it.
fn commands(stated: &SetUp, evidence: &Evidence, seen: &Seen) -> Option<Isometry3<f64>> {
    let tool = point(&stated.flange_from_tool?.translation.vector);
    let (to, from): (Vec<Point3<f64>>, Vec<Point3<f64>>) =
        seen.commanded(stated, evidence).iter().map(|(flange, at)| (flange * tool, *at)).unzip();
    Some(robust_align(&to, &from)? * stated.base_from_command)
}

/// The angle between two frames, degrees; a target has no orientation.
fn turn_deg(frame: FrameKey, was: &Isometry3<f64>, moved: &Isometry3<f64>) -> f64 {
    if frame == FrameKey::Target {
        return 0.0;
    }
    was.rotation.angle_to(&moved.rotation).to_degrees()
}
