//! Faults of a robot file, each with the joint and what to do.

use thiserror::Error;

use crate::geometry::PlacementError;

/// A fault of a robot file.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ArmError {
    /// No joints, or too many to be an arm.
    #[error(
        "the robot file has {found} joints that move; an arm has 1 to 16: add a [[joint]] table for each"
    )]
    JointCount {
        /// Number of joints found that move and follow no other.
        found: usize,
    },
    /// Keys that the convention needs, or does not read.
    #[error(
        "joint {:?}, convention {:?}: {}{}", .0.joint, .0.convention, needs(&.0.missing), reads(&.0.missing, &.0.unread)
    )]
    Keys(Box<WrongKeys>),
    /// A kind of joint that the convention has no words for.
    #[error(
        "joint {joint:?}: kind = \"fixed\" has no place in convention {convention:?}: state its transform with the link before it"
    )]
    FixedJoint {
        /// The joint's name.
        joint: String,
        /// The convention's word.
        convention: &'static str,
    },
    /// Products of exponentials without the flange's pose.
    #[error(
        "convention {convention:?} needs [flange]: the flange in the base frame with every joint at zero"
    )]
    NoFlange {
        /// The convention's word.
        convention: &'static str,
    },
    /// A sign other than ±1.
    #[error("joint {joint:?}: sign = {found}, but a sign is 1 or -1")]
    Sign {
        /// The joint's name.
        joint: String,
        /// The sign found.
        found: i8,
    },
    /// Limits in the wrong order or not finite.
    #[error(
        "joint {joint:?}: {key} = [{lower}, {upper}]; the lower limit comes first and both are finite"
    )]
    Limits {
        /// The joint's name.
        joint: String,
        /// The key of the limits.
        key: &'static str,
        /// The lower limit found.
        lower: f64,
        /// The upper limit found.
        upper: f64,
    },
    /// A link value that is not a number.
    #[error("joint {joint:?}: {quantity} is not a finite number")]
    NotFinite {
        /// The joint's name.
        joint: String,
        /// The key of the value.
        quantity: &'static str,
    },
    /// A direction without one.
    #[error(
        "joint {joint:?}: {key} = {found:?} has no direction: give three numbers that are not all zero"
    )]
    NoDirection {
        /// The joint's name.
        joint: String,
        /// The key of the direction.
        key: &'static str,
        /// The numbers found.
        found: [f64; 3],
    },
    /// An angle that is a right angle in radians.
    #[error(
        "joint {joint:?}: {key} = {found} is {degrees}° in radians; angles of a robot file are in degrees: write {degrees}"
    )]
    Radians {
        /// The joint's name.
        joint: String,
        /// The key of the angle.
        key: &'static str,
        /// The number found.
        found: f64,
        /// The angle in degrees that it is in radians.
        degrees: f64,
    },
    /// Lengths that add up to less than an arm.
    #[error(
        "joint {joint:?} and all others: the lengths of the arm add up to {total} mm, the largest is {key} = {found}; \
         lengths of a robot file are in mm: multiply those in metres by 1000"
    )]
    Metres {
        /// The joint with the largest length.
        joint: String,
        /// The key of that length.
        key: &'static str,
        /// The largest length.
        found: f64,
        /// Sum of the lengths.
        total: f64,
    },
    /// A joint that follows one that is not there, or that follows itself.
    #[error(
        "joint {joint:?} follows {found:?}, which is no joint that the controller reports: mimic.joint names one of them"
    )]
    Mimic {
        /// The joint's name.
        joint: String,
        /// The name that it follows.
        found: String,
    },
    /// A joint's name appears twice.
    #[error("joint {joint:?} appears twice in the robot file; each joint needs a name of its own")]
    DuplicateJoint {
        /// The joint's name.
        joint: String,
    },
    /// A home pose that is not one of this arm.
    #[error("home_deg = {found:?}; give one finite angle for each of the {joints} joints")]
    Home {
        /// The angles found, degrees.
        found: Vec<f64>,
        /// Number of reported joints in the file.
        joints: usize,
    },
    /// A joint map of the wrong shape, or one that cannot be inverted.
    #[error("joint_map has to be an invertible matrix of {joints} rows of {joints} numbers")]
    JointMap {
        /// Number of reported joints in the file.
        joints: usize,
    },
    /// A chain that does not move by the joints.
    #[error("the chain moves by {found} joint variables, and the arm has {joints} joints")]
    Variables {
        /// Number of the arm's joints.
        joints: usize,
        /// Number of variables that the chain reads.
        found: usize,
    },
    /// A placement that is none.
    #[error("{place}: {source}")]
    Placement {
        /// The section, or the joint's key.
        place: String,
        /// The fault of its numbers.
        source: PlacementError,
    },
}

/// The keys of a joint that are not those of its convention.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WrongKeys {
    /// The joint's name.
    pub joint: String,
    /// The convention's word.
    pub convention: &'static str,
    /// Keys that it lacks.
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
