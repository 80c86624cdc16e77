//! A robot file as every command reads it: TOML or URDF, with all missing keys told at once.

use std::path::Path;

use thiserror::Error;

use super::keys::KeyReference;
use super::keys::missing::{self, Incomplete};
use crate::io::robot::{self, Read, RobotFault, Selection};

/// A reason why a text is no robot file.
#[derive(Debug, Error)]
pub enum NoRobotFile {
    /// Several keys are missing, or not known.
    #[error(transparent)]
    Incomplete(Box<Incomplete>),
    /// Another fault.
    #[error(transparent)]
    Fault(RobotFault),
}

/// Reads the text of the file at `path`.
pub fn read(path: &Path, text: &str, selection: &Selection) -> Result<Read, NoRobotFile> {
    robot::read(path, text, selection).map_err(|fault| match &fault {
        RobotFault::Toml(_) => missing::told_at_once(KeyReference::robot(), text)
            .map_or(NoRobotFile::Fault(fault), |own| {
                NoRobotFile::Incomplete(Box::new(own))
            }),
        _ => NoRobotFile::Fault(fault),
    })
}
