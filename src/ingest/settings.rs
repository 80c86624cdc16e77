//! What the pipeline file says of the two logs: topics, clocks, units.
//!
//! Units and time sources are conventions that a log does not state, so they have no default. The common message types
//! need no more; for any other, `fields` names where in a message things are.

mod fields;

use std::f64::consts::PI;
use std::fmt;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::units::MM_PER_M;

pub use fields::{
    AngleFields, JointFields, NumberStamp, PoseFields, StampField, TimeUnit, WrongFields,
};

/// `[controller]`: joint angles.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "ControllerFile")]
pub struct ControllerSettings {
    /// Topic of the joint states.
    pub topic: String,
    /// Which time of a message is its time.
    pub time: TimeSource,
    /// Unit of the joint angles.
    pub unit: AngleUnit,
    /// Where a message has them, unless its type is a common one.
    #[serde(skip_serializing_if = "JointFields::is_empty")]
    pub fields: JointFields,
}

/// `[commanded]`: commanded poses, in the controller's log.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "CommandedFile")]
pub struct CommandedSettings {
    /// Topic of the commanded poses.
    pub topic: String,
    /// Which time of a message is its time.
    pub time: TimeSource,
    /// Unit of the positions.
    pub unit: LengthUnit,
    /// Where a message has them, unless its type is a common one.
    #[serde(skip_serializing_if = "PoseFields::is_empty")]
    pub fields: PoseFields,
    /// The frame that messages must name to be used; others are left out. Absent: none is asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<String>,
}

/// `[tracker]`: readings of the target, in the tracker's log.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "TrackerFile")]
pub struct TrackerSettings {
    /// Topic of the readings.
    pub topic: String,
    /// Which time of a message is its time.
    pub time: TimeSource,
    /// Unit of the positions.
    pub unit: LengthUnit,
    /// Topic of the temperatures (°C, same time source), where the log has them.
    pub temperature: Option<String>,
    /// Leave orientations out: a plain reflector whose driver fills in a pose message all the same.
    pub ignore_orientation: bool,
    /// Where a message has them, unless its type is a common one.
    #[serde(skip_serializing_if = "PoseFields::is_empty")]
    pub fields: PoseFields,
    /// The frame that messages must name to be used; others are left out. Absent: none is asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<String>,
}

/// Which of a message's three times is its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TimeSource {
    /// The message's own stamp (`header.stamp`, `timestamp`, or what `fields` names): when it was measured, in the
    /// instrument's clock.
    Header,
    /// When it was published, in the publisher's clock.
    Publish,
    /// When the recorder got it, in the recorder's clock.
    Log,
}

/// Unit of angles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AngleUnit {
    /// Radian.
    Rad,
    /// Degree.
    Deg,
}

/// Unit of lengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LengthUnit {
    /// Metre.
    M,
    /// Millimetre.
    Mm,
}

/// Everything needed to read the samples of a session from its logs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mapping {
    /// `[controller]`.
    pub controller: ControllerSettings,
    /// `[commanded]`, where the log has commands.
    pub commanded: Option<CommandedSettings>,
    /// `[tracker]`.
    pub tracker: TrackerSettings,
    /// Names under which the controller reports the arm's joints, in the arm's order.
    pub joints: Vec<String>,
}

impl AngleUnit {
    /// rad in one of it.
    pub(super) const fn to_rad(self) -> f64 {
        match self {
            Self::Rad => 1.0,
            Self::Deg => PI / 180.0,
        }
    }
}

impl LengthUnit {
    /// mm in one of it.
    pub const fn to_mm(self) -> f64 {
        match self {
            Self::M => MM_PER_M,
            Self::Mm => 1.0,
        }
    }
}

/// `[controller]` as it stands in the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ControllerFile {
    topic: String,
    time: Option<TimeSource>,
    unit: Option<AngleUnit>,
    #[serde(default)]
    fields: JointFields,
}

/// `[commanded]` as it stands in the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CommandedFile {
    pub(crate) topic: String,
    pub(crate) time: Option<TimeSource>,
    pub(crate) unit: Option<LengthUnit>,
    #[serde(default)]
    pub(crate) fields: PoseFields,
    pub(crate) frame: Option<String>,
}

/// `[tracker]` as it stands in the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TrackerFile {
    pub(crate) topic: String,
    pub(crate) time: Option<TimeSource>,
    pub(crate) unit: Option<LengthUnit>,
    pub(crate) temperature: Option<String>,
    #[serde(default)]
    pub(crate) ignore_orientation: bool,
    #[serde(default)]
    pub(crate) fields: PoseFields,
    pub(crate) frame: Option<String>,
}

/// A convention that the pipeline file leaves out.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "[{section}] has no `{key}`, which no log states and nothing is assumed for: choose {choices}"
)]
pub struct MissingConvention {
    section: &'static str,
    key: &'static str,
    choices: &'static str,
}

impl MissingConvention {
    /// That `[section]` leaves out `key`.
    pub(crate) const fn new(
        section: &'static str,
        key: &'static str,
        choices: &'static str,
    ) -> Self {
        Self {
            section,
            key,
            choices,
        }
    }
}

/// Choices for `time`.
const TIMES: &str =
    "\"header\" (the message's own stamp), \"publish\" or \"log\" (when it was recorded)";
/// Choices for `unit` of angles.
const ANGLES: &str = "\"rad\" or \"deg\"";
/// Choices for `unit` of lengths.
const LENGTHS: &str = "\"m\" or \"mm\"";

impl TryFrom<ControllerFile> for ControllerSettings {
    type Error = MissingConvention;
    fn try_from(file: ControllerFile) -> Result<Self, MissingConvention> {
        Ok(Self {
            topic: file.topic,
            time: file
                .time
                .ok_or(MissingConvention::new("controller", "time", TIMES))?,
            unit: file
                .unit
                .ok_or(MissingConvention::new("controller", "unit", ANGLES))?,
            fields: file.fields,
        })
    }
}

impl TryFrom<CommandedFile> for CommandedSettings {
    type Error = MissingConvention;
    fn try_from(file: CommandedFile) -> Result<Self, MissingConvention> {
        Ok(Self {
            topic: file.topic,
            time: file
                .time
                .ok_or(MissingConvention::new("commanded", "time", TIMES))?,
            unit: file
                .unit
                .ok_or(MissingConvention::new("commanded", "unit", LENGTHS))?,
            fields: file.fields,
            frame: file.frame,
        })
    }
}

impl TryFrom<TrackerFile> for TrackerSettings {
    type Error = MissingConvention;
    fn try_from(file: TrackerFile) -> Result<Self, MissingConvention> {
        Ok(Self {
            topic: file.topic,
            time: file
                .time
                .ok_or(MissingConvention::new("tracker", "time", TIMES))?,
            unit: file
                .unit
                .ok_or(MissingConvention::new("tracker", "unit", LENGTHS))?,
            temperature: file.temperature,
            ignore_orientation: file.ignore_orientation,
            fields: file.fields,
            frame: file.frame,
        })
    }
}

impl fmt::Display for TimeSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Header => "header",
            Self::Publish => "publish",
            Self::Log => "log",
        })
    }
}
