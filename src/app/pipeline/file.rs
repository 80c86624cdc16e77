//! The pipeline file as written: sections, keys and their defaults.
//!
//! Unknown keys are refused, and what no log states (units, frames, time sources, the order of angles) has no default.
//! What the file says is checked in [`super::configuration`]; the settings that a run's name follows from are this file without
//! its paths and names.

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use thiserror::Error;

use super::robot_entry::RobotEntry;
use crate::compensation::Conditions;
use crate::fit::full::FullSettings;
use crate::fit::{
    CameraUncertainty, FitSettings, Mounted, Noise, Source, TrackerUncertainty, Uncertainty,
};
use crate::geometry::{EulerOrder, Placement};
use crate::grid::{GridSettings, Tolerance};
use crate::ingest::{
    CommandedFile, CommandedSettings, ControllerSettings, LengthColumns, LengthRead, LengthSource,
    LengthUnit, LoggedLength, LoggedReference, LoggedTarget, MissingConvention, PoseFields,
    StationsSettings, TimeSource, TrackerFile, TrackerSettings,
};
use crate::io::log::Limits;
use crate::io::robot::Selection;
use crate::join::{JoinSettings, ReadingKind};
use crate::plan::section::PlanSection;
use crate::report::locate::Locate;
use crate::similarity::SimilaritySettings;

/// A whole pipeline file.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, remote = "Self")]
pub struct PipelineFile {
    /// `[robot]`: the arm, and the conditions that its results are valid for.
    pub robot: RobotSection,
    /// `[[robots]]`: each robot of a file with several, which is read as one file a robot.
    #[serde(default, skip_serializing)]
    pub robots: Vec<RobotEntry>,
    /// `[input]`: the place of the sessions, and the files of each.
    pub input: InputSection,
    /// `[controller]`: joint angles in a log; absent where sessions are tables.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub controller: Option<ControllerSettings>,
    /// `[stations]`: columns of the tables of stations; absent where sessions are logs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stations: Option<StationsSettings>,
    /// `[commanded]`, where the controller's log has commands.
    pub commanded: Option<CommandedSection>,
    /// `[tracker]`: readings of the target.
    pub tracker: TrackerSection,
    /// `[join]`.
    #[serde(default)]
    pub join: JoinSettings,
    /// `[fit]` with `[fit.full]`.
    #[serde(default)]
    pub fit: FitSection,
    /// `[similarity]`.
    #[serde(default)]
    pub similarity: SimilaritySettings,
    /// `[grid]`.
    pub grid: GridSettings,
    /// `[tolerance]`.
    pub tolerance: Tolerance,
    /// `[report]`.
    #[serde(default)]
    pub report: ReportSection,
    /// `[limits]`: the largest sizes that a log may have.
    #[serde(default)]
    pub limits: Limits,
    /// `[plan]`, for planning alone: no run follows from it.
    #[serde(skip_serializing)]
    pub plan: Option<PlanSection>,
    /// `[output]`.
    pub output: OutputSection,
}

impl<'de> Deserialize<'de> for PipelineFile {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let file = Self::deserialize(from)?;
        recorded_one_way(&file).map_err(D::Error::custom)?;
        Ok(file)
    }
}

impl Serialize for PipelineFile {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        Self::serialize(self, to)
    }
}

