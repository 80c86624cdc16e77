//! `posegrid check`: everything that is known about a pipeline before a log is opened, as text.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;

use super::messages::Printable;
use super::run::{near, work};
use crate::geometry::rpy;
use crate::grid::{GridSettings, Lattice, Tolerance, WorkBox};
use crate::ingest::{Mapping, StationsSettings};
use crate::kinematics::{Arm, Convention, Joint};
use crate::pipeline::configuration::{Configuration, ConfigurationError, Overrides, Reads};
use crate::pipeline::fleet::Fleet;
use crate::units::to_step;

/// Check a pipeline file and show what it would do, without opening a log.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Example:
  posegrid check pipelines/quickstart.toml")]
pub struct CheckArgs {
    /// The pipeline file
    pub pipeline: PathBuf,
    /// Show this robot alone, where the pipeline file has several
    #[arg(long, value_name = "NAME")]
    pub robot: Option<String>,
}

/// The plan of a pipeline file, in words.
pub fn check(args: &CheckArgs) -> Result<String, ConfigurationError> {
    let robots: Vec<String> = args.robot.iter().cloned().collect();
    let fleet = Fleet::load(&args.pipeline, &robots, &Overrides::default())?;
    Ok(match &fleet.robots[..] {
        [only] if !fleet.is_of_several || args.robot.is_some() => described(only, &fleet),
        _ => all_robots(&fleet),
    })
}

/// A line for each robot, and the work of all of them.
fn all_robots(fleet: &Fleet) -> String {
    let line = |own: &Configuration| {
        let robot = own.robot.as_deref().unwrap_or_default();
        let (robot, model) = (Printable(robot), Printable(own.arm.model()));
        let (Tolerance { mm, share, .. }, sessions) = (own.stages.tolerance, own.pieces.len());
        let share = 100.0 * share;
        format!("{robot}: {model}, {mm} mm for {share} % of positions, {sessions} sessions\n")
    };
    let robots: String = fleet.robots.iter().map(line).collect();
    let tables = near(&fleet.lake);
    format!("{robots}tables: {}\n\n{}{}", tables.display(), work(fleet), remarks(fleet))
}

fn remarks(fleet: &Fleet) -> String {
    let left = fleet.left_out.iter();
    let left = left.map(|own| format!("left out: {}: {}\n", Printable(&own.name), own.reason));
    let remarks = fleet.remarks.iter();
    left.chain(remarks.map(|own| format!("note: {}\n", Printable(own)))).collect()
}

fn described(configuration: &Configuration, fleet: &Fleet) -> String {
    let mut text = arm(&configuration.arm) + &checkable(&configuration.arm);
    let mut line = |name: &str, value: &str| {
        writeln!(text, "{name:<12} {value}").expect("a string");
    };
    let robot = configuration.robot.as_deref().unwrap_or("as the logs name it");
    line("robot", &Printable(robot).to_string());
    for (name, value) in conventions(configuration) {
        line(name, &value);
    }
    let grid = &configuration.stages.grid;
    let joined = |steps: Vec<String>| steps.join(", ");
    line("steps", &joined(grid.steps_mm.iter().map(|step| nodes(*step, grid)).collect()));
    line("nodes from", &joined(grid.sources.iter().map(|s| s.name().to_owned()).collect()));
    let ways = grid.interpolations.iter().map(|way| way.name().to_owned());
    line("between them", &joined(ways.collect()));
    line(
        "box",
        &grid.bounds.map_or_else(
            || "around the stations in the table's orientation and configuration".to_owned(),
            |bounds| format!("{:?} to {:?} mm", bounds.low_mm, bounds.high_mm),
        ),
    );
    for (name, value) in limits(configuration) {
        line(name, &value);
    }
    line("tables", &near(&configuration.lake).display().to_string());
    text += "\n";
    text += &work(fleet);
    text += &split(configuration);
    text + &remarks(fleet)
}

