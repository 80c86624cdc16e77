//! `posegrid check`: everything that is known about a pipeline before a log is opened, as text.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;

use super::messages::Printable;
use super::run::{near, work};
use crate::kinematics::Arm;
use crate::pipeline::configuration::{Configuration, ConfigurationError, Overrides};
use crate::units::to_step;

/// Check a pipeline file and show what it would do, without opening a log.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Example:
  posegrid check pipelines/quickstart.toml")]
pub struct CheckArgs {
    /// The pipeline file
    pub pipeline: PathBuf,
}

/// The plan of a pipeline file, in words.
pub fn check(args: &CheckArgs) -> Result<String, ConfigurationError> {
    Configuration::load(&args.pipeline, &Overrides::default())
        .map(|configuration| described(&configuration))
}

fn described(configuration: &Configuration) -> String {
    let mut text = arm(&configuration.arm) + &checkable(&configuration.arm);
    let mut line = |name: &str, value: &str| {
        writeln!(text, "{name:<12} {value}").expect("a string");
    };
    let robot = configuration
        .robot
        .as_deref()
        .unwrap_or("as the logs name it");
    line("robot", &Printable(robot).to_string());
    for (name, value) in conventions(configuration) {
        line(name, &value);
    }
    let grid = &configuration.stages.grid;
    let joined = |steps: Vec<String>| steps.join(", ");
    line(
        "steps",
        &format!(
            "{} mm",
            joined(grid.steps_mm.iter().map(f64::to_string).collect())
        ),
    );
    line(
        "nodes from",
        &joined(grid.sources.iter().map(|s| s.name().to_owned()).collect()),
    );
    let ways = grid.interpolations.iter().map(|way| way.name().to_owned());
    line("between them", &joined(ways.collect()));
    line(
        "box",
        &grid.bounds.map_or_else(
            || "around the stations in the table's orientation and configuration".to_owned(),
            |bounds| format!("{:?} to {:?} mm", bounds.low_mm, bounds.high_mm),
        ),
    );
    let tolerance = &configuration.stages.tolerance;
    line(
        "tolerance",
        &format!(
            "{} mm for {} % of positions, with {} % confidence",
            tolerance.mm,
            100.0 * tolerance.share,
            100.0 * tolerance.confidence
        ),
    );
    line(
        "damage",
        &format!(
            "a session has no result when a log lost more than {} % of its bytes",
            100.0 * configuration.max_lost_share
        ),
    );
    line(
        "rejects",
        &format!(
            "exit code 3 when more than {} % of a topic's messages cannot be used",
            100.0 * configuration.max_rejected_share
        ),
    );
    line("tables", &near(&configuration.lake).display().to_string());
    text += "\n";
    text += &work(configuration);
    text += &split(configuration);
    for left in &configuration.left_out {
        writeln!(text, "left out: {}: {}", Printable(&left.name), left.reason).expect("a string");
    }
    for remark in &configuration.remarks {
        writeln!(text, "note: {remark}").expect("a string");
    }
    text
}

/// Sessions whose logs are split into several files.
fn split(configuration: &Configuration) -> String {
    let sessions = configuration
        .pieces
        .iter()
        .flat_map(|piece| piece.training.iter().chain(&piece.test));
    let counts: BTreeMap<_, _> = sessions
        .map(|session| {
            (
                &session.name,
                (session.logs.controller.len(), session.logs.tracker.len()),
            )
        })
        .filter(|(_, counts)| *counts != (1, 1))
        .collect();
    let line = |(name, (controller, tracker)): (&String, &(usize, usize))| {
        format!(
            "{}: controller's log in {controller} files, tracker's in {tracker}\n",
            Printable(name)
        )
    };
    counts
        .iter()
        .map(|(name, counts)| line((name, counts)))
        .collect()
}

