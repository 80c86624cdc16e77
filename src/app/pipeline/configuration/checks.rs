//! Values of a pipeline file that do not go together, found before a log is opened; the reference of keys has the range of each by itself.
//!
//! Each check is a key, its value and the allowed values; the first that fails is the error.

use std::fmt::Display;
use std::path::Path;

use nalgebra::Vector3;

use super::{ConfigurationErrorKind, Result, lengths};
use crate::files::message;
use crate::fit::Uncertainty;
use crate::grid::{GridSettings, Lattice, WorkBox};
use crate::ingest::{StationsSettings, WrongFields};
use crate::io::lake;
use crate::kinematics::Arm;
use crate::pipeline::file::{PipelineFile, Pool};

pub(in crate::pipeline) type Check = Result<(), ConfigurationErrorKind>;

/// Checks everything that needs only this file; `joints` is the number of joints of the arm.
pub(super) fn check(path: &Path, file: &PipelineFile, joints: usize) -> Result<()> {
    numbers(file, joints).map_err(|wrong| wrong.at(path))?;
    commands(path, file)?;
    own_rows(path, file)?;
    let states_orientations = match &file.tracker.uncertainty {
        Uncertainty::Tracker(tracker) => tracker.orientation_rad.is_some(),
        Uncertainty::Camera(_) => true,
    };
    if file.fit.geometric.orientations && !states_orientations {
        return Err(ConfigurationErrorKind::missing(
            "[tracker] uncertainty.orientation_rad",
            "[fit] orientations = true weighs orientations by it; state it, or leave orientations out",
        )
        .at(path));
    }
    Ok(())
}

/// Checks that the robot has a name where a column of tables names it.
fn own_rows(path: &Path, file: &PipelineFile) -> Result<()> {
    let has_column = |own: &StationsSettings| own.robot.is_some();
    let has_column = file.stations.as_ref().is_some_and(has_column);
    if file.robot.name.is_some() || !has_column {
        return Ok(());
    }
    let kind = ConfigurationErrorKind::missing(
        "[robot] name",
        "[stations] robot names the column of a row's robot: state which one is meant, or all of them under [[robots]]",
    );
    Err(kind.at(path))
}

/// Checks that commands of tables have frames, and that frames of commands have commands.
fn commands(path: &Path, file: &PipelineFile) -> Result<()> {
    let Some(stations) = &file.stations else { return Ok(()) };
    let (key, reason) = match (&stations.commanded, &file.commanded) {
        (Some(_), None) => (
            "[commanded]",
            "[stations] has commanded poses; state their frames: base_from_command, flange_from_tool, target_is_tool",
        ),
        (None, Some(_)) => (
            "[stations] commanded",
            "[commanded] states the frames of commands; name their columns, or leave [commanded] out",
        ),
        (Some(_), Some(_)) if stations.flange_from_tool.is_some() => {
            let (found, wanted) = ("stated", "left out: with commands it stands in [commanded]");
            let key = "[stations] flange_from_tool";
            return Err(ConfigurationErrorKind::setting(key, found, wanted).at(path));
        }
        _ => return Ok(()),
    };
    Err(ConfigurationErrorKind::missing(key, reason).at(path))
}

/// Checks that the unit of positions is stated where `arm` has a joint that slides, and nowhere else.
pub(super) fn length_unit(path: &Path, file: &PipelineFile, arm: &Arm) -> Result<()> {
    let slide = arm.joints().iter().find(|joint| joint.slides);
    let stated = match (&file.stations, &file.controller) {
        (Some(stations), _) => stations.length_unit,
        (None, controller) => controller.as_ref().and_then(|own| own.length_unit),
    };
    let (found, wanted) = match (slide, stated) {
        (Some(joint), None) => (
            "absent".to_owned(),
            format!(
                "\"m\" (ROS) or \"mm\": joint {:?} slides, no log states the unit of its position, and it has no default",
                joint.name
            ),
        ),
        (None, Some(unit)) => (
            unit.to_string(),
            "left out: no joint of this arm slides (kind = \"prismatic\" in the robot file)"
                .to_owned(),
        ),
        _ => return Ok(()),
    };
    let section = if file.stations.is_some() { "stations" } else { "controller" };
    let key = format!("[{section}] length_unit");
    Err(ConfigurationErrorKind::setting(key, found, wanted).at(path))
}

