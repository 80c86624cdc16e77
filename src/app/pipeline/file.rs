//! The pipeline file as written: sections, keys and their defaults. What a key means stands in `keys/pipeline.toml`.
//!
//! Missing and unknown keys and values out of range are refused before it is read ([`super::keys::door`]); what keys say together is checked
//! in [`super::configuration`]. What no log states (units, frames, time sources, the order of angles) has no default. The settings that a
//! run's name follows from are this file without its paths and names.

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer, Serialize};

use super::robot_entry::RobotEntry;
use crate::compensation::Conditions;
use crate::fit::full::FullSettings;
use crate::fit::{FitSettings, Mounted, Noise, Source, Uncertainty};
use crate::geometry::{EulerOrder, Placement};
use crate::grid::{GridSettings, Tolerance};
use crate::ingest::{
    CommandedSettings, ControllerSettings, LengthColumns, LengthRead, LengthSource, LoggedLength,
    StationsSettings, TrackerSettings,
};
use crate::io::log::Limits;
use crate::io::robot::Selection;
use crate::join::{JoinSettings, ReadingKind};
use crate::plan::section::PlanSection;
use crate::report::locate::Locate;
use crate::similarity::SimilaritySettings;

#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PipelineFile {
    pub robot: RobotSection,
    /// `[[robots]]`: each robot of a file with several, which is read as one file a robot.
    #[serde(default, skip_serializing)]
    pub robots: Vec<RobotEntry>,
    pub input: InputSection,
    /// `[controller]`: joint angles in a log; absent where sessions are tables.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub controller: Option<ControllerSettings>,
    /// `[stations]`: columns of the tables of stations; absent where sessions are logs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stations: Option<StationsSettings>,
    pub commanded: Option<CommandedSection>,
    pub tracker: TrackerSection,
    #[serde(default)]
    pub join: JoinSettings,
    #[serde(default)]
    pub fit: FitSection,
    #[serde(default)]
    pub similarity: SimilaritySettings,
    pub grid: GridSettings,
    pub tolerance: Tolerance,
    #[serde(default)]
    pub report: ReportSection,
    #[serde(default)]
    pub limits: Limits,
    /// `[plan]`, for planning alone: no run follows from it.
    #[serde(skip_serializing)]
    pub plan: Option<PlanSection>,
    pub output: OutputSection,
}

impl PipelineFile {
    pub fn tracker_source(&self) -> Source {
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
        columns.map(LengthColumns::source).chain(logged.map(LoggedLength::source)).collect()
    }

    /// Place among the sources of the first instrument of one length: behind that of places, where there is one.
    pub fn first_length(&self) -> usize {
        self.stations.as_ref().map_or(1, StationsSettings::first_length)
    }

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
        let (sources, repeatability_mm) = (sources.collect(), self.fit.geometric.repeatability_mm);
        Noise { sources, repeatability_mm, stated: Vec::new() }
    }
}

#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct RobotSection {
    /// The robot file, relative to the pipeline file. A run's inputs hold its digest.
    #[serde(skip_serializing)]
    pub file: PathBuf,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tip: Option<String>,
    /// The controller's names of the reported joints, from base to flange. Absent: those of the robot file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joints: Option<Vec<String>>,
    #[serde(skip_serializing)]
    pub name: Option<String>,
    pub up: Option<[f64; 3]>,
    #[serde(default)]
    pub valid_for: Conditions,
}

impl RobotSection {
    /// The arm in the robot file, and the names of its joints.
    pub fn selection(&self) -> Selection {
        Selection { base: self.base.clone(), tip: self.tip.clone(), joints: self.joints.clone() }
    }
}

