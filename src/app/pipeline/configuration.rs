//! The configuration: a pipeline file, resolved and checked as far as possible before a log is opened.
//!
//! Input is the path of a pipeline file and the options of the command line; output is a [`Configuration`]. Steps:
//! 1. the file is parsed ([`super::file`]); paths in it are relative to it;
//! 2. the robot file becomes an arm;
//! 3. numbers are checked (`checks`);
//! 4. placements and directions become transforms;
//! 5. sessions are looked for and become pieces of work (`sessions`).

pub(super) mod checks;
mod error;
pub mod files;
mod lengths;
pub(super) mod logs;
mod robots;
mod sessions;
mod stated;
mod tree;

use std::path::{Component, Path, PathBuf};

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};

use super::file::{PipelineFile, TipFrame, ToolTip, TrackerFromBase};
use super::keys::{estimate_settings, grids_settings, join_settings};
use super::robot_file;
use crate::files::input::{self, Bound};
use crate::files::store::{self, Place};
use crate::fit::commanded::CommandFrames;
use crate::fit::{ErrorBase, FitSettings, KnownGauge, KnownTarget, SurveyedBase};
use crate::geometry::Placement;
use crate::ingest::{Mapping, StationsSettings, TrackerSettings};
use crate::io::lake::Lake;
use crate::io::robot::{self, Selection};
use crate::judgement::StageSettings;
use crate::kinematics::Arm;
use crate::manifest::{self, ManifestError};
use crate::similarity::SimilaritySettings;
use sessions::{Candidates, Wanted};

pub(super) use error::Result;
pub use error::{ConfigurationError, ConfigurationErrorKind};
pub use files::Files;
pub use robots::{Robots, StatedRobot};
pub(in crate::pipeline) use sessions::look;
pub use sessions::{
    FoundSessions, JoinedBefore, LeftOut, POOLED, Recorded, Session, SessionFiles, SessionTable,
    SetAside, Why, WorkPiece,
};
pub use stated::StatedSetUp;
pub use tree::Tree;

/// A checked pipeline: the work, its files and its settings.
#[derive(Debug, Clone)]
pub struct Configuration {
    /// The pipeline file's name without its extension.
    pub pipeline: String,
    pub file: PipelineFile,
    /// The robot's name in the tables; absent where the logs' metadata has to name it.
    pub robot: Option<String>,
    /// The robot file, an input of every run.
    pub robot_file: PathBuf,
    pub arm: Arm,
    /// The reading of what sessions were recorded as.
    pub reads: Reads,
    /// The frames of commands, where the logs have them.
    pub command_frames: Option<CommandFrames>,
    /// The set-up as stated, to be held against the logs.
    pub set_up: StatedSetUp,
    pub stages: StageSettings,
    /// Every setting that a result follows from, as canonical JSON without paths: part of every run's name.
    pub settings: String,
    /// Those of them that ingest and join read, likewise: part of the name of every session as joined.
    pub join_settings: String,
    /// Those of them that training reads, likewise: part of the name of every estimate.
    pub estimate_settings: String,
    /// Those of them that the grids of an estimate read, likewise: part of the name of all grids.
    pub grids_settings: String,
    /// Whether the work is with estimates that the lake has, so that nothing is trained.
    pub from_estimates: bool,
    /// Whether it is with grids that the lake has too.
    pub from_grids: bool,
    /// The place of the sessions' logs.
    pub tree: Tree,
    pub pieces: Vec<WorkPiece>,
    /// Sessions that there is no piece for, in the order of the pieces.
    pub set_aside: Vec<SetAside>,
    /// Folders and files among the sessions that are no session.
    pub left_out: Vec<LeftOut>,
    /// Remarks on allowed settings that a person should know.
    pub remarks: Vec<String>,
    pub lake: Place,
}

/// The reading of what sessions were recorded as.
#[derive(Debug, Clone, PartialEq)]
pub enum Reads {
    Logs(Box<Mapping>),
    /// Columns and units of tables of stations.
    Tables(Box<StationsSettings>),
}

impl Reads {
    /// Topics, clocks and units of the two logs; `None` where sessions are tables.
    pub fn mapping(&self) -> Option<&Mapping> {
        match self {
            Self::Logs(mapping) => Some(mapping),
            Self::Tables(_) => None,
        }
    }