/// Checks that a file is about logs or about tables of stations, with all that either needs.
fn recorded_one_way(file: &PipelineFile) -> Result<(), String> {
    let tracker = file.tracker.mapping.is_some();
    let commanded = file.commanded.as_ref().map(|section| section.mapping.is_some());
    if file.stations.is_none() {
        let topic = "has no `topic`, which logs need; for a table of stations write [stations]";
        return match (&file.controller, tracker, commanded) {
            _ if file.input.stations.is_some() => {
                Err("[input] stations names a table, so there has to be a section [stations] with its columns".to_owned())
            }
            (None, ..) => Err("missing section [controller]; for a table of stations write [stations]".to_owned()),
            (_, false, _) => Err(format!("[tracker] {topic}")),
            (_, _, Some(false)) => Err(format!("[commanded] {topic}")),
            _ => Ok(()),
        };
    }
    let unused = [
        (file.controller.is_some(), "[controller]"),
        (tracker, "[tracker] topic"),
        (commanded == Some(true), "[commanded] topic"),
    ];
    if let Some((_, key)) = unused.iter().find(|(is_there, _)| *is_there) {
        return Err(format!(
            "{key} is for logs, and sessions are tables of stations here: leave it out"
        ));
    }
    if file.input.stations.is_none() {
        return Err("[input] has no `stations`, the table of a session: a name or pattern like \"measured.csv\"".to_owned());
    }
    Ok(())
}

impl PipelineFile {
    /// The uncertainty of the tracker's measurements alone.
    pub fn noise_of_tracker(&self) -> Noise {
        Noise::of_one(self.tracker_source(), self.fit.geometric.repeatability_mm)
    }

    fn tracker_source(&self) -> Source {
        Source {
            reads: if self.fit.geometric.orientations {
                ReadingKind::Pose
            } else {
                ReadingKind::Point
            },
            uncertainty: self.tracker.uncertainty,
        }
    }

    /// The instruments of one length, in the order of their sources.
    pub fn lengths(&self) -> Vec<LengthSource<'_>> {
        let columns = self.stations.iter().flat_map(|own| &own.lengths);
        let logged = self.tracker.mapping.iter().flat_map(|own| &own.lengths);
        let columns = columns.map(LengthColumns::source);
        columns.chain(logged.map(LoggedLength::source)).collect()
    }

    /// Place among the sources of the first instrument of one length: behind that of places, where there is one.
    pub fn first_length(&self) -> usize {
        let stations = self.stations.as_ref();
        stations.map_or(1, StationsSettings::first_length)
    }

    /// The measurement's uncertainty, for the fit.
    pub fn noise(&self) -> Noise {
        let tracker = self.tracker_source();
        let lengths = self.lengths().into_iter().map(|own| Source {
            reads: match own.reads {
                LengthRead::Distance => ReadingKind::Distance,
                LengthRead::Height => ReadingKind::Height,
            },
            ..tracker
        });
        let places = self.first_length() > 0;
        let sources = places.then_some(tracker).into_iter().chain(lengths);
        Noise {
            sources: sources.collect(),
            repeatability_mm: self.fit.geometric.repeatability_mm,
            stated: Vec::new(),
        }
    }
}

/// `[robot]`.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct RobotSection {
    /// The robot file, relative to the pipeline file. A run's inputs hold its digest.
    #[serde(skip_serializing)]
    pub file: PathBuf,
    /// The link of a URDF that is the base. Absent: its root.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<String>,
    /// The link of a URDF that is the flange. Absent: the only link that ends a chain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tip: Option<String>,
    /// The controller's names of the reported joints, from base to flange. Absent: those of the robot file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joints: Option<Vec<String>>,
    /// The robot's name in the tables. Absent: `robot` of the logs' metadata record `session`.
    #[serde(skip_serializing)]
    pub name: Option<String>,
    /// Direction against gravity, in the base frame: `[0, 0, 1]` for an arm on the floor. Absent: gravity is left out of
    /// the model.
    pub up: Option<[f64; 3]>,
    /// `[robot.valid_for]`: the conditions that the results are valid for.
    #[serde(default)]
    pub valid_for: Conditions,
}

impl RobotSection {
    /// The arm in the robot file, and the names of its joints.
    pub fn selection(&self) -> Selection {
        Selection { base: self.base.clone(), tip: self.tip.clone(), joints: self.joints.clone() }
    }
}