/// What a result has to hold, and what its logs may lose.
fn limits(configuration: &Configuration) -> [(&'static str, String); 3] {
    let Tolerance { mm, share, confidence } = configuration.stages.tolerance;
    let [share, confidence] = [100.0 * share, 100.0 * confidence];
    let input = &configuration.file.input;
    let [lost, rejected] = [100.0 * input.max_lost_share, 100.0 * input.max_rejected_share];
    let held = format!("{mm} mm for {share} % of positions, with {confidence} % confidence");
    let damage = format!("a session has no result when a log lost more than {lost} % of its bytes");
    let rejects =
        format!("exit code 3 when more than {rejected} % of a topic's messages cannot be used");
    [("tolerance", held), ("damage", damage), ("rejects", rejects)]
}

/// A step with the number of nodes that it makes of the box, or of a cube of 1 m where stations will say the box.
fn nodes(step_mm: f64, grid: &GridSettings) -> String {
    let cube = WorkBox { low_mm: [0.0; 3], high_mm: [1000.0; 3] };
    let of = if grid.bounds.is_some() { "" } else { " in a cube of 1 m" };
    match Lattice::new(&grid.bounds.unwrap_or(cube), step_mm) {
        Ok(lattice) => format!("{step_mm} mm ({} nodes{of})", lattice.node_count()),
        Err(reason) => format!("{step_mm} mm ({reason})"),
    }
}

fn split(configuration: &Configuration) -> String {
    let sessions =
        configuration.pieces.iter().flat_map(|piece| piece.training.iter().chain(&piece.test));
    let counts = sessions.filter_map(|session| {
        let logs = session.recorded.logs()?;
        let counts = (logs.controller.len(), logs.tracker.len());
        (counts != (1, 1)).then_some((&session.name, counts))
    });
    let line = |(name, (controller, tracker)): (&String, (usize, usize))| {
        let name = Printable(name);
        format!("{name}: controller's log in {controller} files, tracker's in {tracker}\n")
    };
    counts.collect::<BTreeMap<_, _>>().into_iter().map(line).collect()
}

const fn remark_on_parallel(convention: Convention) -> &'static str {
    match convention {
        Convention::MdH => ", Hayati's beta beside d: the next axis is parallel",
        Convention::ModifiedDh => ", Hayati's beta instead of d: the axis before is parallel",
        _ => ", Hayati's beta instead of d: the next axis is parallel",
    }
}

/// The arm with the name and range of each joint, and the convention of its link.
fn arm(arm: &Arm) -> String {
    let (joints, links) = (arm.joints().len(), arm.chain().parameters().len());
    let model = Printable(arm.model());
    let mut lines = vec![format!("{model}: {joints} joints, {links} link parameters")];
    for (place, joint) in arm.joints().iter().enumerate() {
        let is_parallel = arm.parallel_joints().contains(&(place + 1));
        let remark = if is_parallel { remark_on_parallel(arm.convention()) } else { "" };
        let unit = joint.sign_of_unit();
        let [lower, upper] = [joint.lower, joint.upper].map(|limit| joint.shown(limit));
        let (place, name) = (place + 1, Printable(&joint.name).to_string());
        let remark = format!("{}{remark}", arm.convention().name());
        lines.push(format!(
            "  {place} {name:<24} {lower:>7.1}{unit} to {upper:>6.1}{unit}  {remark}"
        ));
    }
    lines.join("\n") + "\n"
}

/// The nominal flange at poses that can be gone to: the pendant of a right arm shows the same, for a tool of zero.
fn checkable(arm: &Arm) -> String {
    let zero = vec![0.0; arm.joints().len()];
    let poses = [("at zero", Some(zero.as_slice())), ("at home", arm.home())];
    let line = |(name, joints): (&str, Option<&[f64]>)| Some(flange(arm, name, joints?));
    poses.into_iter().filter_map(line).collect()
}

