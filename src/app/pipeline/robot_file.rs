//! A robot file as every command reads it: TOML or URDF, with all missing keys told at once, and a fault of the arm with its line.

use std::fmt::Display;
use std::path::Path;

use thiserror::Error;

use super::keys::KeyReference;
use super::keys::door::{self, Faults};
use crate::at::At;
use crate::io::robot::{self, Read, RobotFault, Selection};
use crate::kinematics::{Arm, ArmError, RobotFile};

/// A reason why a text is no robot file.
#[derive(Debug, Error)]
pub enum NoRobotFile {
    /// Keys are missing, or not known.
    #[error(transparent)]
    Keys(Faults),
    #[error(transparent)]
    Fault(RobotFault),
    #[error("{source}")]
    Arm {
        /// The line where the joint begins that the fault is in, from 1; `None` where it is none's, and in a URDF.
        line: Option<usize>,
        source: Box<ArmError>,
    },
}

impl NoRobotFile {
    /// This fault of the file at `path`, with its line where it does not name it itself.
    pub fn at<K: Display + From<Self>>(self, path: &Path) -> At<K> {
        match &self {
            Self::Arm { line: Some(line), .. } => {
                At::new(format!("{}, line {line}", path.display()), self)
            }
            _ => At::new(path.display(), self),
        }
    }
}

pub fn read(path: &Path, text: &str, selection: &Selection) -> Result<Read, NoRobotFile> {
    robot::read(path, text, selection).map_err(|fault| match &fault {
        RobotFault::Toml(_) => faults(text).unwrap_or(NoRobotFile::Fault(fault)),
        _ => NoRobotFile::Fault(fault),
    })
}

pub fn arm(path: &Path, text: &str, selection: &Selection) -> Result<Arm, Box<At<NoRobotFile>>> {
    let arm = read(path, text, selection).and_then(|read| arm_of(&read.file, text));
    arm.map_err(|fault| Box::new(fault.at(path)))
}

pub fn arm_of(file: &RobotFile, text: &str) -> Result<Arm, NoRobotFile> {
    file.arm().map_err(|source| {
        let joint = source.joint();
        faults(text).unwrap_or_else(|| NoRobotFile::Arm {
            line: joint.and_then(|joint| door::line_of_joint(text, joint)),
            source: Box::new(source.clone()),
        })
    })
}

fn faults(text: &str) -> Option<NoRobotFile> {
    door::check(KeyReference::robot(), text, true).err().map(NoRobotFile::Keys)
}
