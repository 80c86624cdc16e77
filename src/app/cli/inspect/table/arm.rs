//! The arm that a table is said to be of: a robot file, a URDF, or the name of a ready robot.

use std::io;
use std::path::Path;

use thiserror::Error;

use crate::at::At;
use crate::cli::robot::file_or_ready;
use crate::io::inspect::table::Arms;
use crate::io::robot::Selection;
use crate::pipeline::robot_file::{self, NoRobotFile};

#[derive(Debug, Error)]
pub enum NoArm {
    #[error("--robot {0}; `posegrid robot --list` names the ready robots")]
    Read(At<io::Error>),
    #[error("--robot {0}")]
    File(#[from] Box<At<NoRobotFile>>),
}

/// The arm that was named, or the ready ones.
pub fn arms(robot: Option<&Path>, selection: &Selection) -> Result<Arms, NoArm> {
    let Some(path) = robot else { return Ok(Arms::ready()) };
    let (file, text) =
        file_or_ready(path).map_err(|source| NoArm::Read(At::new(path.display(), source)))?;
    Ok(Arms::named(file, robot_file::arm(path, &text, selection)?))
}