/// The arm with the name and range of each joint, and its link convention: standard DH, or Hayati's β.
fn arm(arm: &Arm) -> String {
    let parameters = arm.chain().parameters();
    let mut text = format!(
        "{}: {} joints, {} link parameters\n",
        Printable(arm.model()),
        arm.joints().len(),
        parameters.len()
    );
    for (place, joint) in arm.joints().iter().enumerate() {
        let convention = if arm.parallel_joints().contains(&(place + 1)) {
            "the next axis is parallel: Hayati's beta instead of d"
        } else {
            "standard DH"
        };
        let limits = [joint.lower, joint.upper].map(f64::to_degrees);
        writeln!(
            text,
            "  {} {:<24} {:>7.1}° to {:>6.1}°  {convention}",
            place + 1,
            Printable(&joint.name).to_string(),
            limits[0],
            limits[1]
        )
        .expect("a string");
    }
    text
}

/// The nominal flange at poses that can be gone to at the cell: an arm whose file is right shows the same on its pendant, for a
/// tool of zero.
fn checkable(arm: &Arm) -> String {
    let zero = vec![0.0; arm.joints().len()];
    let poses = [("at zero", Some(zero.as_slice())), ("at home", arm.home())];
    let line = |(name, joints): (&str, Option<&[f64]>)| Some(flange(arm, name, joints?));
    poses.into_iter().filter_map(line).collect()
}

/// The nominal flange at reported angles, and the joints whose limits they exceed.
fn flange(arm: &Arm, name: &str, reported: &[f64]) -> String {
    let flange = *arm.flange(reported).isometry();
    let (roll, pitch, yaw) = flange.rotation.euler_angles();
    let degrees = [roll, pitch, yaw].map(|angle| to_step(angle.to_degrees(), 1e-3));
    let mm = flange.translation.vector.map(|x| to_step(x, 1e-3));
    let angles: Vec<String> = reported
        .iter()
        .map(|q| format!("{:.0}", to_step(q.to_degrees(), 1.0)))
        .collect();
    let beyond = arm.joints().iter().zip(reported);
    let beyond = beyond.filter(|(joint, q)| !(joint.lower..=joint.upper).contains(q));
    let beyond: Vec<String> = beyond
        .map(|(joint, _)| Printable(&joint.name).to_string())
        .collect();
    let limits = if beyond.is_empty() {
        String::new()
    } else {
        format!(
            " (outside the limits of {}: it cannot be gone to)",
            beyond.join(", ")
        )
    };
    format!(
        "  flange {name} ({}°): [{:.3}, {:.3}, {:.3}] mm, [{:.3}, {:.3}, {:.3}]° fixed-xyz{limits}\n",
        angles.join(", "),
        mm.x,
        mm.y,
        mm.z,
        degrees[0],
        degrees[1],
        degrees[2]
    )
}

/// What no log states.
fn conventions(configuration: &Configuration) -> Vec<(&'static str, String)> {
    let topic = |topic: &str, time, unit: &str| format!("{topic} in {unit}, time: {time}");
    let controller = &configuration.mapping.controller;
    let tracker = &configuration.mapping.tracker;
    let angle = format!("{:?}", controller.unit).to_lowercase();
    let length = format!("{:?}", tracker.unit).to_lowercase();
    let mut named = vec![
        (
            "controller",
            topic(&controller.topic, controller.time, &angle),
        ),
        ("tracker", topic(&tracker.topic, tracker.time, &length)),
    ];
    if let Some(commanded) = &configuration.mapping.commanded {
        let unit = format!("{:?}", commanded.unit).to_lowercase();
        named.push(("commanded", topic(&commanded.topic, commanded.time, &unit)));
    }
    named.push((
        "error frame",
        configuration.stages.base_in_words().to_owned(),
    ));
    named.push((
        "up",
        configuration.stages.up.map_or_else(
            || "not given".to_owned(),
            |up| format!("[{}, {}, {}] in the base frame", up.x, up.y, up.z),
        ),
    ));
    named
}