#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct InputSection {
    #[serde(skip_serializing)]
    pub folder: PathBuf,
    #[serde(skip_serializing)]
    pub sessions_by: ToldBy,
    #[serde(skip_serializing)]
    pub robots_by: ToldBy,
    #[serde(skip_serializing)]
    pub robots: Option<PathBuf>,
    #[serde(skip_serializing)]
    pub sessions: Option<Vec<String>>,
    #[serde(skip_serializing)]
    pub test: Vec<String>,
    #[serde(skip_serializing)]
    pub controller: LogNames,
    #[serde(skip_serializing)]
    pub tracker: LogNames,
    #[serde(skip_serializing)]
    pub stations: Option<LogNames>,
    #[serde(skip_serializing)]
    pub corrected_targets: LogNames,
    #[serde(skip_serializing)]
    pub pool: Pool,
    #[serde(skip_serializing)]
    pub pool_latest: Option<usize>,
    #[serde(skip_serializing)]
    pub settle_s: u64,
    pub max_lost_share: f64,
    pub max_rejected_share: f64,
}

impl Default for InputSection {
    fn default() -> Self {
        let log = |side: &str| LogNames::One(format!("{side}.mcap"));
        let corrected = ["csv", "parquet", "json"].map(|form| format!("corrected*.{form}"));
        Self {
            folder: PathBuf::new(),
            sessions_by: ToldBy::Folder,
            robots_by: ToldBy::Folder,
            robots: None,
            sessions: None,
            test: Vec::new(),
            controller: log("controller"),
            tracker: log("tracker"),
            stations: None,
            corrected_targets: LogNames::Several(corrected.into()),
            pool: Pool::Each,
            pool_latest: None,
            // Recorders write whole chunks. The slowest log is the tracker's: 20 readings a second of 100 bytes fill a chunk of
            // 1 MiB in nine minutes, during which its file does not change.
            settle_s: 600,
            // A log that lost more no longer shows the whole session.
            max_lost_share: 0.01,
            // Where one message in twenty cannot be used, the cell or the pipeline file has a fault.
            max_rejected_share: 0.05,
        }
    }
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
    pub fn patterns(&self) -> &[String] {
        match self {
            Self::One(pattern) => std::slice::from_ref(pattern),
            Self::Several(patterns) => patterns,
        }
    }

    #[must_use]
    pub fn of(&self, session: &str) -> Self {
        let patterns = self.patterns().iter();
        Self::Several(patterns.map(|pattern| pattern.replace(SESSION_PLACE, session)).collect())
    }
}

/// The placeholder for a session's name in the names of its files.
pub const SESSION_PLACE: &str = "{session}";
/// Where the name of a robot is in names of files.
pub const ROBOT_PLACE: &str = "{robot}";

impl fmt::Display for LogNames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.patterns().join(", "))
    }
}

/// What tells the session that a file is of, or the robot that a session is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ToldBy {
    /// The folder that it is in, by its name.
    #[default]
    Folder,
    /// The names of files, by what stands in the place of `{session}` or `{robot}`.
    FileName,
    /// The logs' metadata record `session`, under `session` or `robot`.
    Metadata,
    /// Rows of tables, in the column `[stations] session` or `[stations] robot`.
    Column,
}

impl InputSection {
    /// The definition of a session, as text.
    pub fn session_in_words(&self) -> String {
        let (controller, tracker) = (&self.controller, &self.tracker);
        if let Some(stations) = &self.stations {
            return match self.sessions_by {
                ToldBy::Folder => format!("a sub-folder with {stations}"),
                ToldBy::FileName | ToldBy::Metadata => format!("a file {stations}"),
                ToldBy::Column => {
                    format!("rows of {stations} with one name in the column [stations] session")
                }
            };
        }
        match self.sessions_by {
            ToldBy::Folder => format!("a sub-folder with {controller} and {tracker}"),
            ToldBy::FileName => format!("a pair of files {controller} and {tracker}"),
            ToldBy::Metadata | ToldBy::Column => format!(
                "two files, one of {controller} and one of {tracker}, with the same name in a metadata record `session`"
            ),
        }
    }
}

/// The sessions that are learnt from together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Pool {
    #[default]
    Each,
    /// All of them, in one fit named `pooled`.
    All,
    /// Each one with all before it, in the order listed (by name where they are found).
    Until,
}