    /// Where the readings come from, in words: `on /tracker/point`.
    pub fn of_readings(&self) -> String {
        match self {
            Self::Logs(mapping) => format!("on {}", mapping.tracker.topic),
            Self::Tables(stations) => {
                let columns = stations.measured.iter().map(|own| own.position.join(", "));
                format!("in the columns {}", columns.collect::<Vec<_>>().join("; "))
            }
        }
    }
}

/// Options of the command line that override the pipeline file.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Overrides {
    /// The robot, where the pipeline file has several.
    pub robot: Option<String>,
    /// Sessions to learn from, instead of `[input] sessions`; empty for none.
    pub sessions: Vec<String>,
    /// Sessions that only judge, instead of `[input] test`; empty for none.
    pub test: Vec<String>,
    /// The folder of the published tables, relative to the working folder, instead of `[output] lake`; or an address on object storage.
    pub lake: Option<PathBuf>,
    /// Whether the work is with sessions that the lake has as joined, instead of the files of `[input]`.
    pub from_joined: bool,
    /// Whether the work is with estimates that the lake has too.
    pub from_estimates: bool,
    /// Whether the work is with grids that the lake has as well.
    pub from_grids: bool,
}

impl Configuration {
    /// Reads and checks the pipeline file at `path`, of the robot that the command line names where it has several.
    pub fn load(path: &Path, overrides: &Overrides) -> Result<Self> {
        let files = files::read(path, overrides.robot.as_deref())?;
        let tree = files.tree()?;
        Self::of(path, files, tree, None, overrides)
    }

    /// The configuration of one robot: `found` are its sessions, where they were searched already.
    pub(super) fn of(
        path: &Path,
        files: Files,
        tree: Tree,
        found: Option<FoundSessions>,
        overrides: &Overrides,
    ) -> Result<Self> {
        let folder = files.sessions().named();
        let Files { file, robot_file, arm, lake, .. } = files;
        let placed = Placed::new(path, &file)?;
        let lake = usable(overrides.lake.as_deref(), lake)?;
        let settings = serde_json::to_value(&file).map_err(ManifestError::from)?;
        let join_settings = manifest::canonical(&join_settings(&settings))?;
        let candidates = if overrides.from_joined {
            joined_sessions(path, &file, &robot_file, &join_settings, &lake)?
        } else {
            let found = found.map_or_else(|| look(path, &tree, &folder, &file), Ok)?;
            Candidates { found, place: folder, wanted: file.input.session_in_words() }
        };
        let listed = candidates.listed(&file.input, overrides)?;
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        Ok(Self {
            pipeline: stem.into_owned(),
            robot: file.robot.name.clone(),
            set_up: StatedSetUp::new(&file, &placed, &robot_file, &arm),
            robot_file,
            reads: reads(path, &file, &arm)?,
            estimate_settings: manifest::canonical(&estimate_settings(&settings))?,
            grids_settings: manifest::canonical(&grids_settings(&settings))?,
            settings: manifest::canonical(&settings)?,
            join_settings,
            from_estimates: overrides.from_estimates,
            from_grids: overrides.from_grids,
            remarks: remarks(&file),
            command_frames: placed.command_frames,
            stages: stages(&file, &placed, &arm),
            arm,
            tree,
            pieces: listed.pieces,
            set_aside: listed.set_aside,
            left_out: listed.left_out,
            lake,
            file,
        })
    }
}

/// The sessions that the lake has as joined, by this robot file and these settings of ingest and join.
fn joined_sessions(
    path: &Path,
    file: &PipelineFile,
    robot_file: &Path,
    settings: &str,
    lake: &Place,
) -> Result<Candidates> {
    if file.output.logs {
        let wanted =
            "false: decoded samples are published from logs, and --from estimate reads none";
        return Err(ConfigurationErrorKind::setting("[output] logs", true, wanted).at(path));
    }
    let unread = |source| {
        let robot = robot_file.to_owned();
        ConfigurationErrorKind::Robot { robot, source }.at(path)
    };
    let opened = input::open(robot_file, Bound::ANY).map_err(unread)?;
    let (robot_digest, _) = manifest::digest(opened).map_err(unread)?;
    let wanted =
        Wanted { robot: file.robot.name.as_deref(), robot_digest: &robot_digest, settings };
    Candidates::joined(&Lake::at(lake)?, &wanted)
}