fn numbers(file: &PipelineFile, joints: usize) -> Check {
    if let Some(latest) = file.input.pool_latest {
        wrong_unless(
            matches!(file.input.pool, Pool::All | Pool::Until),
            "[input] pool_latest",
            latest,
            "left out where each session is learnt from by itself; pool = \"until\" or \"all\" has pools",
        )?;
    }
    if let Some(name) = &file.robot.name {
        let refused = |error| {
            let wanted = format!("another: {error}");
            ConfigurationErrorKind::setting("[robot] name", format!("{name:?}"), wanted)
        };
        lake::check_name("robot", name).map_err(refused)?;
    }
    mapping(file, joints)?;
    if let Uncertainty::Camera(own) = &file.tracker.uncertainty {
        let axis = own.looks_along.map(Vector3::from);
        wrong_unless(
            axis.is_none_or(|axis| axis.norm() > 1e-6),
            "[tracker] camera.looks_along",
            format!("{:?}", own.looks_along),
            "a direction, for example [0, 0, 1]",
        )?;
    }
    file.fit.full.repaired.iter().try_for_each(|repair| {
        wrong_unless(
            (1..=joints).contains(&repair.joint),
            "[[fit.full.repaired]] joint",
            repair.joint,
            format!("1 to {joints}, from the base"),
        )
    })?;
    let weights = file.similarity.joint_weights.as_ref().map_or(joints, Vec::len);
    wrong_unless(
        weights == joints,
        "[similarity] joint_weights",
        format!("{weights} weights"),
        format!("one for each of the arm's {joints} joints"),
    )?;
    grid(&file.grid)
}

/// Checks the fields of messages that are named.
fn mapping(file: &PipelineFile, joints: usize) -> Check {
    let of_section = |section: &'static str| {
        move |wrong: WrongFields| {
            let key = format!("[{section}] {}", wrong.key);
            ConfigurationErrorKind::setting(key, wrong.found, wrong.wanted)
        }
    };
    if let Some(stations) = &file.stations {
        return columns(stations, joints);
    }
    if let Some(controller) = file.controller.as_ref().map(|own| &own.fields) {
        controller.check(joints).map_err(of_section("controller"))?;
        paths("[controller] fields", &controller.paths())?;
    }
    if let Some(tracker) = &file.tracker.mapping {
        let fields = &tracker.fields;
        fields.check().map_err(of_section("tracker"))?;
        paths("[tracker] fields", &fields.paths())?;
        tracker.check_targets().map_err(of_section("tracker"))?;
        wrong_unless(
            tracker.references.is_empty() || !file.tracker.is_eye_in_hand(),
            "[[tracker.references]]",
            "beside a camera on the flange",
            "left out: such a camera moves with the arm, and what it sees shows no motion of an instrument",
        )?;
        lengths::logged(tracker, file.tracker.is_eye_in_hand())?;
    }
    let commanded = file.commanded.as_ref();
    let Some(commanded) = commanded.and_then(|own| own.mapping.as_ref()) else { return Ok(()) };
    let commanded = &commanded.fields;
    commanded.check().map_err(of_section("commanded"))?;
    wrong_unless(
        commanded.temperature.is_none(),
        "[commanded] fields.temperature",
        "given",
        "left out: temperatures are read by [tracker]",
    )?;
    let (is_absent, wanted) = (commanded.target.is_none(), "left out: targets are of [tracker]");
    wrong_unless(is_absent, "[commanded] fields.target", "given", wanted)?;
    paths("[commanded] fields", &commanded.paths())
}