/// `[input]`.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct InputSection {
    /// The folder with the sessions, relative to the pipeline file.
    #[serde(skip_serializing)]
    pub folder: PathBuf,
    /// The way in which files belong to sessions.
    #[serde(default, skip_serializing)]
    pub sessions_by: SessionsBy,
    /// The way in which sessions belong to robots, where the file has several.
    #[serde(default, skip_serializing)]
    pub robots_by: RobotsBy,
    /// The table of the robots, instead of `[[robots]]`.
    #[serde(default, skip_serializing)]
    pub robots: Option<PathBuf>,
    /// Sessions to learn from. Absent: every one that has both logs.
    #[serde(skip_serializing)]
    pub sessions: Option<Vec<String>>,
    /// Sessions that only judge.
    #[serde(default, skip_serializing)]
    pub test: Vec<String>,
    /// The controller's log: a name in the session's folder, a pattern with `*` or `?`, or a list of them.
    #[serde(default = "controller_log", skip_serializing)]
    pub controller: LogNames,
    /// The tracker's log; it may be the same file.
    #[serde(default = "tracker_log", skip_serializing)]
    pub tracker: LogNames,
    /// The table of stations, instead of the two logs: a name in the session's folder or a pattern.
    #[serde(default, skip_serializing)]
    pub stations: Option<LogNames>,
    /// The file of corrected targets that drove a session, in its folder: a name, a pattern or a list of them. A session
    /// whose folder has one is also judged by it.
    #[serde(default = "corrected_targets", skip_serializing)]
    pub corrected_targets: LogNames,
    /// The sessions that are learnt from together.
    #[serde(default, skip_serializing)]
    pub pool: Pool,
    /// The most sessions that a pool learns from, the latest of them; absent: all.
    #[serde(default, skip_serializing)]
    pub pool_latest: Option<usize>,
    /// Time for which a log without an end must not have changed to be taken as damaged, s; until then its session waits.
    #[serde(default = "settle_s", skip_serializing)]
    pub settle_s: u64,
    /// Share of a log's bytes or messages, or of those of a topic that is read, that may be lost before its session fails.
    #[serde(default = "max_lost_share")]
    pub max_lost_share: f64,
    /// Share of a topic's messages that may be rejected before a result does not count as good.
    #[serde(default = "max_rejected_share")]
    pub max_rejected_share: f64,
}

/// The files that one side of a session was recorded into, in any order: they are ordered by the times in them.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, Serialize)]
#[serde(untagged)]
pub enum LogNames {
    /// A name, or a pattern.
    One(String),
    Several(Vec<String>),
}

impl LogNames {
    /// Each name or pattern.
    pub fn patterns(&self) -> &[String] {
        match self {
            Self::One(pattern) => std::slice::from_ref(pattern),
            Self::Several(patterns) => patterns,
        }
    }
}

/// The placeholder for a session's name in the names of its files.
pub const SESSION_PLACE: &str = "{session}";
/// Where the name of a robot is in names of files.
pub const ROBOT_PLACE: &str = "{robot}";

impl LogNames {
    /// The names or patterns for a session.
    #[must_use]
    pub fn of(&self, session: &str) -> Self {
        let patterns = self.patterns().iter();
        Self::Several(patterns.map(|pattern| pattern.replace(SESSION_PLACE, session)).collect())
    }
}

impl fmt::Display for LogNames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.patterns().join(", "))
    }
}

/// The way in which sessions belong to robots.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RobotsBy {
    /// Each robot has a folder with its sessions.
    #[default]
    Folder,
    /// Names of files contain the robot's name, in the place of `{robot}`.
    FileName,
    /// The logs' metadata record `session` names it under `robot`.
    Metadata,
    /// Rows of tables name it in the column `[stations] robot`.
    Column,
}

/// The way in which files belong to sessions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SessionsBy {
    /// Each sub-folder is a session with the folder's name.
    #[default]
    Folder,
    /// Files of the folder whose names contain the session's name, in the place of `{session}` in `controller` and
    /// `tracker`.
    FileName,
    /// Files of the folder whose metadata record `session` names it under `session`.
    Metadata,
    /// Rows of tables in the folder whose column `[stations] session` names it.
    Column,
}