#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
pub struct CommandedSection {
    /// The frame commands are stated in, in the base frame of the robot file.
    pub base_from_command: Placement,
    pub flange_from_tool: Option<Placement>,
    pub target_is_tool: bool,
    /// Topic, time source, unit and fields; absent where sessions are tables.
    #[serde(flatten, deserialize_with = "of_log")]
    pub mapping: Option<CommandedSettings>,
}

#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
pub struct TrackerSection {
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
    pub tracker_from_base: Option<TrackerFromBase>,
    /// Topic, time source, unit and fields; absent where sessions are tables.
    #[serde(flatten, deserialize_with = "of_log")]
    pub mapping: Option<TrackerSettings>,
}

/// The keys of a section that are about a log; `None` without a `topic`, where sessions are tables.
fn of_log<'de, D: Deserializer<'de>, T: DeserializeOwned>(from: D) -> Result<Option<T>, D::Error> {
    let keys = toml::Table::deserialize(from)?;
    keys.contains_key("topic").then(|| keys.try_into()).transpose().map_err(D::Error::custom)
}

impl TrackerSection {
    /// The surveyed base; `None` of one that is fitted, or of which nothing is stated.
    pub const fn survey(&self) -> Option<&Survey> {
        match &self.tracker_from_base {
            Some(TrackerFromBase::Surveyed(survey)) => Some(survey),
            Some(TrackerFromBase::Fitted) | None => None,
        }
    }

    /// Whether the readings are of a camera on the flange.
    pub fn is_eye_in_hand(&self) -> bool {
        let camera = self.uncertainty.camera();
        camera.is_some_and(|camera| camera.mounted == Mounted::Flange)
    }
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
    pub xyz_mm: [f64; 3],
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quaternion_xyzw: Option<[f64; 4]>,
    /// Rotation as three angles, degrees; `euler_order` says about what.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub euler_deg: Option<[f64; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub euler_order: Option<EulerOrder>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sd_mm: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sd_deg: Option<f64>,
}

impl Survey {
    pub const fn placement(&self) -> Placement {
        let Self { xyz_mm, quaternion_xyzw, euler_deg, euler_order, .. } = *self;
        Placement { xyz_mm, quaternion_xyzw, euler_deg, euler_order }
    }
}

/// `[fit]`: the geometric fit, and the full error model under `full`.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, Serialize)]
#[serde(try_from = "BTreeMap<String, toml::Value>")]
pub struct FitSection {
    #[serde(flatten)]
    pub geometric: FitSettings,
    pub full: FullSettings,
}

#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct ReportSection {
    /// How base and target of a session that only judges are found, and from how many of its stations; the others judge. Each
    /// session of a pool is judged so too, by a training on the others, always with a target of its own.
    pub locate: Locate,
    pub leave_sessions_out: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plan: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tool_tip: Option<ToolTip>,
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ToolTip {
    pub frame: TipFrame,
    pub xyz_mm: [f64; 3],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TipFrame {
    Flange,
    /// The controller's own tool, `[commanded] flange_from_tool`.
    Tool,
}

#[derive(Debug, Clone, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct OutputSection {
    #[serde(skip_serializing)]
    pub lake: PathBuf,
    #[serde(default)]
    pub logs: bool,
}

impl Default for ReportSection {
    fn default() -> Self {
        Self { locate: Locate::default(), leave_sessions_out: true, plan: None, tool_tip: None }
    }
}

impl TryFrom<BTreeMap<String, toml::Value>> for FitSection {
    type Error = toml::de::Error;
    fn try_from(mut keys: BTreeMap<String, toml::Value>) -> Result<Self, toml::de::Error> {
        let full = keys.remove("full").map(toml::Value::try_into).transpose()?;
        let geometric: toml::Table = keys.into_iter().collect();
        Ok(Self { geometric: geometric.try_into()?, full: full.unwrap_or_default() })
    }
}
