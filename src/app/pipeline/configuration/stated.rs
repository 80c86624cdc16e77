//! The set-up as pipeline file and robot file state it, for the check against the logs.

use std::path::Path;
use std::sync::{Arc, LazyLock};

use nalgebra::{Isometry3, Vector3};

use super::Placed;
use crate::fit::ErrorBase;
use crate::geometry::Placement;
use crate::ingest::{AngleUnit, LengthUnit, OrientationColumns};
use crate::io::robot::{self, ready};
use crate::kinematics::{Arm, Convention, RobotFile};
use crate::pipeline::file::{PipelineFile, Survey};
use crate::setup::{Alternatives, FrameKey, KnownArm, OtherReading, SetUp, UnitKeys, Units};

/// The stated set-up, and what it may have been taken for.
#[derive(Debug, Clone)]
pub struct StatedSetUp {
    pub set_up: SetUp,
    /// Other robot files, and the frames' numbers under other conventions.
    pub alternatives: Alternatives,
}

impl StatedSetUp {
    pub(super) fn new(file: &PipelineFile, placed: &Placed, robot_file: &Path, arm: &Arm) -> Self {
        let frames = placed.command_frames.as_ref();
        let surveyed = match placed.base {
            Some(ErrorBase::Surveyed(base)) => Some(base.tracker_from_base),
            Some(ErrorBase::Fitted) | None => None,
        };
        let form = |columns: &OrientationColumns| columns.form.clone();
        let tables = file.stations.as_ref();
        let mut measured = tables.into_iter().flat_map(|tables| &tables.measured);
        let reading_form = measured.find_map(|own| own.orientation.as_ref()).map(form);
        let commanded = tables.and_then(|tables| tables.commanded.as_ref());
        let command_form = commanded.and_then(|own| own.orientation.as_ref()).map(form);
        Self {
            set_up: SetUp {
                base_from_command: frames
                    .map_or_else(Isometry3::identity, |frames| frames.base_from_command),
                flange_from_tool: placed.flange_from_tool,
                target: file.fit.geometric.target.map(|target| Vector3::from(target.xyz_mm)),
                target_is_tool: placed.target_is_tool == Some(true),
                tracker_from_base: surveyed,
                unit_keys: if file.stations.is_some() { UnitKeys::TABLES } else { UnitKeys::LOGS },
                units: units(file),
                reading_form,
                command_form,
                ..SetUp::of_arm(arm.clone())
            },
            alternatives: Alternatives {
                arms: Arc::new(LazyLock::new(ready::arms)),
                readings: other_conventions(file),
                convention: other_table(robot_file),
            },
        }
    }
}

/// The stated units; mm and degrees where nothing is in one.
fn units(file: &PipelineFile) -> Units {
    let (controller, tables) = (file.controller.as_ref(), file.stations.as_ref());
    let angles = controller.map(|own| own.unit).or(tables.map(|own| own.joint_unit));
    let slides = controller.and_then(|own| own.length_unit);
    let in_log = file.tracker.mapping.as_ref().map(|own| own.unit);
    let in_table = tables.and_then(|own| Some(own.measured.first()?.unit));
    let commands = file.commanded.as_ref().and_then(|own| Some(own.mapping.as_ref()?.unit));
    let commanded = tables.and_then(|own| Some(own.commanded.as_ref()?.unit));
    let of = |log: Option<LengthUnit>, table| log.or(table).unwrap_or(LengthUnit::Mm);
    Units {
        angles: angles.unwrap_or(AngleUnit::Deg),
        slides: of(slides, tables.and_then(|own| own.length_unit)),
        readings: of(in_log, in_table),
        commands: of(commands, commanded),
    }
}

/// The robot file's table read as standard DH for modified and the reverse; `None` of a file without one.
fn other_table(robot_file: &Path) -> Option<KnownArm> {
    let mut file: RobotFile = toml::from_str(&robot::text(robot_file).ok()?).ok()?;
    file.convention = match file.convention {
        Convention::StandardDh | Convention::MdH => Convention::ModifiedDh,
        Convention::ModifiedDh => Convention::StandardDh,
        _ => return None,
    };
    Some(KnownArm { file: file.convention.word().to_owned(), arm: file.arm().ok()? })
}

/// The stated placements under other conventions.
fn other_conventions(file: &PipelineFile) -> Vec<OtherReading> {
    let commanded = file.commanded.as_ref();
    let survey = file.tracker.survey().map(Survey::placement);
    let stated: [(FrameKey, Option<Placement>); 3] = [
        (FrameKey::Commands, commanded.map(|section| section.base_from_command)),
        (FrameKey::Tool, commanded.and_then(|section| section.flange_from_tool)),
        (FrameKey::Survey, survey),
    ];
    let mut all = Vec::new();
    for (frame, placement) in stated {
        // No rotation is one in every convention.
        let turned =
            placement.filter(|own| own.isometry().is_ok_and(|own| own.rotation.angle() > 0.0));
        let others = turned.map_or_else(Vec::new, |placement| placement.other_conventions());
        let others = others.into_iter();
        all.extend(others.map(|(convention, placed)| OtherReading { frame, convention, placed }));
    }
    all
}