/// The folder that paths in a pipeline file are relative to, without symbolic links.
fn folder_of(path: &Path) -> Result<PathBuf> {
    let real =
        path.canonicalize().map_err(|source| ConfigurationErrorKind::Read(source).at(path))?;
    Ok(real.parent().unwrap_or(Path::new("/")).to_owned())
}

/// The lake that the command line names, otherwise the file's; an error if this program cannot use it.
pub(super) fn usable(named: Option<&Path>, of_file: Place) -> Result<Place> {
    let lake = named.map_or(of_file, Place::of);
    store::at(&lake)?;
    Ok(lake)
}

/// A place as written in a file in `base`; a path is [`resolved`].
fn placed_at(base: &Path, written: &Path) -> Place {
    match Place::of(written) {
        Place::Path(path) => Place::Path(resolved(base, &path)),
        url @ Place::Url(_) => url,
    }
}

/// `path` relative to `base`, which has no symbolic links, with its leading `..` removed.
fn resolved(base: &Path, path: &Path) -> PathBuf {
    let mut whole = base.to_owned();
    let mut rest = path.components().peekable();
    while let Some(part) =
        rest.next_if(|part| matches!(part, Component::ParentDir | Component::CurDir))
    {
        if part == Component::ParentDir {
            whole.pop();
        }
    }
    whole.extend(rest);
    whole
}

fn read_arm(path: &Path, robot_path: &Path, selection: &Selection) -> Result<Arm> {
    let text = robot::text(robot_path).map_err(|source| {
        let robot = robot_path.to_owned();
        ConfigurationErrorKind::Robot { robot, source }.at(path)
    })?;
    Ok(robot_file::arm(robot_path, &text, selection)?)
}

/// The reading of the logs, or of the tables where the file names columns.
fn reads(path: &Path, file: &PipelineFile, arm: &Arm) -> Result<Reads> {
    if let Some(stations) = &file.stations {
        return Ok(Reads::Tables(Box::new(stations.clone())));
    }
    let (Some(controller), Some(tracker)) = (&file.controller, &file.tracker.mapping) else {
        let reason = "logs need it and the topic of [tracker]; tables of stations need [stations]";
        return Err(ConfigurationErrorKind::missing("[controller]", reason).at(path));
    };
    let joints = arm.joints().iter();
    Ok(Reads::Logs(Box::new(Mapping {
        controller: controller.clone(),
        commanded: file.commanded.as_ref().and_then(|section| section.mapping.clone()),
        tracker: TrackerSettings { eye_in_hand: file.tracker.is_eye_in_hand(), ..tracker.clone() },
        joints: joints.map(|joint| joint.name.clone()).collect(),
        slides: slides(arm),
    })))
}

/// Whether each joint slides; empty where none does.
fn slides(arm: &Arm) -> Vec<bool> {
    arm.joints().iter().map(|joint| joint.slides).filter(|_| arm.has_slides()).collect()
}

fn stages(file: &PipelineFile, placed: &Placed, arm: &Arm) -> StageSettings {
    let fit = &file.fit.geometric;
    StageSettings {
        noise: file.noise(),
        fit: FitSettings {
            target_names: several_targets(file),
            gauges: gauges(file),
            source_names: source_names(file),
            ..fit.clone()
        },
        full: file.fit.full.clone().measured_by(&file.tracker.uncertainty),
        up: placed.up,
        flange_from_tool: placed.flange_from_tool,
        base_from_command: placed
            .command_frames
            .map_or_else(Isometry3::identity, |frames| frames.base_from_command),
        base: placed.base,
        target_is_tool: placed.target_is_tool,
        similarity: SimilaritySettings { slides: slides(arm), ..file.similarity.clone() },
        grid: file.grid.clone(),
        tolerance: file.tolerance,
        locate: file.report.locate,
        leave_sessions_out: file.report.leave_sessions_out,
        tool_tip: placed.tool_tip,
    }
}