impl SessionsBy {
    /// The definition of a session, as text.
    pub fn of(self, input: &InputSection) -> String {
        let (controller, tracker) = (&input.controller, &input.tracker);
        if let Some(stations) = &input.stations {
            return match self {
                Self::Folder => format!("a sub-folder with {stations}"),
                Self::FileName | Self::Metadata => format!("a file {stations}"),
                Self::Column => {
                    format!("rows of {stations} with one name in the column [stations] session")
                }
            };
        }
        match self {
            Self::Folder => format!("a sub-folder with {controller} and {tracker}"),
            Self::FileName => format!("a pair of files {controller} and {tracker}"),
            Self::Metadata | Self::Column => format!(
                "two files, one of {controller} and one of {tracker}, with the same name in a metadata record `session`"
            ),
        }
    }
}

/// The sessions that are learnt from together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Pool {
    /// Each session by itself.
    #[default]
    Each,
    /// All of them, in one fit named `pooled`.
    All,
    /// Each one with all before it, in the order listed (by name where they are found).
    Until,
}

/// `[commanded]`.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(try_from = "CommandedKeys")]
pub struct CommandedSection {
    /// Topic, time source, unit and fields; absent where sessions are tables.
    #[serde(flatten)]
    pub mapping: Option<CommandedSettings>,
    /// The frame commands are stated in, in the base frame of the robot file.
    pub base_from_command: Placement,
    /// The controller's tool at the flange.
    pub flange_from_tool: Option<Placement>,
    /// Whether the commanded point is the measured target.
    pub target_is_tool: bool,
}

/// `[commanded]` as written in the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CommandedKeys {
    topic: Option<String>,
    time: Option<TimeSource>,
    unit: Option<LengthUnit>,
    #[serde(default)]
    fields: PoseFields,
    frame: Option<String>,
    base_from_command: Option<Placement>,
    flange_from_tool: Option<Placement>,
    target_is_tool: Option<bool>,
}

/// `[tracker]`.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(try_from = "TrackerKeys")]
pub struct TrackerSection {
    /// Topic, time source, unit and fields; absent where sessions are tables.
    #[serde(flatten)]
    pub mapping: Option<TrackerSettings>,
    /// The instrument's uncertainty: `uncertainty`, or `camera`.
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
    /// Pose of the arm's base in the tracker's frame: errors, table and verdict are stated in that base. Absent: fitted.
    pub tracker_from_base: Option<TrackerFromBase>,
}

impl TrackerSection {
    /// Whether the readings are of a camera on the flange.
    pub fn is_eye_in_hand(&self) -> bool {
        let camera = self.uncertainty.camera();
        camera.is_some_and(|camera| camera.mounted == Mounted::Flange)
    }
}

/// `[tracker]` as written in the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TrackerKeys {
    topic: Option<String>,
    time: Option<TimeSource>,
    unit: Option<LengthUnit>,
    #[serde(default)]
    fields: PoseFields,
    frame: Option<String>,
    temperature: Option<String>,
    #[serde(default)]
    ignore_orientation: bool,
    #[serde(default)]
    targets: Vec<LoggedTarget>,
    #[serde(default)]
    references: Vec<LoggedReference>,
    #[serde(default)]
    lengths: Vec<LoggedLength>,
    uncertainty: Option<TrackerUncertainty>,
    camera: Option<CameraUncertainty>,
    tracker_from_base: Option<TrackerFromBase>,
}

/// Pose of the arm's base in the tracker's frame.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum TrackerFromBase {
    /// Found by the base + target fit: `"fitted"`.
    Fitted,
    /// Measured by other means: `{ surveyed = { xyz_mm = …, … } }`.
    Surveyed(Survey),
}