/// Checks the columns of a table of stations that need no table to be wrong.
fn columns(stations: &StationsSettings, joints: usize) -> Check {
    wrong_unless(
        stations.joints.len() == joints,
        "[stations] joints",
        format!("{} columns", stations.joints.len()),
        format!("{joints}, one for each reported joint of the robot file, from base to flange"),
    )?;
    let names = stations.target_names();
    let is_long = stations.target.is_some();
    wrong_unless(
        !names.is_empty(),
        if is_long { "[stations] targets" } else { "[stations] measured" },
        "empty",
        "the targets that are measured, the main one first",
    )?;
    let twice = names.iter().enumerate().find(|(place, name)| names[..*place].contains(name));
    let twice = twice.map(|(_, name)| format!("{name:?} twice"));
    wrong_if(twice, "[stations] targets", "names, each of one target")?;
    wrong_unless(
        is_long || stations.targets.is_empty(),
        "[stations] targets",
        "without target",
        "left out: each table of [[stations.measured]] has the name of its target",
    )?;
    lengths::columns(stations, &names)?;
    wrong_unless(
        !is_long
            || (stations.station.is_some()
                && (stations.measured.len() == 1 || stations.first_length() == 0)),
        "[stations] target",
        "a column of targets",
        "beside `station`, the column that says which rows belong together, and one [stations.measured] where any row has a position",
    )?;
    references(stations)
}

/// Checks the references of a table: names of their own, and columns where the table is not long.
fn references(stations: &StationsSettings) -> Check {
    let is_long = stations.target.is_some();
    let targets = stations.target_names();
    stations.references.iter().enumerate().try_for_each(|(place, own)| {
        let earlier = stations.references[..place].iter().map(|other| &other.name);
        wrong_unless(
            !targets.iter().chain(earlier).any(|name| *name == own.name),
            "[[stations.references]] name",
            format!("{:?} twice", own.name),
            "a name that no other reference and no target has",
        )?;
        wrong_unless(
            own.position.is_some() != is_long && own.unit.is_some() != is_long,
            "[[stations.references]] position",
            if is_long { "columns in a long table" } else { "no columns" },
            if is_long {
                "left out, as `unit`: rows of references have the columns of [stations.measured]"
            } else {
                "three columns, with their unit"
            },
        )
    })
}

pub(super) fn paths(key: &str, paths: &[&str]) -> Check {
    paths.iter().try_for_each(|path| {
        wrong_unless(
            message::FieldPath::parse(path).is_ok(),
            key,
            format!("{path:?}"),
            "a field path like pose.position.x, joints[2].angle or joints[].name",
        )
    })
}

fn grid(grid: &GridSettings) -> Check {
    let steps = &grid.steps_mm;
    let twice = |place: &usize| steps[..*place].contains(&steps[*place]);
    let twice = (0..steps.len()).find(twice).map(|place| steps[place]);
    wrong_if(twice, "[grid] steps_mm", "given once")?;
    if let Some(bounds) = &grid.bounds {
        work_box(bounds)?;
    }
    if let Some(quaternion) = grid.orientation_xyzw {
        let norm = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
        let wanted = format!("a quaternion of norm 1; this one has {norm}");
        let (is_unit, found) = ((norm - 1.0).abs() < 1e-3, format!("{quaternion:?}"));
        wrong_unless(is_unit, "[grid] orientation_xyzw", found, wanted)?;
    }
    Ok(())
}

fn work_box(bounds: &WorkBox) -> Check {
    let sizes = [0, 1, 2].map(|axis| bounds.size(axis));
    let [x, y, z] = sizes.map(|size| format!("{size}"));
    wrong_unless(
        Lattice::of_cells(bounds, [1; 3]).is_ok(),
        "[grid] box",
        format!("{x} × {y} × {z} mm"),
        "a box whose high_mm is above its low_mm along each axis, by a millimetre at least",
    )
}

pub(in crate::pipeline) fn wrong_unless(
    holds: bool,
    key: impl Display,
    found: impl Display,
    wanted: impl Display,
) -> Check {
    wrong_if((!holds).then_some(found), key, wanted)
}

/// An error where there is something to be found.
pub(super) fn wrong_if(
    found: Option<impl Display>,
    key: impl Display,
    wanted: impl Display,
) -> Check {
    found.map_or(Ok(()), |found| Err(ConfigurationErrorKind::setting(key, found, wanted)))
}