/// Names of the sources where some read one length: that of places first.
fn source_names(file: &PipelineFile) -> Vec<String> {
    let lengths = file.lengths();
    if lengths.is_empty() {
        return Vec::new();
    }
    let places = (file.first_length() > 0).then(|| "tracker".to_owned());
    places.into_iter().chain(lengths.iter().map(|own| own.name.to_owned())).collect()
}

/// Stated place and offset of each source that reads lengths, in the order of sources; none of that of places.
fn gauges(file: &PipelineFile) -> Vec<KnownGauge> {
    let lengths = file.lengths();
    if lengths.is_empty() {
        return Vec::new();
    }
    let known = lengths.iter().map(|own| KnownGauge {
        place: own.place.map(|place| KnownTarget { xyz_mm: place.xyz_mm, sd_mm: place.sd_mm }),
        offset: own.offset.map(|offset| (offset.mm, offset.sd_mm)),
    });
    vec![KnownGauge::default(); file.first_length()].into_iter().chain(known).collect()
}

/// Names of the targets of sessions with several, the main one first; empty where there is one.
pub(in crate::pipeline) fn several_targets(file: &PipelineFile) -> Vec<String> {
    let names = file.stations.as_ref().map(StationsSettings::target_names);
    let logged = file.tracker.mapping.as_ref().map(TrackerSettings::target_names);
    let names = names.or(logged);
    names.filter(|names| names.len() > 1).unwrap_or_default()
}

fn remarks(file: &PipelineFile) -> Vec<String> {
    let one_point = file.commanded.as_ref().map(|section| section.target_is_tool);
    let based = file.tracker.tracker_from_base.is_some();
    let survey = file.tracker.survey();
    let surveyed = survey.is_some();
    let remarks = [
        (
            file.robot.up.is_none() && file.fit.full.enabled && file.fit.full.gravity,
            "[robot] up is not given, so gravity is left out of the model",
        ),
        (
            one_point.is_none(),
            "there is no [commanded], so there are no errors relative to the command",
        ),
        (
            one_point == Some(false) && surveyed && file.fit.geometric.target.is_none(),
            "[fit] target is not given: the tool's place beside the measured target is that of the fit, which the arm's errors are in too; \
             state it with its sd_mm, so that the verdict counts it",
        ),
        (
            survey.is_some_and(|survey| survey.sd_mm.is_none() || survey.sd_deg.is_none()),
            "[tracker] tracker_from_base.surveyed has no sd_mm and sd_deg: verdict and corrections suppose that the survey has no error",
        ),
        (
            one_point == Some(true) && !based,
            "[tracker] tracker_from_base is not given, so there are no errors relative to the raw command",
        ),
        (
            file.grid.steps_mm.len() < 6,
            "[grid] steps_mm has fewer than six steps: a choice among few shows little",
        ),
    ];
    let held = remarks.into_iter().filter(|(holds, _)| *holds);
    held.map(|(_, remark)| remark.to_owned()).chain(two_places(file)).collect()
}

/// Places further apart than this are not one point, mm.
const ONE_POINT_MM: f64 = 1.0;

/// A remark where the file gives one point two places; `None` where it does not.
fn two_places(file: &PipelineFile) -> Option<String> {
    let commanded = file.commanded.as_ref().filter(|section| section.target_is_tool)?;
    let tool = Vector3::from(commanded.flange_from_tool?.xyz_mm);
    let target = file.fit.geometric.target?;
    let apart_mm = (tool - Vector3::from(target.xyz_mm)).norm();
    let reach_mm = ONE_POINT_MM.max(3.0 * target.sd_mm);
    (apart_mm > reach_mm).then(|| {
        format!(
            "[commanded] flange_from_tool and [fit] target are {apart_mm:.1} mm apart, but target_is_tool states that they are one point: \
             mend one of the three"
        )
    })
}

/// Directions and placements of a pipeline file as transforms.
struct Placed {
    up: Option<UnitVector3<f64>>,
    command_frames: Option<CommandFrames>,
    /// The controller's tool, which commands are for. It may be meant to be the target; the position of the target is
    /// measured.
    flange_from_tool: Option<Isometry3<f64>>,
    base: Option<ErrorBase>,
    /// Whether the commanded point is the measured target; `None` without commands.
    target_is_tool: Option<bool>,
    /// Position of the tool tip at the flange, mm.
    tool_tip: Option<Vector3<f64>>,
}