/// The nominal flange at reported angles, and the joints whose limits they exceed.
fn flange(arm: &Arm, name: &str, reported: &[f64]) -> String {
    let flange = *arm.flange(reported).isometry();
    let degrees = rpy(&flange.rotation).map(|angle| to_step(angle.to_degrees(), 1e-3));
    let mm = flange.translation.vector.map(|x| to_step(x, 1e-3));
    let any_slides = arm.has_slides();
    let position = |(joint, &q): (&Joint, &f64)| {
        let unit = if any_slides { joint.sign_of_unit() } else { "" };
        format!("{:.0}{unit}", to_step(joint.shown(q), 1.0))
    };
    let positions: Vec<String> = arm.joints().iter().zip(reported).map(position).collect();
    let degrees_at_end = if any_slides { "" } else { "°" };
    let positions = positions.join(", ");
    let ([x, y, z], [roll, pitch, yaw]) = (<[f64; 3]>::from(mm), degrees);
    format!(
        "  flange {name} ({positions}{degrees_at_end}): [{x:.3}, {y:.3}, {z:.3}] mm, [{roll:.3}, {pitch:.3}, {yaw:.3}]° fixed-xyz{}\n",
        beyond_limits(arm, reported)
    )
}

fn beyond_limits(arm: &Arm, reported: &[f64]) -> String {
    let beyond = arm.joints().iter().zip(reported);
    let beyond = beyond.filter(|(joint, q)| !(joint.lower..=joint.upper).contains(q));
    let beyond: Vec<String> = beyond.map(|(joint, _)| Printable(&joint.name).to_string()).collect();
    if beyond.is_empty() {
        return String::new();
    }
    format!(" (outside the limits of {}: it cannot be gone to)", beyond.join(", "))
}

fn topics(mapping: &Mapping) -> Vec<(&'static str, String)> {
    let topic = |topic: &str, time, unit: &str| format!("{topic} in {unit}, time: {time}");
    let Mapping { controller, tracker, .. } = mapping;
    let mut named = vec![
        ("controller", topic(&controller.topic, controller.time, controller.unit.word())),
        ("tracker", topic(&tracker.topic, tracker.time, &tracker.unit.to_string())),
    ];
    if let Some(commanded) = &mapping.commanded {
        let unit = commanded.unit.to_string();
        named.push(("commanded", topic(&commanded.topic, commanded.time, &unit)));
    }
    for own in &tracker.lengths {
        let topic = topic(&own.topic, tracker.time, &own.unit.to_string());
        let read = format!("{}: {} {topic}", own.name, own.reads.word());
        named.push(("lengths", read));
    }
    named
}

fn columns(stations: &StationsSettings) -> Vec<(&'static str, String)> {
    let pose = |position: &[String; 3], unit| format!("{} in {unit}", position.join(", "));
    let angle = stations.joint_unit.word();
    let mut named = vec![("joints", format!("{} in {angle}", stations.joints.join(", ")))];
    let targets = stations.target_names();
    for (own, target) in stations.measured.iter().zip(&targets) {
        let words = pose(&own.position, own.unit);
        let words = if targets.len() > 1 { format!("{target}: {words}") } else { words };
        named.push(("measured", words));
    }
    for own in &stations.lengths {
        let (name, read, column, unit) = (&own.name, own.reads.word(), &own.column, own.unit);
        named.push(("lengths", format!("{name}: {read} {column} in {unit}")));
    }
    if let Some(own) = &stations.commanded {
        named.push(("commanded", pose(&own.position, own.unit)));
    }
    named
}

/// What no log states.
fn conventions(configuration: &Configuration) -> Vec<(&'static str, String)> {
    let mut named = match &configuration.reads {
        Reads::Logs(mapping) => topics(mapping),
        Reads::Tables(stations) => columns(stations),
    };
    named.push(("error frame", configuration.stages.base_in_words().to_owned()));
    named.push((
        "up",
        configuration.stages.up.map_or_else(
            || "not given".to_owned(),
            |up| format!("[{}, {}, {}] in the base frame", up.x, up.y, up.z),
        ),
    ));
    named
}
