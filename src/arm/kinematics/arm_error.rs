use thiserror::Error;

use crate::geometry::PlacementError;

#[derive(Debug, Clone, PartialEq, Error)]
pub enum ArmError {
    #[error(
        "the robot file has {found} joints that move; an arm has 1 to 16: add a [[joint]] table for each"
    )]
    JointCount { found: usize },
    #[error(
        "joint {:?}, convention {:?}: {}{}", .0.joint, .0.convention, needs(&.0.missing), reads(&.0.missing, &.0.unread)
    )]
    Keys(Box<WrongKeys>),
    #[error(
        "joint {joint:?}: kind = \"fixed\" has no place in convention {convention:?}: state its transform with the link before it"
    )]
    FixedJoint { joint: String, convention: &'static str },
    #[error(
        "convention {convention:?} needs [flange]: the flange in the base frame with every joint at zero"
    )]
    NoFlange { convention: &'static str },
    #[error("joint {joint:?}: sign = {found}, but a sign is 1 or -1")]
    Sign { joint: String, found: i8 },
    #[error(
        "joint {joint:?}: {key} = [{lower}, {upper}]; the lower limit comes first and both are finite"
    )]
    Limits { joint: String, key: &'static str, lower: f64, upper: f64 },
    #[error("joint {joint:?}: {quantity} is not a finite number")]
    NotFinite { joint: String, quantity: &'static str },
    #[error(
        "joint {joint:?}: {key} = {found:?} has no direction: give three numbers that are not all zero"
    )]
    NoDirection { joint: String, key: &'static str, found: [f64; 3] },
    #[error(
        "joint {joint:?}: {key} = {found} is {degrees}° in radians; angles of a robot file are in degrees: write {degrees}"
    )]
    Radians { joint: String, key: &'static str, found: f64, degrees: f64 },
    #[error(
        "joint {joint:?} and all others: the lengths of the arm add up to {total} mm, the largest is {key} = {found}; \
         lengths of a robot file are in mm: multiply those in metres by 1000"
    )]
    Metres { joint: String, key: &'static str, found: f64, total: f64 },
    #[error(
        "joint {joint:?} follows {found:?}, which is no joint that the controller reports: mimic.joint names one of them"
    )]
    Mimic { joint: String, found: String },
    #[error("joint {joint:?} appears twice in the robot file; each joint needs a name of its own")]
    DuplicateJoint { joint: String },
    #[error("home_deg = {found:?}; give one finite angle for each of the {joints} joints")]
    Home { found: Vec<f64>, joints: usize },
    #[error("joint_map has to be an invertible matrix of {joints} rows of {joints} numbers")]
    JointMap { joints: usize },
    #[error("the chain moves by {found} joint variables, and the arm has {joints} joints")]
    Variables { joints: usize, found: usize },
    #[error("{place}: {source}")]
    Placement { place: String, source: PlacementError },
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WrongKeys {
    pub joint: String,
    pub convention: &'static str,
    pub missing: Vec<&'static str>,
    /// Keys that the convention does not read for a joint of this kind.
    pub unread: Vec<&'static str>,
}

impl ArmError {
    /// The joint that the fault is in; `None` for a fault of the whole file.
    pub fn joint(&self) -> Option<&str> {
        match self {
            Self::Keys(wrong) => Some(&wrong.joint),
            Self::FixedJoint { joint, .. }
            | Self::Sign { joint, .. }
            | Self::Limits { joint, .. }
            | Self::NotFinite { joint, .. }
            | Self::NoDirection { joint, .. }
            | Self::Radians { joint, .. }
            | Self::Metres { joint, .. }
            | Self::Mimic { joint, .. }
            | Self::DuplicateJoint { joint } => Some(joint),
            Self::JointCount { .. }
            | Self::NoFlange { .. }
            | Self::Home { .. }
            | Self::JointMap { .. }
            | Self::Variables { .. }
            | Self::Placement { .. } => None,
        }
    }
}

fn needs(missing: &[&str]) -> String {
    if missing.is_empty() { String::new() } else { format!("needs {}", missing.join(", ")) }
}

fn reads(missing: &[&str], unread: &[&str]) -> String {
    let and = if missing.is_empty() { "" } else { " and " };
    if unread.is_empty() {
        String::new()
    } else {
        format!("{and}has {}, which nothing reads there", unread.join(", "))
    }
}