impl Placed {
    fn new(path: &Path, file: &PipelineFile) -> Result<Self> {
        let isometry = |key, placement: &Placement| placed(path, key, placement);
        let base = match &file.tracker.tracker_from_base {
            Some(TrackerFromBase::Surveyed(survey)) => Some(ErrorBase::Surveyed(SurveyedBase {
                tracker_from_base: isometry("[tracker] tracker_from_base", &survey.placement())?,
                sd_mm: survey.sd_mm,
                sd_rad: survey.sd_deg.map(f64::to_radians),
            })),
            Some(TrackerFromBase::Fitted) => Some(ErrorBase::Fitted),
            None => None,
        };
        let up = file.robot.up.map(|up| upwards(path, up)).transpose()?;
        let section = file.commanded.as_ref();
        let (key, tool) = match (section, &file.stations) {
            (Some(section), _) => ("[commanded] flange_from_tool", &section.flange_from_tool),
            (None, Some(stations)) => ("[stations] flange_from_tool", &stations.flange_from_tool),
            (None, None) => ("", &None),
        };
        let tool = tool.as_ref().map(|tool| isometry(key, tool)).transpose()?;
        let base_from_command = section
            .map(|section| isometry("[commanded] base_from_command", &section.base_from_command))
            .transpose()?;
        let frames =
            |base_from_command| CommandFrames { base_from_command, flange_from_tool: tool };
        let tip = file.report.tool_tip.as_ref();
        let placed = Self {
            up,
            command_frames: base_from_command.map(frames),
            flange_from_tool: tool,
            base,
            target_is_tool: section.map(|section| section.target_is_tool),
            tool_tip: tip.map(|tip| tip_at_flange(path, tip, tool.as_ref())).transpose()?,
        };
        if placed.target_is_tool == Some(false) && tool.is_none() {
            let why = "target_is_tool = false states that the commanded point is not the measured target, so no other key states its position at \
                       the flange; state the controller's tool";
            return Err(
                ConfigurationErrorKind::missing("[commanded] flange_from_tool", why).at(path)
            );
        }
        Ok(placed)
    }
}

/// A placement as a transform; the key states its place in the file.
pub(super) fn placed(
    path: &Path,
    key: &'static str,
    placement: &Placement,
) -> Result<Isometry3<f64>> {
    placement
        .isometry()
        .map_err(|source| ConfigurationErrorKind::Fault(format!("{key}: {source}")).at(path))
}

/// The tool tip along the flange's axes, mm.
fn tip_at_flange(
    path: &Path,
    tip: &ToolTip,
    flange_from_tool: Option<&Isometry3<f64>>,
) -> Result<Vector3<f64>> {
    let [x, y, z] = tip.xyz_mm;
    match (tip.frame, flange_from_tool) {
        (TipFrame::Flange, _) => Ok(Vector3::new(x, y, z)),
        (TipFrame::Tool, Some(flange_from_tool)) => {
            Ok((flange_from_tool * Point3::new(x, y, z)).coords)
        }
        (TipFrame::Tool, None) => Err(ConfigurationErrorKind::missing(
            "[commanded] flange_from_tool",
            "[report] tool_tip is stated in the frame of the controller's tool; state where that is, or the tip with \
                     frame = \"flange\"",
        )
        .at(path)),
    }
}

/// Tolerance for the length of a direction, which should be 1; a larger difference is a mistake.
const UNIT: f64 = 0.01;

/// The direction against gravity in the base frame.
pub(super) fn upwards(path: &Path, up: [f64; 3]) -> Result<UnitVector3<f64>> {
    let vector = Vector3::from(up);
    let (direction, norm) = UnitVector3::new_and_get(vector);
    if (norm - 1.0).abs() <= UNIT {
        return Ok(direction);
    }
    Err(ConfigurationErrorKind::setting(
        "[robot] up",
        format!("{up:?}, which has length {norm}"),
        "a direction of length 1, against gravity in the base frame: [0, 0, 1] for an arm on the floor",
    )
    .at(path))
}