/// A surveyed base: its placement and how well it was surveyed.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Survey {
    /// Where the base's origin lies in the tracker's frame, mm.
    pub xyz_mm: [f64; 3],
    /// Rotation as a quaternion x y z w.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quaternion_xyzw: Option<[f64; 4]>,
    /// Rotation as three angles, degrees; `euler_order` says about what.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub euler_deg: Option<[f64; 3]>,
    /// The order of the three angles; it has no default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub euler_order: Option<EulerOrder>,
    /// Standard deviation of each coordinate of the origin, mm; without it verdict and corrections do not count the survey.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sd_mm: Option<f64>,
    /// Standard deviation of the rotation about each axis, degrees; without it verdict and corrections do not count the survey.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sd_deg: Option<f64>,
}

impl Survey {
    /// The placement without its uncertainty.
    pub const fn placement(&self) -> Placement {
        Placement {
            xyz_mm: self.xyz_mm,
            quaternion_xyzw: self.quaternion_xyzw,
            euler_deg: self.euler_deg,
            euler_order: self.euler_order,
        }
    }
}

/// `[fit]`: the geometric fit, and the full error model under `full`.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, Serialize)]
#[serde(try_from = "BTreeMap<String, toml::Value>")]
pub struct FitSection {
    #[serde(flatten)]
    pub geometric: FitSettings,
    /// `[fit.full]`.
    pub full: FullSettings,
}

/// `[report]`.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct ReportSection {
    /// How base and target of a session that only judges are found, and from how many of its stations; the others judge. Each
    /// session of a pool is judged so too, by a training on the others, always with a target of its own.
    pub locate: Locate,
    /// Whether each session of a pool is judged by a training on the others.
    pub leave_sessions_out: bool,
    /// The id of the plan that the sessions were measured by, where their logs do not state it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plan: Option<String>,
    /// Position of the tool tip, for figures there. Absent: no such figures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tool_tip: Option<ToolTip>,
}

/// Position of the tool tip.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ToolTip {
    /// The frame that it is stated in.
    pub frame: TipFrame,
    /// Position in that frame, mm.
    pub xyz_mm: [f64; 3],
}

/// Frames that a tool tip can be stated in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TipFrame {
    Flange,
    /// The controller's own tool, `[commanded] flange_from_tool`.
    Tool,
}

/// `[output]`.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct OutputSection {
    /// The folder of the published tables, relative to the pipeline file.
    #[serde(skip_serializing)]
    pub lake: PathBuf,
    /// Whether the decoded samples of the logs are published as table `logs`.
    #[serde(default)]
    pub logs: bool,
}

impl Default for ReportSection {
    fn default() -> Self {
        Self { locate: Locate::default(), leave_sessions_out: true, plan: None, tool_tip: None }
    }
}

fn controller_log() -> LogNames {
    LogNames::One("controller.mcap".to_owned())
}

fn tracker_log() -> LogNames {
    LogNames::One("tracker.mcap".to_owned())
}

/// Recorders write whole chunks. The slowest log is the tracker's: 20 readings a second of 100 bytes fill a chunk of 1 MiB in
/// nine minutes, during which its file does not change.
const fn settle_s() -> u64 {
    600
}

fn corrected_targets() -> LogNames {
    LogNames::Several(["csv", "parquet", "json"].map(|form| format!("corrected*.{form}")).into())
}

/// A log that lost more than a hundredth of its bytes or messages no longer shows the whole session.
const fn max_lost_share() -> f64 {
    0.01
}

/// Where one message in twenty cannot be used, the cell or the pipeline file has a fault.
const fn max_rejected_share() -> f64 {
    0.05
}

