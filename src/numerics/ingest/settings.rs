//! The pipeline file's sections about the two logs: topics, clocks, units.
//!
//! Units and time sources are conventions that a log does not state, so they have no default. Common message types need
//! nothing else; for any other type, `fields` gives the paths inside a message. What each key means stands in the reference that
//! `posegrid schema pipeline` shows.

mod fields;
mod lengths;
mod logged;
mod stations;

use std::f64::consts::PI;
use std::fmt;

use serde::{Deserialize, Serialize};

use crate::units::{MM_PER_M, per_radian};

pub use fields::{
    AngleFields, JointFields, NumberStamp, PoseFields, StampField, TimeUnit, WrongFields,
};
pub use lengths::{
    KnownOffset, KnownPlace, LengthColumns, LengthRead, LengthSource, LoggedLength, is_length,
};
pub use logged::{LoggedReference, LoggedTarget, Seen, TargetName};
pub use stations::{
    CovarianceColumns, MISSING, OrientationColumns, OrientationForm, PoseColumns, ReadingColumns,
    ReferenceColumns, StandsOn, StationsSettings, TableTime, TimeColumn,
};

/// `[controller]`: joint angles.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControllerSettings {
    pub topic: String,
    pub time: TimeSource,
    pub unit: AngleUnit,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub length_unit: Option<LengthUnit>,
    #[serde(default, skip_serializing_if = "JointFields::is_empty")]
    pub fields: JointFields,
}

/// `[commanded]`: commanded poses, in the controller's log.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CommandedSettings {
    pub topic: String,
    pub time: TimeSource,
    pub unit: LengthUnit,
    #[serde(default, skip_serializing_if = "PoseFields::is_empty")]
    pub fields: PoseFields,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<String>,
}

/// `[tracker]`: readings of the measured target, in the tracker's log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackerSettings {
    pub topic: String,
    pub time: TimeSource,
    pub unit: LengthUnit,
    pub temperature: Option<String>,
    #[serde(default)]
    pub ignore_orientation: bool,
    #[serde(default, skip_serializing_if = "PoseFields::is_empty")]
    pub fields: PoseFields,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<String>,
    /// The targets at the flange, the main first, where there are several or one is told by its name; else all readings are of one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub targets: Vec<LoggedTarget>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub references: Vec<LoggedReference>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lengths: Vec<LoggedLength>,
    /// Whether readings are of a camera on the flange, which measures a target in the cell: they are inverted (`[tracker] camera`).
    #[serde(skip)]
    pub eye_in_hand: bool,
}

/// The one of a message's three times that is used as its stamp.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TimeSource {
    /// The message's own stamp (`header.stamp`, `timestamp`, or what `fields` names): when it was measured, in the
    /// instrument's clock.
    Header,
    /// The time of publication, in the publisher's clock.
    Publish,
    /// The time when the recorder received it, in the recorder's clock.
    Log,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AngleUnit {
    Rad,
    Deg,
    /// A hundredth of a right angle.
    Gon,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LengthUnit {
    M,
    Mm,
    Cm,
    /// Inch, 25.4 mm.
    Inch,
    /// Foot, 304.8 mm.
    Ft,
    /// Micrometre.
    Um,
}

/// All settings needed to read the samples of a session from its logs.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapping {
    pub controller: ControllerSettings,
    /// `[commanded]`; absent when the log has no commanded poses.
    pub commanded: Option<CommandedSettings>,
    pub tracker: TrackerSettings,
    /// Names under which the controller reports the arm's joints, in the arm's order.
    pub joints: Vec<String>,
    /// Whether each of these joints slides; empty where none does.
    pub slides: Vec<bool>,
}

impl Mapping {
    /// Factor on the logged values of each joint, which makes them rad of an angle and mm of a position.
    pub(super) fn factors(&self) -> Vec<f64> {
        let lengths = self.controller.length_unit.map_or(1.0, LengthUnit::to_mm);
        let of_joint = |joint: usize| match self.slides.get(joint) {
            Some(true) => lengths,
            Some(false) | None => self.controller.unit.to_rad(),
        };
        (0..self.joints.len()).map(of_joint).collect()
    }

    /// Radians that one unit of each joint's variable counts as where the arm's stop is detected; empty where every joint turns.
    ///
    /// [`per_radian`] states the length that counts as a radian.
    pub fn counted(&self) -> Vec<f64> {
        self.slides.iter().map(|&slides| 1.0 / per_radian(slides)).collect()
    }
}

impl AngleUnit {
    pub const ALL: [Self; 3] = [Self::Deg, Self::Rad, Self::Gon];

    pub const fn word(self) -> &'static str {
        match self {
            Self::Rad => "rad",
            Self::Deg => "deg",
            Self::Gon => "gon",
        }
    }

    /// Radians in one of this unit.
    pub const fn to_rad(self) -> f64 {
        match self {
            Self::Rad => 1.0,
            Self::Deg => PI / 180.0,
            Self::Gon => PI / 200.0,
        }
    }
}

impl LengthUnit {
    pub const ALL: [Self; 6] = [Self::M, Self::Mm, Self::Inch, Self::Ft, Self::Cm, Self::Um];

    pub const fn to_mm(self) -> f64 {
        match self {
            Self::M => MM_PER_M,
            Self::Mm => 1.0,
            Self::Cm => 10.0,
            Self::Inch => 25.4,
            Self::Ft => 304.8,
            Self::Um => 1e-3,
        }
    }
}

impl fmt::Display for LengthUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::M => "m",
            Self::Mm => "mm",
            Self::Cm => "cm",
            Self::Inch => "inch",
            Self::Ft => "ft",
            Self::Um => "um",
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