impl TryFrom<CommandedKeys> for CommandedSection {
    type Error = MissingConvention;
    fn try_from(keys: CommandedKeys) -> Result<Self, MissingConvention> {
        let missing = |key, choices| MissingConvention::new("commanded", key, choices);
        let of_topic = |topic| CommandedFile {
            topic,
            time: keys.time,
            unit: keys.unit,
            fields: keys.fields,
            frame: keys.frame,
        };
        Ok(Self {
            mapping: keys.topic.map(|topic| of_topic(topic).try_into()).transpose()?,
            base_from_command: keys
                .base_from_command
                .ok_or(missing("base_from_command", PLACED))?,
            flange_from_tool: keys.flange_from_tool,
            target_is_tool: keys.target_is_tool.ok_or(missing("target_is_tool", SAME_POINT))?,
        })
    }
}

/// The fault of a section `[tracker]`.
#[derive(Debug, Error)]
pub enum TrackerSectionError {
    /// It leaves out what has no default.
    #[error(transparent)]
    Missing(#[from] MissingConvention),
    /// It states two kinds of instrument.
    #[error(
        "[tracker] has `uncertainty` and `camera`: keep the one of the instrument that measured"
    )]
    Both,
    /// It states what is in a log, and names no topic.
    #[error(
        "[tracker] has `{key}` and no `topic`: {key} are of a log; a table of stations has them in [stations]"
    )]
    OfNoLog { key: &'static str },
}

impl TryFrom<TrackerKeys> for TrackerSection {
    type Error = TrackerSectionError;
    fn try_from(keys: TrackerKeys) -> Result<Self, TrackerSectionError> {
        let of_logs = [
            ("targets", keys.targets.is_empty()),
            ("references", keys.references.is_empty()),
            ("lengths", keys.lengths.is_empty()),
        ];
        if let Some((key, _)) = of_logs.into_iter().find(|(_, is_empty)| !is_empty)
            && keys.topic.is_none()
        {
            return Err(TrackerSectionError::OfNoLog { key });
        }
        let of_topic = |topic| TrackerFile {
            topic,
            time: keys.time,
            unit: keys.unit,
            fields: keys.fields,
            frame: keys.frame,
            temperature: keys.temperature,
            ignore_orientation: keys.ignore_orientation,
            targets: keys.targets,
            references: keys.references,
            lengths: keys.lengths,
        };
        Ok(Self {
            mapping: keys.topic.map(|topic| of_topic(topic).try_into()).transpose()?,
            uncertainty: match (keys.uncertainty, keys.camera) {
                (Some(tracker), None) => Uncertainty::Tracker(tracker),
                (None, Some(camera)) => Uncertainty::Camera(camera),
                (Some(_), Some(_)) => return Err(TrackerSectionError::Both),
                (None, None) => {
                    return Err(MissingConvention::new("tracker", "uncertainty", DATA_SHEET).into());
                }
            },
            tracker_from_base: keys.tracker_from_base,
        })
    }
}

/// Choices for `base_from_command`.
const PLACED: &str = "{ xyz_mm = [0, 0, 0], quaternion_xyzw = [0, 0, 0, 1] } where commands are stated in the robot \
     file's base frame, or where their frame lies in it";
/// Choices for `target_is_tool`.
const SAME_POINT: &str =
    "true where the commanded point is the measured target, false where it is another";
/// Choices for `uncertainty`.
const DATA_SHEET: &str = "the values of the data sheet, for example { range_um = 10, range_um_per_m = 0.3, transverse_um = 15, \
     transverse_um_per_m = 6, divisor = 2 }, or of a camera `camera` in its place: { focal_px = 1500, noise_px = 0.2, target_mm = 100 }";

impl TryFrom<BTreeMap<String, toml::Value>> for FitSection {
    type Error = toml::de::Error;
    fn try_from(mut keys: BTreeMap<String, toml::Value>) -> Result<Self, toml::de::Error> {
        let full = keys.remove("full").map(toml::Value::try_into).transpose()?;
        let geometric: toml::Table = keys.into_iter().collect();
        Ok(Self { geometric: geometric.try_into()?, full: full.unwrap_or_default() })
    }
}
